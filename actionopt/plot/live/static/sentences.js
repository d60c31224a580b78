// What the live figure says, and what must have been measured for it: of each group the first
// sentence whose predicate holds. Names are those of the words in words.py. Every S that is compared
// is so far as `error` allows, and against `range`, how S varies over bends: S itself has no zero.
globalThis.actionopt.sentences = (() => {
  "use strict";
  const HALF = 0.02; // of a ratio, how near to a power of two it is read as one
  const NOTHING = 1e-10; // of the range of S
  const about = (r, power) => Math.abs(r * 2 ** power - 1) < HALF;

  const SENTENCES = {
    // The kind of the motion: { forced, known, met, kind, pinned }, where `met` is one that no mesh resolves
    badge: {
      forced: (m) => m.forced && m.known,
      none: (m) => !m.known && !m.met,
      coarse: (m) => !m.known,
      minimum: (m) => m.kind === "minimum",
      saddle: (m) => m.kind === "saddle",
      degenerate: (m) => m.pinned,
      undecided: () => true,
    },
    // S beside that of the motion shown: { rise, error }
    compared: {
      same: (m) => Math.abs(m.rise) <= m.error,
      more: (m) => m.rise > 0,
      less: (m) => m.rise < 0,
    },
    // Newton's method: { found, known, met, steps, parts, forced }, where `found` is known to be
    // a motion, and `parts` those in which a force was taken away
    solved: {
      elsewhere: (m) => !m.found && m.known,
      none: (m) => !m.found && !m.met,
      coarse: (m) => !m.found,
      released: (m) => m.parts > 0,
      once: (m) => m.steps < 2,
      solved: () => true,
    },
    // Where the motion is, S is level in every direction, but for a force that is not in it.
    level: { stationary: (m) => m.found && !m.forced },
    // Half the bend: { size, a, b, error, range }, the changes of S before and after
    halved: {
      nothing: (m) => m.size < 1e-7,
      noise: (m) => !(Math.abs(m.a) > Math.max(10 * m.error / HALF, NOTHING * m.range)),
      first: (m) => about(m.b / m.a, 1),
      quarter: (m) => about(m.b / m.a, 2),
      eighth: (m) => about(m.b / m.a, 3),
      sixteenth: (m) => about(m.b / m.a, 4),
      mixed: () => true,
    },
    // The end of the way downhill: { away, least, saddle }; `least`: it has come to a known minimum
    downhill: {
      away: (m) => m.away,
      arrived: (m) => m.least,
      flat: (m) => m.saddle,
      stalled: () => true,
    },
    // The sum over paths: { wide, second, fourth }, the second order of S along the bend and all of it
    turned: {
      focus: (m) => m.wide && m.degenerate && Math.abs(m.second) < 1e-5 * m.range,
      turned: () => true,
    },
  };

  // The name of the sentence of a group for what was measured, or null.
  const said = (group, measured) =>
    Object.entries(SENTENCES[group]).find(([, holds]) => holds(measured))?.[0] ?? null;
  return { SENTENCES, said };
})();
