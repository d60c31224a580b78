// The discrete action in the page: its value, gradient and Hessian, and Newton's method on it.
// The rule is the package's own: polynomials through LGL nodes on equal elements, summed with the
// LGL weights. Constraints are held at each node by itself: a path lies on their surface, and
// varies in their tangent planes, of which `planes` has an orthonormal basis at every node.
globalThis.actionopt = (() => {
  "use strict";
  const STEPS = 40, FEW = 12, HALVINGS = 12; // of Newton's method; from a path that is near
  const CLOSE = 1e-11; // a step relative to the coordinates' sizes that is the last
  const SEEN = 160; // points of a curve
  const DEPENDENT = 1e-9; // of a constraint's gradient, what is left of one that others imply
  const STRIDE = 0.1, SHORTEST = 1e-3; // of a duration: the first step along a motion, and the last
  const FAMILY = 48; // steps over all durations
  const TOUCHING = 1e-5; // of its largest value: what is none of a determinant that does not change its sign
  const RESOLVED = 1e-9, TRUSTED = 1e-6, ROUNDS = 12, UNKNOWNS = 1200; // of the coordinates' sizes; of refinement; most
  const WORST = 0.03; // of the largest residual of an element: those that are cut
  const LEAST_PART = 0.01; // of a force that is taken away part by part
  const FLAT = 1e-6; // of the kinetic part of the second variation: eigenvalues that are zero

  // Abramowitz and Stegun 7.1.6, and by continued fractions where that takes long (7.1.14).
  function erf(x) {
    const y = Math.abs(x);
    if (y > 6) return Math.sign(x);
    if (y < 2.5) {
      let term = x, sum = x;
      for (let k = 1; Math.abs(term) > 1e-17 * Math.abs(sum); k++) sum += term *= (2 * x * x) / (2 * k + 1);
      return (2 / Math.sqrt(Math.PI)) * Math.exp(-x * x) * sum;
    }
    let tail = y;
    for (let k = 80; k > 0; k--) tail = y + k / 2 / tail;
    return Math.sign(x) * (1 - Math.exp(-y * y) / tail / Math.sqrt(Math.PI));
  }

  function compiled({ body, work, sizes, places }) {
    const run = new Function("erf", `return (x,o,w)=>{${body}}`)(erf);
    const out = sizes.map((size) => new Float64Array(size)), memory = new Float64Array(work);
    return { out, places, at: (x) => (run(x, out, memory), out) };
  }

  // -- linear algebra: square matrices of `band` entries either side of the diagonal. Row r has its
  // entry of column c at r stride + c; what elimination adds on the right has room.
  const stride = (N, band) => Math.min(N, 3 * band);
  const blank = (N, band) => new Float64Array(N * (stride(N, band) + 1));

  // Gauss's elimination with partial pivoting, in place; returns the function b -> x.
  function factored(A, N, band) {
    const pivots = new Int32Array(N), W = stride(N, band);
    for (let i = 0; i < N; i++) {
      const last = Math.min(N - 1, i + band), right = Math.min(N - 1, i + 2 * band);
      let p = i;
      for (let r = i + 1; r <= last; r++) if (Math.abs(A[r * W + i]) > Math.abs(A[p * W + i])) p = r;
      pivots[i] = p;
      if (p !== i) for (let c = i; c <= right; c++) [A[i * W + c], A[p * W + c]] = [A[p * W + c], A[i * W + c]];
      for (let r = i + 1; r <= last; r++) {
        const x = (A[r * W + i] /= A[i * W + i]);
        if (x) for (let c = i + 1; c <= right; c++) A[r * W + c] -= x * A[i * W + c];
      }
    }
    return (b) => {
      const x = b.slice();
      for (let i = 0; i < N; i++) {
        [x[i], x[pivots[i]]] = [x[pivots[i]], x[i]];
        for (let r = i + 1; r <= Math.min(N - 1, i + band); r++) x[r] -= A[r * W + i] * x[i];
      }
      for (let i = N - 1; i >= 0; i--) {
        for (let c = i + 1; c <= Math.min(N - 1, i + 2 * band); c++) x[i] -= A[i * W + c] * x[c];
        x[i] /= A[i * W + i];
      }
      return x;
    };
  }

  // The number of negative eigenvalues of a symmetric A: the signs of its pivots (Sylvester).
  function negative(A, N, band) {
    const W = stride(N, band);
    let count = 0;
    for (let i = 0; i < N; i++) {
      const pivot = A[i * W + i] || Number.MIN_VALUE, last = Math.min(N - 1, i + band);
      count += pivot < 0;
      for (let r = i + 1; r <= last; r++) {
        const x = A[r * W + i] / pivot;
        if (x) for (let c = i + 1; c <= last; c++) A[r * W + c] -= x * A[i * W + c];
      }
    }
    return count;
  }

  // Of a few rows, which are lost.
  function determinant(rows) {
    let found = 1;
    for (let i = 0; i < rows.length; i++) {
      const p = rows.reduce((best, row, r) => (r > i && Math.abs(row[i]) > Math.abs(rows[best][i]) ? r : best), i);
      if (p !== i) { [rows[i], rows[p]] = [rows[p], rows[i]]; found = -found; }
      found *= rows[i][i];
      if (!found) return 0;
      for (const row of rows.slice(i + 1)) less(row, row[i] / rows[i][i], rows[i]);
    }
    return found;
  }

  const dot = (a, b) => {
    let sum = 0;
    for (let i = 0; i < a.length; i++) sum += a[i] * b[i];
    return sum;
  };
  const less = (x, c, row) => { for (let i = 0; i < x.length; i++) x[i] -= c * row[i]; };
  const largest = (row) => row.reduce((most, x) => (Math.abs(x) <= most ? most : Math.abs(x)), 0); // NaN is

  // -- the action

  class Action {
    // `data` is that of `figure.py`; `duration` and `p`, the packed parameters, may be changed.
    constructor(data) {
      const { law, rule, elements } = data;
      Object.assign(this, { data, n: law.n, m: law.m, forced: law.forced });
      this.degree = rule.nodes.length - 1;
      this.first = compiled(law.first);
      this.second = compiled(law.second);
      this.sizes = data.sizes; // of the coordinates
      this.start = data.start;
      this.duration = data.duration;
      this.p = Float64Array.from(data.p);
      this.ends = [data.q0, data.q1].map((row) => Array.from(row)); // null where it is free
      this.lay(Array.from({ length: elements + 1 }, (_, e) => e / elements));
    }

    // Elements between `bounds`, shares of the duration.
    lay(bounds) {
      const { degree } = this, { nodes } = this.data.rule;
      this.bounds = bounds;
      this.elements = bounds.length - 1;
      this.count = this.elements * degree + 1; // nodes
      this.shares = Array.from({ length: this.count }, (_, k) => {
        const e = Math.min(Math.floor(k / degree), this.elements - 1), x = (1 + nodes[k - e * degree]) / 2;
        return x === 1 ? bounds[e + 1] : bounds[e] + x * (bounds[e + 1] - bounds[e]);
      });
      return this;
    }

    // The same action on another mesh, with these elements cut in halves, and a path carried to it.
    split(cut = () => true) {
      const { bounds } = this, finer = Object.assign(Object.create(Action.prototype), this);
      return finer.lay(bounds.flatMap((a, e) => (e < this.elements && cut(e) ? [a, (a + bounds[e + 1]) / 2] : [a])));
    }

    // The same action on the mesh of the page's data.
    coarse() { return this.split(() => false).lay(Array.from({ length: this.data.elements + 1 }, (_, e) => e / this.data.elements)); }

    carried(Q, other) {
      if (other === this) return Q;
      const found = new Float64Array(other.count * this.n);
      other.shares.forEach((s, k) => found.set(this.sample(Q, s), k * this.n));
      return found;
    }

    half(e) { return (this.duration * (this.bounds[e + 1] - this.bounds[e])) / 2; }
    times() { return this.shares.map((s) => this.start + s * this.duration); }
    node(e, k) { return e * this.degree + k; }
    row(Q, k) { return Q.subarray(k * this.n, (k + 1) * this.n); }
    pinned(k) {
      const end = k === 0 ? 0 : k === this.count - 1 ? 1 : -1;
      return Array.from({ length: this.n }, (_, i) => end >= 0 && this.ends[end][i] !== null);
    }

    // Weights of the nodes in the whole sum.
    weights() {
      const found = new Float64Array(this.count);
      for (let e = 0; e < this.elements; e++)
        this.data.rule.weights.forEach((w, k) => (found[this.node(e, k)] += w * this.half(e)));
      return found;
    }

    // Coordinates and velocity at node k of element e, into q and v.
    place(Q, e, k, q, v) {
      const { derivative } = this.data.rule, first = this.node(e, 0) * this.n;
      for (let i = 0; i < this.n; i++) {
        const origin = Q[first + i];
        let rate = 0;
        for (let j = 1; j <= this.degree; j++) rate += derivative[k][j] * (Q[first + j * this.n + i] - origin);
        q[i] = Q[first + k * this.n + i];
        v[i] = rate / this.half(e);
      }
    }

    time(e, k) { return this.at(e, this.data.rule.nodes[k]); }
    at(e, x) { return this.start + this.duration * this.bounds[e] + this.half(e) * (1 + x); }

    // S, and into g (K n) its gradient with the virtual work of the forces.
    value(Q, g) {
      const { weights, derivative } = this.data.rule, { n } = this;
      const q = new Float64Array(n), v = new Float64Array(n), x = [q, v, [0], this.p];
      let S = 0;
      if (g) g.fill(0);
      for (let e = 0; e < this.elements; e++) {
        const half = this.half(e);
        for (let k = 0; k <= this.degree; k++) {
          this.place(Q, e, k, q, v);
          x[2][0] = this.time(e, k);
          const [L, Lq, Lv, force] = this.first.at(x), w = weights[k];
          S += half * w * L[0];
          if (!g) continue;
          const here = this.node(e, k) * n, base = this.node(e, 0) * n;
          for (let i = 0; i < n; i++) {
            g[here + i] += half * w * (Lq[i] + (force.length ? force[i] : 0));
            for (let j = 0; j <= this.degree; j++) g[base + j * n + i] += w * derivative[k][j] * Lv[i];
          }
        }
      }
      return S;
    }

    // The path at `parts` equal steps of every element: rows of t, q and v.
    seen(Q, parts = Math.ceil(SEEN / this.elements)) {
      const { n, degree, elements } = this, q = new Float64Array(n), rows = [];
      const basis = Array.from({ length: parts + 1 }, (_, i) => this.basis((2 * i) / parts - 1));
      const rates = Array.from({ length: degree + 1 }, () => new Float64Array(n));
      for (let e = 0; e < elements; e++) {
        for (let k = 0; k <= degree; k++) this.place(Q, e, k, q, rates[k]);
        for (let i = +(e > 0); i <= parts; i++) {
          const at = new Float64Array(n), v = new Float64Array(n);
          basis[i].forEach((c, k) => { for (let j = 0; j < n; j++) { at[j] += c * Q[this.node(e, k) * n + j]; v[j] += c * rates[k][j]; } });
          rows.push({ t: this.at(e, (2 * i) / parts - 1), q: at, v });
        }
      }
      return rows;
    }

    // The values at x of the polynomials that are one at one node.
    basis(x) {
      const { nodes, barycentric } = this.data.rule, at = nodes.findIndex((y) => Math.abs(y - x) < 1e-14);
      if (at >= 0) return nodes.map((_, k) => +(k === at));
      const terms = nodes.map((y, k) => barycentric[k] / (x - y)), sum = terms.reduce((a, b) => a + b);
      return terms.map((c) => c / sum);
    }

    // [t, L] along what is `seen`.
    along(rows) { return rows.map(({ t, q, v }) => [t, this.first.at([q, v, [t], this.p])[0][0]]); }

    // The Hessian of S + sum w lam f, with the derivatives of the forces, (K n)^2, of `nodal` band;
    // `kinetic` only what d2L/dv2 makes of it.
    hessian(Q, lam, kinetic = false) {
      const { weights, derivative } = this.data.rule, { n, degree } = this, N = this.count * n, W = stride(N, this.nodal);
      const q = new Float64Array(n), v = new Float64Array(n), none = new Float64Array(this.m);
      const x = [q, v, [0], this.p, none], A = blank(N, this.nodal), [bent, forces, , curved] = this.second.places;
      for (let e = 0; e < this.elements; e++) {
        const half = this.half(e);
        for (let k = 0; k <= degree; k++) {
          this.place(Q, e, k, q, v);
          x[2][0] = this.time(e, k);
          if (lam) x[4] = lam.subarray(this.node(e, k) * this.m, (this.node(e, k) + 1) * this.m);
          const out = this.second.at(x), w = half * weights[k], base = this.node(e, 0) * n, slope = derivative[k];
          const add = (a, b, value) => { // derivative by q or v (from n on) number a, and b
            if (kinetic && (a < n || b < n)) return;
            const from = a < n ? [k, k] : [0, degree], to = b < n ? [k, k] : [0, degree];
            for (let i = from[0]; i <= from[1]; i++) {
              const left = w * value * (a < n ? 1 : slope[i] / half), row = base + i * n + (a % n);
              for (let j = to[0]; j <= to[1]; j++) A[row * W + base + j * n + (b % n)] += left * (b < n ? 1 : slope[j] / half);
            }
          };
          const both = ([rows, cols], values) => {
            for (let i = 0; i < values.length; i++) {
              add(rows[i], cols[i], values[i]);
              if (rows[i] !== cols[i]) add(cols[i], rows[i], values[i]);
            }
          };
          both(bent, out[0]);
          if (kinetic) continue;
          for (let i = 0; i < out[1].length; i++) add(forces[0][i], forces[1][i], out[1][i]);
          if (lam) both(curved, out[3]);
        }
      }
      return A;
    }

    get nodal() { return (this.degree + 1) * this.n - 1; } // unknowns of an element

    // -- constraints, node by node

    // f and G at a node, as plain rows.
    surface(Q, k) {
      const q = this.row(Q, k), still = new Float64Array(this.n), t = [this.start + this.shares[k] * this.duration];
      const f = Array.from(this.held(Q, k));
      const G = f.map(() => new Float64Array(this.n)), [rows, cols] = this.second.places[2];
      const values = this.second.at([q, still, t, this.p, new Float64Array(this.m)])[2];
      for (let i = 0; i < values.length; i++) G[rows[i]][cols[i]] = values[i];
      return { f, G };
    }

    // Of the coordinates free at node k, in units of their sizes: orthonormal rows `normal` that
    // span the constraints' gradients, G = lower normal, and `tangent` rows across them, unless `bare`.
    plane(Q, k, free = this.pinned(k).map((x) => !x), bare = false) {
      const { f, G } = this.m ? this.surface(Q, k) : { f: [], G: [] }, normal = [], lower = [], kept = [];
      const clean = (x, rows) => { // twice: once leaves round-off
        for (let round = 0; round < 2; round++) for (const r of rows) less(x, dot(r, x), r);
        return Math.sqrt(dot(x, x));
      };
      G.forEach((g, row) => {
        const x = g, scaled = new Float64Array(this.n);
        for (let i = 0; i < this.n; i++) scaled[i] = x[i] = free[i] ? g[i] * this.sizes[i] : 0;
        const size = Math.sqrt(dot(x, x));
        const left = clean(x, normal);
        if (left <= DEPENDENT * size || !size) return;
        normal.push(x.map((value) => value / left));
        lower.push(normal.map((r) => dot(r, scaled)));
        kept.push(row);
      });
      const known = { normal, lower, kept, f: kept.map((row) => f[row]) };
      if (bare) return known;
      const axes = [];
      for (let i = 0; i < this.n; i++) if (free[i]) (axes[axes.length] = new Float64Array(this.n))[i] = 1;
      if (!normal.length) return { ...known, tangent: axes };
      const tangent = [];
      for (const axis of axes) clean(axis, normal);
      for (let left = axes.length - normal.length; left > 0; left--) { // the longest that is left
        const sizes = axes.map((x) => dot(x, x)), at = sizes.indexOf(Math.max(...sizes)), [x] = axes.splice(at, 1);
        const size = clean(x, [...normal, ...tangent]);
        tangent.push(x.map((value) => value / size));
        const z = tangent[tangent.length - 1];
        for (const axis of axes) less(axis, dot(axis, z), z);
      }
      return { ...known, tangent };
    }

    planes(Q) { return this.shares.map((_, k) => this.plane(Q, k)); }

    // f at a node.
    held(Q, k) {
      const still = new Float64Array(this.n), t = [this.start + this.shares[k] * this.duration];
      return this.first.at([this.row(Q, k), still, t, this.p])[4];
    }

    // Move each node onto the surface, along its normals; false where there is none near. Normals
    // are those of a step before as long as steps become tenths.
    project(Q) {
      if (!this.m) return true;
      const by = new Float64Array(this.n);
      for (let k = 0; k < this.count; k++) {
        let size = Infinity, plane = null, f = null;
        for (let round = 0; round < 60 && size > 1e-14; round++) {
          if (plane) f = plane.kept.map((row) => this.held(Q, k)[row]);
          else ({ f } = plane = this.plane(Q, k, undefined, true));
          const c = [];
          by.fill(0);
          plane.lower.forEach((row, i) => {
            let rest = -f[i];
            for (let j = 0; j < i; j++) rest -= row[j] * c[j];
            c.push(rest / row[i]);
            less(by, -c[i], plane.normal[i]);
          });
          const step = largest(by);
          for (let i = 0; i < this.n; i++) Q[k * this.n + i] += by[i] * this.sizes[i];
          if (!(step < size) && round > 20) break;
          if (!(step < 0.1 * size)) plane = null;
          size = step;
        }
        if (!(size < 1e-9)) return false;
      }
      return true;
    }

    // The multipliers (K, m) that come nearest to g + w G' lam = 0.
    multipliers(g, planes) {
      const found = new Float64Array(this.count * this.m), w = this.weights();
      planes.forEach(({ normal, lower, kept }, k) => {
        const mu = normal.map((r) => -r.reduce((sum, x, i) => sum + x * this.sizes[i] * g[k * this.n + i], 0) / w[k]);
        for (let i = mu.length - 1; i >= 0; i--) {
          let sum = mu[i];
          for (let j = i + 1; j < mu.length; j++) sum -= lower[j][i] * found[k * this.m + kept[j]];
          found[k * this.m + kept[i]] = sum / lower[i][i];
        }
      });
      return found;
    }

    // Where the unknowns of each node begin, one for each tangent, and how many there are.
    offsets(planes) {
      const found = [0];
      for (const { tangent } of planes) found.push(found[found.length - 1] + tangent.length);
      return found;
    }

    reduced(g, planes) {
      return Float64Array.from(planes.flatMap(({ tangent }, k) =>
        tangent.map((z) => z.reduce((sum, x, i) => sum + x * this.sizes[i] * g[k * this.n + i], 0))));
    }

    // Z' A Z for bases of rows and columns at each node.
    within(A, left, right = left) {
      const { n, degree, count } = this, N = stride(count * n, this.nodal), a = this.offsets(left), b = this.offsets(right);
      const band = this.band(right), M = stride(b[count], band), R = blank(b[count], band);
      const scaled = (planes) => planes.map(({ tangent }) => tangent.map((z) => z.map((x, i) => x * this.sizes[i])));
      const Y = scaled(left), Z = scaled(right), half = new Float64Array(n);
      for (let k = 0; k < count; k++)
        for (let r = 0; r < Y[k].length; r++) { // nodes of the elements that it is in
          const first = Math.floor((k - 1) / degree) * degree, last = Math.floor(k / degree) * degree + degree;
          for (let l = Math.max(0, first); l <= Math.min(count - 1, last); l++) {
            half.fill(0);
            for (let i = 0; i < n; i++) {
              const y = Y[k][r][i];
              if (y) for (let j = 0; j < n; j++) half[j] += y * A[(k * n + i) * N + l * n + j];
            }
            for (let s = 0; s < Z[l].length; s++) R[(a[k] + r) * M + b[l] + s] = dot(Z[l][s], half);
          }
        }
      return R;
    }

    // Unknowns of one element and of one node more: the rows of a motion are shifted by one.
    band(planes) { return (this.degree + 2) * Math.max(...planes.map(({ tangent }) => tangent.length)); }

    // Q moved by y along the tangents, and back onto the surface; null where it cannot be.
    moved(Q, planes, y, by = 1) {
      const found = Q.slice(), at = this.offsets(planes);
      planes.forEach(({ tangent }, k) => tangent.forEach((z, r) => {
        for (let i = 0; i < this.n; i++) found[k * this.n + i] += by * y[at[k] + r] * z[i] * this.sizes[i];
      }));
      return this.project(found) ? found : null;
    }

    // How far a path is from stationary, an action: duration times the mean of missing force and size.
    slope(Q, g = this.gradient(Q), planes = this.planes(Q)) {
      const w = this.weights(), at = this.offsets(planes), r = this.reduced(g, planes);
      let sum = 0;
      for (let k = 0; k < this.count; k++) {
        const mass = w[k] / this.duration + +(k === 0 || k === this.count - 1);
        for (let i = at[k]; i < at[k + 1]; i++) sum += r[i] ** 2 / mass;
      }
      return Math.sqrt(sum);
    }

    gradient(Q) {
      const g = new Float64Array(this.count * this.n);
      this.value(Q, g);
      return g;
    }

    // The force missing at the nodes, as rows of one coordinate each; what constraints provide is not.
    missing(Q) {
      const g = this.gradient(Q), w = this.weights(), planes = this.m ? this.planes(Q) : null;
      if (planes) {
        const lam = this.multipliers(g, planes);
        planes.forEach((_, k) => this.surface(Q, k).G.forEach((row, c) =>
          row.forEach((x, i) => (g[k * this.n + i] += w[k] * x * lam[k * this.m + c]))));
      }
      return Array.from({ length: this.n }, (_, i) => Array.from(w, (x, k) => (k && k < this.count - 1 ? -g[k * this.n + i] / x : 0)));
    }

    // The straight line between the events; a free end keeps the other's.
    straight() {
      const Q = new Float64Array(this.count * this.n);
      this.shares.forEach((s, k) => {
        for (let i = 0; i < this.n; i++) {
          const [a, b] = [0, 1].map((end) => this.ends[end][i] ?? this.ends[1 - end][i] ?? 0);
          Q[k * this.n + i] = a + s * (b - a);
        }
      });
      return Q;
    }

    // -- Newton's method

    // The stationary path near Q, or null. Steps are shortened until the next one, by the same
    // matrix, is shorter than this one: Deuflhard's natural test (Newton Methods, section 3.3).
    // `sides` gives the planes of rows and columns, `force` is added to the gradient.
    newton(Q, { steps = STEPS, sides = (P) => [P, P], force = null, follow = null } = {}) {
      Q = Q.slice();
      if (!this.project(Q)) return null;
      for (let k = 0; k < steps; k++) {
        const g = this.gradient(Q);
        if (force) force.forEach((x, i) => (g[i] += x));
        const [rows, cols] = sides(this.planes(Q), Q);
        const lam = this.m ? this.multipliers(g, this.planes(Q)) : null;
        const r = this.reduced(g, rows).map((x) => -x);
        const backward = factored(this.within(this.hessian(Q, lam), rows, cols), r.length, this.band(cols));
        const y = backward(r), size = largest(y);
        if (!Number.isFinite(size)) return null;
        const last = size < CLOSE;
        let t = Math.min(1, 2 / size), ahead = null; // no coordinate by more than twice its size
        for (let h = 0; h < HALVINGS; h++, t /= 2) {
          ahead = this.moved(Q, cols, y, t);
          if (!ahead || last) { if (last) break; continue; }
          const next = this.gradient(ahead);
          if (force) force.forEach((x, i) => (next[i] += x));
          const there = sides(this.planes(ahead), ahead)[0];
          const after = largest(backward(this.reduced(next, there)));
          if (after <= (1 - t / 4) * size || (size < 1e-7 && after < 1e-7)) break;
          ahead = null;
        }
        if (!ahead) return size < 1e-8 ? Q : null;
        Q = ahead;
        if (follow) follow(Q);
        if (last) return Q;
      }
      return null;
    }

    // The stationary path to which Q leads as the force that makes a motion of it is taken away, part
    // by part; null where that ends before.
    released(Q, follow = () => {}) {
      const lacking = this.gradient(Q);
      let left = 1, part = 0.25, at = Q;
      while (left > 0) {
        const next = Math.max(0, left - part), found = this.newton(at, { force: lacking.map((x) => -next * x), steps: FEW });
        if (found) { [at, left, part] = [found, next, 2 * part]; follow(at); }
        else if ((part /= 2) < LEAST_PART) return null;
      }
      return at;
    }

    // What a stationary path leaves between its nodes, seen on the mesh twice as fine: `off`, how far
    // its residual moves it, relative to the coordinates' sizes, and `error`, that of S; with the elements
    // that are the worst. The residual is measured by the kinetic part of the second variation alone,
    // which is no less definite where paths are conjugate.
    doubt(Q) {
      const fine = this.split(), at = this.carried(Q, fine), bare = { off: Infinity, error: Infinity, known: false, worst: () => true };
      if (!fine.project(at)) return bare;
      const g = fine.gradient(at), planes = fine.planes(at), r = fine.reduced(g, planes), place = fine.offsets(planes);
      const y = factored(fine.within(fine.hessian(at, null, true), planes), r.length, fine.band(planes))(r.map((x) => -x));
      const off = largest(y), error = Math.abs(fine.value(at) - this.value(Q)) + Math.abs(dot(r, y)), w = fine.weights();
      if (!Number.isFinite(off + error)) return bare;
      const left = Float64Array.from({ length: this.elements }, (_, e) => {
        let sum = 0;
        for (let k = 2 * e * this.degree + 1; k < 2 * (e + 1) * this.degree; k++)
          for (let i = place[k]; i < place[k + 1]; i++) sum += r[i] ** 2 / w[k];
        return Math.sqrt(sum);
      });
      const most = largest(left);
      return { off, error, known: off < TRUSTED, worst: (e) => left[e] >= WORST * most };
    }

    // The stationary path that `ask` finds near Q, on a mesh fine enough for it, as far as there is one:
    // { A, Q, off, error, known }: `known` if it is resolved; null if there is none.
    resolved(Q, ask = (A, at) => A.newton(at)) {
      let A = this, found = ask(A, Q), before = Infinity;
      for (let round = 0; found; round++) {
        const doubt = A.doubt(found), finer = A.split(doubt.worst);
        const enough = doubt.off < RESOLVED || (doubt.known && doubt.off > before / 2); // round-off is all that is left
        if (enough || round === ROUNDS || finer.count * this.n > UNKNOWNS) return { A, Q: found, ...doubt };
        before = doubt.off;
        found = ask(finer, A.carried(found, finer));
        A = finer;
      }
      return null;
    }

    // S, how far a finer mesh would have it elsewhere, and what round-off leaves of it.
    sum(Q) {
      const fine = this.split(), at = this.carried(Q, fine), S = this.value(Q);
      const error = fine.project(at) ? Math.abs(fine.value(at) - S) : Infinity;
      let whole = 0;
      for (let e = 0; e < this.elements; e++) {
        const q = new Float64Array(this.n), v = new Float64Array(this.n);
        for (let k = 0; k <= this.degree; k++) {
          this.place(Q, e, k, q, v);
          whole += this.half(e) * this.data.rule.weights[k] * Math.abs(this.first.at([q, v, [this.time(e, k)], this.p])[0][0]);
        }
      }
      return { S, error, noise: 4 * Number.EPSILON * whole };
    }

    // The integral of sqrt(2 L), where L is half a squared length, and how far a finer mesh has another.
    way(Q) {
      const along = (A, P) => {
        const q = new Float64Array(A.n), v = new Float64Array(A.n);
        let sum = 0;
        for (let e = 0; e < A.elements; e++)
          for (let k = 0; k <= A.degree; k++) {
            A.place(P, e, k, q, v);
            sum += A.half(e) * A.data.rule.weights[k] * Math.sqrt(2 * A.first.at([q, v, [A.time(e, k)], A.p])[0][0]);
          }
        return sum;
      };
      const fine = this.split(), long = along(this, Q);
      return { long, error: Math.abs(long - along(fine, this.carried(Q, fine))) };
    }

    // S(Q) - S(P) by its gradient between them, where the difference is lost in round-off.
    between(P, Q) {
      const { nodes, weights } = this.data.rule, by = Q.map((x, i) => x - P[i]);
      return nodes.reduce((sum, x, k) => sum + (weights[k] / 2) * dot(this.gradient(P.map((y, i) => y + ((1 + x) / 2) * by[i])), by), 0);
    }

    // How S ranges over bends as large as the coordinates: what is none beside it is none of S, which
    // knows no zero. Half of the kinetic part of the second variation along half a wave.
    range(Q) {
      const { n, duration } = this, { weights } = this.data.rule, q = new Float64Array(n), v = new Float64Array(n);
      const x = [q, v, [0], this.p, new Float64Array(this.m)], [rows, cols] = this.second.places[0];
      let sum = 0;
      for (let e = 0; e < this.elements; e++)
        for (let k = 0; k <= this.degree; k++) {
          this.place(Q, e, k, q, v);
          x[2][0] = this.time(e, k);
          const W = this.second.at(x)[0], rate = (Math.PI / duration) * Math.cos((Math.PI * (x[2][0] - this.start)) / duration);
          for (let i = 0; i < W.length; i++)
            if (rows[i] >= n && cols[i] >= n && rows[i] === cols[i])
              sum += (this.half(e) * weights[k] * Math.abs(W[i]) * (rate * this.sizes[rows[i] - n]) ** 2) / 2;
        }
      return sum;
    }

    // Kind and index of the action at a path; degenerate too where a finer mesh counts otherwise.
    index(Q) {
      const fine = this.split(), at = this.carried(Q, fine), here = this.signs(Q);
      const same = fine.project(at) && fine.signs(at).index === here.index;
      return same ? here : { ...here, kind: "degenerate" };
    }

    signs(Q) {
      const planes = this.planes(Q), g = this.gradient(Q), lam = this.m ? this.multipliers(g, planes) : null;
      const A = this.within(this.hessian(Q, lam), planes), N = this.offsets(planes)[this.count];
      const kinetic = this.within(this.hessian(Q, null, true), planes);
      const [below, above] = [FLAT, -FLAT].map((by) => {
        const B = A.map((x, i) => x + by * kinetic[i]);
        return negative(B, N, this.band(planes));
      });
      const index = below;
      return { kind: below !== above ? "degenerate" : index ? "saddle" : "minimum", index };
    }

    // One step downhill in S, in the metric of the kinetic energy; null where none goes down.
    descend(Q, longest = 0.5) {
      const planes = this.planes(Q), g = new Float64Array(Q.length), S = this.value(Q, g), r = this.reduced(g, planes);
      const K = this.within(this.hessian(Q, null, true), planes);
      const y = factored(K, r.length, this.band(planes))(r.map((x) => -x)), falls = dot(r, y);
      if (!(falls < 0)) return null;
      const size = largest(y);
      for (let t = Math.min(longest, 0.1 / size); t > 1e-6; t /= 2) {
        const ahead = this.moved(Q, planes, y, t);
        if (ahead && this.value(ahead) < S + 1e-4 * t * falls) return ahead;
      }
      return null;
    }

    // -- motions from the start: the same equations, with the first momentum given

    // Of a stationary path: minus its gradient at the start.
    momentum(Q) { return this.gradient(Q).slice(0, this.n).map((x) => -x); }

    // The motion with this momentum at the start over the present duration, near Q; null if none.
    motion(Q, p0) {
      const force = new Float64Array(Q.length);
      force.set(p0);
      return this.thrown(Q, (sides) => this.newton(Q, { force, steps: FEW, sides }));
    }

    // What `ask` makes of Newton's rows and columns where the start is given and the end is free.
    thrown(Q, ask) {
      const ends = this.ends, all = Array.from({ length: this.n }, () => true);
      this.ends = [Array.from(this.row(Q, 0)), all.map(() => null)];
      const rows = (P, at) => [this.plane(at, 0, all), ...P.slice(1, -1), { tangent: [] }];
      const cols = (P) => [{ ...P[0], tangent: [] }, ...P.slice(1)];
      const found = ask((P, at) => [rows(P, at), cols(P)]);
      this.ends = ends;
      return found;
    }

    // A motion over a duration nearer to `goal`, and all of it if it can be followed, in steps that
    // fit; `duration` is then how far that is.
    followed(Q, p0, goal) {
      for (let step = STRIDE * this.duration; this.duration !== goal; ) {
        const before = this.duration, left = goal - before;
        const next = Math.abs(left) <= step ? goal : before + Math.sign(left) * step;
        const ahead = new Float64Array(Q.length);
        this.shares.forEach((s, k) => ahead.set(this.sample(Q, (s * next) / before), k * this.n));
        this.duration = next;
        const found = this.motion(ahead, p0);
        if (found) Q = found;
        else this.duration = before;
        step *= found ? 2 : 0.25;
        if (step < SHORTEST * before) break;
      }
      return Q;
    }

    // The times conjugate to the start along a motion and on to the duration `longest`: where
    // neighbours that leave with other momenta, of which each is a Jacobi field, meet it again;
    // null where no mesh resolves the motion so far.
    conjugate(Q, p0, longest) {
      const far = this.split(() => false), ahead = far.followed(Q, p0, longest);
      const found = far.duration === longest && far.resolved(ahead, (A, at) => A.motion(at, p0));
      return found && found.known ? found.A.meetings(found.Q) : null;
    }

    meetings(Q) {
      const { n, degree } = this;
      const D = this.thrown(Q, (sides) => {
        const planes = this.planes(Q), [rows, cols] = sides(planes, Q), at = this.offsets(cols), g = this.gradient(Q);
        const A = this.within(this.hessian(Q, this.m ? this.multipliers(g, planes) : null), rows, cols);
        const size = at[this.count], backward = factored(A, size, this.band(cols));
        const fields = rows[0].tangent.map((_, r) => {
          const kick = new Float64Array(size);
          kick[r] = 1;
          return backward(kick);
        });
        return this.shares.map((_, k) => determinant([
          ...fields.map((y) => cols[k].tangent.reduce((sum, z, r) => sum.map((x, i) => x + y[at[k] + r] * z[i]), new Float64Array(n))),
          ...(this.m ? this.surface(Q, k).G.filter((_, c) => planes[Math.max(1, k)].kept.includes(c)).map((row) => row.map((x, i) => x * this.sizes[i])) : []),
        ]));
      });
      const found = [], top = Math.max(...D.map(Math.abs));
      for (let e = 0; e < this.elements; e++) {
        const values = D.slice(e * degree, (e + 1) * degree + 1), { nodes } = this.data.rule;
        const value = (x) => this.basis(x).reduce((sum, c, k) => sum + c * values[k], 0);
        for (let k = e ? 0 : 1; k < degree; k++) {
          let [a, b] = [nodes[k], nodes[k + 1]];
          if (values[k] * values[k + 1] < 0) {
            for (let i = 0; i < 50; i++) { const c = (a + b) / 2; if (value(c) * values[k] > 0) a = c; else b = c; }
            found.push(this.at(e, a));
            continue;
          }
          // Two at once: the least of |D| on the way, and none of it is left.
          for (let i = 0; i < 50; i++) {
            const [c, d] = [a + (b - a) / 3, b - (b - a) / 3];
            if (Math.abs(value(c)) < Math.abs(value(d))) b = d; else a = c;
          }
          const inside = a > nodes[k] + 1e-6 && b < nodes[k + 1] - 1e-6;
          if (inside && Math.abs(value(a)) < TOUCHING * top) found.push(this.at(e, a), this.at(e, a));
        }
      }
      return found.filter((t) => t < this.start + this.duration * (1 - 1e-9));
    }

    // The times between durations at which the index of motions with free ends changes: of those that
    // are met from this one on, a step after the other.
    focal(Q, low, high) {
      const A = this.split(() => false), found = [];
      const at = (T, from) => {
        A.duration = T;
        const next = A.newton(from);
        return next && { T, Q: next, k: A.index(next).index };
      };
      for (const goal of [low, high]) {
        let here = at(this.duration, Q);
        for (const begun = this.duration; here && here.T !== goal; ) {
          const step = (Math.sign(goal - begun) * (high - low)) / FAMILY;
          const next = at(Math.abs(goal - here.T) <= Math.abs(step) ? goal : here.T + step, here.Q);
          for (let [a, b] = [here, next], i = 0; b && a.k !== b.k && i < 24; i++) {
            const c = at((a.T + b.T) / 2, a.Q);
            if (!c || i === 23) { found.push(...Array(Math.abs(a.k - b.k)).fill(this.start + (a.T + b.T) / 2)); break; }
            if (c.k === a.k) a = c; else b = c;
          }
          here = next;
        }
      }
      return found.sort((a, b) => a - b);
    }

    // A path at shares of its duration, beyond the end along its last velocity.
    sample(Q, share) {
      const { n, bounds, degree } = this, e = Math.max(0, bounds.findLastIndex((a, k) => k < this.elements && a <= share));
      const x = (2 * (share - bounds[e])) / (bounds[e + 1] - bounds[e]) - 1, q = new Float64Array(n), v = new Float64Array(n);
      this.basis(Math.min(x, 1)).forEach((c, k) => { for (let i = 0; i < n; i++) q[i] += c * Q[this.node(e, k) * n + i]; });
      if (x > 1) {
        this.place(Q, e, degree, new Float64Array(n), v);
        v.forEach((rate, i) => (q[i] += rate * (x - 1) * this.half(e)));
      }
      return q;
    }
  }

  return { Action, compiled, erf, stride, TRUSTED };
})();
