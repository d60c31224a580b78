"""How time and memory grow with duration, degrees of freedom and tolerance.

    python -m benchmarks.scaling [--quick] [--report-only]

Every measurement runs in a process of its own on one thread; memory is the growth of its peak
beyond the imports. Writes `docs/benchmarks/scaling.{json,md,png}`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from functools import partial
from time import process_time

import numpy as np

import actionopt as ao
from actionopt import scenes
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.tools.files import rounded, write
from actionopt.tools.progress import steps
from actionopt.tools.types import Array
from benchmarks import child, many, peers
from benchmarks.problems import Case
from benchmarks.report import FOLDER
from benchmarks.results import brief, table, text

ELEMENTS = (100, 1000, 10_000)
LINKS = (10, 30, 100)  # in Cartesian coordinates, with one constraint a link
ANGLES = (5, 10, 20, 30, 50, 70, 100)  # a pendulum of so many links, no constraints
BODIES = (3, 5, 10, 20, 50, 100)
ALONE = 100  # bodies of which one question takes what a measurement may
LATTICES = (8, 32, 128, 512)  # masses
MASSES = (10, 100, 1000, 10_000)
WAYPOINTS = (1, 10, 100, 1000)
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
    return _timed(**many.chain(links))


def angles(links: int) -> dict:
    """Solve a small swing of a pendulum of so many links, in angles."""
    return _timed(many.problem(many.pendulum(links)))


def bodies(count: int) -> dict:
    """Solve so many bodies that attract each other, past a third of their sizes."""
    return _drawn(QUESTIONS["bodies"](count))


def fput(masses: int) -> dict:
    """Solve a row of masses on stiffening springs between ends of a motion."""
    return _drawn(QUESTIONS["fput"](masses))


def fput_swift(masses: int) -> dict:
    """Solve the same twice as far from rest, where paths are saddles."""
    return _drawn(_seeded(lambda seed: many.fput(masses, seed, many.SWIFT)))


def toda(masses: int) -> dict:
    """Solve a row of masses that repel each other exponentially."""
    return _drawn(_seeded(lambda seed: many.toda(masses, seed)))


def _seeded(ask: Callable[[int], Case], several: bool = True) -> list[Callable[[], Case]]:
    return [partial(ask, seed) for seed in range(many.SEEDS if several else 1)]


# What peers are asked too: by study, a size's questions.
QUESTIONS: dict[str, Callable[[int], list[Callable[[], Case]]]] = {
    "angles": lambda links: [lambda: many.pendulum(links)],
    "bodies": lambda count: _seeded(lambda seed: many.bodies(count, seed), count < ALONE),
    "fput": lambda masses: _seeded(lambda seed: many.fput(masses, seed)),
}


def beside(study: str, peer: str, value: int) -> dict:
    """Ask a peer the questions of a study."""
    return many.asked(peer, QUESTIONS[study](value), LIMIT / 3)


def _drawn(cases: list[Callable[[], Case]]) -> dict:
    """Return the row of the median time of some random questions, and how many are solved.

    Each has its part of the time; those that are not solved count with what they took.
    """
    if len(cases) == 1:
        return _timed(many.problem(cases[0]()))
    rows = [_timed(many.problem(case()), seconds=LIMIT / (1.5 * len(cases))) for case in cases]
    solved = [row for row in rows if not row["status"]] or rows
    middle = sorted(solved, key=lambda row: row["time"])[len(solved) // 2]
    count = sum(not row["status"] for row in rows)
    return {**middle, "solved": f"{count} of {len(rows)}", "longest": max(r["time"] for r in rows)}


def lattice(masses: int) -> dict:
    """Solve a row of so many masses on stiffening springs, below the first conjugate time."""
    return _timed(**many.lattice(masses))


def waypoints(count: int) -> dict:
    """Solve an oscillator that passes so many places at given times, a tenth of a radian apart."""
    t = np.linspace(0.0, 0.1 * (count + 1), count + 2)
    system = ao.System(lambda q, v, t: (v[0] ** 2 - q[0] ** 2) / 2, ["x"])
    events = [ao.Event(*pair) for pair in zip(t, np.sin(3 * t)[:, None], strict=True)]
    return _timed(ao.Problem(system, events[0], events[-1], through=events[1:-1]))


def waypoints_unknown(count: int) -> dict:
    """Solve a body on a wavy line that passes so many places at times that are found."""
    x = np.linspace(0.0, 0.3 * (count + 1), count + 2)
    system = ao.System(lambda q, v, t: v[0] ** 2 / 2 - 0.1 * np.cos(q[0]), ["x"])
    events = [ao.Event(None, [place]) for place in x]
    start, end = events[0].at(0.0), events[-1].at(0.1 * (count + 1))
    return _timed(ao.Problem(system, start, end, through=events[1:-1]))


def duration(T: float) -> dict:
    """Follow a pendulum for a time T through a guess of a tenth of its swing off."""
    scene = scenes.get("pendulum", duration=T)
    exact = scene.exact
    assert exact is not None
    return _timed(scene.problem, guess=lambda t: 0.97 * exact(t))


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
    problem = many.chain(links)["problem"]
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
    "waypoints": (WAYPOINTS, "waypoints at given times"),
    "waypoints_unknown": (WAYPOINTS, "waypoints at times to be found"),
    "duration": (DURATIONS, "duration of a pendulum's motion (s)"),
    "tolerance": ((1e-3, 1e-6, 1e-9, 1e-12), "tolerance, double pendulum"),
}
BY_SIZE = {  # studies of many coordinates, in figures
    "chain": "chain, Cartesian",
    "angles": "links in angles",
    "bodies": "bodies",
    "fput": "FPUT",
    "fput_swift": "FPUT, twice as far",
    "toda": "Toda",
    "lattice": "lattice",
    "waypoints": "waypoints",
    "waypoints_unknown": "waypoints, times unknown",
}
BY_UNKNOWNS = {"elements": "double pendulum", "duration": "pendulum, longer", "lattice": "lattice"}
UNITS = {"time": ("time (s)", 1.0), "memory": ("memory (MB)", 1e6)}
LARGEST = 3  # sizes by which a power is told: small ones show what any solve costs
Rows = dict[str, dict[str, dict]]


def measured(quick: bool, keep: Callable[[Rows], object]) -> Rows:
    """Return the rows by study and value; those of a peer by "study peer"; `keep` has the last."""
    few = -1 if quick else None
    jobs = [(study, study, (v,)) for study, (values, _) in STUDIES.items() for v in values[:few]]
    for study in QUESTIONS:
        for peer in many.PEERS:
            values = STUDIES[study][0][:few]
            jobs += [(f"{study} {peer}", "beside", (study, peer, v)) for v in values]
    rows: Rows = {}
    for name, function, given in steps(jobs):
        known = rows.setdefault(name, {})
        if function == "beside" and any(row["status"] for row in known.values()):
            continue  # what is larger takes longer
        found = child.row(f"benchmarks.scaling:{function}", *given, limit=LIMIT)
        known[repr(given[-1])] = rounded(found)
        keep(rows)
    return rows


def curve(points: dict[str, dict], key: str, against: str = "") -> tuple[Array, Array]:
    """Return sizes, or what they are `against`, and times or memory of what was solved."""
    good = [(float(k), p) for k, p in points.items() if not p["status"]]
    x = [p[against] if against else k for k, p in good]
    return np.array(x), np.array([p[key] for _, p in good])


def power(points: dict[str, dict], key: str) -> float:
    """Return that of the size with which time or memory grows, by the largest sizes."""
    x, y = (a[-LARGEST:] for a in curve(points, key))
    return float(np.polyfit(np.log(x), np.log(y), 1)[0]) if x.size == LARGEST else np.nan


def figure(rows: Rows, file) -> None:
    """Draw time and memory against size, and the peers beside."""
    from benchmarks.figures import plt, save, style

    fig, axes = plt.subplots(3, 2, figsize=(8.0, 10.0))
    for ax, key in zip(axes[0], UNITS, strict=True):
        for k, (study, name) in enumerate(BY_SIZE.items()):
            _line(ax, *curve(rows.get(study, {}), key), key, label=name, color=f"C{k}")
        ax.set_title(f"{UNITS[key][0]}, many coordinates", fontsize=10)
        ax.set_xlabel("links, bodies, masses, waypoints")
    fig.legend(
        *axes[0, 0].get_legend_handles_labels(),
        fontsize=9,
        frameon=False,
        ncols=5,
        loc="upper center",
    )
    for ax, study in zip(axes[1:].flat, QUESTIONS, strict=False):
        _line(
            ax,
            *curve(rows.get(study, {}), "time"),
            "time",
            label="actionopt",
            **style("actionopt_"),
        )
        for peer in many.PEERS:
            points = curve(rows.get(f"{study} {peer}", {}), "time")
            _line(ax, *points, "time", label=peers.LABELS[peer], **style(peer))
        ax.set_title(f"time (s): {BY_SIZE[study]}", fontsize=10)
        ax.set_xlabel(STUDIES[study][1])
        ax.set_xticks(STUDIES[study][0], map(str, STUDIES[study][0]))
        ax.set_xticks([], minor=True)
    axes[1, 0].legend(fontsize=8, frameon=False)
    for k, (study, name) in enumerate(BY_UNKNOWNS.items()):
        x, y = curve(rows.get(study, {}), "time", "unknowns")
        _line(axes[2, 1], x, y, "time", label=name, color=f"C{k}")
    axes[2, 1].set_title("time (s), by unknowns", fontsize=10)
    axes[2, 1].set_xlabel("unknowns")
    axes[2, 1].legend(fontsize=8, frameon=False)
    fig.tight_layout(rect=(0, 0, 1, 0.95))
    save(fig, file)


def _line(ax, x: Array, y: Array, key: str, **style) -> None:
    style = {"marker": "o", "markersize": 4, **style}
    ax.loglog(x, y / UNITS[key][1], **style)
    ax.grid(True, which="major", alpha=0.3)


def page(rows: Rows) -> str:
    """Return the page."""
    cells, powers, times = [], [], []
    for study, (values, name) in STUDIES.items():
        for value, p in rows.get(study, {}).items():
            head = [name, value]
            if "unknowns" not in p:
                cells.append([*head, *[""] * 7, p["status"]])
                continue
            u = max(p["unknowns"], 1)
            count = ", ".join(f"{k} {v}" for k, v in p["iterations"].items())
            solved = p.get("solved", "")
            sizes = (p["time"], p["time"] / u * 1e3, p["memory"] / 1e6, p["memory"] / u / 1e3)
            cells.append([*head, f"{u}", *(f"{x:.3g}" for x in sizes), count, solved, p["status"]])
        if study in rows and (study in BY_SIZE or study in BY_UNKNOWNS):
            both = [power(rows[study], key) for key in UNITS]
            told = ["" if np.isnan(p) else f"{p:.1f}" for p in both]
            powers.append([name, *told, *(_solved(rows[study]) if study in BY_SIZE else ["", ""])])
        if any(name in rows for name in _beside(study)):
            for value in values:
                known = [rows.get(k, {}).get(repr(value)) for k in (study, *_beside(study))]
                times.append([name, f"{value}", *map(_told, known)])
    columns = ("study", "", "unknowns", "time, s", "ms an unknown", "MB", "kB an unknown")
    shares = [f"{links} links {a:.2g} and {b:.2g}" for links in LINKS[1:] for a, b in [fill(links)]]
    labels = [peers.LABELS[peer] for peer in ("actionopt_", *many.PEERS)]
    lines = [
        "# Scaling",
        "",
        "Made by `python -m benchmarks.scaling`; tol = 1e-8 unless varied.",
        "",
        "![scaling](scaling.png)",
        "",
        "## Powers",
        "",
        f"Time and memory grow with these powers of the size, over the largest {LARGEST} solved; "
        "and how many are solved of the smallest and the largest.",
        "",
        *table(["study", "time", "memory", "smallest", "largest"], powers, right=range(1, 5)),
        "",
        "## Beside others",
        "",
        "Seconds, and how many are solved where several are drawn at random; all begin at the "
        "straight line. `solve_bvp` has derivatives by hand and tol = {:.0e}, collocation {} "
        "elements of degree {}. No answer in {:.0f} s, or none at all, ends a column.".format(
            many.PEERS["scipy_bvp"], *many.PEERS["casadi_collocation"], LIMIT
        ),
        "",
        *table(["study", "", *labels], times, right=range(1, 5)),
        "",
        "## All",
        "",
        *table([*columns, "iterations", "solved", ""], cells, right=range(1, 7)),
        "",
        "Chains have sparse factors, ordered by minimum degree. On {} elements of degree {} their "
        "nonzeros and operations are these parts of those of dense blocks, tridiagonal in time: "
        "{}.".format(*FILLED, "; ".join(shares)),
    ]
    return "\n".join(lines)


def _beside(study: str) -> list[str]:
    return [f"{study} {peer}" for peer in many.PEERS]


def _told(row: dict | None) -> str:
    """Return a row as a cell: its time, and how many are solved."""
    if row is None:
        return ""
    if row["status"]:
        return brief(row["status"])
    several = row.get("solved", "of 1")
    return f"{row['time']:.3g}" + ("" if several.endswith("of 1") else f" ({several})")


def _solved(points: dict[str, dict]) -> list[str]:
    """Return how many of the smallest and the largest are solved."""
    ends = [points[k] for k in (min(points, key=float), max(points, key=float))]
    return [p.get("solved", "no" if p["status"] else "yes") for p in ends]


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--quick", action="store_true", help="leave the largest of each out; print the page only")
    add("--report-only", action="store_true", help="measure nothing")
    options = parser.parse_args()
    file = FOLDER / "scaling.json"

    def keep(rows: Rows) -> None:
        if not options.quick:
            write(file, text(rows, 2) + "\n")

    rows = json.loads(file.read_text()) if options.report_only else measured(options.quick, keep)
    if options.quick:
        print(page(rows))
        return
    write(file.with_suffix(".md"), page(rows) + "\n")
    figure(rows, file)


if __name__ == "__main__":
    main()
