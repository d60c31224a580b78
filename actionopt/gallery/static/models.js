// Systems to model: T and V as formulas, read, differentiated, and compared with samples of the system.
(() => {
  "use strict";
  const { address, panels: { filled, written } } = globalThis.actionopt;
  const STEP = 1e-3; // of central differences: to 1e-6 for what varies over lengths of one
  const SAME = 1e-4; // of the largest: differences err by some 1e-5, a wrong law by more than 1e-2
  const FUNCTIONS = { sin: Math.sin, cos: Math.cos, tan: Math.tan, sqrt: Math.sqrt, exp: Math.exp, log: Math.log };
  const LETTERS = { "\u03b8": "theta", "\u03c6": "phi", "\u03d5": "phi", "\u03c9": "w", "\u2212": "-", "\u2013": "-", "\u00b7": "*", "\u00d7": "*", "\u00b2": "^2", "\u00b3": "^3", "\u00bd": "(1/2)", "\u2019": "'", "\u2032": "'", "\u02b9": "'", "[": "(", "]": ")" };

  // Return a formula as a function of the values of its names; throws [what is wrong, where].
  function parse(text, names) {
    const plain = [...text].map((x) => (LETTERS[x] ? (/[a-z]/.test(LETTERS[x]) ? ` ${LETTERS[x]}` : LETTERS[x]) : x)).join("").replace(/(\d),(?=\d)/g, "$1.").replace(/\*\*/g, "^");
    const known = [...names, ...Object.keys(FUNCTIONS)].sort((a, b) => b.length - a.length);
    const several = new RegExp(known.join("|"), "g"); // "mgl" is m g l
    const tokens = [];
    for (const [token] of plain.matchAll(/\d+\.?\d*|\.\d+|[A-Za-z]+'*|\S/g)) {
      if (!/^[A-Za-z]/.test(token) || known.includes(token)) { tokens.push(token); continue; }
      const parts = token.match(several) ?? [];
      if (parts.join("") !== token) throw ["unknown", token];
      tokens.push(...parts);
    }
    let at = 0;
    const fail = () => { throw ["unread", tokens.slice(at).join(" ") || text]; };
    const expect = (token) => { if (tokens[at] !== token) fail(); at += 1; };
    const atom = () => {
      const token = tokens[at];
      if (token === undefined) fail();
      if (/^[\d.]/.test(token)) { at += 1; return () => Number(token); }
      if (token === "(") { at += 1; const inner = sum(); expect(")"); return inner; }
      if (FUNCTIONS[token]) {
        at += 1;
        let raised = null;
        if (tokens[at] === "^") { at += 1; raised = atom(); } // sin^2 x
        const argument = atom();
        return (x) => FUNCTIONS[token](argument(x)) ** (raised ? raised(x) : 1);
      }
      if (!names.includes(token)) fail();
      at += 1;
      return (x) => x[token];
    };
    const power = () => {
      const base = atom();
      if (tokens[at] !== "^") return base;
      at += 1;
      const exponent = signed();
      return (x) => base(x) ** exponent(x);
    };
    const signed = () => {
      if (tokens[at] !== "-" && tokens[at] !== "+") return power();
      const minus = tokens[at++] === "-", of = signed();
      return minus ? (x) => -of(x) : of;
    };
    const product = () => {
      let all = signed();
      while (tokens[at] !== undefined && !/^[-+)]$/.test(tokens[at])) {
        const divided = tokens[at] === "/";
        if (divided || tokens[at] === "*") at += 1;
        const before = all, next = tokens[at] === "-" ? signed() : power();
        all = divided ? (x) => before(x) / next(x) : (x) => before(x) * next(x);
      }
      return all;
    };
    const sum = () => {
      let all = product();
      while (tokens[at] === "+" || tokens[at] === "-") {
        const minus = tokens[at++] === "-", before = all, next = product();
        all = minus ? (x) => before(x) - next(x) : (x) => before(x) + next(x);
      }
      return all;
    };
    const all = sum();
    if (at < tokens.length) fail();
    return all;
  }

  // Return the accelerations that follow from L(q, v, t) by differences; NaN where none follow.
  function accelerations(L, q, v) {
    const n = q.length, along = (e, i) => e.map((x, j) => x + (j === i ? STEP : 0)), back = (e, i) => e.map((x, j) => x - (j === i ? STEP : 0));
    const p = (i, q, v, t) => (L(q, along(v, i), t) - L(q, back(v, i), t)) / (2 * STEP);
    const rows = q.map((_, i) => {
      const moved = (s) => p(i, q.map((x, j) => x + s * v[j]), v, s); // along the motion, the clock too
      const row = v.map((_, j) => (p(i, q, along(v, j), 0) - p(i, q, back(v, j), 0)) / (2 * STEP));
      row.push((L(along(q, i), v, 0) - L(back(q, i), v, 0)) / (2 * STEP) - (moved(STEP) - moved(-STEP)) / (2 * STEP));
      return row;
    });
    for (let i = 0; i < n; i++) {
      const best = rows.slice(i).reduce((a, b) => (Math.abs(b[i]) > Math.abs(a[i]) ? b : a));
      if (Math.abs(best[i]) < SAME) return q.map(() => NaN);
      rows.splice(rows.indexOf(best), 1);
      rows.splice(i, 0, best);
      rows.forEach((row, k) => { if (k !== i) { const share = row[i] / best[i]; row.forEach((x, j) => { row[j] = x - share * best[j]; }); } });
    }
    return rows.map((row, i) => row[n] / row[i]);
  }

  const largest = (values) => Math.max(...values.map(Math.abs));
  const alike = (a, b) => largest(a.map((x, k) => x - b[k])) <= SAME * largest(b);
  const level = (values) => values.map((x) => x - values[0]); // but for a constant
  const ratio = (a, b) => { // of a to b, where it is one number
    const x = a.reduce((s, y, k) => s + y * b[k], 0) / b.reduce((s, y) => s + y * y, 0);
    return alike(a, b.map((y) => x * y)) || largest(a.map((y, k) => y - x * b[k])) <= SAME * largest(b) ? x : NaN;
  };

  // Return what is to be said of T and V, and the values in it.
  function check(data, texts) {
    const { coordinates, parameters, letters, samples } = data;
    const rates = coordinates.map((x) => `${x}'`), names = [...coordinates, ...rates, ...Object.keys(parameters), "t"];
    const spell = (text) => text.replace(/[A-Za-z]+/g, (x) => letters[x] ?? x);
    const place = ({ q, v }) => coordinates.map((x, i) => `${spell(x)} = ${written(q[i], 2)}, ${spell(x)}' = ${written(v[i], 2)}`).join(", ");
    const energies = {};
    for (const side of ["T", "V"]) {
      let read;
      try { read = parse(texts[side], names); } catch (wrong) {
        if (!Array.isArray(wrong)) throw wrong;
        return [wrong[0], { side, part: wrong[1], names: names.slice(0, -1).map(spell).join(", ") }];
      }
      energies[side] = (q, v, t) => read(Object.assign({ t }, parameters, Object.fromEntries(coordinates.flatMap((x, i) => [[x, q[i]], [rates[i], v[i]]]))));
      const empty = samples.find(({ q, v }) => !Number.isFinite(energies[side](q, v, 0)));
      if (empty) return ["valueless", { side, place: place(empty) }];
    }
    const L = (q, v, t) => energies.T(q, v, t) - energies.V(q, v, t);
    const found = samples.map(({ q, v }) => accelerations(L, q, v)), at = (side) => samples.map(({ q, v }) => energies[side](q, v, 0));
    const T = at("T"), V = at("V"), knownT = samples.map((x) => x.T), knownV = samples.map((x) => x.V);
    if (!found.flat().every(Number.isFinite)) return ["singular", { names: rates.map(spell).join(", ") }];
    if (coordinates.every((_, i) => alike(found.map((a) => a[i]), samples.map(({ a }) => a[i])))) {
      const usual = alike(level(T.map((x, k) => x - V[k])), level(knownT.map((x, k) => x - knownV[k])));
      return [usual ? "right" : "other", { n: samples.length }];
    }
    const x = ratio(T, knownT), y = ratio(level(V), level(knownV)), is = (a, b) => Math.abs(a - b) < SAME;
    if (Number.isFinite(x) && !is(x, 1) && !is(x, 0)) return ["kinetic_factor", { x: written(x, 3) }];
    if (is(y, -1) && is(x, 1)) return ["sign", {}];
    if (Number.isFinite(y) && !is(y, 1) && !is(y, 0)) return ["potential_factor", { x: written(y, 3) }];
    if (is(x, 1)) return ["potential", {}];
    if (is(y, 1)) return ["kinetic", {}];
    const off = samples.flatMap((s, k) => coordinates.map((c, i) => ({ s, c, mine: found[k][i], known: s.a[i] })));
    const { s, c, mine, known } = off.reduce((a, b) => (Math.abs(b.mine - b.known) > Math.abs(a.mine - a.known) ? b : a));
    return ["neither", { place: place(s), name: `${spell(c)}''`, mine: written(mine, 3), known: written(known, 3) }];
  }

  document.querySelectorAll("form.model").forEach((form) => {
    const data = JSON.parse(form.querySelector("script").textContent), fields = { T: form.elements.T, V: form.elements.V };
    const show = () => {
      const [mark, values] = check(data, { T: fields.T.value, V: fields.V.value });
      form.dataset.said = mark;
      form.dataset.mark = mark === "right" || mark === "other" ? "right" : "wrong";
      form.querySelector("output").textContent = filled(data.words[mark], values);
    };
    form.hidden = false;
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      show();
      address.set(form.id, JSON.stringify([fields.T.value, fields.V.value]));
    });
    const before = address.get(form.id);
    if (before) try { // a link of another page is none of this one's
      const [T, V] = JSON.parse(before).map(String);
      Object.assign(fields.T, { value: T });
      Object.assign(fields.V, { value: V });
      show();
    } catch { /* torn */ }
  });
})();
