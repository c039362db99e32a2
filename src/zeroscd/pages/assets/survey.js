"use strict";
const form = document.getElementById("filters");
const list = document.getElementById("cards");
const cards = [...list.querySelectorAll(".event")];
const points = new Map([...document.querySelectorAll("[data-point]")].map((point) => [point.dataset.point, point]));
const features = JSON.parse(list.dataset.features);
const said = document.getElementById("said");
const key = `zeroscd survey ${list.dataset.survey}`;
const words = { accepted: "accepted", rejected: "rejected", unsure: "unsure", null: "not reviewed" };
const keys = { a: "accepted", r: "rejected", u: "unsure" };
const steps = { j: 1, k: -1, ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 };

// What was said: in the survey's files, and since then in this browser.
const reviews = new Map(features.map((feature) => [String(feature.id), feature.properties.review]));
function kept() {
  try {
    return JSON.parse(localStorage.getItem(key)) ?? {};
  } catch {
    return {};
  }
}
function recall() {
  for (const [id, review] of Object.entries(kept())) {
    if (reviews.has(id) && String(review) in words) reviews.set(id, review);
  }
}
function keep(id, review) {
  reviews.set(id, review);
  try {
    localStorage.setItem(key, JSON.stringify({ ...kept(), [id]: review }));
  } catch {
    document.getElementById("unkept").hidden = false;
  }
}

// Filters, and the numbers that follow them
function isShown(card) {
  const { kind, least, review } = form.elements;
  return (kind.value === "all" || card.dataset.kind === kind.value)
    && Number(card.dataset.score) >= Number(least.value)
    && (review.value === "all" || (reviews.get(card.dataset.id) ?? "open") === review.value);
}
function filter() {
  form.querySelector("output").textContent = Number(form.elements.least.value).toFixed(2);
  const figures = {};
  const count = (name, by = 1) => { figures[name] = (figures[name] ?? 0) + by; };
  for (const card of cards) {
    const review = reviews.get(card.dataset.id);
    card.hidden = !isShown(card);
    card.dataset.state = review ?? "open";
    for (const button of card.querySelectorAll("[data-review]")) {
      button.setAttribute("aria-pressed", String(button.dataset.review === review));
    }
    const point = points.get(card.dataset.id);
    if (point) {
      point.toggleAttribute("hidden", card.hidden);
      point.dataset.state = card.dataset.state;
    }
    if (card.hidden) continue;
    count("shown");
    count(card.dataset.kind);
    count(card.dataset.state);
    count("sightings", Number(card.dataset.sightings));
  }
  document.getElementById("shown").textContent = String(figures.shown ?? 0);
  for (const figure of document.querySelectorAll("[data-figure]")) {
    figure.textContent = String(figures[figure.dataset.figure] ?? 0);
  }
}
const orders = {
  id: (a, b) => a.dataset.id - b.dataset.id,
  sightings: (a, b) => b.dataset.sightings - a.dataset.sightings || orders.id(a, b),
  name: (a, b) => a.dataset.name.localeCompare(b.dataset.name, undefined, { numeric: true }) || orders.id(a, b),
};
function order() {
  cards.sort(orders[form.elements.order.value]);
  list.append(...cards);
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
  if (current) current.classList.remove("current");
  if (current) points.get(current.dataset.id)?.classList.remove("picked");
  current = card;
  if (!card) return;
  card.classList.add("current");
  points.get(card.dataset.id)?.classList.add("picked");
}
function go(card) {
  if (!card) return;
  choose(card);
  card.focus({ preventScroll: true });
  card.scrollIntoView({ block: "start" });
}
function judge(card, review, { move }) {
  const before = reviews.get(card.dataset.id);
  const after = before === review ? null : review;
  const next = neighbour(card, 1) ?? neighbour(card, -1);
  keep(card.dataset.id, after);
  filter();
  said.textContent = `Event ${card.dataset.id}: ${words[after]}`;
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
  const card = event.target.closest(".event");
  const button = event.target.closest("[data-review]");
  if (button) judge(card, button.dataset.review, { move: false });
});

// Exports
function download(name, type, content) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([JSON.stringify(content, null, 1), "\n"], { type }));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}
function reviewed() {
  return features.map((feature) => (
    { ...feature, properties: { ...feature.properties, review: reviews.get(String(feature.id)) } }
  ));
}
const exporters = {
  geojson: () => download("reviewed.geojson", "application/geo+json", { type: "FeatureCollection", features: reviewed() }),
  json: () => download("reviewed.json", "application/json", {
    events: reviewed().map(({ id, geometry, properties }) => {
      const [longitude, latitude] = geometry?.coordinates ?? [null, null];
      return { id, longitude, latitude, ...properties };
    }),
  }),
};
for (const button of document.querySelectorAll("[data-export]")) {
  button.addEventListener("click", exporters[button.dataset.export]);
}

form.addEventListener("input", filter);
form.elements.order.addEventListener("change", order);
form.addEventListener("submit", (event) => event.preventDefault());
window.addEventListener("storage", () => { recall(); filter(); });
for (const card of cards) {
  const point = points.get(card.dataset.id);
  card.querySelector(".verdict").hidden = false;
  if (!point) continue;
  card.addEventListener("pointerenter", () => point.classList.add("picked"));
  card.addEventListener("pointerleave", () => point.classList.toggle("picked", card === current));
}
form.hidden = document.getElementById("reviewing").hidden = cards.length === 0;
recall();
filter();
