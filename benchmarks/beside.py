"""What stands beside a solve, as ratios to it: analysis, guesses, other kinds, many, searches.

    python -m benchmarks.beside [--quick]

The solve and the other are measured in turn on one thread, each question in a process of its own.
The page `docs/benchmarks/beside.md` is written by this command.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from itertools import product
from time import perf_counter, process_time
from typing import Any

import numpy as np

import actionopt as ao
from actionopt import scenes
from actionopt.tools import process
from actionopt.tools.files import write
from actionopt.tools.progress import steps
from benchmarks import child, many
from benchmarks.problems.lattice import lagrangian as fput
from benchmarks.results import DOCS, brief, made_by, table
from benchmarks.scaling import LARGEST, power

PAGE = DOCS / "benchmarks" / "beside.md"
TURNS, ENOUGH, LIMIT, TOL = 3, 1.0, 12.0, 1e-8  # after ENOUGH seconds no turn begins
SIZES, TOLERANCES = (2, 5, 20), (1e-6, 1e-12)


def row(solve: Callable[[], Any], other: Callable[[Any], Any], parts: int = 1) -> dict:
    """Return the least times of a solve and of what is beside it, which is given its answer."""
    spent, began = [math.inf] * 2, process_time()
    for _ in range(TURNS):
        clock = [process_time()]
        answer = solve()
        clock.append(process_time())
        other(answer)
        clock.append(process_time())
        spent = np.minimum(spent, np.diff(clock)).tolist()
        if clock[-1] - began > ENOUGH:
            break
    time = spent[1] / parts
    return {"solve": spent[0], "time": time, "ratio": time / spent[0], "status": ""}


def pendulum(T: float) -> dict:
    """Return the question of a pendulum's motion of a time."""
    return {"problem": scenes.get("pendulum", duration=T).problem}


FAMILIES: dict[str, tuple[Callable[[Any], dict], tuple[float, ...]]] = {
    "links of a Cartesian chain": (many.chain, (5, 10, 20)),
    "links in angles": (lambda n: {"problem": many.problem(many.pendulum(n))}, (5, 10, 20)),
    "masses of a lattice": (many.lattice, (10, 40, 160)),
    "duration of a pendulum's motion (s)": (pendulum, (2.5, 12.5, 62.5)),
}
ANALYSES: dict[str, Callable[[ao.Solution], Any]] = {
    "nothing": lambda s: None,
    "index": lambda s: s.morse_index,
    "conjugate points": ao.conjugate_points,
    "three modes": lambda s: ao.second_variation(s, count=3),
    "sensitivity": lambda s: s.sensitivity(),
    "compare": lambda s: s.compare(),
}


def analysis(family: str, what: str, size: float) -> dict:
    """Measure an analysis of a solution."""
    asked = FAMILIES[family][0](size)
    return row(lambda: ao.solve(**asked, tol=TOL), ANALYSES[what])


GUESSED: dict[str, Callable[[], dict]] = {
    "pendulum": lambda: pendulum(0.5),
    "pendulum, ten swings": lambda: pendulum(20.0),
    "double pendulum": lambda: {"problem": scenes.get("double_pendulum").problem},
    "rod pendulum": lambda: {"problem": scenes.get("rod_pendulum").problem},
    "10 links in angles": lambda: {"problem": many.problem(many.pendulum(10))},
    "FPUT lattice of 32": lambda: {"problem": many.problem(many.fput(32, 0))},
}
GUESSES: dict[str, Callable[[ao.Solution], Any]] = {
    "callable": lambda known: known.path.__call__,
    "9 points": lambda known: known(np.linspace(known.start.t, known.end.t, 9)),
    "Path": lambda known: known.path,
    "Solution": lambda known: known,
}


def guess(name: str, given: str, tol: float) -> dict:
    """Measure a solve with the motion as its guess, beside one without."""
    asked = GUESSED[name]()
    known = GUESSES[given](ao.solve(**asked, tol=tol))
    return row(
        lambda: ao.solve(**asked, tol=tol), lambda _: ao.solve(**asked, tol=tol, guess=known)
    )


