// Figures of lessons. Each is a description of what is seen for what its reader has set, `state`:
// { state, sliders, choices, checks, handles, panels, see }, numbers in, marks out. Here is all else:
// panels, hands, keys, sentences by their predicates, the page's address.
(() => {
  "use strict";
  const { address, figures, sentences } = globalThis.actionopt;
  const { element, html, put, filled, slider, written, Panel } = globalThis.actionopt.panels;
  const STEP = 0.02, FINE = 0.1; // of a panel, for one key; with shift
  const SNAP = 0.006; // of a slider: nearer than this to a marked value it is that value
  const MARGIN = 8; // pixels around what has no axes
  const HEAD = 7, WING = 0.45; // pixels of an arrow's head; rad to either side

  const MARKS = { // in the panel's own numbers; an arrow's head is of one size
    line: (panel, points) => ["polyline", { points: panel.points(points.filter((p) => p.every(Number.isFinite))) }],
    area: (panel, points) => ["path", { d: `M${panel.points(points).replace(/ /g, "L")}Z` }],
    dot: (panel, [x, y], r = 5) => ["circle", { cx: panel.X(x), cy: panel.Y(y), r }],
    arrow: (panel, [x, y], [a, b]) => {
      const [px, py, qx, qy] = [panel.X(x), panel.Y(y), panel.X(a), panel.Y(b)], way = Math.atan2(qy - py, qx - px);
      const head = Math.min(HEAD, Math.hypot(qx - px, qy - py) / 2), wing = (turn) => `L${qx - head * Math.cos(way + turn)},${qy - head * Math.sin(way + turn)}`;
      return ["path", { d: `M${px},${py}L${qx},${qy}${wing(WING)}M${qx},${qy}${wing(-WING)}` }];
    },
    text: (panel, [x, y], words, anchor = "start", [dx, dy] = [0, 0]) => ["text", { x: panel.X(x) + dx, y: panel.Y(y) + dy, "text-anchor": anchor, words }],
  };

  function start(figure) {
    const data = JSON.parse(figure.querySelector("script").textContent), W = data.words, name = figure.dataset.figure, key = `f-${name}`;
    const it = figures[name](data), state = { ...it.state };
    let held = null;
    const has = (shown) => !shown || shown(state);

    // -- what is set
    const verdict = html(figure, "div", { class: "verdict" }), output = html(verdict, "output", { class: "action" });
    const controls = html(figure, "div", { class: "controls" });
    const options = Object.entries(it.choices ?? {}).map(([what, { of, shown }]) => {
      const set = html(controls, "span", { class: "chips", role: "radiogroup", "aria-label": W[what] });
      const inputs = of.map((value) => {
        const label = html(set, "label"), input = html(label, "input", { type: "radio", name: `${name}-${what}`, "data-choice": value });
        label.append(W[value]);
        input.addEventListener("change", () => change({ [what]: value, ...it.choices[what].sets?.(value) }));
        return input;
      });
      return () => { set.hidden = !has(shown); inputs.forEach((input, k) => { input.checked = of[k] === state[what]; }); };
    });
    for (const [what, shown] of Object.entries(it.checks ?? {})) {
      const label = html(controls, "label", { class: "check" }), input = html(label, "input", { type: "checkbox", "data-check": what });
      label.append(W[what]);
      input.addEventListener("change", () => change({ [what]: input.checked }));
      options.push(() => { label.hidden = !has(shown); input.checked = state[what]; });
    }
    html(controls, "button", { type: "button", class: "again" }, W.restart).addEventListener("click", () => { change(it.state); address.set(key, null); });
    const table = html(figure, "div", { class: "controls sliders" });
    for (const [what, { from, to, marks, unit, shown }] of Object.entries(it.sliders ?? {})) {
      const at = (f) => (typeof f === "function" ? f(state) : f ?? []), made = slider(table, W[what], 0, 1, 0);
      made.input.dataset.slider = what;
      const places = html(made.track, "span", { class: "foci", "aria-hidden": "true" });
      made.input.addEventListener("input", () => {
        const value = Number(made.input.value), near = at(marks).find((x) => Math.abs(x - value) < SNAP * (at(to) - at(from)));
        change({ [what]: near ?? value });
      });
      options.push(() => {
        made.label.hidden = !has(shown);
        const [low, high] = [at(from), at(to)];
        put(made.input, { min: low, max: high });
        made.input.value = state[what];
        made.clock.textContent = `${written(state[what], 3, high - low)} ${unit ?? ""}`.trim().replace(/ /g, "\u00a0");
        made.input.setAttribute("aria-valuetext", made.clock.textContent);
        places.replaceChildren(...at(marks).map((x) => { const mark = document.createElement("i"); mark.style.left = `${(100 * (x - low)) / (high - low)}%`; return mark; }));
      });
    }
    const message = html(figure, "p", { class: "message", role: "status" });

    // -- what is seen
    const box = html(figure, "div", { class: `panels ${it.even ? "thirds" : "shared"}` });
    const panels = Object.entries(it.panels).map(([what, height]) => {
      const panel = new Panel(html(box, "div", { class: "column" }), W[what], it.handles?.some((h) => h.panel === what) ? "path" : what, (w) => Math.min(330, height * w + 50));
      panel.free = element(panel.svg, "g"); // what may stand on the frame
      panel.svg.insertBefore(panel.free, panel.marks);
      return Object.assign(panel, { what });
    });
    const handles = (it.handles ?? []).map(({ panel: at, says, place, move, shown }) => {
      const panel = panels.find(({ what }) => what === at), group = element(panel.marks, "g", "handle");
      put(group, { tabindex: 0, role: "slider", "aria-label": W[says], "data-handle": says });
      element(group, "circle", "reach").setAttribute("r", 22);
      element(group, "circle", "knob").setAttribute("r", 8);
      const under = (event) => {
        const frame = panel.svg.getBoundingClientRect(), zoom = panel.svg.viewBox.baseVal.width / frame.width;
        return panel.value((event.clientX - frame.left) * zoom, (event.clientY - frame.top) * zoom);
      };
      group.addEventListener("pointerdown", (event) => {
        const [x, y] = place(state), [px, py] = under(event);
        held = [x - px, y - py];
        group.setPointerCapture(event.pointerId);
        group.classList.add("held");
        group.focus({ preventScroll: true });
        event.preventDefault();
      });
      group.addEventListener("pointermove", (event) => {
        if (held === null || !group.hasPointerCapture(event.pointerId)) return;
        const [x, y] = under(event);
        change(move(x + held[0], y + held[1], state));
      });
      for (const end of ["pointerup", "pointercancel"])
        group.addEventListener(end, () => { group.classList.remove("held"); held = null; draw(); });
      group.addEventListener("keydown", (event) => {
        const way = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowRight: [1, 0], ArrowLeft: [-1, 0] }[event.key];
        if (!way) return;
        event.preventDefault();
        const { x: [a, b], y: [c, d] } = panel.shown, step = STEP * (event.shiftKey ? FINE : 1), [x, y] = place(state);
        const to = ([i, j]) => move(x + step * (b - a) * i, y + step * (d - c) * j, state), by = to(way);
        const stays = Object.entries(by).every(([what, value]) => value === state[what]); // it moves the other way alone
        change(stays ? to([...way].reverse()) : by);
      });
      return () => {
        const [x, y] = place(state), no = !has(shown);
        group.toggleAttribute("hidden", no);
        group.setAttribute("transform", `translate(${panel.X(x).toFixed(2)},${panel.Y(y).toFixed(2)})`);
        put(group, { "aria-valuenow": y.toFixed(4), "aria-valuemin": panel.shown.y[0].toFixed(4), "aria-valuemax": panel.shown.y[1].toFixed(4), "aria-valuetext": `${written(x, 3)}, ${written(y, 3)}` });
      };
    });

    function draw() {
      if (!panels[0].right) return;
      options.forEach((show) => show());
      const seen = it.see(state, W);
      panels.forEach((panel) => {
        const { x, y, across, up, equal, marks, keys } = seen[panel.what];
        const bare = across === null && up === null;
        if (bare) panel.spread(MARGIN);
        panel.scale(x, y, equal);
        if (bare) panel.back.replaceChildren();
        else panel.axes(across, up);
        if (keys) panel.named(keys.map(([text, look]) => [W[text] ?? text, look]));
        panel.lines.replaceChildren();
        panel.free.replaceChildren();
        for (const [kind, look, ...rest] of marks) {
          const [tag, { words, ...attributes }] = MARKS[kind](panel, ...rest);
          put(element(kind === "dot" || kind === "text" ? panel.free : panel.lines, tag, look, words), attributes);
        }
      });
      handles.forEach((place) => place());
      const said = sentences.said(name, seen.measured);
      Object.assign(figure, { measured: seen.measured, state });
      figure.dataset.said = said;
      output.setAttribute("aria-live", held === null ? "polite" : "off");
      output.replaceChildren(...seen.text.map((words) => { const part = document.createElement("span"); part.textContent = words; return part; }));
      message.textContent = filled(W[said], seen.values ?? {});
      if (held === null) panels[0].svg.setAttribute("aria-label", `${W[panels[0].what]}: ${message.textContent}`);
    }

    function change(by) {
      Object.assign(state, by);
      draw();
      address.set(key, JSON.stringify(Object.values(state).map((x) => (typeof x === "number" ? Number(x.toPrecision(7)) : x))));
    }
    const hold = () => { // numbers where sliders can put them
      for (const [what, { from, to }] of Object.entries(it.sliders ?? {})) {
        const [low, high] = [from, to].map((f) => (typeof f === "function" ? f(state) : f));
        state[what] = Math.min(high, Math.max(low, state[what]));
      }
    };
    const before = address.get(key);
    if (before) try { // a link of another page is none of this one's
      const values = JSON.parse(before), names = Object.keys(state);
      if (names.every((what, k) => it.choices?.[what]?.of.includes(values[k]) ?? (typeof values[k] === typeof state[what] && Math.abs(values[k]) !== Infinity))) {
        names.forEach((what, k) => { state[what] = values[k]; });
        hold(); // what a slider allows may hang on a handle, and the other way round
        for (const { place, move } of it.handles ?? []) Object.assign(state, move(...place(state), state));
        hold();
      }
    } catch { /* torn */ }
    const caption = figure.querySelector("figcaption");
    if (caption) figure.append(caption);
    const layout = () => { panels.forEach((panel) => panel.layout()); draw(); };
    layout();
    new ResizeObserver(layout).observe(figure);
    figure.change = change;
  }

  document.querySelectorAll("[data-figure]").forEach(start);
})();
