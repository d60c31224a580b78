"""Long and large: ten revolutions, a chain of fifty pendulums, a lattice of a thousand masses.

Time and memory are measured in a fresh process for each size, and fitted as a power of the
size; a power of one is linear growth. Kepler's time tells of the ways that are tried before one
leads to the path as well: from a circle, 2.5 revolutions take 19 factorizations of Newton's method
alone, and 5 to 20 take 130 to 210 of several ways, at a power of 0.6 to 0.7 among themselves.
"""

from __future__ import annotations

from functools import cache
from time import process_time

import numpy as np

import actionopt as ao
from actionopt import Event, Problem, System, scenes
from benchmarks import child
from benchmarks.problems.chain import G
from benchmarks.stress.case import Case, Criterion, Question, measured, mine, told
from benchmarks.stress.families._hanging import release

TITLE = "Long and large"
MASSES = (125, 250, 500, 1000)
REVOLUTIONS = (2.5, 5, 10, 20)
PENDULUMS = (10, 50)
LINEAR = 1.3  # largest power that counts as linear growth: meshes differ a little
MEMORY_FLOOR = 8e6  # bytes: less than this is noise of the allocator


def revolutions(count: float) -> Question:
    """Return so many revolutions of e = 0.3 from perihelion, less a tenth of one.

    The guess is a circle run through evenly.
    """
    scene = scenes.get("kepler", eccentricity=0.3, fraction=count - 0.1)

    def circle(t):
        return np.array([np.cos(t), np.sin(t)])

    return Question(scene.problem, scene.exact, circle, tol=1e-8)


def lattice(masses: int, duration: float = 1.0) -> Question:
    """Return masses in a row, joined by springs of force x + x^3, from one wave to another."""

    def lagrangian(q, v, t):
        stretch = q[1:] - q[:-1]
        return v @ v / 2 - np.sum(stretch**2 / 2 + stretch**4 / 4)

    system = System(lagrangian, [f"q{i}" for i in range(masses)], name="lattice")
    x = 2 * np.pi * np.arange(masses) / 100
    ends = Event(0.0, 0.3 * np.sin(3 * x)), Event(duration, 0.2 * np.cos(2 * x))
    return Question(Problem(system, *ends), tol=1e-6)


@cache
def pendulum_chain(links: int) -> System:
    """Return unit masses on links of length 1 / links, in angles from straight down."""

    def lagrangian(q, v, t):
        x_rate, y_rate, y, kinetic, height = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(links):
            x_rate = x_rate + np.cos(q[i]) * v[i] / links
            y_rate = y_rate + np.sin(q[i]) * v[i] / links
            y = y - np.cos(q[i]) / links
            kinetic = kinetic + (x_rate**2 + y_rate**2) / 2
            height = height + y
        return kinetic - G * height

    return System(lagrangian, [f"a{i}" for i in range(links)], name="pendulum chain")


def swing(links: int) -> Question:
    """Return the chain, released and followed while it falls."""
    first, last, T = release(links)
    return Question(Problem(pendulum_chain(links), Event(0.0, first), Event(T, last)), tol=1e-6)


QUESTIONS = {"revolutions": revolutions, "lattice": lattice, "swing": swing}


def solve(name: str, size: float) -> dict:
    """Return the row of a question solved in this process, the derivation included."""
    asked = QUESTIONS[name](size)
    clock = process_time()
    solution = ao.solve(asked.problem, tol=asked.tol, guess=asked.guess, throw=False)
    return told(asked, solution, process_time() - clock)


def measure(name: str, size: float) -> list[dict]:
    """Solve in a fresh process."""
    return [{**child.row(f"{__name__}:solve", name, size), "size": size}]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    masses = MASSES[:3] if quick else MASSES
    jobs = [
        *((f"Kepler, {k:g} revolutions", "revolutions", k) for k in REVOLUTIONS),
        *((f"lattice, {n} masses", "lattice", n) for n in masses),
        *((f"pendulum chain, {n}", "swing", n) for n in (PENDULUMS[:1] if quick else PENDULUMS)),
    ]
    return [measured(label, measure, *job) for label, *job in jobs]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    out = []
    for prefix in ("Kepler", "lattice", "pendulum chain"):
        own = mine(rows, prefix)
        good = [r for r in own if r["success"]]
        errors = [r["error"] for r in good if "error" in r]
        wrong = any(e > 1e-8 for e in errors)
        found = f"{len(good)}" + (f", true error {max(errors):.0e}" if errors else "")
        label = {
            "Kepler": f"Kepler, to {REVOLUTIONS[-1]} revolutions",
            "lattice": f"lattice, to {MASSES[-1]} masses",
        }
        out.append(
            Criterion(
                f"{label.get(prefix, prefix)}: a path",
                f"{len(own)}",
                f"{found}; longest {max(r['time'] for r in own):.2f} s",
                len(good) == len(own) and not wrong,
            )
        )
        if prefix != "pendulum chain":
            out += [_power(own, kind) for kind in ("time", "memory")]
    return out


def _power(rows, kind: str) -> Criterion:
    rows = [r for r in rows if r["success"]]
    size = np.array([r["size"] for r in rows])
    value = np.maximum([r[kind] for r in rows], MEMORY_FLOOR if kind == "memory" else 0.0)
    power = float(np.polyfit(np.log(size), np.log(value), 1)[0])
    scale, unit = (1e-6, "MB") if kind == "memory" else (1.0, "s")
    listed = ", ".join(f"{v * scale:.3g}" for v in value)
    what = rows[0]["case"].split(",")[0]
    by = "revolutions" if what == "Kepler" else "masses"
    return Criterion(
        f"{what}: {kind} against {by}",
        f"power <= {LINEAR}",
        f"{power:.2f} ({listed} {unit})",
        power <= LINEAR,
    )
