// A trial path under the reader's hand. What is computed stands in action.js; here are the
// panels, the handles and what the buttons do.
(() => {
  "use strict";
  const STEP = 0.02, FINE = 0.1; // of the picture, for one key; with shift
  const REACH = 1.5, CURVE = 41; // alpha to either side; points of S(alpha)
  const FREE = 0.1; // of a coordinate's size: by so much it is tried whether it moves
  const STEEP = 8; // how far S(alpha) is shown, in its range from the motion to the path: a parabola needs 1.6
  const ROOM = 0.45; // around a path, to drag into, of its extent
  const SLOW = 0.15, MOST = 400; // of a step downhill; steps
  const TRIALS = 4; // of the hunt, in a step: one handle is seen to move after the other
  const AWAY = 12; // of the picture, where a path that runs away is let go
  const SHOWING = 4; // seconds of the picture
  const A_STEP = 200; // milliseconds that a step of Newton's method is seen
  const SNAP = 0.006; // of the slider: nearer than this to a conjugate time it is that time
  const NONE = 1e-6; // of a force: what is missing where nothing is
  const PARTS = 64; // of a change of a parameter that Newton's method does not follow at once
  const PROMPT = 600; // unknowns of a path whose conjugate times take no second
  const FINGER = 24; // pixels from handle to handle, at least: WCAG 2.2, criterion 2.5.8
  const ARROW = 46, LEAST_ARROW = 3; // pixels of the longest slope at a handle; of one that is seen
  const DIGITS = 5, HIDDEN = 1e-7; // of the range of S that are shown; of it or of S, what its differences lose
  const TURNS = 6, WHOLE = 0.3, ARROWS = 361, NEIGHBOURS = 31, WIDEST = 8; // of the sum over paths: data/phasors.py
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const { Action, address, compiled, sentences, TRUSTED } = globalThis.actionopt;
  const { NS, element, html, put, filled, written, fixed, to, nice, span, slider, Panel } = globalThis.actionopt.panels;

  // B-splines of degree 3, knots at the handles that are kept: the bend of one ends two of them away.
  const spline = (x) => {
    const y = Math.abs(x);
    return y >= 2 ? 0 : y >= 1 ? (2 - y) ** 3 / 6 : 2 / 3 - y * y + y ** 3 / 2;
  };

  // How the system looks at one time, of any path or, where that is not known, of the motion alone.
  class Picture extends Panel {
    constructor(parent, W, data) {
      super(parent, data.frames ? W.film : W.picture, "picture", (w) => Math.min(330, 0.8 * w));
      this.data = data;
      this.make = data.draw && compiled(data.draw);
      let bodies = 0;
      this.shapes = (data.frames ?? data.shapes).map(({ kind, count, points }) => {
        const dot = (count ?? (data.frames ? points[0] : points).length) === 1;
        return element(this.lines, dot ? "circle" : "polyline", kind === "body" ? `body b${bodies++ % 5}` : kind);
      });
      this.controls = html(this.box, "div", { class: "controls" });
      this.button = html(this.controls, "button", { type: "button", "data-do": "play" }, W.play);
      this.input = html(this.controls, "input", { type: "range", min: 0, max: 1, step: "any", value: 0, "aria-label": W.picture });
      this.clock = html(this.controls, "span", { class: "clock" });
    }

    layout() {
      super.layout();
      this.spread(8);
      const [a, b, c, d] = this.data.box, room = 0.15 * Math.max(b - a, d - c, 1e-9);
      this.scale([a - room, b + room], [c - room, d + room], true);
    }

    show(share, q, t) {
      const values = this.make ? this.make.at([q, [t]])[0] : null;
      let at = 0;
      (this.data.frames ?? this.data.shapes).forEach(({ kind, count, points, still }, i) => {
        let rows = points;
        if (count) rows = Array.from({ length: count }, () => [values[at++], values[at++]]);
        else if (this.data.frames) {
          const place = share * (points.length - 1), k = Math.min(Math.floor(place), points.length - 2);
          rows = still ? points[0] : points[k].map(([x, y], j) => [x + (place - k) * (points[k + 1][j][0] - x), y + (place - k) * (points[k + 1][j][1] - y)]);
        }
        const shape = this.shapes[i];
        if (rows.length === 1) put(shape, { cx: this.X(rows[0][0]), cy: this.Y(rows[0][1]), r: kind === "body" ? 7 : 3.5 });
        else shape.setAttribute("points", this.points(kind === "spring" ? coil(rows, 7 / this.unit[0]) : rows));
      });
    }
  }

  const coil = ([a, b], width) => {
    const turns = 8, dx = b[0] - a[0], dy = b[1] - a[1], side = width / (Math.hypot(dx, dy) || 1), rows = [a];
    for (let k = 0; k < 2 * turns; k++) {
      const along = 0.1 + (0.8 * (k + 0.5)) / (2 * turns), way = k % 2 ? -side : side;
      rows.push([a[0] + along * dx - way * dy, a[1] + along * dy + way * dx]);
    }
    return [...rows, b];
  };

  function start(figure) {
    const data = JSON.parse(figure.querySelector("script").textContent), W = data.words;
    let A = new Action(data);
    const { n, forced } = A, units = data.units, spans = data.spans, up = data.down ? -1 : 1; // as the picture has it
    const unit = (x, word) => (word ? `${x} ${word}`.replace(/ /g, "\u00a0") : x);
    const energy = (x, digits = 4, size = 0) => unit(written(x, digits, size), units.action);
    const knot = (j) => A.shares.indexOf(j / spans); // meshes are cut in halves, and keep the handles' nodes
    const free = (j, i) => !(j === 0 || j === spans) || A.ends[j ? 1 : 0][i] === null;

    // -- what is known at one moment
    // The motion: `known` if the page has a mesh that resolves it, else it is not shown and nothing is
    // said of it; `own` if it is that of the numbers given; `foci` the times at which its index changes.
    const given = () => {
      const begun = new Action(data), answer = Float64Array.from(data.answer);
      const found = begun.resolved(answer, (B, Q) => (B === begun ? Q : B.newton(Q))) ?? { A: begun, Q: answer, known: false };
      A = found.A;
      return { p0: A.momentum(found.Q), own: true, foci: data.conjugate, ...found };
    };
    let motion = given(), met = [];
    const begun = () => { // the straight line, where there is an action along it
      const Q = A.straight();
      return A.project(Q) && Number.isFinite(A.slope(Q)) ? Q : motion.Q.slice();
    };
    let first = begun(), trial, best = null, shown = "show" in figure.dataset, chosen = 0, held = null, busy = null, wide = false;
    trial = first.slice();
    const S = (Q) => A.value(Q);
    const seen = () => shown && motion.known, base = () => (seen() ? motion.Q : first);
    const say = (group, measured, values = {}) => {
      const name = sentences.said(group, measured);
      return name === null ? "" : filled(W[name], values);
    };
    // The mesh of another action for all there is, and what else lies on this one.
    const remesh = (other, ...others) => {
      const from = A, on = (Q) => (other === from ? Q : from.carried(Q, other));
      A = other;
      trial = on(trial);
      first = on(first);
      motion.Q = on(motion.Q);
      return others.map(on);
    };
    // Take what `resolved` found as the motion, if it is one; what else lies on the mesh is carried.
    const take = (found, rest, ...others) => {
      if (!found?.known) { Object.assign(motion, { known: false, met: Boolean(found) }); return others; }
      const carried = remesh(found.A, ...others);
      motion = { ...motion, ...found, ...rest, p0: A.momentum(found.Q) };
      return carried;
    };
    const pinned = () => !A.ends.flat().includes(null);
    const plus = (Q, by, b) => {
      const found = Q.map((x, i) => x + by * b[i]);
      return A.project(found) ? found : null;
    };
    const bend = () => { const Q = base(); return trial.map((x, i) => x - Q[i]); };
    const size = (b) => b.reduce((most, x, i) => Math.max(most, Math.abs(x) / data.sizes[i % n]), 0);

    // -- the frame
    const verdict = html(figure, "div", { class: "verdict" });
    const said = html(verdict, "span", { class: "measured" }), light = html(said, "span", { role: "img" }), output = html(said, "output", { class: "action" }), badge = html(verdict, "span", { class: "badge" });
    const chips = html(figure, "div", { class: "controls met", role: "group", "aria-label": W.met });
    const order = html(verdict, "p", { class: "order" });
    const controls = html(figure, "div", { class: "controls" });
    const buttons = {};
    const wanted = figure.dataset.with?.split(" ") ?? []; // of what is folded away else
    const folded = (made, name) => { made.classList.toggle("extra", !wanted.includes(name)); return made; };
    for (const name of ["solve", ...(forced ? [] : ["relax"]), "restart"]) buttons[name] = html(controls, "button", { type: "button", "data-do": name }, W[name]);
    for (const name of ["bend", "wave", ...(forced ? [] : ["half", "hunt"])])
      buttons[name] = folded(html(controls, "button", { type: "button", "data-do": name }, W[name]), name);
    const check = html(controls, "label", { class: "check" }), reveal = html(check, "input", { type: "checkbox" });
    check.append(W.show);
    const more = html(controls, "button", { type: "button", class: "quiet", "aria-expanded": false }, W.others);
    more.addEventListener("click", () => {
      more.setAttribute("aria-expanded", figure.classList.toggle("all"));
      layout();
    });
    const sliders = html(figure, "div", { class: "controls sliders" });
    const time = slider(sliders, data.measure ? W.part : W.duration, 0.1 * data.duration, data.longest, data.duration);
    time.input.dataset.duration = "";
    const marks = html(time.track, "span", { class: "foci", "aria-hidden": "true" });
    const message = html(figure, "p", { class: "message", role: "status" });
    const panels = html(figure, "div", { class: "panels" });
    const [left, right] = [0, 1].map(() => html(panels, "div", { class: "column" }));
    const pathPanel = new Panel(left, W.path, "path", (w) => Math.min(330, (data.pairs.length ? 0.75 : 0.6) * w + 60)); // one scale for both axes of a plane
    const energyPanel = forced ? null : new Panel(left, W.lagrangian, "lagrangian", (w) => Math.min(240, 0.35 * w + 70));
    const alphaPanel = forced ? null : new Panel(right, W.alpha, "alpha", (w) => Math.min(330, 0.75 * w + 40));
    const missingPanel = new Panel(data.picture && !forced ? left : right, data.measure ? W.lacking : W.missing, "missing", (w) => Math.min(forced && !data.picture ? 370 : 220, 0.5 * w + 40));
    const picture = data.picture ? new Picture(right, W, data.picture) : null;
    const all = [pathPanel, alphaPanel, energyPanel, missingPanel, picture].filter(Boolean);
    for (const [panel, name] of [[energyPanel, "lagrangian"], ...(forced ? [] : [[missingPanel, "missing"]]), [picture, "picture"]])
      if (panel) folded(panel.box, name);
    const folds = html(figure, "div", { class: "folds" });
    const numbers = data.parameters.length ? html(folds, "details") : null;
    if (numbers) { html(numbers, "summary", {}, W.parameters); numbers.open = wanted.includes("parameters"); }
    const table = numbers && html(numbers, "div", { class: "controls sliders" });
    data.parameters.forEach(({ name, place, value }) => {
      const [low, high] = value ? [0.1 * value, 2.5 * value].sort((a, b) => a - b) : [-1, 1];
      const made = slider(table, name, low, high, value);
      made.input.dataset.parameter = name;
      const tell = () => (made.clock.textContent = written(A.p[place], 4));
      made.input.addEventListener("input", () => {
        const asked = Number(made.input.value);
        setParameter(place, asked);
        if (A.p[place] !== asked) made.input.value = A.p[place];
        tell();
      });
      made.input.addEventListener("change", refocus); // let go
      made.recall = () => { made.input.value = A.p[place]; tell(); };
      made.reset = () => { made.input.value = value; tell(); };
      (table.rows ??= []).push(made);
      tell();
    });
    const paths = forced ? null : html(folds, "details", { class: "sum" });
    if (paths) {
      html(paths, "summary", {}, W.sum);
      paths.open = "sum" in figure.dataset;
      paths.hbar = slider(html(paths, "div", { class: "controls sliders" }), W.hbar, -3, -0.3, -1.2);
      const both = html(paths, "div", { class: "panels even" });
      paths.near = new Panel(html(both, "div", { class: "column" }), W.neighbours, "near", (w) => Math.min(330, 0.7 * w + 40));
      paths.spiral = new Panel(html(both, "div", { class: "column" }), W.spiral, "spiral", (w) => Math.min(330, 0.7 * w + 40));
      paths.words = html(paths, "p", { class: "note", role: "status" });
      for (const [parent, name, count, look] of [["near", "strands", NEIGHBOURS, ""], ["spiral", "turns", 24, ""]])
        paths[name] = Array.from({ length: count }, () => element(paths[parent].lines, name === "turns" ? "path" : "g", look));
      paths.truth = element(paths.near.lines, "g");
      paths.total = element(paths.spiral.marks, "path", "total");
      paths.limit = element(paths.spiral.marks, "path", "motion");
      paths.hbar.input.addEventListener("input", sum);
      paths.addEventListener("toggle", () => { layout(); });
    }
    const caption = figure.querySelector("figcaption");
    if (caption) figure.append(caption);

    // -- curves: pairs (x, y), or one coordinate against time
    const pairs = data.pairs.length ? data.pairs : null;
    const curves = () => pairs ?? [[null, chosen]];
    const radios = [];
    if (!pairs && n > 1) {
      const set = html(pathPanel.title, "span", { class: "chips", role: "radiogroup", "aria-label": W.coordinate });
      data.coordinates.forEach(({ name }, i) => {
        const label = html(set, "label"), input = html(label, "input", { type: "radio", name: `chosen-${data.name}-${Panel.count}` });
        label.append(name);
        radios.push(input);
        input.addEventListener("change", () => { chosen = i; rebuild(); });
      });
    }
    const axis = (i) => unit(data.coordinates[i].name, data.coordinates[i].unit && `(${data.coordinates[i].unit})`);
    const inTime = unit("t", units.time && `(${units.time})`);
    const spot = (Q, k, [x, y]) => [x === null ? A.start + A.shares[k] * A.duration : Q[k * n + x], Q[k * n + y]];
    const drawn = (rows, [x, y]) => rows.map(({ t, q }) => [x === null ? t : q[x], q[y]]);

    let shapes = [], handles = [];
    function rebuild() {
      pathPanel.lines.replaceChildren();
      pathPanel.marks.replaceChildren();
      shapes = curves().map((pair, c) => ({
        pair, truth: element(pathPanel.lines, "polyline", "motion"), line: element(pathPanel.lines, "polyline", `trial c${c % 5}`),
        ends: [0, 1].map((end) => element(pathPanel.marks, "circle", end ? "event" : "event first")),
      }));
      handles = shapes.flatMap(({ pair }, c) => Array.from({ length: spans + 1 }, (_, j) => j)
        .filter((j) => pair.some((i) => i !== null && free(j, i))).map((j) => handle(pair, c, j)));
      fit(true);
      draw();
    }

    // -- scales, which stay while a pointer is down
    let view = null, levels = null, rises = null, forces = null;
    const padded = ([a, b], room, least) => {
      const extra = room * Math.max(b - a, least), middle = (a + b) / 2, half = Math.max(b - a, least) / 2;
      return [middle - half - extra, middle + half + extra];
    };
    // Of values: kept where they fit and use a quarter of it, else ends on a step.
    const range = (old, values, zero) => {
      let [a, b] = span(values);
      if (!(b > a)) [a, b] = Number.isFinite(a) ? [a - 1e-9 - 1e-6 * Math.abs(a), b + 1e-9 + 1e-6 * Math.abs(a)] : [-1, 1];
      if (zero) [a, b] = [Math.min(a, 0), Math.max(b, 0)];
      if (old && a >= old[0] && b <= old[1] && b - a >= (old[1] - old[0]) / 4) return old;
      const step = nice((b - a) / 4);
      return [Math.floor(a / step - 0.2) * step, Math.ceil(b / step + 0.2) * step];
    };
    function fit(anew = false) {
      if (held !== null && !anew) return;
      const lines = [...(motion.known ? [motion.Q] : []), trial, first].map((Q) => A.seen(Q, 4));
      const rows = lines.flatMap((one) => curves().flatMap((pair) => drawn(one, pair)));
      const y = span(rows.map((r) => r[1])), x = span(rows.map((r) => r[0]));
      const most = Math.max(...curves().flat().filter((i) => i !== null).map((i) => data.sizes[i]));
      const inside = view && rows.every(([a, b]) => a >= view.x[0] && a <= view.x[1] && b >= view.y[0] && b <= view.y[1]);
      if (anew || !inside || wide !== view.wide) {
        const right = wide ? data.longest : Math.max(A.duration, data.duration);
        view = pairs ? { x: padded(x, ROOM, 0.3 * most), y: padded(y, ROOM, 0.3 * most) }
          : { x: [A.start, A.start + right], y: padded(y, ROOM, 0.6 * most) };
        view.wide = wide;
      }
    }

    function layout() {
      all.forEach((panel) => panel.layout());
      if (paths?.open) for (const panel of [paths.near, paths.spiral]) panel.layout();
      draw();
    }

    const truth = { L: energyPanel && element(energyPanel.lines, "polyline", "motion") };
    const adds = energyPanel && element(energyPanel.lines, "path", "adds"), takes = energyPanel && element(energyPanel.lines, "path", "takes");
    const parabola = alphaPanel && element(alphaPanel.lines, "polyline", "trial"), tangent = alphaPanel && element(alphaPanel.lines, "path", "tangent");
    const now = alphaPanel && element(alphaPanel.lines, "path", "tangent here");
    const dot = alphaPanel && element(alphaPanel.marks, "circle", "dot"), foot = alphaPanel && element(alphaPanel.marks, "circle", "event");
    const lacking = data.coordinates.map((_, i) => element(missingPanel.lines, "polyline", `trial thin c${i % 5}`));
    if (energyPanel) energyPanel.note = html(energyPanel.box, "p", { class: "note" });

    // What is seen in a panel, for who cannot see it.
    const named = (q) => data.coordinates.map(({ name, unit: word }, i) => unit(`${name} = ${written(q[i], 3, data.sizes[i])}`, word)).join(", ");
    const describe = (panel, words) => {
      if (held === null && busy === null) panel.svg.setAttribute("aria-label", `${panel.title.firstChild.data}: ${words}`);
    };

    function draw() {
      if (!pathPanel.right) return;
      fit();
      const sums = A.sum(trial), value = sums.S, own = seen() ? A.sum(motion.Q) : null, extent = A.range(motion.Q);
      const right = A.start + (wide ? data.longest : Math.max(A.duration, data.duration));
      const mineSeen = A.seen(trial), exactSeen = own ? A.seen(motion.Q) : [];
      // the path
      pathPanel.scale(view.x, view.y, Boolean(pairs), up);
      const [x, y] = curves()[0];
      pathPanel.axes(x === null ? inTime : axis(x), axis(y));
      shapes.forEach(({ pair, truth: line, line: mine, ends }) => {
        line.setAttribute("points", pathPanel.points(drawn(exactSeen, pair)));
        mine.setAttribute("points", pathPanel.points(drawn(mineSeen, pair)));
        [0, A.count - 1].forEach((k, end) => { const [a, b] = spot(trial, k, pair); put(ends[end], { cx: pathPanel.X(a), cy: pathPanel.Y(b), r: 5.5 }); });
      });
      thin();
      handles.forEach((it) => it.place());
      if (wanted.includes("slopes")) slopesAtHandles();
      // S along the bend
      let slopes = null, bare = false;
      if (alphaPanel) {
        let b = bend(), at = 1;
        if (size(b) < 1e-7) { b = ripple(1); at = 0; bare = true; }
        const from = base(), curve = [], lost = sums.noise > HIDDEN * extent;
        const along = (a) => {
          const Q = plus(from, a, b);
          if (!Q || (data.measure?.name && !Number.isFinite(A.way(Q).long))) return NaN; // lengths have no square below zero
          return lost ? A.between(from, Q) : S(Q);
        };
        const count = held === null ? CURVE : A.m ? 11 : 21; // paths are moved onto a surface one by one
        for (let k = 0; k < count; k++) { const a = REACH * ((2 * k) / (count - 1) - 1); curve.push([a, along(a)]); }
        const h = 1e-4, slope = (a) => { // S may be large, and its gradient small
          const [Q, ahead, back] = [a, a + h, a - h].map((c) => plus(from, c, b));
          return Q && ahead && back ? A.gradient(Q).reduce((sum, g, i) => sum + (g * (ahead[i] - back[i])) / (2 * h), 0) : NaN;
        };
        slopes = [slope(at), slope(0)];
        if (held === null || !rises) { // where S is infinite on the way it leaves the picture
          const [low, high] = span(curve.filter(([a]) => a >= 0 && a <= 1).map((r) => r[1])), far = STEEP * (high - low);
          rises = range(rises, curve.filter(([a]) => Math.abs(a) <= 1.25).map((r) => Math.max(low - far, Math.min(high + far, r[1]))));
        }
        alphaPanel.scale([-REACH, REACH], rises);
        alphaPanel.axes("\u03b1", unit(lost ? "S \u2212 S\u2080" : "S", units.action && `(${units.action})`));
        parabola.setAttribute("points", alphaPanel.points(curve.filter((r) => Number.isFinite(r[1]))));
        const line = (a, s, g, reach) => `M${alphaPanel.X(a - reach)},${alphaPanel.Y(s - g * reach)}L${alphaPanel.X(a + reach)},${alphaPanel.Y(s + g * reach)}`;
        const [low, high] = [along(0), along(at)];
        tangent.setAttribute("d", line(0, low, slopes[1], 1.2));
        now.setAttribute("d", at && Number.isFinite(high) ? line(1, high, slopes[0], 0.35) : ""); // a path may have no length
        const lowest = curve.reduce((a, b) => (b[1] < a[1] ? b : a)), highest = curve.reduce((a, b) => (b[1] > a[1] ? b : a));
        const inside = ([a]) => Math.abs(a) < REACH * 0.99;
        describe(alphaPanel, inside(lowest) ? filled(W.lowest, { a: fixed(lowest[0], 1) }) : inside(highest) ? filled(W.highest, { a: fixed(highest[0], 1) }) : filled(W.runs, { a: written(curve[0][1], 3), b: written(curve[curve.length - 1][1], 3) }));
        put(dot, { cx: alphaPanel.X(at), cy: Number.isFinite(high) ? Math.max(-20, Math.min(alphaPanel.bottom + 60, alphaPanel.Y(high))) : -20, r: 6 });
        put(foot, { cx: alphaPanel.X(0), cy: alphaPanel.Y(low), r: 4 });
        // the Lagrangian, whose area is S
        const L = A.along(mineSeen), exact = A.along(exactSeen);
        if (held === null || !levels) levels = range(levels, [...L, ...exact].map((r) => r[1]), true);
        energyPanel.scale([A.start, right], levels);
        energyPanel.axes(inTime, unit("L", units.energy && `(${units.energy})`), true);
        const cell = energyPanel.cell[0] * energyPanel.cell[1];
        energyPanel.note.textContent = filled(W.square, { x: energy(cell, 3) });
        const area = (cut) => `M${energyPanel.points([[A.start, 0]])}L` + energyPanel.points(L.filter(([, l]) => Number.isFinite(l)).map(([t, l]) => [t, cut(l)])) + `L${energyPanel.points([[A.start + A.duration, 0]])}Z`;
        adds.setAttribute("d", area((l) => Math.max(l, 0)));
        takes.setAttribute("d", area((l) => Math.min(l, 0)));
        truth.L.setAttribute("points", energyPanel.points(exact));
        const [least, most] = span(L.map((r) => r[1]));
        describe(energyPanel, filled(W.runs, { a: written(least, 3), b: written(most, 3) }));
        Object.assign(figure.dataset, { area: cell, pixels: energyPanel.unit[0] * energyPanel.unit[1] });
      }
      // the missing force
      const missing = A.missing(trial), mine = pairs ? pairs.flat() : [chosen];
      if (held === null || !forces) {
        const reach = Math.max(...mine.flatMap((i) => Array.from(missing[i], Math.abs)), NONE * extent / A.duration / Math.max(...data.sizes), Number.MIN_VALUE);
        const top = Math.max(1.1 * reach, (forces?.most ?? 0) / 8); // what vanishes is seen to vanish
        forces = Object.assign([-top, top], { most: Math.max(top, forces?.most ?? 0) });
      }
      missingPanel.scale([A.start, right], forces);
      missingPanel.axes(inTime, [...new Set(mine.map((i) => data.coordinates[i].force).filter(Boolean))].map((word) => `(${word})`).join(" "));
      if (mine.length > 1) missingPanel.named(mine.map((i) => [data.coordinates[i].name, `c${i % 5}`]));
      lacking.forEach((line, i) => line.setAttribute("points", mine.includes(i) ? missingPanel.points(Array.from(missing[i], (f, k) => [A.start + A.shares[k] * A.duration, f]).slice(1, -1)) : ""));
      // words
      const distance = A.slope(trial);
      let rise = own ? value - own.S : 0;
      if (own && Math.abs(rise) < sums.noise / HIDDEN) rise = A.between(motion.Q, trial);
      // The place of the last digit that is known, and of those that matter.
      const place = (off) => 10 ** Math.ceil(Math.log10(Math.max(2 * off, extent * 10 ** -DIGITS)) - 1e-9), last = place(sums.error + sums.noise);
      const text = [];
      if (data.measure?.name) { // what its reader wants
        const { name, unit: word, factor } = data.measure, { long, error } = A.way(trial), size = factor * long;
        text.push(["S", `${name} = ${unit(to(size, 10 ** Math.ceil(Math.log10(Math.max(2 * factor * error, size * 10 ** -DIGITS)) - 1e-9)), word)}`]);
      }
      text.push(["S", `S = ${unit(to(value, last), units.action)}`]);
      if (!forced && own) {
        const off = place(sums.noise > HIDDEN * extent ? sums.noise * HIDDEN : sums.error + own.error + sums.noise), by = unit(to(Math.abs(rise), off), units.action);
        const name = sentences.said("compared", { rise, error: off / 2 });
        text.push([name === "same" ? "" : name, filled(W[name], { x: by })]);
      } else if (!forced) {
        best = best === null ? value : Math.min(best, value);
        text.push(["", filled(W.best, { x: unit(to(best, last), units.action) })]);
      }
      const doubt = Math.max(sums.error / extent, own ? motion.off : 0), green = doubt < TRUSTED && (motion.known || !shown);
      const why = green ? filled(W.trusted, { x: written(Math.max(doubt, Number.EPSILON), 1) }) : W.coarse;
      put(light, { class: green ? "light green" : "light", "aria-label": why, title: why });
      output.setAttribute("aria-live", held === null && busy === null ? "polite" : "off"); // not at each pixel
      output.replaceChildren(...text.map(([look, words]) => { const part = document.createElement("span"); part.className = look; part.textContent = words; return part; }));
      const lean = (x, digits) => unit(Math.abs(x) < 1e-7 * extent ? "0" : written(x, digits), units.action);
      const [here, there] = (slopes ?? []).map((x) => lean(x, 2));
      order.textContent = forced ? filled(W.distance, { x: lean(distance, 3) })
        : bare ? filled(W.steepest, { x: lean(distance, 2) }) : filled(seen() ? W.slope : W.slopes, { here, there });
      describe(pathPanel, [0, A.count - 1].map((k) => named(A.row(trial, k))).join(" \u2192 "));
      describe(missingPanel, filled(W.most, { x: written(Math.max(...mine.flatMap((i) => Array.from(missing[i], Math.abs))), 2) }));
      verdictOf();
      time.clock.textContent = unit(fixed(A.duration, 3), units.time);
      time.input.setAttribute("aria-valuetext", time.clock.textContent);
      sum();
      show();
      keep();
      Object.assign(figure.dataset, { action: value, rise, slope: distance, duration: A.duration, best: best ?? "", bend: size(bend()), known: motion.known, last, range: extent });
    }

    // A handle is put away where one that is kept is closer than a finger tells apart, along the
    // straight line or the motion. The middle of each curve is kept first, then what halves its parts;
    // the fewer are left of a curve, the wider each bends it.
    function thin() {
      const rank = (j) => (j % spans ? spans / 2 / (j & -j) : spans), kept = [];
      const lines = [first, ...(motion.known ? [motion.Q] : [])];
      [...handles].sort((a, b) => rank(a.j) - rank(b.j)).forEach((it) => {
        it.at = lines.map((Q) => { const [x, y] = spot(Q, knot(it.j), it.pair); return [pathPanel.X(x), pathPanel.Y(y)]; });
        it.away = kept.some((other) => it.at.some(([x, y], k) => Math.hypot(x - other.at[k][0], y - other.at[k][1]) < FINGER));
        if (!it.away) kept.push(it);
        it.group.classList.toggle("away", it.away);
      });
      const step = (j) => (j % spans ? j & -j : spans / 2);
      handles.forEach((it) => { it.wide = Math.min(...kept.filter(({ pair }) => pair === it.pair).map(({ j }) => step(j)), spans / 2); });
    }

    // How S falls with each handle: an arrow the way that it is to be pulled, of a length as the slope
    // is to the steepest one that was met.
    let steepest = 0;
    function slopesAtHandles() {
      const g = A.gradient(trial), falls = handles.map(({ pair, j, wide }) => pair.map((i) => (i === null || !free(j, i) ? 0
        : -A.shares.reduce((sum, s, k) => sum + g[k * n + i] * bump(j, s * spans, wide), 0) / bump(j, j, wide))));
      if (held === null) steepest = Math.max(steepest, ...falls.map(([a, b]) => Math.hypot(a, b)));
      figure.dataset.slopes = falls.map(([a, b]) => Math.hypot(a, b).toPrecision(4)).join(" ");
      handles.forEach((it, k) => {
        const [x, y] = falls[k].map((f) => (steepest ? (ARROW * f) / steepest : 0)), long = Math.hypot(x, y), way = Math.atan2(-up * y, x);
        if (!it.arrow) it.group.prepend((it.arrow = element(it.group, "path", "pull"))); // below the knob
        const tip = (by) => `M${x},${-up * y}L${x - 7 * Math.cos(way + by)},${-up * y - 7 * Math.sin(way + by)}`;
        it.arrow.setAttribute("d", long > LEAST_ARROW ? `M0,0L${x},${-up * y}${tip(0.5)}${tip(-0.5)}` : "");
      });
    }

    // -- the picture, and a mark of its time on the path and on L
    let share = 0, playing = null;
    const cursors = picture ? [pathPanel, energyPanel].filter(Boolean).map((panel) => element(panel.marks, "path", "cursor")) : [];
    const places = picture ? element(pathPanel.svg, "g", "places") : null;
    function show() { // at the share of the duration
      if (!picture) return;
      const Q = data.picture.frames ? motion.Q : trial, q = A.sample(Q, share), t = A.start + share * A.duration;
      picture.show(share, q, t);
      picture.clock.textContent = filled(W.clock, { t: unit(fixed(t, 2), units.time) });
      picture.input.value = share;
      picture.input.setAttribute("aria-valuetext", picture.clock.textContent);
      const moved = share > 0;
      cursors.forEach((cursor, i) => {
        const panel = i ? energyPanel : pathPanel;
        cursor.setAttribute("d", moved && (i || !pairs) ? `M${panel.X(t)},${panel.top}V${panel.bottom}` : "");
      });
      places.replaceChildren(...(moved ? curves().map(([x, y], c) => {
        const dot = document.createElementNS(NS, "circle");
        put(dot, { class: `place c${c % 5}`, cx: pathPanel.X(x === null ? t : q[x]), cy: pathPanel.Y(q[y]), r: 5 });
        return dot;
      }) : []));
    }
    function play(yes) {
      if (playing !== null) cancelAnimationFrame(playing);
      playing = null;
      picture.button.textContent = yes ? W.pause : W.play;
      if (!yes) return;
      if (share >= 1) share = 0;
      let before = performance.now();
      const tick = (now) => {
        share = Math.min(1, share + Math.max(0, now - before) / 1000 / SHOWING);
        before = now;
        show();
        if (share >= 1) play(false);
        else playing = requestAnimationFrame(tick);
      };
      playing = requestAnimationFrame(tick);
    }
    if (picture) {
      picture.button.addEventListener("click", () => play(playing === null));
      picture.input.addEventListener("input", () => { play(false); share = Number(picture.input.value); show(); });
    }

    // -- the sum over paths, along the present bend or half a wave
    function sum() {
      if (!paths?.open || !paths.near.right || held !== null) return; // not laid out yet: `toggle` will be
      paths.hidden = !motion.known;
      if (!motion.known) return;
      const Q = motion.Q, wave = ripple(1), mine = trial.map((x, i) => x - Q[i]);
      const b = size(mine) < 1e-7 ? wave : mine.map((x) => (x * size(wave)) / size(mine));
      const S0 = S(Q), along = (a) => { const moved = plus(Q, a, b); return moved ? S(moved) - S0 : NaN; };
      const h = 1e-3, second = (along(h) + along(-h)) / (h * h), unitOf = (paths.unit ??= Math.abs(second) || 1);
      const hbar = unitOf * 10 ** Number(paths.hbar.input.value), reach = Math.min(WIDEST, Math.sqrt((4 * Math.PI * TURNS * hbar) / Math.abs(second)));
      paths.hbar.clock.textContent = energy(hbar, 2);
      const whole = (x) => { // falls smoothly from 1 to 0 towards the ends
        const u = (Math.abs(x) - WHOLE) / (1 - WHOLE);
        return u <= 0 ? 1 : u >= 1 ? 0 : 1 / (1 + Math.exp(1 / (1 - u) - 1 / u));
      };
      const hue = (phase) => `oklab(${(0.56 - 0.08 * Math.cos(phase)).toFixed(3)} 0 ${(0.11 * Math.sin(phase)).toFixed(3)})`, step = (2 * reach) / (ARROWS - 1);
      const ends = [[0, 0]], phases = [];
      for (let k = 0; k < ARROWS; k++) {
        const a = reach * ((2 * k) / (ARROWS - 1) - 1), rise = along(a), [x, y] = ends[k];
        if (!Number.isFinite(rise)) { ends.push([x, y]); phases.push(0); continue; }
        const long = step * whole(a / reach);
        phases.push(rise / hbar);
        ends.push([x + long * Math.cos(rise / hbar), y + long * Math.sin(rise / hbar)]);
      }
      const total = ends[ARROWS], limit = second > 0 ? 45 : -45, length = Math.sqrt((2 * Math.PI * hbar) / Math.abs(second));
      const known = [length * Math.SQRT1_2, Math.sign(second) * length * Math.SQRT1_2];
      // the neighbours
      const near = paths.near, [x, y] = curves()[0];
      near.scale(view.x, view.y, Boolean(pairs), up);
      near.axes(x === null ? inTime : axis(x), axis(y));
      const curve = (group, rows, look, colour) => group.replaceChildren(...curves().map((pair) => {
        const line = document.createElementNS(NS, "polyline");
        put(line, { points: near.points(drawn(rows, pair)), class: look, ...(colour && { style: `stroke: ${colour}` }) });
        return line;
      }));
      paths.strands.forEach((group, k) => {
        const a = 0.4 * reach * ((2 * k) / (NEIGHBOURS - 1) - 1), moved = plus(Q, a, b);
        if (moved) curve(group, A.seen(moved, 6), "strand", hue((S(moved) - S0) / hbar));
        else group.replaceChildren();
      });
      curve(paths.truth, A.seen(Q, 6), "trial truth");
      // the arrows
      const spiral = paths.spiral, [a, c] = span([...ends.map((e) => e[0]), known[0]]), [d, e] = span([...ends.map((p) => p[1]), known[1]]);
      spiral.scale(padded([a, c], 0.12, 1e-9), padded([d, e], 0.12, 1e-9), true);
      spiral.axes("Re", "Im");
      paths.turns.forEach((line, k) => {
        const from = Math.round((k * ARROWS) / 24), to = Math.round(((k + 1) * ARROWS) / 24);
        put(line, { d: `M${spiral.points(ends.slice(from, to + 1)).replace(/ /g, "L")}`, class: "arrows" });
      });
      const arrow = ([u, v]) => {
        const [px, py, qx, qy] = [spiral.X(0), spiral.Y(0), spiral.X(u), spiral.Y(v)], way = Math.atan2(qy - py, qx - px);
        const tip = (by) => `M${qx},${qy}L${qx - 11 * Math.cos(way + by)},${qy - 11 * Math.sin(way + by)}`;
        return `M${px},${py}L${qx},${qy}${tip(0.4)}${tip(-0.4)}`;
      };
      paths.total.setAttribute("d", arrow(total));
      paths.limit.setAttribute("d", `M${spiral.X(0)},${spiral.Y(0)}L${spiral.X(known[0])},${spiral.Y(known[1])}`);
      const degrees = (Math.atan2(total[1], total[0]) * 180) / Math.PI, signed = (x) => (x > 0 ? "+" : "") + fixed(x, 0);
      paths.words.textContent = say("turned", { wide: reach >= WIDEST, degenerate: motion.verdict.kind === "degenerate", second, range: A.range(Q) }, { found: signed(degrees), known: signed(limit) });
      Object.assign(figure.dataset, { turned: degrees, length: Math.hypot(...total), limit: length });
    }

    // -- what the motion is
    function verdictOf() {
      badge.hidden = motion.known && !seen();
      if (motion.known && !forced && motion.verdict?.of !== motion.Q) motion.verdict = { ...A.index(motion.Q), of: motion.Q };
      const { kind, index } = (motion.known && motion.verdict) || {};
      const name = sentences.said("badge", { forced, known: motion.known, met: motion.met, kind, pinned: pinned() });
      badge.textContent = filled(W[name], { k: index });
      badge.className = `badge ${name}`;
      reveal.disabled = !motion.known;
      Object.assign(figure.dataset, { kind: name, index: index ?? "" });
      list();
    }

    // The motions met between these events, to be seen again.
    function list() {
      if (forced) return;
      if (motion.known && seen() && !met.some(alike)) met.push({ motion, action: A });
      chips.hidden = met.length < 2;
      chips.replaceChildren(...met.map((one) => {
        const button = document.createElement("button"), { kind, index } = one.motion.verdict ?? {};
        put(button, { type: "button", "aria-pressed": alike(one) });
        button.textContent = `S = ${unit(to(one.action.value(one.motion.Q), 10 ** Math.ceil(Math.log10(A.range(motion.Q)) - DIGITS)), units.action)}, ${filled(W[kind] ?? W.undecided, { k: index })}`;
        button.addEventListener("click", () => {
          stop();
          remesh(one.action);
          motion = { ...one.motion };
          told(true);
          become(motion.Q.slice());
          refocus();
        });
        return button;
      }));
    }
    const alike = ({ motion: { Q }, action }) => {
      const other = action === A ? Q : action.carried(Q, A);
      return size(other.map((x, i) => x - motion.Q[i])) < 1e-5;
    };

    function foci() {
      const low = Number(time.input.min), high = Number(time.input.max);
      marks.replaceChildren();
      for (const t of motion.foci ?? []) {
        const share = (t - A.start - low) / (high - low);
        if (share >= 0 && share <= 1) html(marks, "i", { style: `left:${(100 * share).toFixed(2)}%` });
      }
    }

    // Those of another motion: with free ends, of its family. There are as many before its end as its
    // index says, else they are not known.
    function refocus() {
      if (!forced && motion.known && !motion.foci) {
        const { Q, p0, verdict } = motion, low = Number(time.input.min);
        const times = A.count * n > PROMPT ? null : pinned() ? A.conjugate(Q, p0, data.longest) : A.focal(Q, low, data.longest);
        const count = times?.filter((t) => t < A.start + A.duration).length;
        if (times && (!pinned() || verdict.kind === "degenerate" || count === verdict.index)) motion.foci = times;
        else message.textContent += ` ${W.unmarked}`;
      }
      foci();
    }

    // -- what the reader does
    function become(Q, words = "") {
      trial = Q;
      message.textContent = words;
      draw();
    }

    // Half waves along the path, of the coordinates that are shown: of the last of each pair.
    function ripple(waves) {
      const b = new Float64Array(trial.length), shape = A.shares.map((s) => Math.sin(waves * Math.PI * s) / Math.sqrt(waves));
      if (!A.m) {
        const by = 0.22 * (view.y[1] - view.y[0]);
        for (const [, i] of curves()) shape.forEach((x, k) => (b[k * n + i] += by * x));
        return b;
      }
      A.planes(base()).forEach(({ tangent }, k) => tangent.forEach((z) => { // along the surface
        const c = 0.3 * shape[k] * z.reduce((sum, x) => sum + x, 0);
        for (let i = 0; i < n; i++) b[k * n + i] += c * z[i] * data.sizes[i];
      }));
      return b;
    }

    function bent(from, j, to, wide = 1) { // handle j of `from` moved: to = {coordinate: value}
      const Q = from.slice(), peak = bump(j, j, wide);
      for (const [i, value] of Object.entries(to)) {
        if (!free(j, Number(i))) continue;
        const by = value - from[knot(j) * n + Number(i)];
        A.shares.forEach((s, k) => (Q[k * n + Number(i)] += (by * bump(j, s * spans, wide)) / peak));
      }
      return A.project(Q) ? Q : null;
    }
    const bump = (j, u, wide) => // odd about both ends, where the path is held
      spline((u - j) / wide) - (j > 0 ? spline((u + j) / wide) : 0) - (j < spans ? spline((u - 2 * spans + j) / wide) : 0);

    function stop() {
      if (busy === null) return false;
      cancelAnimationFrame(busy.frame);
      buttons[busy.name].textContent = W[busy.name];
      busy = null;
      return true;
    }

    // Run `step` until it returns words, a frame each; all at once for who wants no motion. `spent` are
    // the words where it has not after MOST.
    function animate(name, step, { then = () => {}, spent = () => "" } = {}) {
      if (busy?.name === name) { stop(); return; }
      stop();
      if (still.matches) {
        let words;
        for (let k = 0; k < MOST && !words; k++) words = step(k);
        become(trial, words || spent());
        return;
      }
      busy = { name };
      message.textContent = "";
      buttons[name].textContent = W.stop;
      let k = 0;
      const tick = () => {
        if (busy === null) return;
        const words = step(k++);
        if (words || k > MOST) { stop(); become(trial, words || spent()); then(); return; }
        draw();
        busy.frame = requestAnimationFrame(tick);
      };
      busy.frame = requestAnimationFrame(tick);
    }

    function solve() {
      stop();
      // On few elements first, from which Newton's method goes less far astray than on many; where it
      // ends at none that a finer mesh confirms, the force that is missing is taken away part by part.
      const ways = [(mesh, at, follow) => mesh.newton(at, { follow }), (mesh, at, follow) => mesh.released(at, (P) => { follow(P); parts++; })];
      let steps, from, begun, parts, any = false;
      for (const [mesh, ask] of (motion.known ? [A.coarse()] : [A.coarse(), A]).flatMap((mesh) => ways.map((ask) => [mesh, ask]))) {
        [steps, from, parts] = [[], mesh, 0];
        begun = mesh.resolved(A.carried(trial, mesh), (B, Q) => (B === mesh ? ask(B, Q, (P) => steps.push(P)) : B.newton(Q)));
        any ||= Boolean(begun);
        if (begun?.known) break;
      }
      const found = begun?.known ? begun : null, measured = { found: Boolean(found), known: motion.known, met: any, steps: steps.length, parts, forced };
      const words = [say("solved", measured, { k: parts || steps.length }), say("level", measured)].join(" ").trim();
      if (!found && !motion.known) { motion.met = any; become(trial, words); return; }
      const before = found ? steps.map((Q) => from.carried(Q, found.A)) : steps;
      if (found) {
        take(found, { own: false, foci: null });
        const same = met.find(alike);
        if (same) Object.assign(motion, { own: same.motion.own, foci: same.motion.foci });
      }
      told(true);
      if (!found || still.matches || steps.length < 2) { become(motion.Q.slice(), words); refocus(); return; }
      const since = performance.now();
      animate("solve", () => {
        const k = Math.floor((performance.now() - since) / A_STEP);
        trial = before[k] ?? motion.Q.slice();
        if (k >= before.length) return words;
      }, { then: refocus });
    }

    function relax() {
      let before = S(trial);
      const noise = Math.max(1e-11 * A.range(trial), A.sum(trial).noise);
      animate("relax", () => {
        const next = A.descend(trial, SLOW), falls = next && before - S(next) > noise;
        if (falls && size(bend()) <= AWAY) { trial = next; before = S(next); return ""; }
        const saddle = motion.known && motion.verdict.index > 0 && size(trial.map((x, i) => x - motion.Q[i])) < 1e-3;
        const end = falls || saddle ? null : A.resolved(trial);
        const least = Boolean(end?.known && end.A.index(end.Q).index === 0 && size(A.carried(trial, end.A).map((x, i) => x - end.Q[i])) < 0.01);
        return say("downhill", { away: Boolean(falls), least, saddle });
      }, { spent: () => filled(W.unfinished, { k: MOST }) });
    }

    function hunt() {
      let by = 0.12 * (view.y[1] - view.y[0]), j = 0, tries = 0, luck = false, sign = 1;
      const moves = handles.flatMap((it) => it.pair.filter((i) => i !== null && free(it.j, i)).map((i) => [it.j, i]));
      const spent = () => filled(W.hunted, { k: tries });
      animate("hunt", () => {
        for (let round = 0; round < TRIALS; round++) {
          const [k, i] = moves[j], Q = bent(trial, k, { [i]: trial[knot(k) * n + i] + sign * by });
          tries++;
          if (Q && S(Q) < S(trial)) { trial = Q; luck = true; } // and again the same way
          else if (sign > 0) sign = -1;
          else { sign = 1; if (++j === moves.length) { j = 0; if (!luck) by /= 2; luck = false; } }
          if (by < 2e-4 * (view.y[1] - view.y[0])) return spent();
          if (size(trial.map((x, c) => x - first[c])) > AWAY) return W.away;
        }
      }, { spent });
    }

    function half() {
      const b = bend(), from = base(), Q = plus(from, 0.5, b), { error, noise } = A.sum(trial);
      if (!Q) return;
      const lost = noise > HIDDEN * A.range(from), rise = (P) => (lost ? A.between(from, P) : S(P) - S(from));
      const measured = { size: size(b), a: rise(trial), b: rise(Q), error: lost ? noise * HIDDEN : error + noise, range: A.range(from) };
      const words = say("halved", measured);
      if (measured.size < 1e-7) message.textContent = words;
      else become(Q, `${filled(W.halved, { a: energy(measured.a, 4), b: energy(measured.b, 4), r: fixed(measured.b / measured.a, 3) })} ${words}`);
    }

    function told(yes) { // whether the motion is seen
      shown = reveal.checked = yes;
      figure.toggleAttribute("data-show", yes);
      if (yes) best = null;
    }

    function setDuration(T) {
      stop();
      wide = true;
      const nearest = pinned() && motion.foci?.find((t) => Math.abs(t - A.start - T) < SNAP * (data.longest - 0.1 * data.duration));
      const goal = !nearest ? T : nearest - A.start, line = !seen(), along = pinned() && motion.known;
      let b = trial.map((x, i) => x - base()[i]);
      const before = A.duration, steps = along ? 1 : Math.ceil(Math.abs(goal - before) / (0.06 * data.duration));
      message.textContent = "";
      for (let k = 1; k <= steps; k++) {
        const from = A.duration, next = k < steps ? before + ((goal - before) * k) / steps : goal;
        if (along) { // on along the motion, whose end event is where it is then
          const { p0 } = motion, Q = A.followed(motion.Q, p0, next), found = A.resolved(Q, (B, at) => B.motion(at, p0));
          if (!found?.known) { A.duration = from; message.textContent = W.lost; break; }
          [b] = take(found, {}, b);
          motion.p0 = p0;
          if (A.duration !== next) message.textContent = W.lost;
        } else {
          A.duration = next;
          [b] = take(A.resolved(motion.Q), { foci: motion.foci }, b);
        }
      }
      met = [];
      if (along) A.ends[1] = Array.from(A.row(motion.Q, A.count - 1));
      first = begun();
      trial = plus(line || !motion.known ? first : motion.Q, 1, b) ?? first.slice();
      time.input.value = A.duration;
      best = null;
      draw();
    }

    function setParameter(place, value) {
      stop();
      const from = base(), kept = A.p[place];
      let b = trial.map((x, i) => x - from[i]), reached = value;
      A.p[place] = value;
      let now = A.newton(motion.Q);
      if (!now && motion.known) { // in smaller steps, as far as there is a motion
        [now, reached] = [motion.Q, kept];
        for (let k = 1; k <= PARTS; k++) {
          A.p[place] = k < PARTS ? kept + ((value - kept) * k) / PARTS : value;
          const next = A.newton(now);
          if (!next) break;
          [now, reached] = [next, A.p[place]];
        }
      }
      A.p[place] = reached;
      met = [];
      const own = data.p.every((x, i) => x === A.p[i]) && A.duration === data.duration;
      [b] = take(now && A.resolved(now), { own, foci: own && pinned() ? data.conjugate : null }, b);
      message.textContent = !motion.known || reached === value ? "" : W.lost;
      trial = plus(base(), 1, b) ?? base().slice();
      best = null;
      foci();
      draw();
    }

    // -- what the reader did, for the address: revealed, duration, parameters, path, its motion
    const origin = A, key = data.name;
    let untouched = null;
    const onOrigin = (Q) => address.packed(A === origin ? Q : A.carried(Q, origin));
    const state = () => [Number(shown), A.duration, Array.from(A.p).join(","), onOrigin(trial), seen() && !motion.own ? onOrigin(motion.Q) : ""].join("~");
    function keep() {
      if (untouched !== null && held === null && busy === null) address.set(key, state() === untouched ? null : state());
    }
    function recall(text) { // as far as it is understood; the motion is solved for again
      const [yes, T, p, path, other] = text.split("~");
      p.split(",").forEach((x, place) => { if (Number(x) !== A.p[place]) setParameter(place, Number(x)); });
      if (Math.abs(Number(T) - A.duration) > 1e-12 * A.duration) setDuration(Number(T));
      const laid = (rows) => (rows.length === origin.count * n ? (A === origin ? Float64Array.from(rows) : origin.carried(Float64Array.from(rows), A)) : null);
      const Q = other && laid(address.numbers(other)), found = Q && A.resolved(Q, (B, at) => B.newton(at));
      if (found?.known) take(found, { own: false, foci: null });
      const mine = laid(address.numbers(path));
      told(yes === "1");
      if (mine) become(mine.map((x, i) => (A.ends[0][i] !== null && i < n ? A.ends[0][i] : i >= mine.length - n && A.ends[1][i - mine.length + n] !== null ? A.ends[1][i - mine.length + n] : x)));
      table?.rows.forEach((row) => row.recall());
    }

    function restart() {
      stop();
      motion = given();
      met = [];
      first = begun();
      time.input.value = data.duration;
      table?.rows.forEach((row) => row.reset());
      if (paths) paths.unit = null;
      wide = false;
      best = levels = rises = forces = null;
      told(false);
      foci();
      trial = first.slice();
      fit(true);
      become(trial);
    }

    const ways = {
      solve, relax, hunt, half, restart,
      bend: () => { stop(); become(plus(base(), 1, ripple(1)) ?? trial); },
      wave: () => { stop(); become(plus(base(), 1, ripple(3)) ?? trial); },
    };
    for (const [name, button] of Object.entries(buttons)) button.addEventListener("click", () => ways[name]());
    reveal.addEventListener("change", () => { message.textContent = ""; told(reveal.checked); draw(); });
    time.input.addEventListener("pointerdown", () => { wide = true; fit(true); draw(); });
    time.input.addEventListener("input", () => setDuration(Number(time.input.value)));

    // -- handles
    function handle(pair, c, j) {
      const group = element(pathPanel.marks, "g", `handle c${c % 5}`);
      put(group, { tabindex: 0, role: "slider", "data-handle": j });
      element(group, "circle", "reach").setAttribute("r", 22);
      element(group, "circle", "knob").setAttribute("r", 8);
      const it = { group, pair, j, wide: 1 };
      it.place = () => {
        const [x, y] = spot(trial, knot(j), pair), named = pair.filter((i) => i !== null);
        group.setAttribute("transform", `translate(${pathPanel.X(x).toFixed(2)},${pathPanel.Y(y).toFixed(2)})`);
        put(group, {
          "aria-label": `${named.map((i) => data.coordinates[i].name).join(", ")}: ` + filled(W.at, { t: unit(fixed(A.start + (A.duration * j) / spans, 2), units.time) }), "aria-valuenow": y.toFixed(4),
          "aria-valuemin": view.y[0].toFixed(4), "aria-valuemax": view.y[1].toFixed(4),
          "aria-valuetext": named.map((i) => unit(`${data.coordinates[i].name} = ${fixed(trial[knot(j) * n + i], 3)}`, data.coordinates[i].unit)).join(", "),
        });
      };
      const move = (from, x, y) => {
        const Q = bent(from, j, pair[0] === null ? { [pair[1]]: y } : { [pair[0]]: x, [pair[1]]: y }, it.wide);
        if (Q) become(Q);
      };
      const clamp = (x, [a, b]) => Math.min(b, Math.max(a, x));
      group.addEventListener("pointerdown", (event) => {
        stop();
        const taken = nearest(event);
        taken.group.setPointerCapture(event.pointerId);
        taken.group.classList.add("held");
        taken.group.focus({ preventScroll: true });
        held = { from: trial.slice(), by: pathPanel.value(...under(event)).map((x, i) => x - spot(trial, knot(taken.j), taken.pair)[i]) };
        event.preventDefault();
      });
      group.addEventListener("pointermove", (event) => {
        if (held === null || !group.hasPointerCapture(event.pointerId)) return;
        const [x, y] = pathPanel.value(...under(event)).map((value, i) => value - held.by[i]);
        move(held.from, clamp(x, pathPanel.shown.x), clamp(y, pathPanel.shown.y));
      });
      for (const end of ["pointerup", "pointercancel"])
        group.addEventListener(end, () => { group.classList.remove("held"); if (held) { held = null; draw(); } });
      group.addEventListener("keydown", (event) => {
        const way = { ArrowUp: [0, up], ArrowDown: [0, -up], ArrowRight: [1, 0], ArrowLeft: [-1, 0] }[event.key];
        if (!way) return;
        event.preventDefault();
        stop();
        const step = STEP * (view.y[1] - view.y[0]) * (event.shiftKey ? FINE : 1), [x, y] = spot(trial, knot(j), pair);
        move(trial, x + step * way[0], y + step * (pair[0] === null ? way[1] || way[0] : way[1]));
      });
      return it;
    }

    const under = (event) => {
      const frame = pathPanel.svg.getBoundingClientRect(), zoom = pathPanel.svg.viewBox.baseVal.width / frame.width;
      return [(event.clientX - frame.left) * zoom, (event.clientY - frame.top) * zoom];
    };
    const nearest = (event) => { // their reaches overlap where they stand close
      const there = handles.filter((it) => !it.away), away = there.map(({ group }) => {
        const knob = group.lastChild.getBoundingClientRect();
        return Math.hypot(knob.x + knob.width / 2 - event.clientX, knob.y + knob.height / 2 - event.clientY);
      });
      return there[away.indexOf(Math.min(...away))];
    };

    // First a coordinate that a handle can move: a constraint may leave others none of their own.
    if (!pairs && n > 1) {
      const moves = (i) => {
        const at = knot(spans / 2) * n + i, Q = bent(first, spans / 2, { [i]: first[at] + FREE * data.sizes[i] });
        return Q && Math.abs(Q[at] - first[at]) > (FREE / 10) * data.sizes[i];
      };
      chosen = Math.max(0, data.coordinates.findIndex((_, i) => moves(i)));
      radios[chosen].checked = true;
    }
    told(shown);
    rebuild();
    if (shown) trial = motion.Q.slice();
    layout();
    if (shown && !("sum" in figure.dataset)) ways.bend();
    else if (!shown) message.textContent = W.hint;
    foci();
    untouched = state();
    const before = address.get(key);
    if (before) try { recall(before); } catch { restart(); } // a link of another page, or torn
    new ResizeObserver(layout).observe(figure);
    figure.live = { get A() { return A; }, sum, setDuration, setParameter, trial: () => trial, motion: () => motion.Q, known: () => motion.known, foci: () => motion.foci };
  }

  document.querySelectorAll("[data-live]").forEach(start);
  for (const alone of ["embed", "projector"]) // the figure alone, as it is or large
    if (new URLSearchParams(location.search).has(alone)) document.documentElement.classList.add(alone);
})();
