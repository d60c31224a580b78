// The index: cards that have all words searched for, and all tags chosen.
(() => {
  "use strict";
  const finder = document.querySelector(".finder"), field = finder.querySelector("input"), none = finder.querySelector("[role=status]");
  const chips = [...finder.querySelectorAll("[data-tag]")], cards = [...document.querySelectorAll(".card")];
  const tags = new Map(cards.map((card) => [card, [...card.querySelectorAll(".tags li")].map((x) => x.textContent)]));
  function find() {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    const chosen = chips.filter((x) => x.getAttribute("aria-pressed") === "true").map((x) => x.dataset.tag);
    for (const card of cards)
      card.hidden = !(words.every((word) => (card.dataset.words + " " + tags.get(card).join(" ").toLowerCase()).includes(word)) && chosen.every((tag) => tags.get(card).includes(tag)));
    for (const group of document.querySelectorAll("[data-group]")) group.hidden = !group.querySelector(".card:not([hidden])");
    none.textContent = cards.every((card) => card.hidden) ? none.dataset.none : "";
  }
  field.addEventListener("input", find);
  for (const chip of chips)
    chip.addEventListener("click", () => { chip.setAttribute("aria-pressed", chip.getAttribute("aria-pressed") !== "true"); find(); });
  finder.hidden = false;
})();
