"""How time and memory grow with duration, degrees of freedom and tolerance.

    python -m benchmarks.scaling [--quick]

Every measurement runs in a process of its own on one thread; memory is the growth of its peak
beyond the imports. Writes `docs/benchmarks/scaling.{json,md,svg,png}`.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time

import numpy as np

from benchmarks.runner import ONE_THREAD

ELEMENTS = (100, 1000, 10_000)
LINKS = (10, 30, 100)  # in Cartesian coordinates, with one constraint a link
MASSES = (10, 100, 1000)
DURATIONS = (2.5, 7.9, 25.1, 79.1)  # of a pendulum: 1 to 32 periods, roughly
LIMIT = 30.0  # seconds a measurement


def elements(count: int) -> dict:
    """Solve the double pendulum on `count` elements of degree 4, from a coarse solution."""
    import actionopt as ao
    from actionopt import scenes

    problem = scenes.get("double_pendulum", end=(0.3, 0.2), duration=0.5).problem
    coarse = ao.solve(problem, tol=1e-6)
    first = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    clock = time.process_time()
    mesh = ao.Mesh.uniform(0.0, 0.5, count, 4)
    solution = ao.solve(problem, mesh=mesh, guess=coarse, throw=False)
    return _result(solution, clock, first)


def chain(links: int) -> dict:
    """Solve a hanging chain of so many links."""
    import actionopt as ao
    from actionopt import scenes

    scene = scenes.get("chain", links=links, l=1.0 / links, amplitude=0.1)
    return _timed(ao, scene.problem, guess=scene.guess)


def lattice(masses: int) -> dict:
    """Solve a row of so many masses on stiffening springs, below the first conjugate time."""
    import actionopt as ao
    from benchmarks.problems.lattice import lagrangian

    k = np.arange(1, masses + 1)
    shape = np.sin(np.pi * k / (masses + 1))
    system = ao.System(lagrangian, [f"u{j}" for j in k], parameters={"beta": 1.0})
    start, end = ao.Event(0.0, shape), ao.Event(1.0, 0.5 * shape)
    return _timed(ao, ao.Problem(system, start, end))


def duration(T: float) -> dict:
    """Follow a pendulum for a time T through a guess of a tenth of its swing off."""
    import actionopt as ao
    from actionopt import scenes

    scene = scenes.get("pendulum", duration=T)
    return _timed(ao, scene.problem, guess=lambda t: 0.97 * scene.exact(t))


def tolerance(tol: float) -> dict:
    """Solve the double pendulum to a tolerance."""
    import actionopt as ao
    from actionopt import scenes

    problem = scenes.get("double_pendulum", end=(0.3, 0.2), duration=0.5).problem
    return _timed(ao, problem, tol=tol)


def _timed(ao, problem, **options) -> dict:
    first = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    clock = time.process_time()
    solution = ao.solve(problem, throw=False, **options)
    return _result(solution, clock, first)


def _result(solution, clock: float, first: int) -> dict:
    seconds = time.process_time() - clock
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - first) * 1024
    return {
        "time": seconds,
        "memory": memory,
        "unknowns": solution.stats["unknowns"] + solution.stats["rows"],
        "status": "" if solution.success else solution.status.name,
        "parts": solution.stats["time"],
        "iterations": solution.stats["iterations"],
    }


STUDIES = {
    "elements": (elements, ELEMENTS, "elements of degree 4, double pendulum"),
    "chain": (chain, LINKS, "links of a Cartesian chain"),
    "lattice": (lattice, MASSES, "masses of a lattice"),
    "duration": (duration, DURATIONS, "duration of a pendulum's motion (s)"),
    "tolerance": (tolerance, (1e-3, 1e-6, 1e-9, 1e-12), "tolerance, double pendulum"),
}


def measured(study: str, value: float) -> dict:
    """Run one measurement in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.scaling", "--one", study, repr(value)]
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=LIMIT,
            env={**os.environ, **ONE_THREAD},
        )
    except subprocess.TimeoutExpired:
        return {"status": f"no answer in {LIMIT:g} s"}
    if done.returncode:
        return {"status": done.stderr.strip().splitlines()[-1]}
    return json.loads(done.stdout.splitlines()[-1])


def figure(rows: dict[str, dict[str, dict]], file) -> None:
    """Draw time and memory of every study."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

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
                axis.set_minor_formatter(NullFormatter())
            ax.grid(True, alpha=0.3)
        column[1].set_xlabel(STUDIES[study][2], fontsize=8)
        if study == "tolerance":
            for ax in column:
                ax.invert_xaxis()
    axes[0, 0].set_ylabel("time (s)")
    axes[1, 0].set_ylabel("memory (MB)")
    axes[0, 0].legend(frameon=False)
    fig.tight_layout()
    for ending in (".svg", ".png"):
        fig.savefig(file.with_suffix(ending), dpi=110)


def page(rows: dict[str, dict[str, dict]]) -> str:
    """Return the table."""
    lines = [
        "# Scaling",
        "",
        "Made by `python -m benchmarks.scaling`; tol = 1e-8 unless varied.",
        "",
    ]
    lines += ["![scaling](scaling.svg)", ""]
    lines += [
        "| study | | unknowns | time, s | ms an unknown | MB | kB an unknown | iterations | |"
    ]
    lines += ["|---|---:|---:|---:|---:|---:|---:|---|---|"]
    for study, points in rows.items():
        for value, p in points.items():
            if "time" not in p:
                lines.append(f"| {STUDIES[study][2]} | {value} | | | | | | | {p['status']} |")
                continue
            u = max(p["unknowns"], 1)
            count = ", ".join(f"{k} {v}" for k, v in p["iterations"].items())
            lines.append(
                f"| {STUDIES[study][2]} | {value} | {u} | {p['time']:.3g} | "
                f"{p['time'] / u * 1e3:.3g} | {p['memory'] / 1e6:.3g} | "
                f"{p['memory'] / u / 1e3:.3g} | {count} | {p['status']} |"
            )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run the command."""
    from benchmarks.report import FOLDER

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="leave the largest of each out")
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        study, value = options.one
        print(
            json.dumps(
                STUDIES[study][0](float(value) if "." in value or "e" in value else int(value))
            )
        )
        return
    rows: dict[str, dict[str, dict]] = {}
    for study, (_, values, _) in STUDIES.items():
        rows[study] = {}
        for value in values[: -1 if options.quick else None]:
            print(f"\r\033[K{study} {value:g}", end="", file=sys.stderr, flush=True)
            rows[study][repr(value)] = measured(study, value)
    print(file=sys.stderr)
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, text in (("scaling.json", json.dumps(rows, indent=1)), ("scaling.md", page(rows))):
        part = FOLDER / f"{name}.part"
        part.write_text(text)
        os.replace(part, FOLDER / name)
    figure(rows, FOLDER / "scaling")


if __name__ == "__main__":
    main()
