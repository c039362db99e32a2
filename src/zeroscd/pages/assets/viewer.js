"use strict";
{
  const unpins = new WeakMap(); // by viewer; those that are attached

  /* Makes a viewer work; `replaced`, if given, is the one whose divider and layers it takes over. */
  function attach(root, replaced) {
    if (unpins.has(root)) return;
    const stage = root.querySelector("[data-stage]");
    const divider = root.querySelector("[data-divider]");
    const blink = root.querySelector("[data-blink]");
    const layers = [...root.querySelectorAll("[data-layer]")];
    const scope = root.closest("[data-viewer-scope]") || root;
    root.querySelector("[data-controls]").hidden = false;

    const show = (percent) => {
      divider.value = Math.min(100, Math.max(0, percent));
      stage.style.setProperty("--at", divider.value + "%");
    };
    const follow = (event) => {
      const box = stage.getBoundingClientRect();
      show(((event.clientX - box.left) / box.width) * 100);
    };
    divider.addEventListener("input", () => show(divider.value));
    stage.addEventListener("pointerdown", (event) => {
      if (event.target.closest("a") || event.button !== 0) return;
      stage.setPointerCapture(event.pointerId);
      follow(event);
    });
    stage.addEventListener("pointermove", (event) => {
      if (stage.hasPointerCapture(event.pointerId)) follow(event);
    });
    for (const button of root.querySelectorAll("[data-at]")) {
      button.addEventListener("click", () => show(button.dataset.at));
    }

    const switched = (box) => {
      stage.classList.toggle(box.dataset.layer, box.checked);
      root.classList.toggle("show-" + box.dataset.layer, box.checked);
    };
    for (const box of layers) box.addEventListener("change", () => switched(box));

    let timer = null;
    const stop = () => {
      clearInterval(timer);
      timer = null;
      blink.setAttribute("aria-pressed", "false");
    };
    const turn = () => (root.isConnected ? show(divider.value > 50 ? 0 : 100) : stop());
    blink.addEventListener("click", () => {
      if (timer !== null) {
        stop();
        return show(50);
      }
      blink.setAttribute("aria-pressed", "true");
      show(100);
      timer = setInterval(turn, 800);
    });

    let pinned = null;
    const light = (id) => {
      scope.classList.toggle("picking", id !== null);
      for (const part of scope.querySelectorAll("[data-region]")) {
        part.classList.toggle("picked", part.dataset.region === id);
      }
    };
    for (const part of scope.querySelectorAll("[data-region]")) {
      const id = part.dataset.region;
      for (const name of ["pointerenter", "focusin"]) part.addEventListener(name, () => light(id));
      for (const name of ["pointerleave", "focusout"]) part.addEventListener(name, () => light(pinned));
      part.addEventListener("click", (event) => {
        pinned = pinned === id && !event.target.closest("a") ? null : id;
        light(pinned);
      });
    }
    unpins.set(root, () => light((pinned = null)));

    if (replaced) {
      show(replaced.querySelector("[data-divider]").value);
      for (const box of layers) {
        box.checked = replaced.querySelector(`[data-layer="${box.dataset.layer}"]`).checked;
      }
    }
    layers.forEach(switched);
  }

  const viewers = () => document.querySelectorAll("[data-viewer]");
  const attachAll = () => viewers().forEach((root) => attach(root));
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") viewers().forEach((root) => unpins.get(root)?.());
  });
  window.zeroscdViewer = attach;
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", attachAll);
  else attachAll();
}
