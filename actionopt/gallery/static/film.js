// The player of a film: the frames are JSON in the page, drawn as SVG.
(() => {
  "use strict";
  const NS = "http://www.w3.org/2000/svg";
  const SECONDS = 5; // one showing
  const REST = 0.8; // before it starts again
  const COLOURS = 5; // of bodies, in turn
  const still = matchMedia("(prefers-reduced-motion: reduce)");

  function element(parent, name, look) {
    const made = document.createElementNS(NS, name);
    made.setAttribute("class", look);
    parent.append(made);
    return made;
  }

  const text = (points) => points.map(([x, y]) => `${x},${-y}`).join(" ");
  const between = (a, b, s) => a.map(([x, y], i) => [x + s * (b[i][0] - x), y + s * (b[i][1] - y)]);

  function zigzag([a, b], width) {
    const turns = 9, dx = b[0] - a[0], dy = b[1] - a[1];
    const side = width / (Math.hypot(dx, dy) || 1), rows = [a];
    for (let k = 0; k < 2 * turns; k++) {
      const along = 0.1 + (0.8 * (k + 0.5)) / (2 * turns), way = k % 2 ? -side : side;
      rows.push([a[0] + along * dx - way * dy, a[1] + along * dy + way * dx]);
    }
    return [...rows, b];
  }

  function start(figure) {
    const film = JSON.parse(figure.querySelector("script").textContent);
    const svg = figure.querySelector("svg");
    const button = figure.querySelector("button");
    const slider = figure.querySelector("input");
    const clock = figure.querySelector(".clock");
    const [left, right, bottom, top] = film.box;
    const size = Math.max(right - left, top - bottom);
    const last = (film.labels || film.t).length - 1;
    svg.setAttribute("viewBox", `${left} ${-top} ${right - left} ${top - bottom}`);

    for (const trail of film.trails) {
      element(svg, "polyline", "path").setAttribute("points", text(trail));
    }
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

    function place(made, kind, points) {
      if (points.length === 1) {
        made.setAttribute("cx", points[0][0]);
        made.setAttribute("cy", -points[0][1]);
      } else {
        made.setAttribute("points", text(kind === "spring" ? zigzag(points, 0.03 * size) : points));
      }
    }

    function show(frame) {
      const k = Math.min(Math.floor(frame), last - 1), s = frame - k;
      film.shapes.forEach(({ kind, still, points }, i) => {
        place(shapes[i], kind, still ? points[0] : between(points[k], points[k + 1], s));
      });
      film.trails.forEach((trail, i) => {
        const upTo = Math.round((frame / last) * (trail.length - 1));
        tails[i].setAttribute("points", text(trail.slice(0, upTo + 1)));
      });
      const carriers = film.shapes.filter(({ kind }) => kind === "body");
      arrows.forEach((arrow, i) => {
        const { still, points } = carriers[i];
        const [[x, y]] = still ? points[0] : between(points[k], points[k + 1], s);
        const [[u, w]] = between([film.arrows[i][k]], [film.arrows[i][k + 1]], s);
        const long = Math.hypot(u, w), h = 0.025 * size;
        if (long < 0.2 * h) return arrow.setAttribute("d", "");
        const [cx, cy] = [u / long, w / long], tip = [x + u, y + w];
        const at = (a, b) => `${tip[0] - a * cx - b * cy},${-(tip[1] - a * cy + b * cx)}`;
        arrow.setAttribute("d", `M${x},${-y}L${tip[0]},${-tip[1]}M${at(h, h / 2)}L${tip[0]},${-tip[1]}L${at(h, -h / 2)}`);
      });
      clock.textContent = film.labels
        ? film.labels[Math.round(frame)].replaceAll("-", "\u2212")
        : `t = ${(film.t[k] + s * (film.t[k + 1] - film.t[k])).toFixed(2)} s`;
      slider.value = frame;
      slider.setAttribute("aria-valuetext", clock.textContent);
      figure.dataset.frame = frame;
    }

    let frame = 0, playing = false, before = 0;

    function step(now) {
      if (!playing) return;
      frame += (Math.max(0, now - before) / 1000 / SECONDS) * last;
      before = now;
      if (frame > last * (1 + REST / SECONDS)) frame = 0;
      show(Math.min(frame, last));
      requestAnimationFrame(step);
    }

    function play(yes) {
      if (yes && frame >= last) frame = 0;
      playing = yes;
      before = performance.now();
      button.textContent = yes ? "Pause" : "Play";
      if (yes) requestAnimationFrame(step);
    }

    button.addEventListener("click", () => {
      chosen = true;
      play(!playing);
    });
    slider.addEventListener("input", () => {
      chosen = true;
      play(false);
      frame = Number(slider.value);
      show(frame);
    });
    still.addEventListener("change", () => play(false));

    let chosen = false; // once the reader has touched it, it does as told
    new IntersectionObserver(([entry]) => {
      if (!chosen) play(entry.isIntersecting && !still.matches);
    }).observe(figure);
    show(0);
  }

  document.querySelectorAll("[data-film]").forEach(start);
})();
