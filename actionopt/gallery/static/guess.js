// Exercises: a number is typed in before the answer is seen, and marked against the one computed.
(() => {
  "use strict";
  const RIGHT = 0.02, NEAR = 0.2; // of the number
  const RAISED = "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079";
  const { address } = globalThis.actionopt;
  const read = (text) => {
    const plain = text.trim().replace(/[\u2212\u2013\u207b]/g, "-").replace(/[\u2070\u00b9\u00b2\u00b3\u2074-\u2079]/g, (x) => RAISED.indexOf(x)).replace(",", ".").replace(/\s*[\u00d7x*\u00b7]\s*10\^?/, "e");
    return plain === "" ? NaN : Number(plain);
  };
  const verdict = (x, known) => {
    if (!Number.isFinite(x)) return "unread";
    if (known === 0) return Math.abs(x) < RIGHT ? "right" : "wrong";
    const off = Math.abs(x / known - 1), other = Math.abs(-x / known - 1);
    return off <= RIGHT ? "right" : off <= NEAR ? "near" : other <= NEAR ? "sign" : "wrong";
  };
  document.querySelectorAll("form.guess").forEach((form) => {
    const words = JSON.parse(form.dataset.words), field = form.querySelector("input"), said = form.querySelector("output");
    const answer = form.nextElementSibling, key = form.id;
    const show = (text) => {
      const mark = text === "?" ? "given" : verdict(read(text), Number(form.dataset.value));
      form.dataset.mark = mark;
      said.textContent = words[mark];
      if (mark === "unread") return;
      answer.hidden = false;
      address.set(key, text);
    };
    form.hidden = false;
    answer.hidden = true;
    form.addEventListener("submit", (event) => { event.preventDefault(); show(field.value); });
    form.querySelector("[data-give]").addEventListener("click", () => show("?"));
    const before = address.get(key);
    if (before !== null) { if (before !== "?") field.value = before; show(before); }
  });
})();
