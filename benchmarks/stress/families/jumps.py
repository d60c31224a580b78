"""Jumps of L in q, however they are written, and what is steep and does not jump.

A unit mass goes from random x0 to x1 in a unit of time, under V(x) = h step(x - c) + k x^2 / 2 with
random h, c and k. Without a motion across the step that the equations of either side tell, a path
that crosses it is not stationary: its energy jumps by h. Called solved it is *wrong*. A step that
is smooth, of a width of 1e-3 to 1e-7 of the way, has motions: a path that is called solved is wrong
if its energy differs by more than the claim lets it. The controls (kinks, walls of some width,
cusps, jumps in time) are to be solved, with the same energy.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

import numpy as np

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, Row, measured, mine
from benchmarks.stress.tally import Outcome, all_solved, never_wrong, row

TITLE = "Jumps in q"
COUNT, SEED = 6, 29
TOLERANCES = (1e-3, 1e-6, 1e-10)
CHANGE = 20.0  # of the energy, in its own size, times the error of a path
FORMS: dict[str, Callable] = {
    "comparison": lambda x: np.where(x > 0, 1.0, 0.0),
    "abs(x) / x": lambda x: abs(x) / x / 2,
    "x / abs(x)": lambda x: x / abs(x) / 2,
    "x / sqrt(x^2)": lambda x: x / np.sqrt(x**2) / 2,
    "power": lambda x: (x**2) ** 0.5 / x / 2,
    "x^3 / sqrt(x^6)": lambda x: x**3 / np.sqrt(x**6) / 2,
    "arctan(1 / x)": lambda x: np.arctan(1 / x) / np.pi,
    "arctan(y / x)": lambda x: np.arctan((3 + x) / x) / np.pi,
    "tanh(1 / x)": lambda x: np.tanh(1 / x) / 2,
    "1 / (1 + exp(1 / x))": lambda x: 1 / (1 + np.exp(1 / x)),
    "arctan(tan x)": lambda x: np.arctan(np.tan(x + np.pi / 2)) / np.pi,
    "arctan2": lambda x: np.arctan2(x, -1e-300) / np.pi,
    "floor": np.floor,
    "tanh(x / 1e-17)": lambda x: np.tanh(x / 1e-17) / 2,
}
WIDTHS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
SMOOTH: dict[str, Callable] = {
    "kink": abs,
    "wall": lambda x: np.tanh(x / 0.03) / 10,
    "arctan": lambda x: np.arctan(x / 0.1) / 10,
    "hill": lambda x: np.exp(-((x / 0.1) ** 2)) / 10,
    "root": lambda x: np.sqrt(x**2 + 0.01),
    "well": lambda x: -0.1 / (1 + (x / 0.2) ** 2),
}


def ask(seed: int, step: Callable, timed: bool = False) -> tuple[ao.Problem, float, bool]:
    """Return the question, where the step is, and whether it lies between the ends."""
    random = np.random.default_rng((SEED, seed))
    c, h, k = random.uniform(-0.5, 0.5), random.uniform(0.05, 1.0), random.uniform(0.0, 1.0)
    ends = random.uniform(-1.0, 1.0, 2)
    h *= random.choice([-1.0, 1.0])

    def lagrangian(q, v, t):
        held = np.arctan(1 / (t - 0.37)) * q[0] if timed else h * step(q[0] - c)
        return v[0] ** 2 / 2 - held - k * q[0] ** 2 / 2

    system = ao.System(lagrangian, ["x"])
    start, end = ao.Event(0.0, ends[:1]), ao.Event(1.0, ends[1:])
    return ao.Problem(system, start, end), c, bool((ends[0] < c) != (ends[1] < c))


def changed(solution: ao.Solution) -> float:
    """Return by how much the energy differs along the path, in units of the largest energies."""
    t = np.linspace(0.0, 1.0, 9)[[0, -1]]
    v, energy = solution.velocity(t)[0], solution.energy(t)
    return float(np.ptp(energy) / (np.abs(v).max() ** 2 + np.abs(energy).max()))


def outcome(problem: ao.Problem, tol: float, crossed: Callable[[ao.Solution], float]) -> Outcome:
    """Return what came of a solve; `crossed` tells the error of what is called solved."""
    clock = process_time()
    solution = ao.solve(problem, tol=tol, throw=False)
    spent = process_time() - clock
    error = crossed(solution) if solution.success else np.nan
    estimate = float(solution.error)
    status, rung = solution.status.name, solution.stats["rung"]
    return Outcome(status, solution.success, error, estimate, tol, spent, rung=rung)


def jumps(step: Callable, count: int) -> list[Row]:
    """Return the row of a form: solved are those that do not cross."""
    outcomes, right = [], 0
    for seed in range(count):
        for tol in TOLERANCES:
            problem, c, between = ask(seed, step)

            def crosses(solution, c=c):
                x = solution(np.linspace(0.0, 1.0, 4001))[0]
                return np.inf if x.min() < c - 1e-9 and x.max() > c + 1e-9 else 0.0

            outcomes.append(outcome(problem, tol, crosses))
            right += outcomes[-1].success is not between
    return [{**row(outcomes), "right": right}]


def steps(width: float, count: int) -> list[Row]:
    """Return the row of smooth steps of a width: an error is the energy's."""

    def step(x):
        return np.tanh(x / width) / 2

    asked = [(ask(seed, step)[0], tol) for seed in range(count) for tol in TOLERANCES]
    return [row([outcome(problem, tol, lambda s: changed(s) / CHANGE) for problem, tol in asked])]


def controls(step: Callable | None, count: int) -> list[Row]:
    """Return the row of what does not jump."""
    known = [ask(seed, step or abs, timed=step is None)[0] for seed in range(count)]

    def off(solution):
        return changed(solution) / CHANGE if step is not None else 0.0

    return [row([outcome(problem, tol, off) for problem in known for tol in TOLERANCES])]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    count = 2 if quick else COUNT
    out = [measured(f"jump: {name}", jumps, step, count) for name, step in FORMS.items()]
    out += [measured(f"step of {width:.0e}", steps, width, count) for width in WIDTHS]
    known = {**SMOOTH, "a jump in time": None}
    return out + [
        measured(f"control: {name}", controls, step, count) for name, step in known.items()
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    own, count = mine(rows, "jump"), sum(r["count"] for r in mine(rows, "jump"))
    right = sum(r["right"] for r in own)
    what = "jumps: solved where the ends are on one side, and else not"
    return [
        never_wrong("jumps", own),
        Criterion(what, f">= {0.95 * count:.0f} of {count}", f"{right}", right >= 0.95 * count),
        never_wrong("narrow steps", mine(rows, "step")),
        never_wrong("controls", mine(rows, "control")),
        all_solved("controls", mine(rows, "control"), 2),
    ]
