"use strict";
window.zeroscd = (() => {
  const MAX_BYTES = $max_bytes;
  const names = { before: "", after: "" };
  const sent = { before: 0, after: 0 };
  const root = document.documentElement;
  const all = (selector) => document.querySelectorAll(selector);
  const box = (when) => document.querySelector(`[data-photo="${when}"]`);

  function note(when, text, failed) {
    const line = box(when).querySelector(".z-note");
    line.textContent = text;
    line.classList.toggle("z-failure", Boolean(failed));
    box(when).classList.toggle("z-refused", Boolean(failed));
  }

  function picture(when, file) {
    const image = box(when).querySelector("img");
    if (image.src.startsWith("blob:")) URL.revokeObjectURL(image.src);
    image.hidden = !file;
    if (file) image.src = URL.createObjectURL(file);
    else image.removeAttribute("src");
  }

  function refuse(when, text) {
    names[when] = "";
    picture(when, null);
    note(when, text.charAt(0).toUpperCase() + text.slice(1) + ".", true);
  }

  function send(when, file) {
    const turn = ++sent[when];
    names[when] = "";
    picture(when, null);
    if (file.size > MAX_BYTES) {
      refuse(when, `This file has ${Math.ceil(file.size / 1e6)} megabytes, more than ${MAX_BYTES / 1e6}; make it smaller`);
      return;
    }
    const bar = box(when).querySelector("progress");
    const request = new XMLHttpRequest();
    request.open("POST", "/pagedata/photos");
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.responseType = "json";
    request.upload.onprogress = (event) => (bar.value = (100 * event.loaded) / event.total);
    request.onerror = () => turn === sent[when] && refuse(when, "The server cannot be reached; try again");
    request.onload = () => {
      if (turn !== sent[when]) return;
      const answer = request.response || {};
      if (request.status !== 200) {
        refuse(when, answer.detail || "The server refused this file");
        return;
      }
      names[when] = answer.name;
      picture(when, file);
      note(when, `${file.name ? file.name + ", " : ""}${answer.width} × ${answer.height} pixels`);
    };
    request.onloadend = () => (bar.hidden = true);
    bar.value = 0;
    bar.hidden = false;
    note(when, "Sending");
    request.send(file);
  }

  async function sample(when) {
    const answer = await fetch(`/pagedata/samples/${when}.jpg`);
    if (answer.ok) send(when, await answer.blob());
    else refuse(when, "The sample photo cannot be fetched");
  }

  function divide(percent) {
    const at = Math.min(100, Math.max(0, percent));
    root.style.setProperty("--z-at", at + "%");
    for (const slider of all("[data-divider]")) slider.value = at;
  }

  function layer(name, on) {
    root.classList.toggle("z-show-" + name, on);
    for (const check of all(`[data-layer="${name}"]`)) check.checked = on;
  }

  function pick(region) {
    const viewer = region.closest("[data-viewer]");
    const again = region.closest("[data-region]").classList.contains("picked");
    const id = again ? "" : region.closest("[data-region]").dataset.region;
    viewer.classList.toggle("z-picking", id !== "");
    for (const part of viewer.querySelectorAll("[data-region]")) {
      part.classList.toggle("picked", part.dataset.region === id);
      const button = part.querySelector("button");
      if (button) button.setAttribute("aria-pressed", String(part.dataset.region === id));
    }
    if (id === "") return;
    const stage = viewer.querySelector(".z-stage");
    const inTable = Boolean(region.closest("table"));
    const target = inTable ? stage : viewer.querySelector(`tr[data-region="${id}"]`);
    const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    target.scrollIntoView({ block: "nearest", behavior: calm ? "auto" : "smooth" });
    if (!inTable) target.querySelector("button").focus({ preventScroll: true });
  }

  document.addEventListener("change", (event) => {
    const file = event.target.closest("[data-photo] input[type=file]");
    if (file && file.files[0]) {
      send(file.closest("[data-photo]").dataset.photo, file.files[0]);
      file.value = "";
    }
    if (event.target.matches("[data-layer]")) layer(event.target.dataset.layer, event.target.checked);
  });
  document.addEventListener("input", (event) => {
    if (event.target.matches("[data-divider]")) divide(Number(event.target.value));
  });
  document.addEventListener("click", (event) => {
    if (event.target.closest("[data-sample]")) ["before", "after"].forEach(sample);
    const jump = event.target.closest("[data-at]");
    if (jump) divide(Number(jump.dataset.at));
    const region = event.target.closest("[data-viewer] tr[data-region], [data-viewer] a.chip");
    if (region) {
      event.preventDefault();
      pick(region);
    }
  });

  for (const kind of ["dragover", "dragleave", "drop"]) {
    document.addEventListener(kind, (event) => {
      const target = event.target.closest && event.target.closest("[data-photo]");
      event.preventDefault();
      for (const one of all("[data-photo]")) one.classList.toggle("z-over", kind === "dragover" && one === target);
      if (kind === "drop" && target && event.dataTransfer.files[0]) {
        send(target.dataset.photo, event.dataTransfer.files[0]);
      }
    });
  }

  let dragged = null;
  const follow = (event) => {
    const area = dragged.getBoundingClientRect();
    divide((100 * (event.clientX - area.left)) / area.width);
  };
  document.addEventListener("pointerdown", (event) => {
    const stage = event.target.closest && event.target.closest(".z-stage");
    if (!stage || event.button !== 0 || event.target.closest("a")) return;
    dragged = stage;
    follow(event);
  });
  document.addEventListener("pointermove", (event) => dragged && follow(event));
  for (const kind of ["pointerup", "pointercancel"]) {
    document.addEventListener(kind, () => (dragged = null));
  }

  // A new result starts as the one before it was left.
  new MutationObserver(() => {
    const viewer = document.querySelector("[data-viewer]:not([data-ready])");
    if (!viewer) return;
    viewer.dataset.ready = "";
    divide(parseFloat(root.style.getPropertyValue("--z-at")) || 50);
    for (const name of ["outlines", "unknown", "heat"]) layer(name, root.classList.contains("z-show-" + name));
  }).observe(root, { childList: true, subtree: true });
  root.lang = "en";
  root.classList.add("z-show-outlines", "z-show-unknown");
  root.style.setProperty("--z-at", "50%");

  return { photo: (when) => names[when] };
})();
