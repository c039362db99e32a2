"use strict";
const form = document.getElementById("filters");
const list = document.getElementById("cards");
const cards = [...list.querySelectorAll(".event")];
const points = new Map([...document.querySelectorAll("[data-point]")].map((point) => [point.dataset.point, point]));
const features = JSON.parse(list.dataset.features);

// What was said: in the survey's files, and since then in this browser.
const reviews = new Map(features.map((feature) => [String(feature.id), feature.properties.review]));

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
    card.hidden = !isShown(card);
    pressButtons(card, reviews.get(card.dataset.id));
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

// Exports
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
const { isCurrent } = reviewCards({
  list, cards, reviews, filter,
  storage: `zeroscd survey ${list.dataset.survey}`,
  words: { accepted: "accepted", rejected: "rejected", unsure: "unsure", null: "not reviewed" },
  keys: { a: "accepted", r: "rejected", u: "unsure" },
  noun: "Event",
  block: "start",
  nameOf: (card) => card.dataset.id,
  mark: (card, on) => points.get(card.dataset.id)?.classList.toggle("picked", on),
});
for (const card of cards) {
  const point = points.get(card.dataset.id);
  if (!point) continue;
  card.addEventListener("pointerenter", () => point.classList.add("picked"));
  card.addEventListener("pointerleave", () => point.classList.toggle("picked", isCurrent(card)));
}
