// Run with: node live.js action.js < cases.json. For each case S, gradient and Hessian at a path,
// and what Newton's method makes of others; answers as JSON.
const fs = require("fs");
(0, eval)(fs.readFileSync(process.argv[2], "utf8"));
const { Action, erf, stride } = globalThis.actionopt;
const dense = (A, N, band) => Array.from({ length: N * N }, (_, i) => {
  const [r, c] = [Math.floor(i / N), i % N];
  return Math.abs(r - c) > band ? 0 : A[r * stride(N, band) + c];
});
const few = new Set(process.argv.slice(3)); // of which times conjugate to the start are asked
const answers = JSON.parse(fs.readFileSync(0, "utf8")).map(({ name, data, Q, lam }) => {
  const A = new Action(data), at = Float64Array.from(Q), multipliers = Float64Array.from(lam);
  const answer = Float64Array.from(data.answer), newton = A.newton(A.straight());
  return {
    S: A.value(at),
    g: Array.from(A.gradient(at)),
    H: dense(A.hessian(at, multipliers), at.length, A.nodal),
    f: A.m ? A.shares.map((_, k) => A.surface(at, k).f) : [],
    known: A.value(answer),
    index: A.forced ? null : A.index(answer),
    slope: A.slope(answer),
    conjugate: few.has(name) ? A.conjugate(answer, A.momentum(answer), data.longest) : null,
    solved: newton && [A.value(newton), A.slope(newton)],
  };
});
process.stdout.write(JSON.stringify({ answers, erf: [-7, -3, -1, 0, 1e-3, 0.5, 2.4, 2.6, 4].map(erf) }));
