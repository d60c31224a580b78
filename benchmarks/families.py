"""Many members of a family: together, one by one, and by scipy's solver.

    python -m benchmarks.families [--quick]

The end and its time vary on a grid, gone through row by row, to and fro. Each is asked for an error
of 1e-9; the true one is the distance from the motion that is integrated forward from the path's own
start. One process on one thread, seconds of its processor, the least of several turns that are
taken in turn. The page `docs/families.md` is written by this command.
"""

from __future__ import annotations

import argparse
import datetime
from functools import cache
from pathlib import Path
from time import process_time

import numpy as np
from scipy.integrate import solve_ivp

import actionopt as ao
from actionopt import scenes
from actionopt.families.batch import Members, member, solve_run
from actionopt.tools.files import write
from actionopt.tools.progress import steps
from benchmarks import child
from benchmarks.peers import scipy_bvp
from benchmarks.problems import Case, Ends, load
from benchmarks.results import table, versions

PAGE = Path(__file__).parents[1] / "docs" / "families.md"
PACKAGES = ("actionopt", "casadi", "numpy", "scipy")
TOL = 1e-9
TURNS, ALONE, OTHERS, SAMPLE = 3, 60, 6, 20  # turns, members one by one, by scipy, integrated
MEMORY = (1000, 4000, 16_000)  # members
MEASURABLE = 1e-12  # a smaller true error is that of the integration
GRIDS = {  # name: rows and columns, ranges of the end's time and of one coordinate there
    "pendulum": ((0.4, 0.8), "theta", (-0.8, 0.6)),
    "double_pendulum": ((0.9, 1.1), "theta1", (-0.4, 0.0)),
    "kepler": ((2.3, 2.7), "y", (0.2, 0.4)),
}


@cache
def family(name: str, rows: int = 40, cols: int = 25) -> tuple[ao.Problem, dict]:
    """Return a problem and the columns of a grid, neighbour after neighbour."""
    (early, late), coordinate, (low, high) = GRIDS[name]
    problem = scenes.get(name).problem
    times = np.repeat(np.linspace(early, late, rows), cols).reshape(rows, cols)
    ends = np.tile(np.linspace(low, high, cols), (rows, 1))
    ends[1::2] = ends[1::2, ::-1]
    return problem, {"t1": times.ravel(), ("end", coordinate): ends.ravel()}


def together(name: str) -> tuple[float, Members]:
    """Return seconds a member, and the members."""
    problem, columns = family(name)
    started = process_time()
    found = solve_run(problem, columns, TOL)
    return (process_time() - started) / len(found.status), found


def one_by_one(name: str, first: int) -> float:
    """Return seconds a member, of some that are solved from the one before."""
    problem, columns = family(name)
    last = ao.solve(member(problem, columns, first), tol=TOL)
    started = process_time()
    for i in range(first + 1, first + 1 + ALONE):
        last = ao.solve(member(problem, columns, i), tol=TOL, guess=last)
    return (process_time() - started) / ALONE


def by_scipy(name: str, first: int, found: Members) -> tuple[float, float]:
    """Return seconds a member, and the largest distance from the members found."""
    problem, columns = family(name)
    case, spent, error = load()[name], 0.0, 0.0
    answer, before = None, 1.0
    for i in range(first, first + OTHERS + 1):
        asked = member(problem, columns, i)
        ends = Ends(np.array(asked.start.q), np.array(asked.end.q), np.zeros((case.n, 0)))
        path, duration = found.path(i), asked.duration
        if answer is None:
            x = np.linspace(0.0, duration, scipy_bvp.FIRST_MESH)
            y = np.concatenate([path(x), path.velocity(x) * case.time_unit])
            answer = scipy_bvp.solve(case, ends, x, y, TOL)
        else:
            mesh, last = answer.state
            started = process_time()
            answer = scipy_bvp.solve(case, ends, mesh * (duration / before), last(mesh), TOL)
            spent += process_time() - started
        before = duration
        t = np.linspace(0.0, duration, 201)
        size = np.abs(path(t)).max(axis=1, keepdims=True)
        error = max(error, float((np.abs(answer.curve(t) - path(t)) / size).max()))
    return spent / OTHERS, error


