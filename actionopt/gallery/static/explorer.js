// A path under the hand: drag its handles, see its action.
// Matrices and weights come from the page; the sums are those of the package.
(() => {
  "use strict";
  const NS = "http://www.w3.org/2000/svg";
  const STEP = 0.02, FINE = 0.1; // of the picture, for one key; with shift
  const times = (matrix, row) => matrix.map((m) => m.reduce((sum, x, j) => sum + x * row[j], 0));
  const none = (x, digits = 4) => Math.abs(x) < 0.5 * 10 ** -digits; // what would be written as zero
  const words = (x, digits = 4) => (none(x, digits) ? 0 : x).toFixed(digits).replace("-", "\u2212");

  function element(parent, name, look, text) {
    const made = document.createElementNS(NS, name);
    made.setAttribute("class", look);
    if (text) made.textContent = text;
    parent.append(made);
    return made;
  }

  const place = (made, attributes) => {
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  };

  function start(figure) {
    const data = JSON.parse(figure.querySelector("script").textContent);
    const svg = figure.querySelector("svg");
    const output = figure.querySelector("[data-action]");
    const slider = figure.querySelector("[data-duration]");
    const clock = figure.querySelector("[data-time]");
    const { m, k, g } = data.parameters, w = Math.sqrt(k / m);
    const n = data.coordinates.length, flat = n === 1; // one coordinate: against time
    const inner = data.nodes.slice(1, -1).map((_, i) => i + 1);
    let T = data.duration;
    // What the path deviates from the motion at each node; kept when the duration changes.
    const bent = data.coordinates.map(() => data.nodes.map(() => 0));

    const motion = (t) =>
      data.start.q.map((q, i) =>
        w ? q * Math.cos(w * t) + (data.start.v[i] / w) * Math.sin(w * t)
          : q + data.start.v[i] * t - (i === n - 1 ? (g * t * t) / 2 : 0));
    const lagrangian = (q, v) => {
      const square = (x) => x.reduce((sum, y) => sum + y * y, 0);
      return (m * square(v)) / 2 - (k * square(q)) / 2 - m * g * q[n - 1];
    };
    const path = () => {
      const true_ = data.nodes.map((s) => motion(T * s));
      return bent.map((row, i) => row.map((x, j) => true_[j][i] + x));
    };
    const along = (rows, here, rate) => {
      const q = rows.map((row) => times(here, row));
      const v = rows.map((row) => times(rate, row).map((x) => x / T));
      return here.map((_, j) => lagrangian(q.map((x) => x[j]), v.map((x) => x[j])));
    };
    const action = (rows) =>
      T * along(rows, data.here, data.rate).reduce((sum, L, j) => sum + data.weights[j] * L, 0);

    // -- the picture, in pixels
    const layers = {};
    for (const name of ["axes", "energy", "lines", "marks"]) layers[name] = element(svg, "g", name);
    const axis = element(layers.axes, "path", "axis");
    const zero = element(layers.axes, "path", "axis");
    const ticks = element(layers.axes, "g", "ticks");
    const under = element(layers.energy, "path", "adds");
    const over = element(layers.energy, "path", "takes");
    const clip = element(svg, "clipPath", "");
    const clipBox = element(clip, "rect", "");
    clip.id = `clip-${data.name}`;
    layers.lines.setAttribute("clip-path", `url(#${clip.id})`);
    const true_ = element(layers.lines, "polyline", "motion");
    const trial = element(layers.lines, "polyline", "trial");
    const ends = [0, 1].map((i) => element(layers.marks, "circle", i ? "event" : "event first"));
    const labels = ["across", "up", "below", "unit"].map((name) => element(layers.axes, "text", name));
    const handles = inner.map((j) => {
      const group = element(layers.marks, "g", "handle");
      place(group, { tabindex: 0, role: "slider", "data-node": j });
      element(group, "circle", "reach").setAttribute("r", 22);
      element(group, "circle", "knob").setAttribute("r", 9);
      return group;
    });

    let box, X, Y, back;
    const range = flat ? { x: [0, data.longest], y: [-3.4, 3.4] } : { x: [-1.7, 4.7], y: [-1, 3] };

    function layout() {
      const width = Math.max(260, svg.clientWidth), height = Math.min(340, 0.62 * width + 60);
      const lower = Math.min(110, 0.3 * width);
      box = { left: 34, right: width - 14, top: 12, bottom: height, low: height + 46, floor: height + 46 + lower };
      place(svg, { viewBox: `0 0 ${width} ${box.floor + 24}`, height: box.floor + 24 });
      let scale = [(box.right - box.left) / (range.x[1] - range.x[0]), (box.bottom - box.top) / (range.y[1] - range.y[0])];
      if (!flat) scale = [Math.min(...scale), Math.min(...scale)];
      const middle = flat ? box.left : (box.left + box.right - scale[0] * (range.x[1] - range.x[0])) / 2;
      X = (x) => middle + scale[0] * (x - range.x[0]);
      Y = (y) => box.bottom - scale[1] * (y - range.y[0]);
      back = (px, py) => [(px - middle) / scale[0] + range.x[0], (box.bottom - py) / scale[1] + range.y[0]];
      place(clipBox, { x: box.left, y: 0, width: box.right - box.left, height: box.bottom + 4 });
      axis.setAttribute("d", `M${box.left},${box.top}V${box.bottom}H${box.right}`);
      ticks.replaceChildren();
      for (let x = Math.ceil(range.x[0]); x < range.x[1]; x++) tick(X(x), box.bottom, x, [0, 4]);
      for (let y = Math.ceil(range.y[0]); y < range.y[1]; y++) tick(box.left, Y(y), y, [-4, 0]);
      if (w) {
        place(element(ticks, "path", "half"), { d: `M${X(Math.PI / w)},${box.top}V${box.bottom}` });
        place(element(ticks, "text", "", "half a period"), { x: X(Math.PI / w) + 6, y: box.bottom - 6 });
      }
      place(labels[0], { x: box.right, y: box.bottom + 17, "text-anchor": "end" });
      labels[0].textContent = flat ? "t (s)" : "x (m)";
      place(labels[1], { x: box.left + 7, y: box.top + 10 });
      labels[1].textContent = flat ? "x (m)" : "y (m)";
      place(labels[2], { x: box.left + 7, y: box.low - 4 });
      labels[2].textContent = "L = T \u2212 V along the path; the area is S";
      place(labels[3], { x: box.right, y: box.floor + 18, "text-anchor": "end" });
      labels[3].textContent = "t";
      draw();
    }

    function tick(x, y, value, [u, v]) {
      if (x < box.left - 1 || x > box.right - (v ? 44 : 0)) return; // there the axis has its name
      element(ticks, "path", "axis").setAttribute("d", `M${x},${y}l${u},${v}`);
      const text = element(ticks, "text", "", words(value, 0));
      place(text, { x: x + 2 * u, y: y + (v ? 17 : 4), "text-anchor": v ? "middle" : "end" });
    }

    const spots = (rows, t) => (flat ? rows[0].map((x, j) => [t[j], x]) : rows[0].map((x, j) => [x, rows[1][j]]));
    const pixels = (list) => list.map(([x, y]) => `${X(x).toFixed(2)},${Y(y).toFixed(2)}`).join(" ");

    function draw() {
      const rows = path(), S = action(rows), least = action(rows.map((r, i) => r.map((x, j) => x - bent[i][j])));
      const shown = data.seen.map((_, j) => (T * j) / (data.seen.length - 1));
      trial.setAttribute("points", pixels(spots(rows.map((r) => times(data.seen, r)), shown)));
      const exact = shown.map(motion);
      true_.setAttribute("points", pixels(spots(rows.map((_, i) => exact.map((q) => q[i])), shown)));
      const at = spots(rows, data.nodes.map((s) => T * s));
      handles.forEach((handle, i) => {
        const [x, y] = at[inner[i]], t = T * data.nodes[inner[i]];
        handle.setAttribute("transform", `translate(${X(x)},${Y(y)})`);
        const where = flat ? `x = ${y.toFixed(2)} m` : `x = ${x.toFixed(2)} m, y = ${y.toFixed(2)} m`;
        place(handle, {
          "aria-label": `Place at t = ${t.toFixed(2)} s`, "aria-valuenow": y.toFixed(3),
          "aria-valuemin": range.y[0], "aria-valuemax": range.y[1], "aria-valuetext": where,
        });
      });
      [at[0], at[at.length - 1]].forEach(([x, y], i) => place(ends[i], { cx: X(x), cy: Y(y), r: 6 }));

      // The Lagrangian against time, and the area under it.
      const L = along(rows, data.seen, data.seenRate);
      const reach = Math.max(1e-9, ...L.map(Math.abs)), longest = flat ? data.longest : T;
      const lows = Math.min(0, ...L), highs = Math.max(0, ...L);
      const level = (y) => box.floor - ((box.floor - box.low - 6) * (y - lows)) / (highs - lows || reach);
      const across = (t) => box.left + ((box.right - box.left) * t) / longest;
      const area = (cut) =>
        `M${across(0)},${level(0)}` + L.map((y, j) => `L${across(shown[j]).toFixed(2)},${level(cut(y)).toFixed(2)}`).join("") + `V${level(0)}Z`;
      under.setAttribute("d", area((y) => Math.max(y, 0)));
      over.setAttribute("d", area((y) => Math.min(y, 0)));
      zero.setAttribute("d", `M${box.left},${level(0)}H${box.right}`);

      const rise = S - least, still = none(rise);
      const verdict = still ? "as on the motion" : rise > 0 ? "more than on the motion" : "less than on the motion";
      output.innerHTML = `<span>S = ${words(S)} J s</span> <span class="${still ? "" : rise > 0 ? "more" : "less"}">${still ? "" : `${words(Math.abs(rise))} J s `}${verdict}</span>`;
      figure.dataset.action = String(S);
      figure.dataset.rise = String(rise);
      figure.dataset.duration = String(T);
      if (slider) {
        clock.textContent = `${T.toFixed(2)} s, ${((T * w) / Math.PI).toFixed(2)} half periods`;
        slider.setAttribute("aria-valuetext", clock.textContent);
      }
    }

    // -- what the reader does
    function setHandle(i, value) {
      const wanted = [].concat(value), true_ = motion(T * data.nodes[inner[i]]);
      wanted.forEach((x, c) => (bent[c][inner[i]] = x - true_[c]));
      draw();
    }

    function setDuration(value) {
      T = value;
      if (slider) slider.value = value;
      draw();
    }

    function bend(shape) {
      data.nodes.forEach((s, j) => (bent[n - 1][j] = j && j < data.nodes.length - 1 ? shape(s) : 0));
      draw();
    }

    const size = flat ? 0.8 : 0.7;
    const ways = {
      motion: () => { bent.forEach((row) => row.fill(0)); draw(); },
      bend: () => bend((s) => size * Math.sin(Math.PI * s)),
      wave: () => bend((s) => (size / 2) * Math.sin(3 * Math.PI * s)),
    };
    figure.querySelectorAll("[data-do]").forEach((button) => button.addEventListener("click", ways[button.dataset.do]));

    const nearest = (event) => { // their reaches overlap where they stand close
      const away = handles.map((handle) => {
        const knob = handle.lastChild.getBoundingClientRect();
        return Math.hypot(knob.x + knob.width / 2 - event.clientX, knob.y + knob.height / 2 - event.clientY);
      });
      return handles[away.indexOf(Math.min(...away))];
    };

    const now = (i) => path().map((row) => row[inner[i]]);
    handles.forEach((handle, i) => {
      const drag = (event) => {
        const frame = svg.getBoundingClientRect(), zoom = svg.viewBox.baseVal.width / frame.width;
        const [x, y] = back((event.clientX - frame.left) * zoom, (event.clientY - frame.top) * zoom);
        const low = range.y, inside = Math.min(low[1], Math.max(low[0], y));
        setHandle(i, flat ? inside : [Math.min(range.x[1], Math.max(range.x[0], x)), inside]);
      };
      handle.addEventListener("pointerdown", (event) => {
        const taken = nearest(event);
        taken.setPointerCapture(event.pointerId);
        taken.classList.add("held");
        taken.focus({ preventScroll: true });
        event.preventDefault();
      });
      handle.addEventListener("pointermove", (event) => handle.hasPointerCapture(event.pointerId) && drag(event));
      for (const end of ["pointerup", "pointercancel"]) handle.addEventListener(end, () => handle.classList.remove("held"));
      handle.addEventListener("keydown", (event) => {
        const ways = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowRight: [1, 0], ArrowLeft: [-1, 0] };
        const way = ways[event.key];
        if (!way) return;
        event.preventDefault();
        const step = STEP * (range.y[1] - range.y[0]) * (event.shiftKey ? FINE : 1);
        const q = now(i);
        setHandle(i, flat ? q[0] + step * (way[1] || way[0]) : [q[0] + step * way[0], q[1] + step * way[1]]);
      });
    });

    if (slider) {
      place(slider, { min: 0.1 * data.longest, max: data.longest });
      slider.value = T;
      slider.addEventListener("input", () => setDuration(Number(slider.value)));
    }
    layout();
    ways.bend();
    new ResizeObserver(layout).observe(figure);
    window.explorer = { ...window.explorer, [data.name]: { setHandle, setDuration, nodes: path } };
  }

  document.querySelectorAll("[data-explorer]").forEach(start);
})();
