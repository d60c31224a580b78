"""How time and memory grow with duration, degrees of freedom and tolerance.

    python -m benchmarks.scaling [--quick] [--report-only]

Every measurement runs in a process of its own on one thread; memory is the growth of its peak
beyond the imports. Writes `docs/benchmarks/scaling.{json,md,png}`.
"""

from __future__ import annotations

import argparse
import json
from time import process_time

import matplotlib
import numpy as np

import actionopt as ao
from actionopt import scenes
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.transcription import Transcription
from actionopt.tools.files import rounded, write
from actionopt.tools.progress import steps
from benchmarks import child
from benchmarks.problems.lattice import lagrangian
from benchmarks.report import FOLDER
from benchmarks.results import table, text

ELEMENTS = (100, 1000, 10_000)
LINKS = (10, 30, 100)  # in Cartesian coordinates, with one constraint a link
ANGLES = (5, 10, 20, 30, 50, 70, 100)  # a pendulum of so many links, no constraints
BODIES = (3, 5, 10, 20, 50)
LATTICES = (8, 32, 128, 512)  # masses
SLOW, SWIFT = 0.3, 0.6  # deviation of their places and rates at the start
SEEDS = 5  # questions of a size, drawn at random
MASSES = (10, 100, 1000, 10_000)
DURATIONS = (2.5, 7.9, 25.1, 79.1)  # of a pendulum: 1 to 32 periods, roughly
FILLED = 16, 12  # elements and degree on which factors are counted
LIMIT = 30.0  # seconds a measurement


def elements(count: int) -> dict:
    """Solve the double pendulum on `count` elements of degree 4, from a coarse solution."""
    problem = scenes.get("double_pendulum", end=(0.3, 0.2), duration=0.5).problem
    coarse = ao.solve(problem, tol=1e-6)
    return _timed(problem, mesh=ao.Mesh.uniform(0.0, 0.5, count, 4), guess=coarse)


def chain(links: int) -> dict:
    """Solve a hanging chain of so many links."""
    scene = scenes.get("chain", links=links, l=1.0 / links, amplitude=0.1)
    return _timed(scene.problem, guess=scene.guess)


def angles(links: int) -> dict:
    """Solve a small swing of a pendulum of so many links, unit masses and lengths, in angles."""

    def lagrangian(q, v, t):
        x, y = np.cumsum(np.cos(q) * v), np.cumsum(np.sin(q) * v)
        return (x @ x + y @ y) / 2 + 9.81 * np.sum(np.cumsum(np.cos(q)))

    first = np.linspace(0.05, 0.15, links)
    system = ao.System(lagrangian, [f"a{j}" for j in range(links)])
    return _timed(ao.Problem(system, ao.Event(0.0, first), ao.Event(0.5, -first / 2)))


def bodies(count: int) -> dict:
    """Solve so many bodies of equal mass that attract each other, past a third of their sizes."""
    return _drawn(lambda seed: _bodies(count, seed))


def _bodies(count: int, seed: int) -> ao.Problem:

    def lagrangian(q, v, t):
        V = 0.0
        for i in range(count):
            for j in range(i):
                r = q[3 * i : 3 * i + 3] - q[3 * j : 3 * j + 3]
                V = V - 1 / (count * np.sqrt(r @ r))
        return (v @ v) / 2 - V

    rng = np.random.default_rng(seed)
    at = rng.normal(size=(count, 3))
    at *= rng.uniform(0.3, 1, (count, 1)) * count ** (1 / 3) / np.linalg.norm(at, axis=1)[:, None]
    then = at + 0.3 * rng.normal(size=at.shape)
    system = ao.System(lagrangian, [f"x{j}" for j in range(3 * count)])
    return ao.Problem(system, ao.Event(0.0, at.ravel()), ao.Event(0.5, then.ravel()))


def fput(masses: int, spread: float = SLOW) -> dict:
    """Solve a row of masses on stiffening springs, held by soft ones at both ends."""

    def lagrangian(q, v, t):
        d = q[1:] - q[:-1]
        return v @ v / 2 - np.sum(d**2) / 2 - np.sum(d**4) / 4 - q[0] ** 2 - q[-1] ** 2

    return _drawn(lambda seed: _between_ends_of_a_motion(lagrangian, masses, spread, seed))


def fput_swift(masses: int) -> dict:
    """Solve the same twice as far from rest, where paths are saddles."""
    return fput(masses, SWIFT)