def true_errors(name: str, found: Members) -> np.ndarray:
    """Return the true errors of a sample, (S, 2), and their estimates beside them."""
    problem, columns = family(name)
    case: Case = load()[name]
    pairs = []
    for i in np.linspace(0, len(found.status) - 1, SAMPLE).astype(int):
        asked, path = member(problem, columns, i), found.path(i)
        p0 = found.momenta[i, 0]
        q0 = np.array(asked.start.q, dtype=float)
        v0 = problem.system.velocity(q0, p0, 0.0, path.velocity(0.0), parameters=asked.parameters)
        t = np.linspace(0.0, asked.duration, 201)
        motion = solve_ivp(
            case.rhs, (0.0, t[-1]), np.r_[q0, v0], "DOP853", t, rtol=1e-13, atol=1e-15
        )
        size = np.abs(path(t)).max(axis=1, keepdims=True)
        apart = float((np.abs(motion.y[: case.n] - path(t)) / size).max())
        pairs.append((apart, float(found.error[i])))
    return np.array(pairs)


def held(count: int) -> dict:
    """Solve so many pendulums; return the bytes of what is returned."""
    problem, columns = family("pendulum", count // 25)
    found = solve_run(problem, columns, TOL)
    return {"held": sum(v.base.nbytes for v in _bases(found))}


def _bases(found: Members) -> list[np.ndarray]:
    """Return the arrays that the values of members are parts of, once each."""
    return list({id(v.base): v for v in found.values if v.base is not None}.values())


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one turn, and no page")
    quick = parser.parse_args().quick
    turns, rows, members = 1 if quick else TURNS, [], []
    for name in steps(list(GRIDS)):
        one, many, other, far, found = np.inf, np.inf, np.inf, 0.0, None
        for turn in range(turns):
            seconds, found = together(name)
            many = min(many, seconds)
            one = min(one, one_by_one(name, 500 + turn * ALONE))
            spent, apart = by_scipy(name, 500 + turn * OTHERS, found)
            other, far = min(other, spent), max(far, apart)
        assert found is not None
        errors = true_errors(name, found)
        rows.append(
            (
                name.replace("_", " "),
                f"{1e6 * many:.0f} µs",
                f"{1e3 * one:.2f} ms",
                f"{one / many:.0f}",
                f"{1e3 * other:.0f} ms",
                f"{other / many:.0f}",
            )
        )
        members.append(
            (
                name.replace("_", " "),
                f"{found.success.sum()} of {len(found.status)}",
                f"{found.alone.sum()}",
                f"{found.iterations.mean():.2f}",
                f"{errors[:, 0].max():.1e}",
                f"{found.error.max():.1e}",
                f"{(errors[:, 0] <= np.maximum(errors[:, 1], MEASURABLE)).mean():.0%}",
                f"{far:.1e}",
            )
        )
    memory = []
    for count in MEMORY[: 1 if quick else None]:
        found, peak = child.run("benchmarks.families:held", count)
        rest = peak - found["held"]
        memory.append((f"{count}", f"{peak / 1e6:.0f} MB", f"{rest / 1e6:.0f} MB"))
    text = _page(rows, members, memory)
    print(text)
    if not quick:
        write(PAGE, text)


def _page(rows: list, members: list, memory: list) -> str:
    """Return the page."""
    intro = __doc__.split("\n\n")[2]
    lines = [
        "# Many members of a family",
        "",
        f"Made by `python -m benchmarks.families`, {datetime.date.today()}; {versions(*PACKAGES)}.",
        "",
        intro.rsplit(" The page", 1)[0].replace("\n", " "),
        "",
        "Seconds a member, of a thousand. One by one is `solve(problem, guess=neighbour)`; scipy's",
        "`solve_bvp` begins with its own answer for the neighbour, on its mesh, and has Jacobians.",
        "",
        *table(
            ("family", "together", "one by one", "times", "`solve_bvp`", "times"),
            rows,
            range(1, 6),
        ),
        "",
        f"True errors are those of {SAMPLE} members; `solve_bvp` is compared with them where it",
        "was asked.",
        "",
        *table(
            (
                "family",
                "solved",
                "left to `solve`",
                "factorizations",
                "true error",
                "estimate",
                "true <= estimate",
                "from `solve_bvp`",
            ),
            members,
            range(1, 8),
        ),
        "",
        "Memory at its peak, of pendulums, and less the paths that are returned.",
        "",
        *table(("members", "peak", "less the paths"), memory, range(3)),
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
