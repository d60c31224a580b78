"""Questions made forwards: a motion is followed, and its end asked for by energy or by a surface.

Random systems of two and three coordinates as in `random_systems`, without clock and friction. Of
transfers the energy of the motion is given, and its duration is to be found; of surfaces the
duration, and a sphere through the motion's end to which it is normal there. So an answer exists,
though others may be found. An answer is judged by the equations derived by hand, as there: by the
distance to a motion with its ends, and by what the first state misses of the energy, or the last
one of the sphere and of its normal, in the motion's units. 40 seeded systems for each range of
durations, at tol 1e-8, with no guess and no limit of time.
"""

from __future__ import annotations

import numpy as np

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, Row, measured, mine, timed
from benchmarks.stress.families.random_systems import Random
from benchmarks.stress.forward import distance
from benchmarks.stress.tally import all_solved, judged, never_wrong, row

TITLE = "Made forwards"
BINS = {"T = 0.4 to 1.6": (0.4, 1.6), "T = 3.2": (3.2, 3.2), "T = 6.4": (6.4, 6.4)}
COUNT, SEED = 40, 41
TOL = 1e-8
ACCURACY = 1e-9  # of the reference
MOST = COUNT // 20  # of a range that may not be solved; ad hoc


def inertia(case: Random, q: np.ndarray) -> np.ndarray:
    """Return the mass matrix (n, n) at q."""
    along = case.masses.along
    m = np.array(case.masses.terms(q, 0.0)).reshape(-1, 1)
    return case.inertia + along.T @ (m * along)


def energy(case: Random, q: np.ndarray, v: np.ndarray) -> float:
    """Return the energy function at (q, v)."""
    rest = case.springs @ q**2 / 2 + sum(case.potential.terms(q, 0.0))
    return float(v @ inertia(case, q) @ v) / 2 + float(rest)


def momentum(case: Random, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return p (n,) at (q, v)."""
    a = np.array(case.vectors.terms(q, 0.0)).reshape(-1, 1)
    return inertia(case, q) @ v + (a * case.vectors.along).sum(axis=0)


def transfer(case: Random, q1: np.ndarray, v1: np.ndarray):
    """Return the question of given energy, and what an answer misses of it."""
    E = energy(case, case.q0, case.v0)
    problem = ao.Problem(case.system, ao.Event(0.0, case.q0), ao.Event(None, q1), energy=E)

    def missed(s: ao.Solution) -> float:
        q, v = s.start.q, s.start.v  # by the momentum: better than the slope of the path
        return abs(energy(case, q, v) - E) / max(float(v @ inertia(case, q) @ v), abs(E))

    return problem, missed


def surface(case: Random, q1: np.ndarray, v1: np.ndarray):
    """Return the question of a sphere, of radius 2 |q1|, and what an answer misses of it."""
    p1 = momentum(case, q1, v1)
    radius = 2 * float(np.linalg.norm(q1))
    centre = q1 + radius * p1 / np.linalg.norm(p1)

    def on(q, t):
        return sum((q[i] - centre[i]) ** 2 for i in range(case.n)) - radius**2

    problem = ao.Problem(case.system, ao.Event(0.0, case.q0), ao.Event(case.T, None, on=on))

    def missed(s: ao.Solution) -> float:
        q, v = s.end.q, s.end.v
        p, normal = momentum(case, q, v), (q - centre) / np.linalg.norm(q - centre)
        off = abs(np.linalg.norm(q - centre) - radius) / np.max(np.abs(s.path.values))
        speeds = s.velocity(s.mesh.nodes)
        largest = max(np.linalg.norm(p), np.max(np.abs(inertia(case, q) @ speeds)))
        return max(off, float(np.linalg.norm(p - (p @ normal) * normal)) / largest)

    return problem, missed


KINDS = {"transfers": transfer, "surfaces": surface}


def draws(which: int, count: int) -> list[tuple[Random, np.ndarray, np.ndarray]]:
    """Return the systems of a range of durations, and the last states of their motions."""
    shortest, longest = list(BINS.values())[which]
    out, seed = [], 0
    while len(out) < count:
        case = Random((SEED, which, seed), shortest, longest)
        seed += 1
        parts = case.masses, case.vectors, case.potential
        clocked = any(np.any(part.omega) for part in parts)
        if case.n in (2, 3) and not clocked and not np.any(case.friction):
            last = case.end()
            if last is not None:
                out.append((case, *last))
    return out


def measure(kind: str, which: int, count: int) -> list[Row]:
    """Return the row of a range of durations."""
    outcomes = []
    for case, q1, v1 in draws(which, count):
        problem, missed = KINDS[kind](case, q1, v1)
        solution, spent = timed(problem, TOL)

        def off(s, case=case, missed=missed):
            return max(distance(s, case.acceleration), missed(s))

        outcomes.append(judged(solution, off, TOL, spent, ACCURACY))
    return [row(outcomes)]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    return [
        measured(f"{kind}, {name}", measure, kind, k, 3 if quick else COUNT)
        for kind in KINDS
        for k, name in enumerate(BINS)
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    found = []
    for kind in KINDS:
        for name in BINS:
            what = f"{kind}, {name}"
            own = mine(rows, what)
            found += [never_wrong(what, own), all_solved(what, own, MOST)]
    return found