def body(n: int, L: Callable[..., Any], start: Any, end: Any, **options: Any) -> ao.Problem:
    """Return the question how a body in n dimensions moves from -1 to 1 along the first."""
    system = ao.System(L, [f"x{k}" for k in range(n)], obstacle=options.pop("obstacle", None))
    first, aside = np.arange(n) == 0, options.pop("aside", 0.0)
    ends = ao.Event(start, np.where(first, -1.0, aside)), ao.Event(end, np.where(first, 1.0, aside))
    return ao.Problem(system, *ends, **options)


def hills(q, v, t):
    """L = v^2 / 2 - V, with V highest at both ends."""
    return v @ v / 2 + (1 - q[0] ** 2) ** 2 / 2 + sum(x**2 for x in q[1:]) / 2


def closed(n: int) -> ao.Problem:
    """Return the question how a lattice answers a force of a period."""
    names = [f"u{j}" for j in range(n)]
    driven = ao.System(lambda q, v, t: fput(q, v, t, beta=1.0) + np.sum(q) * np.cos(7 * t), names)
    return ao.Problem(driven, ao.Event(0.0, None), ao.Periodic(2 * math.pi / 7))


def loose(n: int, end: ao.Event, energy: bool = False) -> ao.Problem:
    """Return the question of a lattice whose end is another one."""
    known = many.lattice(n)["problem"]
    level = float(ao.solve(known).energy(0.5)) if energy else None
    return known.replace(end=ao.Event(end.t, known.end.q) if energy else end, energy=level)


def outside(q, t):
    """Keep out of a ball."""
    return q @ q - 0.25


def sphere(n: int) -> ao.Event:
    """Return an end on a sphere."""
    return ao.Event(1.0, None, on=lambda q, t: q @ q - n / 20)


KINDS: dict[str, Callable[[int], ao.Problem]] = {
    "free end": lambda n: loose(n, ao.Event(1.0, None)),
    "given energy": lambda n: loose(n, ao.Event(None, None), energy=True),
    "end on a sphere": lambda n: loose(n, sphere(n)),
    "closed, given period": closed,
    "infinite ends": lambda n: body(n, hills, -math.inf, math.inf),
    "round a ball": lambda n: body(n, lambda q, v, t: v @ v, 0.0, 1.0, obstacle=outside, aside=0.1),
}


def kind(name: str, n: int, tol: float) -> dict:
    """Measure a kind of question, beside the same path between events that are given.

    Round a ball it is the path that does not see it.
    """
    problem = KINDS[name](n)
    t, path = (0.0, 1.0), ao.solve(problem, tol=tol).path
    system, ends = problem.system, (problem.start, problem.end)
    if system.r:
        system = ao.System(lambda q, v, t: v @ v, system.coordinates)
    else:
        # Where it moves: ends farther out hardly tell when, and round-off of them is 1e-12.
        t = np.clip(path.mesh.boundaries[[0, -1]], -2.5, 2.5)
        ends = tuple(ao.Event(x, path(x)) for x in t)
    plain = ao.Problem(system, *ends, parameters=problem.parameters)
    return row(lambda: ao.solve(plain, tol=tol), lambda _: ao.solve(problem, tol=tol))


BETAS = np.linspace(0.9, 1.1, 41)
# Solves of a question with its guess, or none, the array or tuple that comes of many, and how far
# the parameter moves over these, from one neighbour to the next.
MANY: dict[str, tuple[Callable[[Any], dict], Callable[..., Any], tuple[int, ...], str, float]] = {
    "member of a sweep, lattice": (
        many.lattice,
        lambda problem: ao.sweep(problem, over={"beta": BETAS}, tol=TOL).status,
        (1, 4, 10, 20),
        "beta",
        np.ptp(BETAS),
    ),
    "member of a sweep, chain": (
        lambda n: {"problem": many.chain(n)["problem"]},  # no guess: a sweep is given none
        lambda problem: ao.sweep(problem, over={"g": 9.0 + BETAS}, tol=TOL).status,
        (5, 10),
        "g",
        np.ptp(BETAS),
    ),
    "point of a trace, lattice": (
        many.lattice,
        lambda problem, guess=None: ao.trace(problem, "beta", 1.5, guess=guess, tol=TOL).values,
        (1, 4, 10, 20),
        "beta",
        0.5,
    ),
    "point of a trace, chain": (
        many.chain,
        lambda problem, guess: ao.trace(problem, "g", 10.5, guess=guess, tol=TOL).values,
        (5, 10, 20),
        "g",
        0.69,
    ),
    "one of all paths, pendulum": (
        pendulum,
        lambda problem: ao.solve_all(problem, tol=TOL),
        (2,),
        "g",
        0.0,
    ),
}


