"use strict";
{
  const BLINK_MS = 800; // each photo: slow enough for people who are sensitive to flashes
  const MARGIN = 0.3; // around a region that is zoomed to, by its size
  const MAX_ZOOM = 8;
  const BESIDE = 4; // percent between a region and the divider
  const VIEW = ["--zoom", "--left", "--top"]; // what style.css places the photos by
  const STEP = 2; // percent that an arrow key moves the divider by
  const DRAG_PX = 5; // less is a click
  const calm = matchMedia("(prefers-reduced-motion: reduce)");
  const keysOf = new WeakMap(); // by viewer; those that are attached

  /* Side by side, wipe or blink. */
  function comparison(root, stage) {
    const slider = root.querySelector("[data-divider]");
    let timer = null;

    const show = (percent) => {
      slider.value = percent;
      stage.style.setProperty("--at", slider.value + "%");
    };
    const stop = () => clearInterval(timer);
    const flip = () => {
      stage.dataset.shown = stage.dataset.shown === "before" ? "after" : "before";
      if (!root.isConnected) stop();
    };
    const blink = (when) => {
      stop();
      stage.dataset.shown = when;
      if (!calm.matches) timer = setInterval(flip, BLINK_MS);
    };
    const choose = (mode) => {
      const again = root.dataset.mode === mode;
      stop();
      root.dataset.mode = mode;
      for (const button of root.querySelectorAll("[data-choose]")) {
        button.setAttribute("aria-pressed", String(button.dataset.choose === mode));
      }
      if (mode === "blink") again ? flip() : blink("before");
    };
    /* Brings the photo that shows a place into sight; `left` and `right` are percent of the stage. */
    const reveal = (when, left, right) => {
      show(when === "before" ? right + BESIDE : left - BESIDE);
      if (root.dataset.mode === "blink") blink(when);
    };
    const move = (by) => root.dataset.mode === "wipe" && show(Number(slider.value) + by);

    slider.addEventListener("input", () => show(slider.value));
    for (const button of root.querySelectorAll("[data-choose]")) {
      button.addEventListener("click", () => choose(button.dataset.choose));
    }
    for (const button of root.querySelectorAll("[data-at]")) {
      button.addEventListener("click", () => show(button.dataset.at));
    }
    return { choose, move, reveal, show };
  }

  /* The divider follows the pointer; tells whether what ends now was a drag, and no click. */
  function dragging(root, stage, show) {
    let start = null;
    let dragged = false;
    const follow = (event) => {
      const box = stage.getBoundingClientRect();
      show(((event.clientX - box.left) / box.width) * 100);
    };
    const drag = (event) => {
      stage.setPointerCapture(event.pointerId);
      dragged = true;
      follow(event);
    };
    stage.addEventListener("pointerdown", (event) => {
      dragged = false;
      if (root.dataset.mode !== "wipe" || event.button !== 0 || event.target.closest("a")) return;
      start = event.clientX;
      if (!event.target.closest("[data-region]")) drag(event);
    });
    stage.addEventListener("pointermove", (event) => {
      if (!(event.buttons & 1)) start = null; // it was let go elsewhere
      if (stage.hasPointerCapture(event.pointerId)) follow(event);
      else if (start !== null && Math.abs(event.clientX - start) > DRAG_PX) drag(event);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      stage.addEventListener(end, () => (start = null));
    }
    return () => dragged;
  }

  /* Enlarges a part of both photos; left, top, width and height are shares of them. Returns where
     the part's sides lie then, in percent of the stage. */
  function zoom(stage, left = 0, top = 0, width = 1, height = 1) {
    const fit = 1 / ((1 + 2 * MARGIN) * Math.max(width, height));
    const by = Math.min(Math.max(fit, 1), MAX_ZOOM);
    const start = (from, size) => Math.min(Math.max(from + (size - 1 / by) / 2, 0), 1 - 1 / by);
    const x = start(left, width);
    const values = [by, x, start(top, height)];
    VIEW.forEach((name, at) => stage.style.setProperty(name, values[at]));
    return [100 * (left - x) * by, 100 * (left + width - x) * by];
  }

  /* Regions: pointed at, they light up everywhere; chosen, they are zoomed to. */
  function regions(root, stage, { reveal }, dragged) {
    const scope = root.closest("[data-viewer-scope]") || root;
    const parts = [...scope.querySelectorAll("[data-region]")];
    const outlines = [...root.querySelectorAll("[data-outline]")];
    const current = root.querySelector("[data-current]");
    const whole = root.querySelector("[data-whole]");
    const all = current.textContent;
    let chosen = null;

    const light = (id) => {
      scope.classList.toggle("picking", id !== null);
      for (const part of parts) part.classList.toggle("picked", part.dataset.region === id);
    };
    const mark = (id, text) => {
      chosen = id;
      light(id);
      current.textContent = text;
      whole.disabled = id === null;
      for (const button of scope.querySelectorAll("[data-region] [aria-pressed]")) {
        button.setAttribute("aria-pressed", String(button.closest("[data-region]").dataset.region === id));
      }
    };
    const release = () => {
      zoom(stage);
      mark(null, all);
    };
    const choose = (outline) => {
      const { outline: id, kind, photo, box } = outline.dataset;
      const sides = zoom(stage, ...box.split(" ").map((percent) => percent / 100));
      reveal(photo, ...sides);
      mark(id, `Region ${id} of ${outlines.length}: ${kind}`);
      stage.scrollIntoView({ block: "nearest", behavior: calm.matches ? "auto" : "smooth" });
    };
    const step = (by) => {
      if (!outlines.length) return;
      const now = outlines.findIndex((one) => one.dataset.outline === chosen);
      const next = now < 0 && by < 0 ? -1 : now + by;
      choose(outlines.at(next % outlines.length));
    };

    for (const part of parts) {
      const id = part.dataset.region;
      part.addEventListener("pointerenter", () => light(id));
      part.addEventListener("pointerleave", () => light(chosen));
      if (part instanceof HTMLElement) { // Chromium lets Tab stop at outlines that listen to focus
        part.addEventListener("focusin", () => light(id));
        part.addEventListener("focusout", () => light(chosen));
      }
      part.addEventListener("click", (event) => {
        const link = event.target.closest("a");
        if (link) event.preventDefault(); // it leads there without scripts
        if (dragged() && stage.contains(part)) return;
        if (chosen === id && (!link || stage.contains(link))) return release();
        choose(outlines.find((one) => one.dataset.outline === id));
      });
    }
    whole.addEventListener("click", release);
    for (const button of root.querySelectorAll("[data-step]")) {
      button.addEventListener("click", () => step(Number(button.dataset.step)));
    }
    return { release, step };
  }

  /* Layers: outlines, what is not judged, the heat map. */
  function layers(root, stage, replaced) {
    const hatch = stage.querySelector(".hatch");
    const copy = hatch.cloneNode(); // the page holds the picture once
    copy.alt = "";
    stage.querySelector("img.before").after(copy);
    for (const box of root.querySelectorAll("[data-layer]")) {
      const name = box.dataset.layer;
      const switched = () => {
        stage.classList.toggle(name, box.checked);
        root.classList.toggle("show-" + name, box.checked);
      };
      box.addEventListener("change", switched);
      if (replaced) box.checked = replaced.querySelector(`[data-layer="${name}"]`).checked;
      switched();
    }
  }

  /* Makes a viewer work; `replaced`, if given, is the one that it goes on from: in mode, divider,
     layers and what is enlarged. */
  function attach(root, replaced) {
    if (keysOf.has(root)) return;
    const stage = root.querySelector("[data-stage]");
    const { choose, ...photos } = comparison(root, stage);
    const { release, step } = regions(root, stage, photos, dragging(root, stage, photos.show));
    layers(root, stage, replaced);
    choose(replaced ? replaced.dataset.mode : "side");
    if (replaced) {
      const { style } = replaced.querySelector("[data-stage]");
      for (const name of VIEW) stage.style.setProperty(name, style.getPropertyValue(name));
      photos.show(replaced.querySelector("[data-divider]").value);
      root.querySelector("[data-whole]").disabled = replaced.querySelector("[data-whole]").disabled;
    }
    for (const part of root.querySelectorAll("[data-controls]")) part.hidden = false;
    keysOf.set(root, {
      s: () => choose("side"),
      w: () => choose("wipe"),
      b: () => choose("blink"),
      j: () => step(1),
      k: () => step(-1),
      escape: release,
      arrowleft: () => photos.move(-STEP),
      arrowright: () => photos.move(STEP),
    });
  }

  const viewers = () => document.querySelectorAll("[data-viewer]");
  const attachAll = () => viewers().forEach((root) => attach(root));
  document.addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    const typing = event.target.closest("select, textarea, input:not([type=checkbox], [type=range], [type=radio])");
    const moving = key.startsWith("arrow") && event.target.closest("input");
    if (typing || moving || event.ctrlKey || event.metaKey || event.altKey) return;
    viewers().forEach((root) => keysOf.get(root)?.[key]?.());
  });
  window.zeroscdViewer = attach;
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", attachAll);
  else attachAll();
}
