// The player of a film: the frames are JSON in the page, drawn as SVG, graphs on the same clock.
(() => {
  "use strict";
  const NS = "http://www.w3.org/2000/svg";
  const SECONDS = 5; // one showing, if no speed is chosen
  const REST = 0.8; // seconds before it starts again
  const COLOURS = 5; // of bodies, in turn
  const TURN = 0.12; // radians a key turns space by
  const EDGE = { left: 46, right: 12, top: 20, bottom: 24, height: 132 }; // of a graph, pixels
  const still = matchMedia("(prefers-reduced-motion: reduce)");

  function element(parent, name, look, rest = {}) {
    const made = document.createElementNS(NS, name);
    if (look) made.setAttribute("class", look);
    for (const key in rest) made.setAttribute(key, rest[key]);
    parent.append(made);
    return made;
  }

  const POINT = document.documentElement.lang === "en" ? "." : ",";
  const minus = (x) => String(x).replace("-", "\u2212").replace(/(\d)\.(?=\d)/g, `$1${POINT}`);
  const power = (k) => `10${String(k).replace(/./g, (d) => (d === "-" ? "\u207b" : "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[d]))}`;
  const size = (x) => { const k = Math.floor(Math.log10(x)); return k >= 5 || k < -2 ? k : 0; };
  const short = (x) => { // three digits
    const k = x ? size(Math.abs(x)) : 0;
    return minus(String(Number((x / 10 ** k).toPrecision(3)))) + (k ? `\u00d7${power(k)}` : "");
  };
  const text = (points) => points.map(([x, y]) => `${x},${-y}`).join(" ");
  const mix = (a, b, s) => a.map((row, i) => row.map((x, j) => x + s * (b[i][j] - x)));

  function zigzag([a, b], width) {
    const turns = 8, dx = b[0] - a[0], dy = b[1] - a[1];
    const side = width / (Math.hypot(dx, dy) || 1), rows = [a];
    for (let k = 0; k < 2 * turns; k++) {
      const along = 0.1 + (0.8 * (k + 0.5)) / (2 * turns), way = k % 2 ? -side : side;
      rows.push([a[0] + along * dx - way * dy, a[1] + along * dy + way * dx]);
    }
    return [...rows, b];
  }

  // Round steps of 1, 2 or 5 times a power of ten, about `count` of them.
  function ticks(low, high, count) {
    const rough = (high - low) / count || 1, ten = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].find((m) => m * ten >= rough) * ten, found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return found.map((x) => [x, minus((x + 0).toFixed(digits))]);
  }

  // A graph against time: `draw(width)` lays it out, `show(k, s)` moves its clock.
  function graph(svg, t, data, words) {
    const values = data.rows.flatMap((row) => row.values).concat(data.area ? [0] : []);
    let low = Math.min(...values), high = Math.max(...values);
    const pad = 0.08 * (high - low || Math.abs(high) || 1);
    low -= pad;
    high += pad;
    const k = size(Math.max(Math.abs(low), Math.abs(high))), unit = k ? `${power(k)}\u00a0${data.unit}` : data.unit;
    let x, y, cursor, dots, sum, area;

    function draw() {
      const width = svg.clientWidth || 320, height = EDGE.height;
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      svg.setAttribute("height", height);
      svg.replaceChildren();
      const last = t[t.length - 1];
      x = (time) => EDGE.left + ((time - t[0]) / (last - t[0])) * (width - EDGE.left - EDGE.right);
      y = (v) => EDGE.top + ((high - v) / (high - low)) * (height - EDGE.top - EDGE.bottom);
      for (const [part, name] of ticks(low / 10 ** k, high / 10 ** k, 3)) {
        const v = part * 10 ** k;
        element(svg, "line", "tick", { x1: EDGE.left, x2: width - EDGE.right, y1: y(v), y2: y(v) });
        element(svg, "text", "end", { x: EDGE.left - 6, y: y(v) + 4 }).textContent = name;
      }
      for (const [v, name] of ticks(t[0], last, Math.max(2, width / 110))) {
        element(svg, "text", "mid", { x: x(v), y: height - 7 }).textContent = name;
      }
      const wide = 6.5 * unit.length > EDGE.left - 6;
      element(svg, "text", wide ? "" : "end", { x: wide ? 0 : EDGE.left - 6, y: 12 }).textContent = unit;
      area = data.area && data.rows.map((_, i) => element(svg, "polygon", i ? "takes" : "adds"));
      let at = Math.max(EDGE.left, wide ? 8 * unit.length : 0);
      data.rows.forEach(({ name, values: v }, i) => {
        element(svg, "polyline", `curve c${i}`, { points: v.map((u, k) => `${x(t[k])},${y(u)}`).join(" ") });
        const label = element(svg, "text", `c${i}`, { x: at, y: 12 });
        label.textContent = name;
        at += 14 + 8 * name.length;
      });
      sum = data.area && element(svg, "text", "end sum", { x: width - EDGE.right, y: 12 });
      cursor = element(svg, "line", "cursor", { y1: EDGE.top, y2: height - EDGE.bottom });
      dots = data.rows.map((_, i) => element(svg, "circle", `c${i}`, { r: 4 }));
    }

    // What is shaded: between T and V, or between L and zero, so far.
    function shaded(k, s, more) {
      const [top, floor] = data.rows.map((row) => row.values), up = [], down = [];
      const put = (time, a, b) => {
        const [from, to] = more ? [Math.min(a, b), a] : [a, Math.max(a, b)];
        up.push(`${x(time)},${y(to)}`);
        down.unshift(`${x(time)},${y(from)}`);
      };
      const at = (row, i, r) => (row ? row[i] + (r ? r * (row[i + 1] - row[i]) : 0) : 0);
      for (let i = 0; i <= k; i++) put(t[i], at(top, i, 0), at(floor, i, 0));
      if (s) put(t[k] + s * (t[k + 1] - t[k]), at(top, k, s), at(floor, k, s));
      return [...up, ...down].join(" ");
    }

    function show(k, s) {
      if (!x) draw();
      const time = t[k] + s * (t[k + 1] - t[k]);
      cursor.setAttribute("x1", x(time));
      cursor.setAttribute("x2", x(time));
      data.rows.forEach(({ values: v }, i) => {
        dots[i].setAttribute("cx", x(time));
        dots[i].setAttribute("cy", y(v[k] + s * (v[k + 1] - v[k])));
      });
      if (!data.area) return;
      area[0].setAttribute("points", shaded(k, s, true));
      if (area[1]) area[1].setAttribute("points", shaded(k, s, false));
      const S = data.area[k] + s * (data.area[k + 1] - data.area[k]);
      sum.textContent = `${words.so_far}: ${short(S)}\u00a0${(data.sum ?? "").replace(/ /g, "\u00a0")}`;
    }
    return { draw, show };
  }

  function start(figure) {
    const film = JSON.parse(figure.querySelector("script").textContent);
    const words = JSON.parse(figure.dataset.words);
    const svg = figure.querySelector(".stage");
    const button = figure.querySelector("[data-play]");
    const slider = figure.querySelector("input");
    const clock = figure.querySelector(".clock");
    const speed = figure.querySelector("select");
    const [left, right, bottom, top] = film.box;
    const size = Math.max(right - left, top - bottom);
    const last = (film.labels || film.t).length - 1;
    const duration = film.t ? film.t[last] - film.t[0] : 0;
    const names = svg.querySelectorAll(".grows, .name");
    let turn = 0, rise = film.space ? film.space.rise : 0;
    svg.querySelectorAll(":scope > :not(.grows):not(.name)").forEach((e) => e.remove());

    // Where a point is seen: space turned about the upright, and looked at from above.
    function seen(p) {
      if (!film.space) return p;
      const [x, y, z] = p.map((c, i) => c - film.space.middle[i]);
      const u = x * Math.cos(turn) - y * Math.sin(turn), w = x * Math.sin(turn) + y * Math.cos(turn);
      return [u, z * Math.cos(rise) + w * Math.sin(rise)];
    }
    // An arrow is a difference, and so without the middle.
    const way = (p) => (film.space ? seen(p.map((c, i) => c + film.space.middle[i])) : p);

    const paths = film.trails.map(() => element(svg, "polyline", "path"));
    const tails = film.trails.map((_, i) => element(svg, "polyline", `tail b${i % COLOURS}`));
    let bodies = 0;
    const shapes = film.shapes.map(({ kind, points }) => {
      const dot = points[0].length === 1;
      const look = kind === "body" ? `body b${bodies++ % COLOURS}` : kind;
      const made = element(svg, dot ? "circle" : "polyline", look);
      if (dot) made.setAttribute("r", (kind === "body" ? 0.022 : kind === "event" ? 0.014 : 0.01) * size * (film.points ?? 1));
      return made;
    });
    const arrows = (film.arrows || []).map(() => element(svg, "path", "force"));
    names.forEach((name) => svg.append(name));

    function place(made, kind, given) {
      const points = given.map(seen);
      if (points.length === 1) {
        made.setAttribute("cx", points[0][0]);
        made.setAttribute("cy", -points[0][1]);
      } else {
        made.setAttribute("points", text(kind === "spring" ? zigzag(points, 0.03 * size) : points));
      }
    }

    const graphs = [...figure.querySelectorAll(".graph")].map((g, i) => graph(g, film.t, film.graphs[i], words));

    function show(frame) {
      const k = Math.min(Math.floor(frame), last - 1), s = frame - k;
      film.shapes.forEach(({ kind, still, points }, i) => {
        place(shapes[i], kind, still ? points[0] : mix(points[k], points[k + 1], s));
      });
      film.trails.forEach((trail, i) => {
        const flat = trail.map(seen), upTo = Math.round((frame / last) * (trail.length - 1));
        paths[i].setAttribute("points", text(flat));
        tails[i].setAttribute("points", text(flat.slice(0, upTo + 1)));
      });
      const carriers = film.shapes.filter(({ kind }) => kind === "body");
      arrows.forEach((arrow, i) => {
        const { still, points } = carriers[i];
        const [x, y] = seen(still ? points[0][0] : mix(points[k], points[k + 1], s)[0]);
        const [u, w] = way(mix([film.arrows[i][k]], [film.arrows[i][k + 1]], s)[0]);
        const long = Math.hypot(u, w), h = 0.025 * size;
        if (long < 0.2 * h) return arrow.setAttribute("d", "");
        const [cx, cy] = [u / long, w / long], tip = [x + u, y + w];
        const at = (a, b) => `${tip[0] - a * cx - b * cy},${-(tip[1] - a * cy + b * cx)}`;
        arrow.setAttribute("d", `M${x},${-y}L${tip[0]},${-tip[1]}M${at(h, h / 2)}L${tip[0]},${-tip[1]}L${at(h, -h / 2)}`);
      });
      const first = frame === 0 && turn === 0 && (!film.space || rise === film.space.rise);
      names.forEach((name) => name.toggleAttribute("hidden", !first));
      graphs.forEach((g) => g.show(k, s));
      clock.textContent = film.labels
        ? minus(film.labels[Math.round(frame)])
        : `t = ${minus((film.t[k] + s * (film.t[k + 1] - film.t[k])).toFixed(2))}\u00a0${film.unit ?? "s"}`;
      slider.value = frame;
      slider.setAttribute("aria-valuetext", clock.textContent);
      figure.dataset.frame = frame;
    }

    let frame = 0, playing = false, before = 0;

    // Seconds that a showing takes; and how much faster or slower than life that is, in words.
    function showing() {
      const own = !duration || !speed || speed.value === "fit";
      const seconds = own ? SECONDS : duration / Number(speed.value), pace = duration / seconds;
      if (speed) {
        const about = (x) => (x < 9.5 ? String(Number(x.toPrecision(2))) : x.toPrecision(2) * 1);
        const said = pace < 0.99 ? words.slower.replace("{x}", about(1 / pace))
          : pace > 1.01 ? words.faster.replace("{x}", about(pace)) : words.life;
        speed.title = said;
        figure.dataset.pace = said;
      }
      return seconds;
    }

    function step(now) {
      if (!playing) return;
      const seconds = showing();
      frame += (Math.max(0, now - before) / 1000 / seconds) * last;
      before = now;
      if (frame > last * (1 + REST / seconds)) frame = 0;
      show(Math.min(frame, last));
      requestAnimationFrame(step);
    }

    function play(yes) {
      if (yes && frame >= last) frame = 0;
      playing = yes;
      before = performance.now();
      button.textContent = yes ? words.pause : words.play;
      if (yes) requestAnimationFrame(step);
    }

    function go(to) {
      chosen = true;
      play(false);
      frame = Math.min(last, Math.max(0, to));
      show(frame);
    }

    button.addEventListener("click", () => {
      chosen = true;
      play(!playing);
    });
    slider.addEventListener("input", () => go(Number(slider.value)));
    figure.querySelectorAll("[data-step]").forEach((b) =>
      b.addEventListener("click", () => go(Math.round(frame) + Number(b.dataset.step))));
    if (speed) speed.addEventListener("change", showing);
    const full = figure.querySelector("[data-full]");
    if (full) {
      full.hidden = !figure.requestFullscreen;
      full.addEventListener("click", () => (document.fullscreenElement ? document.exitFullscreen() : figure.requestFullscreen()));
    }
    still.addEventListener("change", () => play(false));

    if (film.space) {
      let held = null;
      const turned = (by, up) => {
        turn += by;
        rise = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, rise + up));
        show(Math.min(frame, last));
      };
      svg.addEventListener("pointerdown", (e) => {
        held = [e.clientX, e.clientY];
        svg.setPointerCapture(e.pointerId);
      });
      svg.addEventListener("pointermove", (e) => {
        if (!held) return;
        turned((e.clientX - held[0]) / 120, (e.clientY - held[1]) / 120);
        held = [e.clientX, e.clientY];
      });
      for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => (held = null));
      svg.addEventListener("keydown", (e) => {
        const by = { ArrowLeft: [-TURN, 0], ArrowRight: [TURN, 0], ArrowUp: [0, -TURN], ArrowDown: [0, TURN] }[e.key];
        if (!by) return;
        e.preventDefault();
        turned(...by);
      });
    }

    let chosen = false; // once the reader has touched it, it does as told
    new IntersectionObserver(([entry]) => {
      if (!chosen) play(entry.isIntersecting && !still.matches);
    }).observe(figure);
    new ResizeObserver(() => {
      graphs.forEach((g) => g.draw());
      show(Math.min(frame, last));
    }).observe(figure);
    showing();
    show(0);
  }

  document.querySelectorAll("[data-film]").forEach(start);
  // As slides: a section a screen, `page.html?slides`.
  if (new URLSearchParams(location.search).has("slides")) document.documentElement.classList.add("slides");
})();
