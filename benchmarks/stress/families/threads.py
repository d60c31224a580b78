"""Several threads at one system: the same bits as one thread finds.

Eight threads solve the same 200 problems of one new System, each from another one on; the
derivation of the system, too, is asked for by all at once. And two solutions of one system have
their energy read by a thread each, 4000 times. Threads take turns every 10 microseconds. *Wrong*
counts the answers that differ in any bit from those of one thread.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Barrier
from time import perf_counter

import numpy as np

import actionopt as ao
from actionopt import Event, Problem, System
from actionopt.scenes import rod_pendulum
from benchmarks.stress.case import Case, Criterion, Row, digest, measured, mine
from benchmarks.stress.tally import counted

TITLE = "Threads"
THREADS, SOLVES, READS = 8, 200, 4000
SEED = 23
TURN = 1e-5  # s


def driven() -> System:
    """Return a new pendulum with a restoring force beside it, pushed in time."""
    return System(
        lambda q, v, t, *, g: (
            v @ v / 2 + g * np.cos(q[0]) - q[1] ** 4 / 4 + np.sin(2 * t) * q[0] * q[1]
        ),
        ["theta", "y"],
        parameters={"g": 9.81},
    )


def rod() -> System:
    """Return a new pendulum with its rod as a constraint."""
    values = {"m": 1.0, "l": 1.0, "g": 9.81}
    L, f = rod_pendulum.lagrangian, rod_pendulum.constraint
    return System(L, ["x", "y"], parameters=values, constraint=f)


SYSTEMS = {"driven pendulum": driven, "rod": rod}


def problems(name: str, count: int) -> list[Problem]:
    """Return problems of one new system."""
    system, random, out = SYSTEMS[name](), np.random.default_rng(SEED), []
    for _ in range(count):
        q0, q1 = random.uniform(-1.0, 1.0, (2, 2))
        if name == "rod":
            q0, q1 = ([np.sin(q[0]), -np.cos(q[0])] for q in (q0, q1))
        out.append(Problem(system, Event(0.0, q0), Event(random.uniform(0.4, 1.2), q1)))
    return out


@contextmanager
def often():
    """Let threads take turns within a call, not only between calls."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(TURN)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def at_once(work: Callable, inputs: Sequence, threads: int) -> list[list]:
    """Return what `work` gives for all inputs in every thread.

    The threads begin together, each at another input.
    """
    begin = Barrier(threads)

    def run(thread):
        first = thread * len(inputs) // threads
        begin.wait()
        order = [(first + k) % len(inputs) for k in range(len(inputs))]
        found = {k: work(inputs[k]) for k in order}
        return [found[k] for k in range(len(inputs))]

    with often(), ThreadPoolExecutor(threads) as pool:
        return list(pool.map(run, range(threads)))


def compared(alone: Sequence[bytes], found: Sequence[Sequence[bytes]]) -> int:
    """Return how many of the threads' answers differ from those of one thread."""
    return sum(a != b for thread in found for a, b in zip(alone, thread, strict=True))


def solving(name: str, count: int, threads: int = THREADS) -> list[Row]:
    """Return the row of one system solved in several threads; times are of one solve there."""

    def work(problem):
        clock = perf_counter()
        solution = ao.solve(problem, throw=False)
        return digest(solution), solution.status.name, perf_counter() - clock

    alone = [work(p)[0] for p in problems(name, count)]
    found = at_once(work, problems(name, count), threads)
    every = [x for thread in found for x in thread]
    wrong = compared(alone, [[x[0] for x in thread] for thread in found])
    return [{**counted([x[1] for x in every], [x[2] for x in every]), "wrong": wrong}]


def reading(name: str, count: int) -> list[Row]:
    """Return the row of two solutions, each read by a thread; times are of one reading."""
    solutions = [ao.solve(p) for p in problems(name, 2)]
    times = [np.linspace(0, s.problem.end.t, 50) for s in solutions]
    alone = [s.energy(t).tobytes() for s, t in zip(solutions, times, strict=True)]

    def work(k):
        clock = perf_counter()
        wrong = sum(solutions[k].energy(times[k]).tobytes() != alone[k] for _ in range(count))
        return wrong, (perf_counter() - clock) / count

    with often(), ThreadPoolExecutor(2) as pool:
        found = list(pool.map(work, range(2)))
    alike = counted(["SOLVED"] * 2 * count, [x[1] for x in found])
    return [{**alike, "wrong": sum(x[0] for x in found)}]


def cases(quick: bool) -> list[Case]:
    """Return them."""
    solves, reads = (20, 400) if quick else (SOLVES, READS)
    return [
        measured(f"{kind} {name}", m, name, k)
        for kind, m, k in (("solving", solving, solves), ("energies of", reading, reads))
        for name in SYSTEMS
    ]


def criteria(rows) -> list[Criterion]:
    """Return them."""
    out = []
    for kind, what in (("solving", "8 threads x 200 solves"), ("energies of", "two readers")):
        own = mine(rows, kind)
        count, wrong = (sum(r[k] for r in own) for k in ("count", "wrong"))
        what = f"{what}: other bits than one thread"
        out.append(Criterion(what, f"0 of {count}", f"{wrong}", not wrong))
    return out
