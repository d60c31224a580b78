"""Closed paths of one energy that are families, random members of them, and others that are single.

All bounded orbits close of a Kepler problem, of isotropic and commensurable oscillators, and of an
oscillator with a term 1/x^2 in one coordinate, whose motions all have one period. In n coordinates
those of one energy are 2n - 1 dimensions, the phase among them; index and nullity are constant
along them, and were counted in Fourier coefficients and the duration. The controls are normal
modes of anharmonic oscillators, which nothing but their phase moves.
"""

from __future__ import annotations

import time
from functools import cache, partial

import numpy as np

import actionopt as ao
from benchmarks.stress.case import Case, Criterion, Row, answer, every, members, mine

TITLE = "Closed paths of one energy: families and single ones"
COUNTS = {name: (12, 1) for name in ("isotropic", "two to one", "Kepler", "isochronous")}
SINGLE = (12, 1)
INDEX = {"isotropic": 3, "two to one": 5, "Kepler": 1, "isochronous": 5}
NULLITY = 3
ENERGY = {"isotropic": 1.0, "two to one": 1.0, "Kepler": -0.5, "isochronous": 1.5}
SEED = 31
TURN = np.linspace(0.0, 2 * np.pi, 33)


@cache
def systems() -> dict[str, ao.System]:
    """Return them, derived once."""

    def anharmonic(q, v, t, *, a, b):
        x, y = q
        return (v @ v - x**2 - 2.3 * y**2) / 2 - a * x**4 - b * y**4 - a * x**2 * y**2

    laws = {
        "isotropic": lambda q, v, t: (v @ v - q @ q) / 2,
        "two to one": lambda q, v, t: (v @ v - q[0] ** 2 - 4 * q[1] ** 2) / 2,
        "Kepler": lambda q, v, t: v @ v / 2 + 1 / np.sqrt(q @ q),
        "isochronous": lambda q, v, t: (v @ v - q @ q - 0.2 / q[0] ** 2) / 2,
    }
    found = {name: ao.System(law, ["x", "y"]) for name, law in laws.items()}
    single = ao.System(anharmonic, ["x", "y"], parameters={"a": 0.1, "b": 0.1})
    return {**found, "single": single}


def waypoints(name: str, rng: np.random.Generator) -> np.ndarray:
    """Return points (2, K) on a member, roughly: they are equally far apart in another time."""
    turn, c = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 0.8)
    if name == "two to one":
        return np.array(
            [np.sqrt(2) * c * np.cos(TURN), np.sqrt((1 - c * c) / 2) * np.sin(2 * TURN + turn)]
        )
    if name == "isochronous":
        y = 1.2 * np.sqrt(1 - c * c) * np.sin(TURN + turn)
        return np.array([1.05 + 0.6 * c * np.cos(2 * TURN), y])
    if name == "Kepler":
        points = np.array([np.cos(TURN) - c, np.sqrt(1 - c * c) * np.sin(TURN)])
    else:
        points = np.array([c * np.cos(TURN), np.sqrt(2 - c * c) * np.sin(TURN)])
    s, k = np.sin(turn), np.cos(turn)
    return np.array([[k, -s], [s, k]]) @ points


def member(name: str, k: int) -> list[Row]:
    """Return the row of a random member of a family."""
    rng = np.random.default_rng([SEED, list(COUNTS).index(name), k])
    problem = ao.Problem(
        systems()[name], ao.Event(0.0, None), ao.Periodic(None), energy=ENERGY[name]
    )
    return [_row(problem, waypoints(name, rng), float(rng.choice([1e-6, 1e-8, 1e-10])))]


def single(k: int) -> list[Row]:
    """Return the row of a normal mode along y, or x, of random anharmonicity and energy."""
    rng = np.random.default_rng([SEED, 100, k])
    a, b, along, E = rng.uniform(0.02, 0.3), rng.uniform(0.02, 0.3), k % 2, rng.uniform(0.1, 1.0)
    problem = ao.Problem(
        systems()["single"],
        ao.Event(0.0, None),
        ao.Periodic(None),
        energy=E,
        parameters={"a": a, "b": b},
    )
    points = np.zeros((2, TURN.size))
    points[along] = np.sqrt(2 * E / (1.0, 2.3)[along]) * 0.9 * np.cos(TURN)
    return [_row(problem, points, 1e-8)]


def _row(problem: ao.Problem, guess: np.ndarray, tol: float) -> Row:
    clock = time.process_time()
    solution = ao.solve(problem, guess=guess, tol=tol, throw=False)
    row, counted = answer(solution, time.process_time() - clock), solution.inertia
    return row | {"index": counted.index, "nullity": counted.nullity, "moves": counted.moves}


def cases(quick: bool) -> list[Case]:
    """Return them."""
    kinds = {name: partial(member, name) for name in COUNTS} | {"single": single}
    return members(kinds, {**COUNTS, "single": SINGLE}, quick)


def criteria(rows) -> list[Criterion]:
    """Return them."""
    found = []
    for name in COUNTS:
        of = mine(rows, name)
        right = [r["status"] == "DEGENERATE" and r["nullity"] == NULLITY for r in of]
        found.append(every(f"{name}: DEGENERATE, nullity {NULLITY}", sum(right), len(of)))
        same = sum(r["index"] == INDEX[name] for r in of)
        found.append(every(f"{name}: index {INDEX[name]}", same, len(of)))
    of = mine(rows, "single")
    right = [r["success"] and r["nullity"] == r["moves"] == 1 for r in of]
    found.append(every("single: SOLVED, nullity of the phase alone", sum(right), len(of)))
    return found
