"""Rough guesses: points of a motion of ten links, each a little off.

The motions of a chain (links of 0.1 m, unit masses) over 0.6 s, from random angles up to 0.6 rad
and rates of 0.6 rad/s; the ends are the motion's, the guess are points of it at equal times, in x
and y, each moved by up to a part of a link both ways. The same question is put in angles, those
of the same points. A path counts that is a motion, whichever; `same` are those along the motion the
points were taken from. scipy's `solve_bvp` starts from the same points, with accelerations and
Jacobians derived by hand, the first few times.
"""

from __future__ import annotations

from functools import cache
from time import process_time

import numpy as np

import actionopt as ao
from actionopt import Event, Problem, System
from actionopt.scenes.chain import positions
from benchmarks import problems
from benchmarks.arithmetic import NUMPY
from benchmarks.peers import scipy_bvp
from benchmarks.peers._peer import Failed
from benchmarks.problems.chain import LINKS, L, acceleration
from benchmarks.problems.chain import cases as chains
from benchmarks.stress.case import Case, Criterion, Row, measured, mine, timed
from benchmarks.stress.forward import miss, motion
from benchmarks.stress.tally import counted, judged, right_and_solved, row

TITLE = "Rough guesses"
T, ANGLE, RATE, SEED, TOL = 0.6, 0.6, 0.6, 15, 1e-8
# Points, how far off in parts of a link, and how many in a hundred may be lost.
GUESSES = {
    "33 points 3 % off": (33, 0.03, 5),
    "33 points 10 % off": (33, 0.1, 10),
    "17 points": (17, 0.0, 10),
    "65 points 3 % off": (65, 0.03, 5),
}
COUNT, COMPARED = 100, 6
MAX_NODES = 1000  # of a peer, whose matrix has 80 rows a node; ours have some 300
SAME = 1e-6  # m
NAMES = {"chain_cartesian": "x and y", "chain_angles": "angles"}


@cache
def question(seed: int):
    """Return the motion's angles, (LINKS, K) of (K,) times."""
    random = np.random.default_rng((SEED, seed))
    first = random.uniform(-ANGLE, ANGLE, LINKS), random.normal(0.0, RATE, LINKS)
    return motion(lambda q, v, t: acceleration(q, v, t, NUMPY), *first, T, 1e-11)


def points(seed: int, count: int, off: float) -> np.ndarray:
    """Return x and y of so many points of the motion, (2 LINKS, count), each a little off."""
    random = np.random.default_rng((SEED, seed, count))
    exact = positions(L, question(seed)(np.linspace(0.0, T, count)))
    return exact + off * L * random.uniform(-1.0, 1.0, exact.shape)


def angles(q: np.ndarray) -> np.ndarray:
    """Return the links' angles (LINKS, K) for x and y (2 LINKS, K)."""
    x, y = (np.diff(part, axis=0, prepend=0.0) for part in (q[0::2], q[1::2]))
    return np.unwrap(np.arctan2(x, -y), axis=1)


@cache
def system(name: str) -> tuple[problems.Case, System]:
    """Return the chain in these coordinates, as the peers and as the package are told it."""
    known = next(case for case in chains() if case.name == name)
    options = {"parameters": known.parameters, "constraint": known.constraint}
    return known, System(known.lagrangian, known.coordinates, **options)


def ask(name: str, seed: int, count: int, off: float) -> tuple[Problem, np.ndarray]:
    """Return the question and the guess."""
    swing, guess = question(seed), points(seed, count, off)
    ends = swing(np.array([0.0, T]))
    if name == "chain_cartesian":
        ends = positions(L, ends)
    else:
        guess = angles(guess)
    events = (Event(t, q) for t, q in zip((0.0, T), ends.T, strict=True))
    return Problem(system(name)[1], *events), guess


def along(solution: ao.Solution, name: str, seed: int) -> bool:
    """Whether the path is the motion that the points were taken from."""
    t = np.linspace(0.0, T, 101)
    q, known = solution(t), positions(L, question(seed)(t))
    q = q if name == "chain_cartesian" else positions(L, q)
    return solution.success and bool(np.max(np.abs(q - known)) < SAME)


def collocation(name: str, problem: Problem, guess: np.ndarray) -> tuple[str, float]:
    """Return what `solve_bvp` says, and the time it took."""
    clock, t = process_time(), np.linspace(0.0, T, guess.shape[1])
    start, end = (np.asarray(e.q, dtype=float) for e in (problem.start, problem.end))
    state = np.concatenate([guess, np.gradient(guess, t, axis=1)])
    try:
        with np.errstate(all="ignore"):
            ends = problems.Ends(start, end, guess)
            scipy_bvp.solve(system(name)[0], ends, t, state, TOL, max_nodes=MAX_NODES)
        said = "SOLVED"
    except (Failed, ValueError, np.linalg.LinAlgError) as error:
        said = str(error)
    return said, process_time() - clock


def measure(name: str, kind: str, count: int, compared: int) -> list[Row]:
    """Return the rows of one kind of guess: ours, and that of collocation."""
    outcomes, others, same = [], [], 0
    for seed in range(count):
        problem, guess = ask(name, seed, *GUESSES[kind][:2])
        solution, spent = timed(problem, TOL, guess=guess)
        outcomes.append(judged(solution, miss, TOL, spent))
        same += along(solution, name, seed)
        if seed < compared:
            others.append(collocation(name, problem, guess))
    said, times = zip(*others, strict=True)
    return [{**row(outcomes), "same": same}, {"solver": "solve_bvp", **counted(said, times)}]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    count, compared = (4, 1) if quick else (COUNT, COMPARED)
    return [
        measured(f"{title}, {kind}", measure, n, kind, count, compared)
        for n, title in NAMES.items()
        for kind in GUESSES
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    out = []
    for title in NAMES.values():
        for kind, (_, _, lost) in GUESSES.items():
            name = f"{title}, {kind}"
            out += right_and_solved(name, mine(rows, name), lost / 100)
    return out