def several(what: str, n: int) -> dict:
    """Measure one of many paths, beside a solve from its neighbour; a trace is given its first."""
    ask, work, _, name, reach = MANY[what]
    asked = ask(n)
    problem, guess = asked["problem"], ao.solve(**asked, tol=TOL)
    asked = {"problem": problem, "guess": guess} if what.startswith("point") else asked
    parts = len(work(**asked))
    value = float(problem.parameters[name]) + reach / parts
    other = problem.replace(parameters={name: value})
    return row(lambda: ao.solve(other, guess=guess, tol=TOL), lambda _: work(**asked), parts)


def catenoid(apart: float) -> ao.Problem:
    """Return the question of a film between rings that are too far apart."""
    known = scenes.get("catenoid").problem
    return known.replace(end=ao.Event(known.end.t, (apart, 1.0)))


def wells(q, v, t):
    """L = v^2 / 2 - V, with a barrier of height 1 between two wells."""
    return v @ v / 2 - (q @ q - 1) ** 2 - (q[1:] @ q[1:])


SEARCHES: dict[str, Callable[[], ao.Problem]] = {
    "energy below a barrier, n = 4": lambda: body(4, wells, 0.0, None, energy=0.5),
    "film beyond the fold": lambda: catenoid(1.4),
    "chain of 100 links, no guess": lambda: many.chain(100)["problem"],
    "end on a sphere, 100 masses": lambda: loose(100, sphere(100)),
}


def search(name: str, seconds: float) -> dict:
    """Measure a search that is given some seconds of wall time: by how many it is late."""
    problem, clock, wall = SEARCHES[name](), process_time(), perf_counter()
    verdict = ao.solve(problem, tol=TOL, throw=False, seconds=seconds).status.name
    late = max(perf_counter() - wall - seconds, 0.0)
    return {"time": process_time() - clock, "late": late, "verdict": verdict, "status": ""}


def start(code: str) -> dict:
    """Measure a start of Python, beside one that imports casadi and numpy, files compiled."""
    import resource  # there is none on Windows

    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    spent = [0.0]
    with tempfile.TemporaryDirectory() as environment["PYTHONPYCACHEPREFIX"]:
        for _, each in product(range(2 * TURNS), ("import casadi, numpy", code)):
            subprocess.run([sys.executable, "-c", each], check=True, env=environment)
            spent.append(sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]))
    base, whole = (min(np.diff(spent)[k::2]) for k in (0, 1))
    return {"solve": base, "time": whole, "ratio": whole / base, "status": ""}


def guards() -> dict[str, float]:
    """Return a number of each kind for `guard`: how many of the others a solve pays for."""
    rows = {
        "index of a chain": analysis("links of a Cartesian chain", "index", 20),
        "motion as the guess": guess("pendulum", "callable", 1e-12),
        "given energy": kind("given energy", 5, 1e-6),
        "round a ball": kind("round a ball", 2, 1e-6),
        "sweep": several("member of a sweep, lattice", 4),
        "trace": several("point of a trace, lattice", 4),
        "import": start("import actionopt"),
    }
    return {f"{name}, beside": float(1 / found["ratio"]) for name, found in rows.items()}


