"use strict";
const form = document.getElementById("filters");
const list = document.getElementById("cards");
const cards = [...list.querySelectorAll(".card")];
const dots = new Map([...document.querySelectorAll("[data-place]")].map((dot) => [dot.dataset.place, dot]));
form.hidden = cards.length === 0;

function wanted(part, kind, least) {
  return (kind === "all" || part.dataset.kind === kind) && Number(part.dataset.score) >= least;
}
function filter() {
  const kind = form.elements.kind.value;
  const least = Number(form.elements.least.value);
  form.querySelector("output").textContent = least.toFixed(2);
  let shown = 0;
  for (const card of cards) {
    let any = false;
    for (const part of card.querySelectorAll("[data-kind]")) {
      const on = wanted(part, kind, least);
      part.classList.toggle("off", !on);
      any = any || on;
    }
    card.hidden = !any;
    const dot = dots.get(card.dataset.rank);
    if (dot) dot.toggleAttribute("hidden", !any);
    shown += any;
  }
  document.getElementById("shown").textContent = String(shown);
}
const orders = {
  rank: (a, b) => a.dataset.rank - b.dataset.rank,
  score: (a, b) => b.dataset.score - a.dataset.score || a.dataset.rank - b.dataset.rank,
  name: (a, b) => a.dataset.name.localeCompare(b.dataset.name, undefined, { numeric: true }),
};
function order() {
  cards.sort(orders[form.elements.order.value]);
  list.append(...cards);
}
form.addEventListener("input", filter);
form.elements.order.addEventListener("change", order);
form.addEventListener("submit", (event) => event.preventDefault());

for (const card of cards) {
  const dot = dots.get(card.dataset.rank);
  if (!dot) continue;
  for (const name of ["pointerenter", "focusin"]) card.addEventListener(name, () => dot.classList.add("picked"));
  for (const name of ["pointerleave", "focusout"]) card.addEventListener(name, () => dot.classList.remove("picked"));
}
