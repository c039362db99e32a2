"use strict";
const stage = document.getElementById("stage");
const slider = document.getElementById("slider");
const blink = document.getElementById("blink");
document.querySelector(".controls").hidden = false;

function show(percent) {
  const at = Math.min(100, Math.max(0, percent));
  slider.value = at;
  stage.style.setProperty("--at", at + "%");
}
function follow(event) {
  const box = stage.getBoundingClientRect();
  show(((event.clientX - box.left) / box.width) * 100);
}
slider.addEventListener("input", () => show(Number(slider.value)));
stage.addEventListener("pointerdown", (event) => {
  if (event.target.closest("a") || event.button !== 0) return;
  stage.setPointerCapture(event.pointerId);
  follow(event);
});
stage.addEventListener("pointermove", (event) => {
  if (stage.hasPointerCapture(event.pointerId)) follow(event);
});

for (const box of document.querySelectorAll("[data-layer]")) {
  box.addEventListener("change", () => {
    stage.classList.toggle(box.dataset.layer, box.checked);
    if (box.dataset.layer === "heat") document.body.classList.toggle("heat-on", box.checked);
  });
}

for (const button of document.querySelectorAll("[data-at]")) {
  button.addEventListener("click", () => show(Number(button.dataset.at)));
}

let timer = null;
blink.addEventListener("click", () => {
  const on = timer === null;
  blink.setAttribute("aria-pressed", String(on));
  if (on) {
    show(100);
    timer = setInterval(() => show(Number(slider.value) > 50 ? 0 : 100), 800);
  } else {
    clearInterval(timer);
    timer = null;
    show(50);
  }
});

function pick(id, on) {
  for (const part of document.querySelectorAll(`[data-region="${id}"]`)) {
    part.classList.toggle("picked", on);
  }
}
for (const part of document.querySelectorAll(".card, .chips a")) {
  const id = part.dataset.region;
  for (const name of ["pointerenter", "focusin"]) part.addEventListener(name, () => pick(id, true));
  for (const name of ["pointerleave", "focusout"]) part.addEventListener(name, () => pick(id, false));
}
