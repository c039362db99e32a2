"use strict";
// Cards that a person judges, by keys or buttons; what was said stays in this browser.
// Needs: #filters, #reviewing, #said, #unkept, and in each card of the list a .verdict with [data-review] buttons.
const steps = { j: 1, k: -1, ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 };

// reviews: Map from names to what was said; words: every review in words; keys: to reviews; mark: shows which card
// is the current one elsewhere, too; filter: shows and hides the cards.
function reviewCards({ list, cards, reviews, storage, words, keys, noun, block, nameOf, mark, filter }) {
  const said = document.getElementById("said");
  let current = null;
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
  function neighbour(card, step) {
    const from = card ? cards.indexOf(card) : step > 0 ? -1 : cards.length;
    for (let k = from + step; k in cards; k += step) {
      if (!cards[k].hidden) return cards[k];
    }
    return null;
  }
  function choose(card) {
    if (current) {
      current.classList.remove("current");
      mark(current, false);
    }
    current = card;
    if (!card) return;
    card.classList.add("current");
    mark(card, true);
  }
  function go(card) {
    if (!card) return;
    choose(card);
    card.focus({ preventScroll: true });
    card.scrollIntoView({ block });
  }
  function judge(card, review, { move }) {
    const name = nameOf(card);
    const after = reviews.get(name) === review ? null : review;
    const next = neighbour(card, 1) ?? neighbour(card, -1);
    keep(name, after);
    filter();
    said.textContent = `${noun} ${card.dataset.id}: ${words[after]}`;
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
  window.addEventListener("storage", () => { recall(); filter(); });
  for (const card of cards) card.querySelector(".verdict").hidden = false;
  for (const id of ["filters", "reviewing"]) document.getElementById(id).hidden = cards.length === 0;
  recall();
  filter();
  return { isCurrent: (card) => card === current };
}
function pressButtons(card, review) {
  card.dataset.state = review ?? "open";
  for (const button of card.querySelectorAll("[data-review]")) {
    button.setAttribute("aria-pressed", String(button.dataset.review === review));
  }
}
function download(name, type, content) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([JSON.stringify(content, null, 1), "\n"], { type }));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}