def toda(masses: int) -> dict:
    """Solve a row of masses that repel each other exponentially."""

    def lagrangian(q, v, t):
        return v @ v / 2 - np.sum(np.exp(q[:-1] - q[1:]))

    return _drawn(lambda seed: _between_ends_of_a_motion(lagrangian, masses, SLOW, seed))


def _between_ends_of_a_motion(lagrangian, masses: int, spread: float, seed: int) -> ao.Problem:
    """Return the problem of a motion from random places at random rates.

    Between two random places there may be none near the line: scaled up from rest, the path of 16
    or 32 masses of `fput` turns back at 0.7 to 0.8 of ends of deviation 0.3.
    """
    q, v = np.random.default_rng((masses, seed)).normal(0.0, spread, (2, masses))
    names = [f"q{j}" for j in range(masses)]
    motion = ao.integrate(ao.System(lagrangian, names), ao.State(0.0, q, v), 1.0, tol=1e-8)
    # A system of its own: what the motion derived is not there yet.
    return ao.Problem(ao.System(lagrangian, names), ao.Event(0.0, q), ao.Event(1.0, motion(1.0)))


def _drawn(ask) -> dict:
    """Return the row of the median time of some random questions, and how many are solved.

    Each has its part of the time; those that are not solved count with what they took.
    """
    rows = [_timed(ask(seed), seconds=LIMIT / (2 * SEEDS)) for seed in range(SEEDS)]
    solved = [row for row in rows if not row["status"]] or rows
    middle = sorted(solved, key=lambda row: row["time"])[len(solved) // 2]
    count = sum(not row["status"] for row in rows)
    return {**middle, "solved": f"{count} of {SEEDS}", "longest": max(r["time"] for r in rows)}


def lattice(masses: int) -> dict:
    """Solve a row of so many masses on stiffening springs, below the first conjugate time."""
    k = np.arange(1, masses + 1)
    shape = np.sin(np.pi * k / (masses + 1))
    system = ao.System(lagrangian, [f"u{j}" for j in k], parameters={"beta": 1.0})
    return _timed(ao.Problem(system, ao.Event(0.0, shape), ao.Event(1.0, 0.5 * shape)))


def duration(T: float) -> dict:
    """Follow a pendulum for a time T through a guess of a tenth of its swing off."""
    scene = scenes.get("pendulum", duration=T)
    return _timed(scene.problem, guess=lambda t: 0.97 * scene.exact(t))


def tolerance(tol: float) -> dict:
    """Solve the double pendulum to a tolerance."""
    problem = scenes.get("double_pendulum", end=(0.3, 0.2), duration=0.5).problem
    return _timed(problem, tol=tol)


def _timed(problem: ao.Problem, **options) -> dict:
    clock = process_time()
    solution = ao.solve(problem, throw=False, **options)
    return {
        "time": process_time() - clock,
        "unknowns": solution.stats["unknowns"] + solution.stats["rows"],
        "status": "" if solution.success else solution.status.name,
        "iterations": solution.stats["iterations"],
    }


def fill(links: int) -> tuple[float, float]:
    """Return nonzeros and operations of a chain's sparse factors, parts of those of blocks.

    Blocks are dense, tridiagonal in time: the nodes inside each element, then those between. As
    for all factors, the squares of the columns are what they cost.
    """
    problem = scenes.get("chain", links=links, l=1.0 / links, amplitude=0.1).problem
    mesh = Mesh.uniform(problem.start.t, problem.end.t, *FILLED)
    layout = Transcription(problem, mesh, problem.lengths).layout
    rows, _ = layout.kkt.sparsity.ldl()
    sparse = np.bincount(np.array(rows.row()), minlength=layout.size) + 1.0
    (elements, degree), width = FILLED, problem.system.n + problem.system.m
    inside = np.arange((degree - 1) * width, 0, -1) + 2.0 * width
    between = np.arange(width, 0, -1) + 1.0 * width
    nonzeros, operations = (
        np.sum(sparse**k) / (elements * np.sum(inside**k) + (elements - 1) * np.sum(between**k))
        for k in (1, 2)
    )
    return float(nonzeros), float(operations)


STUDIES = {  # the function of that name: what it is given
    "elements": (ELEMENTS, "elements of degree 4, double pendulum"),
    "chain": (LINKS, "links of a Cartesian chain"),
    "angles": (ANGLES, "links of a pendulum in angles"),
    "bodies": (BODIES, "bodies that attract each other"),
    "fput": (LATTICES, "masses of an FPUT lattice, ends of a motion"),
    "fput_swift": (LATTICES, "the same, twice as far from rest"),
    "toda": (LATTICES, "masses of a Toda lattice, ends of a motion"),
    "lattice": (MASSES, "masses of a lattice"),
    "duration": (DURATIONS, "duration of a pendulum's motion (s)"),
    "tolerance": ((1e-3, 1e-6, 1e-9, 1e-12), "tolerance, double pendulum"),
}
Rows = dict[str, dict[str, dict]]


def measured(quick: bool) -> Rows:
    """Return the rows by study and value."""
    todo = [(s, v) for s, (values, _) in STUDIES.items() for v in values[: -1 if quick else None]]
    rows: Rows = {study: {} for study in STUDIES}
    for study, value in steps(todo):
        found = child.row(f"benchmarks.scaling:{study}", value, limit=LIMIT)
        rows[study][repr(value)] = rounded(found)
    return rows


def figure(rows: Rows, file) -> None:
    """Draw time and memory of every study."""
    from benchmarks.figures import plt, save

    fig, axes = plt.subplots(2, len(rows), figsize=(3.2 * len(rows), 5.6), squeeze=False)
    for (study, points), column in zip(rows.items(), axes.T, strict=True):
        good = {float(k): p for k, p in points.items() if not p["status"]}
        x = sorted(good)
        for ax, key, unit in zip(column, ("time", "memory"), (1.0, 1e6), strict=True):
            y = [max(good[k][key], 1e4 if key == "memory" else 1e-6) / unit for k in x]
            ax.loglog(x, y, "ko-", markersize=4)
            if x and study != "tolerance":
                ax.loglog(x, [y[-1] * k / x[-1] for k in x], "C0:", linewidth=1, label="linear")
            low, high = ax.get_ylim()
            middle = (low * high) ** 0.5
            ax.set_ylim(min(low, middle / 4), max(high, middle * 4))
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_minor_formatter(matplotlib.ticker.NullFormatter())
            ax.grid(True, alpha=0.3)
        column[1].set_xlabel(STUDIES[study][1], fontsize=8)
        if study == "tolerance":
            for ax in column:
                ax.invert_xaxis()
    axes[0, 0].set_ylabel("time (s)")
    axes[1, 0].set_ylabel("memory (MB)")
    axes[0, 0].legend(frameon=False)
    fig.tight_layout()
    save(fig, file)


def page(rows: Rows) -> str:
    """Return the page."""
    cells = []
    for study, points in rows.items():
        for value, p in points.items():
            head = [STUDIES[study][1], value]
            if "unknowns" not in p:
                cells.append([*head, *[""] * 7, p["status"]])
                continue
            u = max(p["unknowns"], 1)
            count = ", ".join(f"{k} {v}" for k, v in p["iterations"].items())
            solved = p.get("solved", "")
            sizes = (p["time"], p["time"] / u * 1e3, p["memory"] / 1e6, p["memory"] / u / 1e3)
            cells.append([*head, f"{u}", *(f"{x:.3g}" for x in sizes), count, solved, p["status"]])
    columns = ("study", "", "unknowns", "time, s", "ms an unknown", "MB", "kB an unknown")
    shares = [f"{links} links {a:.2g} and {b:.2g}" for links in LINKS[1:] for a, b in [fill(links)]]
    lines = [
        "# Scaling",
        "",
        "Made by `python -m benchmarks.scaling`; tol = 1e-8 unless varied.",
        "",
        "![scaling](scaling.png)",
        "",
        *table([*columns, "iterations", "solved", ""], cells, right=range(1, 7)),
        "",
        "Chains have sparse factors, ordered by minimum degree. On {} elements of degree {} their "
        "nonzeros and operations are these parts of those of dense blocks, tridiagonal in time: "
        "{}.".format(*FILLED, "; ".join(shares)),
    ]
    return "\n".join(lines)


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--quick", action="store_true", help="leave the largest of each out; print the page only")
    add("--report-only", action="store_true", help="measure nothing")
    options = parser.parse_args()
    file = FOLDER / "scaling.json"
    rows = json.loads(file.read_text()) if options.report_only else measured(options.quick)
    if options.quick:
        print(page(rows))
        return
    write(file, text(rows, 2) + "\n")
    write(file.with_suffix(".md"), page(rows) + "\n")
    figure(rows, file)


if __name__ == "__main__":
    main()
