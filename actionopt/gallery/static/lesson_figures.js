// What the figures of lessons show, each for the state that its reader has set, and what has to be
// measured before a sentence is said. Laws come from the package; S is summed here, path by path.
globalThis.actionopt.figures = (() => {
  "use strict";
  const { compiled, sentences } = globalThis.actionopt;
  const { to, written, span } = globalThis.actionopt.panels;
  const G = 9.81; // m/s^2
  const NOTHING = 1e-9; // of what is compared: round-off of the sums here

  const range = (from, to_, count) => Array.from({ length: count }, (_, k) => from + ((to_ - from) * k) / (count - 1));
  const sum = (rows) => rows.reduce((all, x) => all + x, 0);
  const dot = (a, b) => sum(a.map((x, i) => x * b[i]));
  const most = (rows) => Math.max(...rows.map(Math.abs));
  const room = (values, share = 0.1, least = 0) => {
    const [a, b] = span(values), extra = Math.max(share * (b - a), least, 1e-9);
    return [a - extra, b + extra];
  };
  const digits = (x, size, places = 3) => to(x, 10 ** (Math.floor(Math.log10(Math.max(size, 1e-12))) + 1 - places)); // to the last place of `size`
  const J = (x, size) => `${digits(x, size)}\u00a0J\u00a0s`;
  const clamp = (x, a, b) => Math.min(b, Math.max(a, x));

  // L, dL/dq, dL/dv of a law at one place.
  const lagrangian = ({ law, p }) => {
    const first = compiled(law.first);
    return (q, v, t) => { const [L, Lq, Lv] = first.at([q, v, [t], p]); return { L: L[0], Lq: [...Lq], Lv: [...Lv] }; };
  };
  // The same for any number c in it.
  const numbered = (law) => { const p = [0], L = lagrangian({ law, p }); return (c) => (q, v, t) => ((p[0] = c), L(q, v, t)); };
  // Nodes and weights of the package, so that polynomials are summed without error.
  const rows = ({ t, w, q, v }) => t.map((at, k) => ({ t: at, w: w[k], q: q[k], v: v[k] }));

  // -- Noether: a path shifted, all of it, or but for a step at each end
  const noether = (data) => {
    const systems = data.systems, law = Object.fromEntries(Object.entries(systems).map(([name, it]) => [name, lagrangian(it)]));
    const shift = (it, c) => (it.first ? [1, c] : [c, 1]);
    // The share of the shift at one time, and its rate: steps of the first and the last segment.
    const ramp = (it, t, middle) => {
      if (!middle) return [1, 0];
      const s = it.step;
      return t < s ? [t / s, 1 / s] : t > it.T - s ? [(it.T - t) / s, -1 / s] : [1, 0];
    };
    const pieces = (it, L, d, e, middle) => it.segments.map((segment) => sum(rows(segment).map(({ t, w, q, v }) => {
      const mid = (segment.t[0] + segment.t[segment.t.length - 1]) / 2, [, rate] = ramp(it, mid, middle), [share] = ramp(it, t, middle);
      return w * L(q.map((x, i) => x + e * share * d[i]), v.map((x, i) => x + e * rate * d[i]), t).L;
    })));
    return {
      state: { system: "ball", middle: false, e: 0.4, c: 0.5 },
      choices: { system: { of: ["ball", "planet", "screw"], sets: (name) => ({ e: systems[name].e, c: systems[name].c }) } },
      checks: { middle: null },
      sliders: {
        e: { from: (s) => -2 * systems[s.system].e, to: (s) => 2 * systems[s.system].e, marks: [0] },
        c: { from: (s) => systems[s.system].c - 1.5, to: (s) => systems[s.system].c + 1.5, marks: (s) => [systems[s.system].flat], unit: "" },
      },
      panels: { shifted: 0.7, momenta: 0.5, changes: 0.45 },
      see({ system, middle, e, c }, W) {
        const it = systems[system], L = law[system], d = shift(it, c);
        const [ahead, back, still] = [e, -e, 0].map((x) => pieces(it, L, d, x, middle));
        const first = ahead.map((x, k) => (x - back[k]) / 2), rise = sum(ahead) - sum(still);
        const seen = it.segments.flatMap(rows), p = seen.map(({ q, v, t }) => L(q, v, t).Lv), mixed = p.map((x) => dot(x, d));
        const drift = mixed[mixed.length - 1] - mixed[0], size = most(first) + most(mixed) * Math.abs(e);
        const bars = middle ? first : [-mixed[0] * e, 0, mixed[mixed.length - 1] * e];
        const ghost = seen.map(({ q, t }) => q.map((x, i) => x + e * ramp(it, t, middle)[0] * d[i]));
        const drawn = (q) => (it.polar ? [q[0] * Math.cos(q[1]), q[0] * Math.sin(q[1])] : q);
        const [own, moved] = [seen.map(({ q }) => drawn(q)), ghost.map(drawn)], corners = it.view.map(drawn);
        const t = seen.map((row) => row.t), up = room([...p.flat(), ...mixed, 0], 0.08), high = room([...bars, sum(bars), 0], 0.25, size * 0.05);
        const measured = { middle, e, size, rise, first, between: first[1], drift, start: mixed[0], end: mixed[mixed.length - 1], spread: span(mixed)[1] - span(mixed)[0] };
        return {
          measured, values: { x: J(rise, size), y: written(drift, 3, most(mixed)), a: J(first[0], size), b: J(first[1], size), c: J(first[2], size) },
          text: [it.rule, `S = ${J(sum(still), Math.abs(sum(still)))}`, `${W.ghost}: ${J(sum(ahead), Math.abs(sum(still)))}`, ...(middle ? [`${W.second_order}: ${J(rise - sum(first), Math.abs(rise))}`] : [])],
          shifted: {
            x: room(corners.map((r) => r[0])), y: room(corners.map((r) => r[1])), equal: true, across: it.axes[0], up: it.axes[1],
            marks: [
              ...(it.grooves ? range(-4, 4, 9).map((k) => ["line", "grid", range(corners[0][1] - 2, corners[1][1] + 2, 2).map((z) => [it.grooves * z + 2 * Math.PI * k, z])]) : []),
              ...(it.polar ? [["dot", "event", [0, 0], 6]] : []),
              ["line", "motion", own], ["line", "trial", moved],
              ...[own[0], own[own.length - 1]].map((at) => ["dot", "event", at, 4]),
              ...(middle ? [] : [0, moved.length - 1].map((k) => ["arrow", "force", own[k], moved[k]])),
            ],
          },
          momenta: {
            x: [0, it.T], y: up, across: "t (s)", up: "", keys: [[it.names[0], "c1"], [it.names[1], "c2"], [it.names[2], "c0"]],
            marks: [[0, "thin c1"], [1, "thin c2"]].map(([i, look]) => ["line", `trial ${look}`, p.map((x, k) => [t[k], x[i]])]).concat([["line", "trial c0 broad", mixed.map((x, k) => [t[k], x])]]),
          },
          changes: {
            x: [0, 4], y: high, across: null, up: "dS (J s)",
            marks: [["line", "axis", [[0, 0], [4, 0]]], ...[...bars, sum(bars)].flatMap((x, k) => [
              ["area", x < 0 ? "takes" : "adds", [[k + 0.25, 0], [k + 0.25, x], [k + 0.75, x], [k + 0.75, 0]]],
              ["text", "", [k + 0.5, Math.max(x, 0)], W[["first_end", "between", "last_end", "together"][k]], "middle", [0, -6]],
            ])],
          },
        };
      },
    };
  };

  // -- three places of a ball of 1 kg, a time h apart, of which the middle one moves
  const three = () => {
    const SNAP = 0.012; // m: nearer than this to where the slope is zero it is there
    const S = (x, [first, last], h) => ((x - first) ** 2 + (last - x) ** 2) / (2 * h) - h * G * x;
    const still = ([first, last], h) => (first + last) / 2 + (G * h * h) / 2;
    return {
      state: { h: 0.3, x: 0.6, last: 1 },
      sliders: { h: { from: 0.1, to: 0.4, unit: "s" } },
      handles: [
        { panel: "places", says: "x", place: ({ h, x }) => [h, x], move: (_, x, { h, last }) => ({ x: Math.abs(x - still([0, last], h)) < SNAP ? still([0, last], h) : clamp(x, -0.6, 2) }) },
        { panel: "places", says: "last", place: ({ h, last }) => [2 * h, last], move: (_, last) => ({ last: clamp(last, -0.6, 2) }) },
      ],
      panels: { places: 0.7, parabola: 0.7 },
      see({ h, x, last }, W) {
        const ends = [0, last], bend = (2 * x - last) / h, weight = -G * h, slope = bend + weight, calm = still(ends, h), long = 0.22; // m for each N s
        const curve = range(-0.6, 2, 61).map((at) => [at, S(at, ends, h)]), here = S(x, ends, h), y = room(curve.map((r) => r[1]).filter((v) => v < here + 12));
        return {
          measured: { h, x, slope, bend, weight, over: calm - last / 2 }, values: { x: written(100 * (calm - last / 2), 3), s: `${digits(Math.abs(slope), Math.abs(slope))}\u00a0N\u00a0s` },
          text: [...[["bend", bend], ["weight", weight]].map(([part, x]) => `${W[part]} = ${digits(x, 10)}\u00a0N\u00a0s`), `dS/dx\u2082 = ${digits(slope, 10)}\u00a0N\u00a0s`],
          places: {
            x: [-0.05, 0.85], y: [-0.8, 2.2], across: "t (s)", up: "x (m)", keys: [["bend", "c1"], ["weight", "c2"]],
            marks: [["line", "motion", [[0, 0], [2 * h, last]]], ["line", "trial", [[0, 0], [h, x], [2 * h, last]]], ["dot", "event", [0, 0], 5],
              ["arrow", "force", [h - 0.012, x], [h - 0.012, x + long * bend]], ["arrow", "weight", [h + 0.012, x], [h + 0.012, x + long * weight]]],
          },
          parabola: { x: [-0.6, 2], y, across: "x\u2082 (m)", up: "S (J s)", marks: [["line", "trial", curve], ["line", "tangent here", [-0.5, 0.5].map((by) => [x + by, here + slope * by])], ["dot", "event", [calm, S(calm, ends, h)], 4], ["dot", "dot", [x, here], 6]] },
        };
      },
    };
  };

  // -- dF/dt beside L
  const gauge = (data) => {
    const laws = Object.fromEntries(Object.entries(data.laws).map(([name, law]) => [name, numbered(law)]));
    const path = rows(data.path), T = data.T, wave = (t) => [Math.sin((Math.PI * t) / T), (Math.PI / T) * Math.cos((Math.PI * t) / T)];
    const bent = ({ t, q, v }, a) => { const [x, u] = wave(t); return [[q[0] + a * x], [v[0] + a * u], t]; };
    const S = (L, a) => sum(path.map((row) => row.w * L(...bent(row, a)).L));
    const REACH = 1.5;
    return {
      state: { added: "linear", c: 4, a: 0.6 },
      choices: { added: { of: ["linear", "square", "clock", "none"] } },
      sliders: { c: { from: -6, to: 6, marks: [0] } },
      handles: [{
        panel: "bent", says: "a", place: ({ a }) => { const q = path[(path.length - 1) / 2]; return [q.t, q.q[0] + a]; },
        move: (x, y) => ({ a: clamp(y - path[(path.length - 1) / 2].q[0], -REACH, REACH) }),
      }],
      panels: { bent: 0.5, lagrangians: 0.5, landscape: 0.6 },
      see({ added, c, a }, W) {
        const [plain, other] = [laws[added](0), laws[added](c)], bends = range(-REACH, REACH, 31);
        const below = bends.map((x) => [x, S(plain, x)]), above = bends.map((x) => [x, S(other, x)]), rises = bends.map((_, k) => above[k][1] - below[k][1]);
        const [low, high] = [S(plain, a), S(other, a)], size = span(below.map((r) => r[1]))[1] - span(below.map((r) => r[1]))[0];
        // Both are parabolas in the bend: three values tell their lowest places.
        const lowest = (L) => { const [l, m, r] = [-1, 0, 1].map((x) => S(L, x)); return (l - r) / (2 * (l - 2 * m + r)); };
        const spread = span(rises)[1] - span(rises)[0], moved = lowest(other) - lowest(plain);
        const along = (L) => path.map((row) => [row.t, L(...bent(row, a)).L]), [before, after] = [along(plain), along(other)];
        return {
          measured: { c, spread, size, rise: high - low, moved, lowest: lowest(plain) },
          values: { x: J(high - low, size), a: written(lowest(other), 3, 1) },
          text: [`S = ${J(low, size)}`, `${W.with}: ${J(high, size)}`],
          bent: { x: [0, T], y: [-0.6, 3.2], across: "t (s)", up: "y (m)", marks: [["line", "motion", path.map(({ t, q }) => [t, q[0]])], ["line", "trial", path.map((row) => [row.t, bent(row, a)[0][0]])], ...[0, path.length - 1].map((k) => ["dot", "event", [path[k].t, path[k].q[0]], 4])] },
          lagrangians: { x: [0, T], y: room([...before, ...after].map((r) => r[1]).concat(0)), across: "t (s)", up: "L (J)", keys: [["L", "c0"], [W.with, "c1"]], marks: [["area", "adds", [[0, 0], ...after, [T, 0]]], ["line", "trial thin", before], ["line", "trial c1 thin", after]] },
          landscape: {
            x: [-REACH, REACH], y: room([...below, ...above].map((r) => r[1])), across: `${W.a} (m)`, up: "S (J s)",
            marks: [["line", "motion", below], ["line", "trial c1", above], ...bends.filter((_, k) => k % 6 === 3).map((x) => ["arrow", "force", [x, S(plain, x)], [x, S(other, x)]]),
              ["dot", "event", [lowest(plain), S(plain, lowest(plain))], 4], ["dot", "event", [lowest(other), S(other, lowest(other))], 4], ["dot", "dot", [a, high], 6]],
          },
        };
      },
    };
  };

  // -- the momentum as a slope of L(v), and -H as where its tangent begins
  const legendre = (data) => {
    const laws = Object.fromEntries(Object.entries(data.laws).map(([name, law]) => [name, lagrangian({ law, p: [] })]));
    const reach = { slow: 2, fast: 0.95 };
    const at = (kind, v) => { const { L, Lv } = laws[kind]([0], [v], 0); return { L, p: Lv[0], H: Lv[0] * v - L }; };
    const set = (x, _, { kind }) => ({ v: clamp(x, -reach[kind], reach[kind]) });
    return {
      state: { kind: "slow", v: 1 },
      choices: { kind: { of: ["slow", "fast"], sets: (kind) => ({ v: reach[kind] / 2 }) } },
      handles: [{ panel: "lagrangian", says: "v", place: ({ kind, v }) => [v, at(kind, v).L], move: set }],
      panels: { lagrangian: 0.8, hamiltonian: 0.8 },
      see({ kind, v }, W) {
        const { L, p, H } = at(kind, v), end = reach[kind] * 1.12, curve = range(-reach[kind], reach[kind], 81).map((u) => [u, at(kind, u)]);
        const tangent = (u) => L + p * (u - v), rest = at(kind, 0), energies = curve.map(([, x]) => x.H);
        const y = room([...curve.map(([, x]) => x.L), -Math.max(...energies) * 0.6], 0.12);
        return {
          measured: { v, p, L, H, rest: rest.L, intercept: tangent(0) }, text: [`v = ${written(v, 3, 1)}`, `p = ${written(p, 3, 1)}`, `H = p v \u2212 L = ${written(H, 3, 1)}`], values: { h: written(H, 3, 1) },
          lagrangian: {
            x: [-end, end], y, across: "v", up: "L",
            marks: [["line", "axis", [[0, y[0]], [0, y[1]]]], ["line", "trial", curve.map(([u, x]) => [u, x.L])], ["line", "tangent here", [-end, end].map((u) => [u, tangent(u)])],
              ["dot", "event", [0, -H], 5], ["text", "name", [0, -H], "\u2212H", v > 0 ? "end" : "start", [v > 0 ? -9 : 9, 4]], ...(Math.abs(v) > 0.25 * end ? [["line", "axis", [[0, -H], [v, -H]]], ["arrow", "force", [v, -H], [v, L]], ["text", "name", [v, (L - H) / 2], "p\u2009v", v > 0 ? "start" : "end", [v > 0 ? 8 : -8, 4]]] : [])],
          },
          hamiltonian: {
            x: room(curve.map(([, x]) => x.p)), y: room([...energies, 0], 0.12), across: "p", up: "H",
            marks: [["line", "trial c1", curve.map(([, x]) => [x.p, x.H])], ["line", "tangent", [-1, 1].map((k) => [p + k * 1.2, H + k * 1.2 * v])], ["dot", "event", [p, H], 6], ["text", "name", [p, H], W.velocity, v > 0 ? "end" : "start", [v > 0 ? -12 : 12, 4]]],
          },
        };
      },
    };
  };

  // -- motions of one coordinate as curves in the plane of places and momenta
  const phase = (data) => {
    const DT = 0.01, STARTS = 15, CLOSE = 1e-6; // s; motions; a difference of momenta
    const laws = Object.fromEntries(Object.entries(data.systems).map(([name, it]) => [name, lagrangian(it)]));
    const run = (name, p0) => { // m = 1, v = p; Runge and Kutta's method
      const force = (q, v) => laws[name]([q], [v], 0).Lq[0], { q0, T } = data.systems[name], found = [[q0, p0]];
      for (let k = 0, [q, p] = [q0, p0]; k < Math.round(T / DT); k++) {
        const a = [p, force(q, p)], b = [p + (DT / 2) * a[1], force(q + (DT / 2) * a[0], p)], c = [p + (DT / 2) * b[1], force(q + (DT / 2) * b[0], p)], d = [p + DT * c[1], force(q + DT * c[0], p)];
        [q, p] = [q + (DT / 6) * (a[0] + 2 * b[0] + 2 * c[0] + d[0]), p + (DT / 6) * (a[1] + 2 * b[1] + 2 * c[1] + d[1])];
        found.push([q, p]);
      }
      return found;
    };
    const fans = {}, fan = (name) => (fans[name] ??= (() => {
      const { p0, spread } = data.systems[name], motions = range(p0 - spread, p0 + spread, STARTS).map((p) => run(name, p)), own = run(name, p0), [more, less] = [CLOSE, -CLOSE].map((by) => run(name, p0 + by));
      const lean = own.map((_, k) => [0, 1].map((i) => (more[k][i] - less[k][i]) / (2 * CLOSE)));
      const foci = lean.flatMap(([x], k) => (k > 1 && x * lean[k - 1][0] < 0 ? [DT * (k - 1 + lean[k - 1][0] / (lean[k - 1][0] - x))] : []));
      return { motions, own, lean, foci };
    })());
    return {
      state: { system: "spring", t: 1 },
      choices: { system: { of: ["spring", "pendulum"], sets: () => ({ t: 1 }) } },
      sliders: { t: { from: 0, to: (s) => data.systems[s.system].T, marks: (s) => fan(s.system).foci, unit: "s" } },
      panels: { plane: 0.9, fan: 0.7 },
      see({ system, t }, W) {
        const { motions, own, lean, foci } = fan(system), { T, q0 } = data.systems[system], k = Math.min(Math.floor(t / DT), own.length - 2), part = t / DT - k;
        const at = (motion) => motion[k].map((x, i) => x + part * (motion[k + 1][i] - x)), here = at(own), [dq, dp] = at(lean), line = motions.map(at), bits = (motion) => motion.filter((_, j) => j <= k && j % 5 === 0);
        const passed = foci.filter((x) => x < t - 1e-9).length, all = motions.flat(), x = room(all.map((r) => r[0]), 0.06), y = room(all.map((r) => r[1]), 0.06), long = 0.5 / Math.hypot(dq, dp);
        return {
          measured: { t, lean: dq, turn: dp, passed, foci, q: here[0], p: here[1] }, values: { t: written(t, 4), k: passed },
          text: [`t = ${written(t, 3, 1)}\u00a0s`, `${W.lean} = ${written(dq, 2, 1)}`],
          plane: {
            x, y, equal: true, across: "q", up: "p",
            marks: [...motions.map((motion) => ["line", "grid", bits(motion)]), ["line", "motion", motions.map(() => 0).map((_, j) => motions[j][0])], ["line", "trial", [...bits(own), here]], ["line", "trial c1", line], ...line.map((p) => ["dot", "place", p, 3]), ["line", "tangent", [-1, 1].map((s) => [here[0] + s * long * dq * 2, here[1] + s * long * dp * 2])], ["dot", "event", here, 5]],
          },
          fan: {
            x: [0, T], y: x, across: "t (s)", up: "q",
            marks: [...motions.map((motion) => ["line", "grid", motion.filter((_, j) => j % 5 === 0).map(([q], j) => [5 * j * DT, q])]), ["line", "trial", own.slice(0, k + 1).map(([q], j) => [j * DT, q])], ["line", "cursor", x.map((q) => [t, q])], ...line.map(([q]) => ["dot", "place", [t, q], 3]), ["dot", "event", [0, q0], 4], ["dot", "event", [t, here[0]], 5]],
          },
        };
      },
    };
  };

  // -- a stone and a ray of the same E: n = sqrt(2 (E - V)), m = 1
  const optics = () => {
    const index = (E, y) => Math.sqrt(2 * (E - G * y));
    const arc = (x1, y1, h) => (x) => (y1 / x1) * x + 4 * h * (x / x1) * (1 - x / x1);
    const length = (E, x1, y1, h) => { // of an arc between both ends, by Simpson's rule
      const N = 200, f = arc(x1, y1, h);
      let W = 0;
      for (let k = 0; k <= N; k++) W += (k % N ? (k % 2 ? 4 : 2) : 1) * index(E, f((x1 * k) / N)) * Math.hypot(1, (y1 + 4 * h * (1 - (2 * k) / N)) / x1);
      return (W * x1) / (3 * N);
    };
    // A ray in straight pieces, short where n is small; it turns at the middle of each as n changes across it.
    const ray = (E, angle, x1, pieces) => {
      const share = x1 / (Math.cos(angle) * index(E, 0) * pieces), points = [[0, 0]], on = ([x, y], by) => [x + by * Math.cos(angle), y + by * Math.sin(angle)];
      for (let at = [0, 0]; at[0] < x1 && points.length < 6 * pieces;) {
        const ds = share * index(E, at[1]), middle = on(at, ds / 2);
        const most_ = (ds * G) / index(E, middle[1]) ** 2;
        let turn = 0;
        for (let k = 0; k < 20; k++) turn = most_ * Math.cos(angle - turn / 2); // the direction halfway round
        angle -= turn;
        points.push(middle, (at = on(middle, ds / 2)));
      }
      const over = points.findIndex(([x]) => x > x1);
      if (over < 0) return points;
      const [[a, b], [c, d]] = points.slice(over - 1, over + 1);
      return [...points.slice(0, over), [x1, b + ((d - b) * (x1 - a)) / (c - a)]];
    };
    const high = (E, y1) => Math.min(4, (0.999 * (2 * E / G - y1 + 2 * Math.sqrt((E / G) * (E / G - y1)))) / 4); // the arc that just rises to where n = 0
    return {
      state: { E: 20, pieces: 8, x: 2.2, y: 0.5, h: 0.9 },
      sliders: { E: { from: ({ y }) => Math.max(8, 1.1 * G * y), to: 40, unit: "J" }, pieces: { from: 6, to: 60 } },
      handles: [
        { panel: "throws", says: "target", place: ({ x, y }) => [x, y], move: (x, y, { E }) => ({ x: clamp(x, 0.6, 4.2), y: clamp(y, 0, Math.min(2, (0.9 * E) / G)) }) },
        { panel: "throws", says: "arc", place: ({ x, y, h }) => [x / 2, arc(x, y, h)(x / 2)], move: (_, to_, { y, E }) => ({ h: clamp(to_ - y / 2, -0.3, high(E, y)) }) },
      ],
      panels: { throws: 0.62, lengths: 0.6 },
      see({ E, pieces, x: x1, y: y1, h: asked }, W) {
        const top = high(E, y1), h = Math.min(asked, top), v2 = 2 * E, under = v2 * v2 - G * (G * x1 * x1 + 2 * y1 * v2);
        const tangents = under >= 0 ? [-1, 1].map((s) => (v2 + s * Math.sqrt(under)) / (G * x1)) : [], W_ = (x) => length(E, x1, y1, x);
        const sag = (tan) => (G * x1 * x1 * (1 + tan * tan)) / (4 * v2) / 2; // of the throw over its chord
        // Level between two arcs where W stops rising or falling, found by halving.
        const curve = range(-0.3, top, 121).map((x) => [x, W_(x)]), tilt = (x) => W_(x + 1e-4) - W_(x - 1e-4), level = [];
        for (let k = 1; k + 1 < curve.length; k++) {
          if ((curve[k + 1][1] - curve[k][1]) * (curve[k][1] - curve[k - 1][1]) > 0) continue;
          let [a, b] = [curve[k - 1][0], curve[k + 1][0]];
          for (const sign = tilt(a); b - a > 1e-9;) { const m = (a + b) / 2; if (tilt(m) * sign > 0) a = m; else b = m; }
          level.push((a + b) / 2);
        }
        const stone = (tan, share = 1) => range(0, x1 * share, 61).map((x) => [x, tan * x - (G * x * x * (1 + tan * tan)) / (2 * v2)]);
        const rays = tangents.map((tan) => ray(E, Math.atan(tan), x1, Math.round(pieces)));
        const gap = Math.max(0, ...rays.map((points, k) => most(points.map(([x, y]) => y - (tangents[k] * x - (G * x * x * (1 + tangents[k] ** 2)) / (2 * v2))))));
        const wide = 4.4, tall = 2.6;
        return {
          measured: { under: under / (v2 * v2), level, throws: tangents.map(sag), gap, h, W: W_(h) }, values: { gap: written(100 * gap, 2) },
          text: [`W = \u222b n ds = ${J(W_(h), 10)}`, `n = ${written(index(E, 0), 3)} ${W.ground}`],
          throws: {
            x: [-0.2, wide], y: [-0.1, tall], equal: true, across: "x (m)", up: "y (m)",
            marks: [
              ...range(0, 1, 9).map((s) => ["line", "grid", [[-0.2, (s * E) / G], [wide, (s * E) / G]]]),
              ...range(0.25, 1.5, 9).map((angle) => ["line", "grid", range(0, wide, 90).map((x) => [x, Math.tan(angle) * x - (G * x * x) / (2 * v2 * Math.cos(angle) ** 2)]).filter(([, y]) => y > -0.1)]),
              ["line", "tangent here", range(0, wide, 80).map((x) => [x, E / G - (G * x * x) / (4 * E)]).filter(([, y]) => y > -0.1)],
              ["line", "strand", range(0, x1, 61).map((x) => [x, arc(x1, y1, h)(x)])],
              ...tangents.flatMap((tan, k) => [["line", `trial c${k ? 2 : 0}`, stone(tan)], ["line", "motion", rays[k]],
                ...range(0, x1, Math.round((x1 * Math.sqrt(1 + tan * tan)) / Math.sqrt(v2) / 0.08) + 1).map((x) => ["dot", "dot", [x, tan * x - (G * x * x * (1 + tan * tan)) / (2 * v2)], 3.5])]),
              ["dot", "event", [0, 0], 5], ...[0, 0.5, 0.9].filter((s) => (s * E) / G < tall).map((s) => ["text", "", [wide, (s * E) / G], `n = ${written(index(E, (s * E) / G), 2)}`, "end", [0, -5]]),
            ],
          },
          lengths: {
            x: [-0.3, Math.max(top, 0.5)], y: room(curve.map((r) => r[1])), across: `${W.arc} (m)`, up: "W (J s)",
            marks: [["line", "trial", curve], ...level.map((x, k) => ["dot", "event", [x, W_(x)], 5]), ["dot", "place", [h, W_(h)], 6]],
          },
        };
      },
    };
  };

  // -- a rod made longer: the slope of S is the pull, summed over the time
  const rod = (data) => {
    const EDGE = 3; // lengths on either side from which a slope is known
    const { lengths, actions, areas, pulls, places, t } = data, step = lengths[1] - lengths[0], nearest = (e) => clamp(Math.round((e + data.l - lengths[0]) / step), EDGE, lengths.length - 1 - EDGE);
    return {
      state: { e: 0 },
      sliders: { e: { from: lengths[EDGE] - data.l, to: lengths[lengths.length - 1 - EDGE] - data.l, marks: [0], unit: "m" } },
      panels: { circle: 0.8, pull: 0.5, lifted: 0.5 },
      see({ e }, W) {
        const k = nearest(e), l = lengths[k], pull = pulls[k], at = (j) => actions[k + j], found = (45 * (at(1) - at(-1)) - 9 * (at(2) - at(-2)) + at(3) - at(-3)) / (60 * step), middle = nearest(0);
        const round = (r) => range(-1.9, 1.9, 60).map((a) => [r * Math.sin(a), -r * Math.cos(a)]), spot = places[k], most_ = Math.max(...pulls.flat()), S = actions.slice(EDGE, -EDGE).map((x, j) => [lengths[j + EDGE] - data.l, x]);
        return {
          measured: { l, slope: found, area: areas[k], S: actions[k], pull }, values: { s: `${digits(found, Math.abs(found), 5)}\u00a0N\u00a0s`, a: `${digits(areas[k], Math.abs(areas[k]), 5)}\u00a0N\u00a0s` },
          text: [`l = ${written(l, 3)}\u00a0m`, `S = ${J(actions[k], Math.abs(actions[k]))}`],
          circle: {
            x: [-1.4, 1.4], y: [-1.6, 0.15], equal: true, across: "x (m)", up: "y (m)",
            marks: [["line", "motion", round(lengths[middle])], ["line", "ground", round(l)], ["line", "trial", spot], ["dot", "event", [0, 0], 4],
              ...spot.flatMap(([x, y], j) => (j % 5 ? [] : [["arrow", "force", [x, y], [x * (1 - (0.55 * pull[j]) / most_ / l), y * (1 - (0.55 * pull[j]) / most_ / l)]], ["dot", "dot", [x, y], 4]]))],
          },
          pull: { x: [0, t[t.length - 1]], y: [Math.min(0, ...pulls.flat()) * 1.1, most_ * 1.15], across: "t (s)", up: "\u2212\u03bb (N)", marks: [["area", "takes", [[0, 0], ...pull.map((x, j) => [t[j], x]), [t[t.length - 1], 0]]], ["line", "trial c1", pull.map((x, j) => [t[j], x])]] },
          lifted: { x: [S[0][0], S[S.length - 1][0]], y: room(S.map((r) => r[1])), across: "\u03b5 (m)", up: "S (J s)", marks: [["line", "trial", S], ["line", "tangent here", [-0.3, 0.3].map((by) => [l - data.l + by, actions[k] + areas[k] * by])], ["dot", "event", [l - data.l, actions[k]], 6]] },
        };
      },
    };
  };

  // -- the sum over two bends: a spiral in place of each arrow of a spiral
  const bends = (data) => {
    const L = lagrangian(data), N = 161, TURNS = 5, FADED = 0.35; // arrows; turns of the last; of the reach, where they begin to fade
    const second = (T, k) => { // of S along the bend k, by its own sum: S is of second order
      const wave = (s) => [[Math.sin(Math.PI * k * s)], [((Math.PI * k) / T) * Math.cos(Math.PI * k * s)]];
      const S = (a) => sum(data.nodes.map((s, j) => { const [x, u] = wave(s); return T * data.weights[j] * L([a * x[0]], [a * u[0]], 0).L; }));
      return S(1) + S(-1) - 2 * S(0);
    };
    const times = ([a, b], [c, d]) => [a * c - b * d, a * d + b * c];
    const angle = ([a, b]) => (180 / Math.PI) * Math.atan2(b, a);
    const strip = (S2, hbar) => { // as far as the phase turns round TURNS times, but no farther than 3 m
      const reach = Math.min(3, Math.sqrt((4 * Math.PI * TURNS * hbar) / Math.abs(S2))), da = (2 * reach) / (N - 1);
      return range(-reach, reach, N).map((a) => {
        const out = Math.max(0, (Math.abs(a) / reach - FADED) / (1 - FADED)), fade = Math.cos((Math.PI / 2) * out) ** 2, phi = (S2 * a * a) / (2 * hbar);
        return { a, arrow: [fade * da * Math.cos(phi), fade * da * Math.sin(phi)] };
      });
    };
    const chain = (arrows) => arrows.reduce((all, [x, y]) => { const [a, b] = all[all.length - 1]; all.push([a + x, b + y]); return all; }, [[0, 0]]);
    const frame = (points) => { const r = Math.max(...points.map((p) => Math.hypot(...p)), 1e-9) * 1.1; return { x: [-r, r], y: [-r, r], equal: true }; };
    return {
      state: { T: 2.4, hbar: 0.1 },
      sliders: { T: { from: 0.6, to: 9, marks: [Math.PI, 2 * Math.PI], unit: "s" }, hbar: { from: 0.02, to: 0.3, unit: "J s" } },
      even: true,
      panels: { one: 0.9, two: 0.9, both: 0.9 },
      see({ T, hbar }, W) {
        const S2 = [1, 2].map((k) => second(T, k)), [one, two] = S2.map((x) => strip(x, hbar)), [A, B] = [one, two].map((f) => chain(f.map(({ arrow }) => arrow)));
        // All pairs of bends, with the phase of both together.
        let all = [0, 0];
        for (const { a, arrow: [x, y] } of one) for (const { a: b, arrow: [u, v] } of two) {
          const size = Math.hypot(x, y) * Math.hypot(u, v), phi = (S2[0] * a * a + S2[1] * b * b) / (2 * hbar);
          all = [all[0] + size * Math.cos(phi), all[1] + size * Math.sin(phi)];
        }
        const ends = [A, B].map((c) => c[c.length - 1]), both = chain(one.map(({ arrow }) => times(arrow, ends[1]))), soft = S2.map((x) => Math.abs(x) < 1e-9 * T), turns = ends.map(angle);
        const spiral = (points, look, total) => ({
          ...frame(points), across: null, up: null,
          marks: [["line", "grid", [[-9, 0], [9, 0]]], ["line", "grid", [[0, -9], [0, 9]]], ["line", `thin ${look}`, points], ["arrow", "total", [0, 0], total]],
        });
        const down = S2.filter((x) => x < 0).length, degrees = (x) => `${written(Math.round(x * 10) / 10, 4, 100)}\u00b0`;
        return {
          measured: { S2, down, soft: soft.includes(true), turn: angle(all), product: angle(times(...ends)), turns, long: Math.hypot(...all) },
          values: { a: degrees(turns[0]), b: degrees(turns[1]), x: degrees(angle(all)) },
          text: [`${W.one}: ${degrees(turns[0])}`, `${W.two}: ${degrees(turns[1])}`, `${W.both}: ${degrees(angle(all))}`],
          one: spiral(A, "trial", ends[0]), two: spiral(B, "trial c1", ends[1]), both: spiral(both, "trial c2", times(...ends)),
        };
      },
    };
  };

  // -- a wall with slits: paths of two straight legs, in times T each
  const slits = () => {
    const far = 1, T = 1, m = 1, SCREEN = 0.8, N = 81, FREE = 3; // m, s, kg: to the wall; half the screen; arrows of a slit; of no wall, either way
    const openings = ({ wall, d, w }) => (wall === "two" ? [-d / 2, d / 2] : wall === "one" ? [d / 2] : [0]).map((at) => (wall === "open" ? [-FREE, FREE] : [at - w / 2, at + w / 2]));
    const S = (s, y) => (m / (2 * T)) * (far * far + s * s + far * far + (y - s) * (y - s));
    const arrows = (state, y, parts = state.wall === "open" ? 1201 : N) => openings(state).map(([a, b]) => range(a, b, parts).map((s, k) => {
      const size = ((b - a) / (parts - 1)) * (k && k < parts - 1 ? 1 : 0.5), fade = state.wall === "open" ? Math.cos((Math.PI / 2) * Math.max(0, (Math.abs(s) / FREE - 0.4) / 0.6)) ** 2 : 1, phi = (S(s, y) - S(y / 2, y)) / state.hbar;
      return [size * fade * Math.cos(phi), size * fade * Math.sin(phi)];
    }));
    const total = (rows_) => rows_.reduce(([a, b], [x, y]) => [a + x, b + y], [0, 0]);
    const bright = (state, y) => { const [x, v] = total(arrows(state, y, state.wall === "open" ? 1201 : 41).flat()); return (x * x + v * v) * (m / (Math.PI * state.hbar * T)); }; // of what comes without a wall
    return {
      state: { wall: "two", d: 0.4, w: 0.08, hbar: 0.02, y: 0 },
      choices: { wall: { of: ["two", "one", "open"] } },
      sliders: { hbar: { from: 0.01, to: 0.06, unit: "J s" }, d: { from: 0.2, to: 0.7, unit: "m", shown: (s) => s.wall === "two" }, w: { from: 0.03, to: 0.16, unit: "m", shown: (s) => s.wall !== "open" } },
      handles: [{ panel: "room", says: "place", place: ({ y }) => [2 * far, y], move: (_, y) => ({ y: clamp(y, -SCREEN, SCREEN) }) }],
      panels: { room: 0.7, spirals: 0.8 },
      see(state, W) {
        const { wall, d, hbar, y } = state, open = openings(state), parts = arrows(state, y), sums = parts.map(total), all = total(sums), here = bright(state, y), edges = [-SCREEN, ...(wall === "open" ? [] : open.flat()), SCREEN];
        const places = range(-SCREEN, SCREEN, wall === "open" ? 41 : 161), screen = places.map((x) => [x, bright(state, x)]), highest = Math.max(...screen.map((r) => r[1])), lengths = sums.map((x) => Math.hypot(...x));
        let from = [0, 0];
        const drawn = parts.map((rows_) => rows_.reduce((found, [x, v]) => { const [a, b] = found[found.length - 1]; found.push([a + x, b + v]); return found; }, [from]).map((p) => (from = p)));
        const r = room(drawn.flat().map((p) => p[0]).concat(0), 0.15, 0.01), u = room(drawn.flat().map((p) => p[1]).concat(0), 0.15, 0.01);
        return {
          measured: { wall, share: (Math.hypot(...all) / sum(lengths)) ** 2, here, spacing: (2 * Math.PI * hbar * T) / (m * d), spread: span(screen.map((x) => x[1]))[1] - span(screen.map((x) => x[1]))[0] },
          values: { x: written(here, 3, 1), s: written((200 * Math.PI * hbar * T) / (m * d), 3) },
          text: [`${W.brightness}: ${written(here, 3, 1)}`],
          room: {
            x: [-0.1, 2.75], y: [-SCREEN * 1.1, SCREEN * 1.1], across: "x (m)", up: "y (m)",
            marks: [...(wall === "open" ? [] : Array.from({ length: edges.length / 2 }, (_, k) => ["line", "barrier", [[far, edges[2 * k]], [far, edges[2 * k + 1]]]])),
              ...(wall === "open" ? range(-0.7, 0.7, 15) : open.map(([a, b]) => (a + b) / 2)).map((s, k) => ["line", wall === "open" ? "grid" : `trial thin c${k}`, [[0, 0], [far, s], [2 * far, y]]]),
              ...(wall === "open" ? [["line", "trial", [[0, 0], [far, y / 2], [2 * far, y]]]] : []),
              ["line", "axis", [[2 * far, -SCREEN], [2 * far, SCREEN]]], ["area", "adds", [[2 * far, -SCREEN], ...screen.map(([x, b]) => [2 * far + (0.65 * b) / Math.max(highest, wall === "open" ? 2 : 0), x]), [2 * far, SCREEN]]], ["dot", "event", [0, 0], 5]],
          },
          spirals: { x: r, y: u, equal: true, across: null, up: null, marks: [...drawn.map((points, k) => ["line", `trial thin c${k}`, points]), ["arrow", "total", [0, 0], from]] },
        };
      },
    };
  };

  // -- the second variation as a string, held at both ends, whose springs pull it outwards
  const string = (data) => {
    const L = lagrangian(data), COUNT = 3;
    const wave = (k, T, s) => [Math.sin(Math.PI * k * s), ((Math.PI * k) / T) * Math.cos(Math.PI * k * s)];
    const rise = (k, T, a) => sum(data.nodes.map((s, j) => { // of S, over the motion x = cos t
      const [x, u] = wave(k, T, s), t = s * T, [q, v] = [Math.cos(t), -Math.sin(t)];
      return T * data.weights[j] * (L([q + a * x], [v + a * u], t).L - L([q], [v], t).L);
    }));
    const stiffness = (k, T) => (2 * (rise(k, T, 1) + rise(k, T, -1))) / T; // delta^2 S over the mean square of its shape, per mass
    const REACH = 1.2, curves = range(1, COUNT, COUNT).map((j) => range(1, 9.6, 87).map((T) => [T, stiffness(j, T)]));
    return {
      state: { mode: "1", T: 2, a: 0.6 },
      choices: { mode: { of: ["1", "2", "3"] } },
      sliders: { T: { from: 1, to: 9.6, marks: [Math.PI, 2 * Math.PI, 3 * Math.PI], unit: "s" } },
      handles: [{ panel: "shape", says: "a", place: ({ mode, T, a }) => [T / (2 * Number(mode)), a], move: (_, a) => ({ a: clamp(a, -REACH, REACH) }) }],
      panels: { shape: 0.5, stiffnesses: 0.6, cost: 0.5 },
      see({ mode, T, a }, W) {
        const k = Number(mode), found = range(1, COUNT, COUNT).map((j) => stiffness(j, T)), own = found[k - 1], here = rise(k, T, a), down = found.filter((x) => x < -NOTHING).length;
        const shape = range(0, 1, 97).map((s) => [s * T, a * wave(k, T, s)[0]]), [cost, wide] = [range(-REACH, REACH, 41).map((x) => [x, rise(k, T, x)]), 3];
        return {
          measured: { k, T, a, stiffness: own, all: found, rise: here, down, half: Math.abs(a) > 1e-6 ? here / (a * a) : own * T / 4 }, values: { x: J(here, Math.max(Math.abs(here), 1e-3)), n: down },
          text: [`${W.stiffness} = ${written(own, 3, 1)}\u00a0N/m`, `\u0394S = ${J(here, Math.max(Math.abs(here), 0.01))}`],
          shape: {
            x: [0, T], y: [-1.4, 1.4], across: "t (s)", up: "\u03b7 (m)",
            marks: [["line", "axis", [[0, 0], [T, 0]]], ...range(0.5 / 12, 11.5 / 12, 12).map((s) => { const x = a * wave(k, T, s)[0]; return ["arrow", "force", [s * T, x], [s * T, x * 1.35]]; }), ["line", "trial broad", shape], ["dot", "event", [0, 0], 6], ["dot", "event", [T, 0], 6]],
          },
          stiffnesses: {
            x: [1, 9.6], y: [-1.4, wide], across: "T (s)", up: `${W.stiffness} (N/m)`,
            marks: [["line", "axis", [[1, 0], [9.6, 0]]], ...[3, 2, 1].map((j) => ["line", `trial c${j - 1}${j === k ? "" : " thin"}`, curves[j - 1].filter(([, x]) => x < wide)]), ["line", "cursor", [[T, -1.4], [T, wide]]], ...found.map((x, j) => [x, j]).filter(([x]) => x < wide).map(([x, j]) => ["dot", j + 1 === k ? "event" : "place", [T, x], j + 1 === k ? 6 : 4])],
          },
          cost: { x: [-REACH, REACH], y: room([...cost.map((r) => r[1]), -0.5, 0.5]), across: `${W.a} (m)`, up: "\u0394S (J s)", marks: [["line", "axis", [[-REACH, 0], [REACH, 0]]], ["line", `trial c${k - 1}`, cost], ["dot", "event", [a, here], 6]] },
        };
      },
    };
  };

  Object.assign(sentences.SENTENCES, {
    // A shift of all, or of the middle: { middle, e, size, rise, first, between }, changes of S of first order
    noether: {
      unmoved: (m) => m.e === 0,
      steps: (m) => m.middle && Math.abs(m.between) <= NOTHING * m.size,
      pushed: (m) => m.middle,
      symmetric: (m) => Math.abs(m.rise) <= NOTHING * m.size,
      broken: () => true,
    },
    // Three places: { slope, bend, weight }, the slope of S with the middle one and its two parts
    three: {
      level: (m) => Math.abs(m.slope) <= NOTHING * Math.abs(m.weight),
      lower: (m) => m.slope > 0,
      higher: () => true,
    },
    // What is added to L: { c, spread, size, moved }, how differently S rises for different bends
    gauge: {
      nothing: (m) => m.c === 0,
      rigid: (m) => m.spread <= NOTHING * m.size,
      moves: () => true,
    },
    // The tangent of L(v): { v, p, L, rest, intercept, H }
    legendre: {
      level: (m) => m.p === 0,
      twice: (m) => Math.abs(m.p * m.v - 2 * (m.L - m.rest)) <= NOTHING * Math.abs(m.p * m.v),
      more: () => true,
    },
    // The line of starts at one time: { t, lean, passed }
    phase: {
      begin: (m) => m.t < 0.05,
      upright: (m) => Math.abs(m.lean) < 1e-3,
      ahead: (m) => m.lean > 0 && m.passed === 0,
      behind: () => true,
    },
    // Arcs between the ends: { under, level }, of the root in the angles of throws, and where W is level
    optics: {
      edge: (m) => Math.abs(m.under) < 0.01,
      two: (m) => m.under > 0 && m.level.length === 2,
      none: (m) => m.under < 0 && m.level.length === 0,
      higher: () => true, // an arc as high as that is not in the picture
    },
    // A longer rod: { slope, area }
    rod: { same: (m) => Math.abs(m.slope - m.area) < 1e-5 * Math.abs(m.area), differs: () => true },
    // Two bends: { soft, down, turn, product }
    bends: {
      focus: (m) => m.soft,
      apart: (m) => Math.abs(m.turn - m.product) > 0.1,
      up: (m) => m.down === 0,
      pass: (m) => m.down === 1,
      down: () => true,
    },
    // A wall: { wall, share }, of the brightness of arrows that agree
    slits: {
      free: (m) => m.wall === "open",
      alone: (m) => m.wall === "one",
      bright: (m) => m.share > 0.9,
      dark: (m) => m.share < 0.1,
      grey: () => true,
    },
    // A mode: { stiffness, rise }
    string: {
      soft: (m) => Math.abs(m.stiffness) < NOTHING,
      stiff: (m) => m.stiffness > 0,
      gives: () => true,
    },
  });
  return { three, noether, gauge, legendre, phase, optics, rod, bends, slits, string };
})();