SIZED = {name: asked[-1] for name, asked in FAMILIES.items()}
SIZED |= {name: asked[2] for name, asked in MANY.items()}
ALL = ("solve", "time", "ratio", "memory")
# What is measured: the heading, what is asked in one process and what it is given there in turn,
# the columns of both and those of what is found.
PARTS: dict[str, tuple[str, list[tuple], Callable[[str], Any], list[str], tuple[str, ...]]] = {
    "analysis": (
        "What follows from a solution",
        list(product(FAMILIES, ANALYSES)),
        lambda family: [(n,) for n in SIZED[family]],
        ["family", "what", "size"],
        ALL,
    ),
    "guess": (
        "The motion itself as the guess, beside none",
        [(name,) for name in GUESSED],
        lambda _: product(GUESSES, TOLERANCES),
        ["problem", "guess", "tol"],
        ALL[:3],
    ),
    "kind": (
        "Other kinds of question, beside given events",
        [(name,) for name in KINDS],
        lambda _: product(SIZES, TOLERANCES),
        ["question", "n", "tol"],
        ALL[:3],
    ),
    "several": (
        "One of many, beside a solve from its neighbour",
        [(name,) for name in MANY],
        lambda what: [(n,) for n in SIZED[what]],
        ["what", "size"],
        ALL,
    ),
    "search": (
        "Searches with a limit (s)",
        [(name,) for name in SEARCHES],
        lambda _: [(0.5,), (5.0,)],
        ["what", "seconds"],
        ("time", "late", "verdict"),
    ),
    "start": (
        "Starts, beside the import of casadi and numpy",
        [("import actionopt",), ("import actionopt as ao; ao.solve",)],
        lambda _: [()],
        ["code"],
        ALL[:3],
    ),
}
SCALES = {"solve": 1e3, "time": 1e3, "memory": 1e-6}


def each(part: str, *asked: Any) -> list[tuple[tuple, dict]]:
    """Measure what one process is asked, for all that it is given in turn, while there is time."""
    rows, first = [], child.peak()
    for given in PARTS[part][2](asked[0]):
        found: dict = {"status": "not tried"}
        if process_time() < LIMIT:
            try:
                found = globals()[part](*asked, *given)
            except ao.SolveError as failure:
                found = {"status": str(failure)}
        rows.append(((part, *asked, *given), {**found, "memory": child.peak() - first}))
    return rows


def cells(found: dict, columns: tuple[str, ...]) -> list[str]:
    """Return a row as cells, in milliseconds and MB."""
    if found["status"]:
        return [brief(found["status"]), *[""] * (len(columns) - 1)]
    shown = [(found[k], SCALES.get(k, 1.0)) for k in columns]
    return [x if isinstance(x, str) else f"{x * scale:.3g}" for x, scale in shown]


def page(found: dict[tuple, dict]) -> str:
    """Return the page."""
    lines = ["# Beside a solve", "", made_by("beside", "actionopt", "casadi", "numpy"), ""]
    lines += [
        "Milliseconds of the processor; MB by which memory peaked, the solve included; and how",
        f"often the solve takes what stands beside it, to a tolerance of {TOL:g} if none is given.",
    ]
    for part, (title, _, _, first, columns) in PARTS.items():
        rows = [[*map(str, k[1:]), *cells(x, columns)] for k, x in found.items() if k[0] == part]
        right = range(len(first), len(first) + len(columns))
        lines += ["", f"## {title}", "", *table([*first, *columns], rows, right)]
    powers = [
        [*names, *(f"{power(points, key):.1f}" for key in ("time", "memory"))]
        for names, points in by_size(found).items()
        if len(points) >= LARGEST
    ]
    head = ["family", "what", "time", "memory"]
    title = f"## Powers of the size, by the largest {LARGEST}"
    lines += ["", title, "", *table(head, powers, (2, 3))]
    return "\n".join(lines) + "\n"


def by_size(found: dict[tuple, dict]) -> dict[tuple[str, str], dict[str, dict]]:
    """Return the rows of what was measured at several sizes, by its names and the size."""
    rows: dict[tuple[str, str], dict[str, dict]] = {}
    for (part, *names, last), row in found.items():
        if "time" not in row:
            continue
        if part == "analysis":
            rows.setdefault((names[0], names[1]), {})[f"{last}"] = row
        elif part == "several":
            rows.setdefault((names[0], ""), {})[f"{last}"] = row
        elif part == "kind":
            rows.setdefault((names[0], f"to {last:g}"), {})[f"{names[1]}"] = row
    return rows


def main() -> None:
    """Write the page; print a short one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the first of each; print the page")
    quick, found = parser.parse_args().quick, {}
    few = 1 if quick else None
    for part, asked in steps([(part, x) for part, row in PARTS.items() for x in row[1][:few]]):
        try:
            rows, _ = child.run("benchmarks.beside:each", part, *asked, limit=10 * LIMIT)
        except (TimeoutError, process.Died) as failure:
            rows = [((part, *asked), {"status": str(failure)})]
        found |= {tuple(k): x for k, x in rows}
    if quick:
        print(page(found))
    else:
        write(PAGE, page(found))


if __name__ == "__main__":
    main()
