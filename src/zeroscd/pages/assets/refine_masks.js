"use strict";
const form = document.getElementById("filters");
const list = document.getElementById("cards");
const cards = [...list.querySelectorAll(".event")];
const blobs = JSON.parse(list.dataset.blobs);
const said = document.getElementById("said");
const storage = "zeroscd refine-masks";
const words = { accepted: "accepted", rejected: "rejected", null: "not reviewed" };
const keys = { a: "accepted", r: "rejected" };
const steps = { j: 1, k: -1, ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 };
const nameOf = (blob) => `${blob.pair} ${blob.proposal}`;
const blobOf = (card) => blobs[Number(card.dataset.id) - 1];

// What was said: in the tables, and since then in this browser.
const reviews = new Map(blobs.map((blob) => [nameOf(blob), blob.review]));
function kept() {
  try {
    return JSON.parse(localStorage.getItem(storage)) ?? {};
  } catch {
    return {};
  }
}
function recall() {
  for (const [name, review] of Object.entries(kept())) {
    if (reviews.has(name) && String(review) in words) reviews.set(name, review);
  }
}
function keep(name, review) {
  reviews.set(name, review);
  try {
    localStorage.setItem(storage, JSON.stringify({ ...kept(), [name]: review }));
  } catch {
    document.getElementById("unkept").hidden = false;
  }
}

function filter() {
  const { outcome, review } = form.elements;
  for (const card of cards) {
    const verdict = reviews.get(nameOf(blobOf(card)));
    card.dataset.state = verdict ?? "open";
    card.hidden = !["all", card.dataset.outcome].includes(outcome.value)
      || !["all", card.dataset.state].includes(review.value);
    for (const button of card.querySelectorAll("[data-review]")) {
      button.setAttribute("aria-pressed", String(button.dataset.review === verdict));
    }
  }
  document.getElementById("shown").textContent = String(cards.filter((card) => !card.hidden).length);
}

// Reviewing: one card is the current one
let current = null;
function neighbour(card, step) {
  const from = card ? cards.indexOf(card) : step > 0 ? -1 : cards.length;
  for (let k = from + step; k in cards; k += step) {
    if (!cards[k].hidden) return cards[k];
  }
  return null;
}
function choose(card) {
  current?.classList.remove("current");
  current = card;
  current?.classList.add("current");
}
function go(card) {
  if (!card) return;
  choose(card);
  card.focus({ preventScroll: true });
  card.scrollIntoView({ block: "nearest" });
}
function judge(card, review, { move }) {
  const name = nameOf(blobOf(card));
  const after = reviews.get(name) === review ? null : review;
  const next = neighbour(card, 1) ?? neighbour(card, -1);
  keep(name, after);
  filter();
  said.textContent = `Outline ${card.dataset.id}: ${words[after]}`;
  if (card.hidden) choose(null);
  if (card.hidden || (move && after)) go(next);
}
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input, select, textarea")) return;
  const step = steps[event.key];
  const review = keys[event.key.toLowerCase()];
  const hasCurrent = current !== null && !current.hidden;
  if (step && (hasCurrent || !event.key.startsWith("Arrow"))) {
    event.preventDefault();
    go(neighbour(current, step));
  } else if (review && !event.repeat) {
    event.preventDefault();
    if (hasCurrent) judge(current, review, { move: true });
    else go(neighbour(null, 1));
  }
});
list.addEventListener("focusin", (event) => choose(event.target.closest(".event")));
list.addEventListener("click", (event) => {
  const button = event.target.closest("[data-review]");
  if (button) judge(event.target.closest(".event"), button.dataset.review, { move: false });
});

document.getElementById("export").addEventListener("click", () => {
  const reviewed = blobs.map((blob) => ({ ...blob, review: reviews.get(nameOf(blob)) }));
  const content = JSON.stringify({ blobs: reviewed }, null, 1);
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([content, "\n"], { type: "application/json" }));
  link.download = "reviewed.json";
  link.click();
  URL.revokeObjectURL(link.href);
});
form.addEventListener("input", filter);
form.addEventListener("submit", (event) => event.preventDefault());
window.addEventListener("storage", () => { recall(); filter(); });
for (const card of cards) card.querySelector(".verdict").hidden = false;
form.hidden = document.getElementById("reviewing").hidden = cards.length === 0;
recall();
filter();
