"use strict";
const form = document.getElementById("filters");
const list = document.getElementById("cards");
const cards = [...list.querySelectorAll(".event")];
const blobs = JSON.parse(list.dataset.blobs);
const nameOf = (blob) => `${blob.pair} ${blob.proposal}`;
const nameOfCard = (card) => nameOf(blobs[Number(card.dataset.id) - 1]);

// What was said: in the tables, and since then in this browser.
const reviews = new Map(blobs.map((blob) => [nameOf(blob), blob.review]));

function filter() {
  const { outcome, review } = form.elements;
  for (const card of cards) {
    pressButtons(card, reviews.get(nameOfCard(card)));
    card.hidden = !["all", card.dataset.outcome].includes(outcome.value)
      || !["all", card.dataset.state].includes(review.value);
  }
  document.getElementById("shown").textContent = String(cards.filter((card) => !card.hidden).length);
}

document.getElementById("export").addEventListener("click", () => {
  const reviewed = blobs.map((blob) => ({ ...blob, review: reviews.get(nameOf(blob)) }));
  download("reviewed.json", "application/json", { blobs: reviewed });
});
form.addEventListener("input", filter);
form.addEventListener("submit", (event) => event.preventDefault());
reviewCards({
  list, cards, reviews, filter,
  storage: "zeroscd refine-masks",
  words: { accepted: "accepted", rejected: "rejected", null: "not reviewed" },
  keys: { a: "accepted", r: "rejected" },
  noun: "Outline",
  block: "nearest",
  nameOf: nameOfCard,
  mark: () => {},
});
