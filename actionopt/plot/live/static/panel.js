// Axes with curves in them, numbers as they are read, and sliders: what figures under the hand are made of.
globalThis.actionopt.panels = (() => {
  "use strict";
  const NS = "http://www.w3.org/2000/svg";
  const POINT = document.documentElement.lang === "en" ? "." : ",";

  // A sentence with values in its braces.
  const filled = (text, values) => text.replace(/\{(\w+)\}/g, (_, name) => values[name]);

  const element = (parent, name, look, text) => {
    const made = document.createElementNS(NS, name);
    if (look) made.setAttribute("class", look);
    if (text) made.textContent = text;
    parent.append(made);
    return made;
  };
  const html = (parent, name, attributes = {}, text = "") => {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.textContent = text;
    parent.append(made);
    return made;
  };
  const put = (made, attributes) => {
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  };
  const minus = (text) => text.replace(".", POINT).replace("e", "\u00d710^").replace(/-/g, "\u2212").replace(/\^(\u2212?)\+?(\d+)/, (_, s, d) =>
    [...(s ? "\u207b" : ""), ...[...d].map((x) => "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[x])].join(""));
  // A number in so many digits, as small as nothing beside `size` if it is.
  const written = (x, digits = 4, size = 0) => {
    if (!Number.isFinite(x)) return "\u2014";
    if (Math.abs(x) <= 1e-9 * size || x === 0) return "0";
    const large = Math.abs(x) >= 1e5 || Math.abs(x) < 1e-3;
    return minus(large ? x.toExponential(Math.max(0, digits - 2)) : String(Number(x.toPrecision(digits))));
  };
  const fixed = (x, places) => minus((Math.abs(x) < 0.5 * 10 ** -places ? 0 : x).toFixed(places));
  // A number to the place of its last digit that is known, a power of ten.
  const to = (x, last) => {
    const size = Math.floor(Math.log10(Math.abs(x)) + 1e-12), digits = size - Math.round(Math.log10(last));
    if (!Number.isFinite(x) || !Number.isFinite(last)) return "\u2014";
    if (!(digits >= 0)) return "0";
    return minus(size >= 5 || size < -3 || digits < size ? x.toExponential(digits) : x.toFixed(digits - size));
  };
  const nice = (x) => { // 1, 2 or 5 times a power of ten, at least x
    const power = 10 ** Math.floor(Math.log10(x));
    return power * ([1, 2, 5, 10].find((k) => k * power >= x * 0.999) ?? 10);
  };
  const span = (rows) => rows.reduce(([a, b], x) => (Number.isFinite(x) ? [Math.min(a, x), Math.max(b, x)] : [a, b]), [Infinity, -Infinity]);

  const slider = (parent, name, low, high, value) => {
    const label = html(parent, "label"), text = html(label, "span", { class: "slider-name" }, name);
    const track = html(label, "span", { class: "track" });
    const input = html(track, "input", { type: "range", min: low, max: high, step: "any", "aria-label": name });
    input.value = value;
    return { label, text, input, track, clock: html(label, "span", { class: "clock" }) };
  };

  // A panel: axes with their own scale, which stays while a pointer is down.
  class Panel {
    constructor(parent, title, look, height) {
      this.box = html(parent, "div", { class: `panel ${look}` });
      this.title = html(this.box, "p", { class: "panel-title" }, title);
      this.svg = element(this.box, "svg");
      put(this.svg, { role: look === "path" ? "group" : "img", "aria-label": title }); // handles are in that of the path
      this.height = height;
      this.back = element(this.svg, "g", "back");
      const clip = element(this.svg, "clipPath");
      clip.id = `clip-${(Panel.count = (Panel.count ?? 0) + 1)}`;
      this.frame = element(clip, "rect");
      this.lines = element(this.svg, "g", "lines");
      this.lines.setAttribute("clip-path", `url(#${clip.id})`);
      this.marks = element(this.svg, "g", "marks");
    }

    layout() {
      const width = Math.max(240, this.svg.clientWidth), height = this.height(width);
      put(this.svg, { viewBox: `0 0 ${width} ${height}`, height });
      Object.assign(this, { left: 50, right: width - 12, top: 24, bottom: height - 30 });
      put(this.frame, { x: this.left, y: this.top - 6, width: this.right - this.left, height: this.bottom - this.top + 8 });
    }

    // All of it for what has no axes, but for a margin.
    spread(margin) {
      const [, , width, height] = this.svg.getAttribute("viewBox").split(" ").map(Number);
      Object.assign(this, { left: margin, right: width - margin, top: margin, bottom: height - margin });
      put(this.frame, { x: 0, y: 0, width, height });
    }

    // `up` is -1 where y grows downwards.
    scale(x, y, equal = false, up = 1) {
      let a = (this.right - this.left) / (x[1] - x[0]), b = (this.bottom - this.top) / (y[1] - y[0]);
      if (equal) a = b = Math.min(a, b);
      b *= up;
      const left = (this.left + this.right - a * (x[1] - x[0])) / 2, base = (this.top + this.bottom + b * (y[1] - y[0])) / 2;
      this.X = (value) => left + a * (value - x[0]);
      this.Y = (value) => base - b * (value - y[0]);
      this.value = (px, py) => [(px - left) / a + x[0], (base - py) / b + y[0]];
      this.unit = [a, b];
      this.shown = { x: [this.value(this.left, 0)[0], this.value(this.right, 0)[0]], y: [this.value(0, this.bottom)[1], this.value(0, this.top)[1]].sort((c, d) => c - d) };
    }

    // Axes by their names; without ticks across where there is none.
    axes(across, up, grid = false) {
      this.back.replaceChildren();
      const { x, y } = this.shown, dx = nice(((x[1] - x[0]) * 66) / (this.right - this.left)), dy = nice(((y[1] - y[0]) * 30) / (this.bottom - this.top));
      const ticks = ([a, b], step) => { // counted: a step may be less than the spacing of floats
        const from = Math.ceil(a / step - 1e-9), count = Math.min(40, Math.floor(b / step + 1e-9) - from + 1);
        return Array.from({ length: Math.max(0, count) }, (_, k) => (from + k) * step);
      };
      const power = (ends) => { const k = Math.floor(Math.log10(Math.max(...ends.map(Math.abs)))); return k >= 5 || k < -2 ? k : 0; };
      const named = (name, k) => (!k ? name : name.includes("(") ? name.replace("(", `(10${minus(`^${k}`)}\u00a0`) : `${name} (10${minus(`^${k}`)})`);
      const label = (value, step, k) => {
        if (Math.abs(value) < step / 2) return "0";
        return minus((value / 10 ** k).toFixed(Math.max(0, Math.min(12, k - Math.floor(Math.log10(step) + 1e-9)))));
      };
      const [right, high] = [power(x), power(y)];
      across = across && named(across, right);
      this.up = named(up, high);
      for (const value of across === null ? [] : ticks(x, dx)) {
        const at = this.X(value);
        element(this.back, "path", grid ? "grid" : "axis").setAttribute("d", `M${at},${this.bottom}V${grid ? this.top : this.bottom + 4}`);
        if (at < this.right - 10 - 7 * across.length) put(element(this.back, "text", "", label(value, dx, right)), { x: at, y: this.bottom + 18, "text-anchor": "middle" });
      }
      for (const value of ticks(y, dy)) {
        const at = this.Y(value);
        element(this.back, "path", grid ? "grid" : "axis").setAttribute("d", `M${this.left},${at}H${grid ? this.right : this.left - 4}`);
        put(element(this.back, "text", "", label(value, dy, high)), { x: this.left - 7, y: at + 4, "text-anchor": "end" });
      }
      element(this.back, "path", "axis").setAttribute("d", `M${this.left},${this.top}V${this.bottom}H${this.right}`);
      put(element(this.back, "text", "name", across), { x: this.right, y: this.bottom + 18, "text-anchor": "end" });
      put(element(this.back, "text", "name", this.up), { x: 4, y: 12 });
      this.cell = [dx, dy];
    }

    // Which colour is whose, beside the unit.
    named(rows) {
      const text = element(this.back, "text");
      put(text, { x: Math.max(48, 14 + 7 * this.up.length), y: 12 });
      rows.forEach(([name, look]) => `${name} `.split(/_(\S)/).forEach((part, k) => { // letters and their indices
        put(element(text, "tspan", `key ${look}`, part), { dy: k % 2 ? 3 : k ? -3 : 0 });
      }));
    }

    points(rows) { return rows.map(([x, y]) => `${this.X(x).toFixed(2)},${this.Y(y).toFixed(2)}`).join(" "); }
  }

  return { NS, element, html, put, filled, written, fixed, to, nice, span, slider, Panel };
})();
