"""Many members of a family: together, one by one, and by scipy's solver; on several processes.

    python -m benchmarks.families [PART ...] [--quick]

The end and its time vary on a grid, gone through row by row, to and fro. Each is asked for an error
of 1e-9; the true one is the distance from the motion that is integrated forward from the path's own
start. One process on one thread, seconds of its processor, the least of several turns that are
taken in turn. The page `docs/families.md` is written by this command, part by part: `members`,
`transfers`, and `processes` and `dask`, which need a machine that does nothing else.
"""

from __future__ import annotations

import argparse
import math
import pickle
import runpy
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp

import actionopt as ao
from actionopt import scenes
from actionopt.families.sweeps import sweep as sweeping
from actionopt.families.sweeps.batch import solve_run
from actionopt.families.sweeps.members import Members, member
from actionopt.families.sweeps.runs import Runs
from actionopt.families.sweeps.task import work
from actionopt.tools.files import write
from actionopt.tools.progress import steps
from benchmarks import child
from benchmarks.peers import scipy_bvp
from benchmarks.problems import Case, Ends, load
from benchmarks.results import DOCS, made_by, table

ROOT = Path(__file__).parents[1]
PAGE = DOCS / "families.md"
PACKAGES = ("actionopt", "casadi", "numpy", "scipy")
TOL = 1e-9
TURNS, ALONE, OTHERS, SAMPLE = 3, 60, 6, 20  # turns, members one by one, by scipy, integrated
MEMORY = (1000, 4000, 16_000)  # members
DAYS, EMPTY, MANY = 300, 1000, 10**7  # of a side of the map; tasks that do nothing; members
SPHERE = (np.cos, np.sin), (lambda x: -np.sin(x), np.cos)  # outwards, and across
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


def by_scipy(name: str, first: int, found: Members) -> tuple[float, float, float]:
    """Return seconds a member, without Jacobians and with them, and the distance from `found`."""
    problem, columns = family(name)
    case, spent, error = load()[name], [0.0, 0.0], 0.0
    plain, answer, before = None, None, 1.0
    for i in range(first, first + OTHERS + 1):
        asked = member(problem, columns, i)
        ends = Ends(np.array(asked.start.q), np.array(asked.end.q), np.zeros((case.n, 0)))
        path, duration = found.path(i), asked.duration
        if plain is None or answer is None:
            x = np.linspace(0.0, duration, scipy_bvp.FIRST_MESH)
            y = np.concatenate([path(x), path.velocity(x)])
            plain = _plain(case, ends, x, y)
            y[case.n :] *= case.time_unit
            answer = scipy_bvp.solve(case, ends, x, y, TOL)
        else:
            mesh, last = answer.state
            started = process_time()
            plain = _plain(case, ends, plain.x * (duration / before), plain.y)
            between = process_time()
            answer = scipy_bvp.solve(case, ends, mesh * (duration / before), last(mesh), TOL)
            spent[0] += between - started
            spent[1] += process_time() - between
        before = duration
        t = np.linspace(0.0, duration, 201)
        size = np.abs(path(t)).max(axis=1, keepdims=True)
        for curve in (answer.curve(t), plain.sol(t)[: case.n]):
            error = max(error, float((np.abs(curve - path(t)) / size).max()))
    return spent[0] / OTHERS, spent[1] / OTHERS, error


def _plain(case: Case, ends: Ends, x: np.ndarray, y: np.ndarray):
    """Return what scipy finds from a guess y (2 n, K) at the nodes x (K,)."""
    n = case.n

    def conditions(a, b):
        return np.concatenate([a[:n] - ends.start, b[:n] - ends.end])

    return solve_bvp(case.rhs, conditions, x, y, tol=TOL, max_nodes=scipy_bvp.MAX_NODES)


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
    return {"held": sum(v.base.nbytes for v in _bases(found) if v.base is not None)}


def _bases(found: Members) -> list[np.ndarray]:
    """Return the arrays that the values of members are parts of, once each."""
    return list({id(v.base): v for v in found.values if v.base is not None}.values())


def begin_sweep(runs: Runs) -> sweeping._SweepRun:
    """Return a sweep of which no task is done."""
    run = sweeping._SweepRun(runs.grid, runs, None, None, None)  # type: ignore[arg-type]
    run.begin()
    return run


def members(turns: int) -> list[str]:
    """Return the part on members in one process."""
    rows, answers = [], []
    for name in steps(list(GRIDS)):
        one, many, others, far, found = np.inf, np.inf, [np.inf] * 2, 0.0, None
        for turn in range(turns):
            seconds, found = together(name)
            many = min(many, seconds)
            one = min(one, one_by_one(name, 500 + turn * ALONE))
            *spent, apart = by_scipy(name, 500 + turn * OTHERS, found)
            others, far = np.minimum(others, spent), max(far, apart)
        assert found is not None
        errors = true_errors(name, found)
        rows.append(
            (
                name.replace("_", " "),
                f"{1e6 * many:.0f} µs",
                f"{1e3 * one:.2f} ms",
                f"{one / many:.0f}",
                *(x for t in others for x in (f"{1e3 * t:.1f} ms", f"{t / many:.0f}")),
            )
        )
        answers.append(
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
    for count in MEMORY[:turns]:
        found, peak = child.run("benchmarks.families:held", count)
        rest = peak - found["held"]
        memory.append((f"{count}", f"{peak / 1e6:.0f} MB", f"{rest / 1e6:.0f} MB"))
    others = "`solve_bvp`", "times", "with Jacobians", "times"
    told = "factorizations", "true error", "estimate", "true <= estimate", "from `solve_bvp`"
    return [
        "The end and its time vary on a grid, gone through row by row, to and fro. Each is asked",
        "for an error of 1e-9; the true one is the distance from the motion that is integrated",
        "forward from the path's own start. One process on one thread, seconds of its processor,",
        "the least of several turns that are taken in turn.",
        "",
        "Seconds a member, of a thousand. One by one is `solve(problem, guess=neighbour)`; scipy's",
        "`solve_bvp` begins with its own answer for the neighbour, on its mesh.",
        "",
        *table(("family", "together", "one by one", "times", *others), rows, range(1, 8)),
        "",
        f"True errors are those of {SAMPLE} members; `solve_bvp` is compared with them where it",
        "was asked.",
        "",
        *table(("family", "solved", "left to `solve`", *told), answers, range(1, 8)),
        "",
        "Memory at its peak, of pendulums, and less the paths that are returned.",
        "",
        *table(("members", "peak", "less the paths"), memory, range(3)),
    ]


def transfers(turns: int) -> list[str]:
    """Return the part on transfers from the Earth to Mars, beside Izzo's solver."""
    from lamberthub import izzo2015  # pyright: ignore[reportMissingImports]

    example = runpy.run_path(str(ROOT / "examples" / "09_pork_chop.py"))
    mu, rows, count = example["mu"], [], DAYS if turns > 1 else 30
    for prograde in (True, False):  # compiles
        izzo2015(1.0, np.array([1.0, 0, 0]), np.array([0, 1.1, 0]), 1.5, prograde=prograde)
    for way, name in enumerate(example["WAYS"]):
        started = process_time()
        runs, _ = example["transfers"](count, way)
        between = process_time()
        (r, phi), (radial, h) = runs.ends[:, 0].T, runs.momenta[:, 0].T
        out, across = (np.array([f(phi), g(phi), 0 * phi]) for f, g in SPHERE)
        velocity = radial * out + h / r * across
        (there, angle), over = runs.ends[:, 1].T, runs.grid.columns(np.arange(runs.grid.size))
        q0, q1 = r * out, there * np.array([np.cos(angle), np.sin(angle), 0 * angle])
        flights, apart, answered = over["t1"] - over["t0"], [], 0
        solved = runs.success
        before = process_time()
        for i in range(runs.grid.size):
            try:
                v, _ = izzo2015(mu, q0[:, i], q1[:, i], flights[i], prograde=way == 0)
            except (RuntimeError, ValueError):  # it does not converge
                continue
            answered += 1
            if solved[i]:
                apart.append(np.linalg.norm(v - velocity[:, i]) / np.linalg.norm(v))
        spent = between - started, process_time() - before
        rows.append(
            (
                name,
                f"{solved.sum()} of {runs.grid.size}",
                f"{answered}",
                f"{max(apart):.1e}",
                *(f"{1e6 * t / runs.grid.size:.0f} µs" for t in spent),
            )
        )
    return [
        "`examples/09_pork_chop.py`: when to leave for Mars, both ways round the Sun. Lambert's",
        "problem has solvers of its own, which know that paths are conic sections; the one of",
        "lamberthub (Izzo's) is asked for every cell of the map. Velocities at the departure are",
        "compared; seconds are those of a cell.",
        "",
        *table(
            ("way", "solved", "Lambert's solver", "velocities differ by", "sweep", "its time"),
            rows,
            range(1, 6),
        ),
        "",
        "![speeds of departure](pork_chop.png)",
        "",
        "`examples/10_fronts.py`: the action of a double pendulum's paths from rest to all places.",
        "",
        "![fronts](fronts.png)",
        "",
        "Both pictures are made by `python docs/pictures.py`.",
    ]


def swept(executor: Executor | None, size: int) -> tuple[float, Runs]:
    """Return the seconds that a sweep of double pendulums takes, after a small one."""
    problem, columns = family("double_pendulum")
    over = {name: (min(row), max(row)) for name, row in columns.items()}
    ao.sweep(problem, {name: np.linspace(*row, 8) for name, row in over.items()}, executor=executor)
    sizes = zip(over.items(), (size, 100), strict=True)
    rows = {name: np.linspace(*row, count) for (name, row), count in sizes}
    started = perf_counter()
    runs = ao.sweep(problem, rows, executor=executor, tol=TOL)
    return perf_counter() - started, runs


def spent(given: tuple) -> float:
    """Return the seconds of the processor that a task takes."""
    started = process_time()
    work(*given)
    return process_time() - started


def processes(turns: int) -> list[str]:
    """Return the part on several processes.

    Where processors share what they have, two tasks at a time take longer, each: the most that two
    processes can be faster is measured by one task in both at once, which says nothing of a sweep.
    """
    size, seconds = 200 if turns > 1 else 20, {1: np.inf, 2: np.inf}
    runs, each = [], {1: np.inf, 2: np.inf}
    for _ in range(turns):
        for workers in seconds:
            with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
                for _ in pool.map(math.sqrt, range(8 * workers)):  # all are started
                    pass
                passed, found = swept(pool, size)
                given = begin_sweep(found)._arguments(0)
                last = [list(pool.map(spent, [given] * workers)) for _ in range(2)][-1]
            seconds[workers] = min(seconds[workers], passed)
            each[workers] = min(each[workers], float(np.mean(last)))
            runs.append(found)
    assert all(np.array_equal(found.action, runs[0].action) for found in runs)
    one, two = seconds.values()
    whole, most = runs[0], 2 * each[1] / each[2]
    return [
        f"A sweep of {whole.grid.size} double pendulums in {whole.stats['tasks']} tasks, by one",
        f"process and by two: {one:.2f} s and {two:.2f} s, a ratio of {one / two:.2f}. One task",
        f"takes {each[1]:.2f} s of a processor, and {each[2]:.2f} s beside another one: the",
        f"machine lets two processes be {most:.2f} times as fast as one.",
    ]


def dask(turns: int) -> list[str]:
    """Return the part on Dask's scheduler: what a task costs, and how many workers one feeds."""
    from distributed import Client, LocalCluster  # pyright: ignore[reportMissingImports]

    size, seconds = 200 if turns > 1 else 20, {"a pool": np.inf, "Dask": np.inf}
    local = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    with (
        LocalCluster(**local) as cluster,
        Client(cluster) as client,
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool,
    ):
        cluster_executor = client.get_executor()
        for _ in range(turns):
            for name, executor in (("a pool", pool), ("Dask", cluster_executor)):
                spent, runs = swept(executor, size)
                seconds[name] = min(seconds[name], spent)
        started = perf_counter()
        waiting = [cluster_executor.submit(_nothing, i) for i in range(EMPTY)]
        for future in as_completed(waiting):
            future.result()
        empty = (perf_counter() - started) / EMPTY
    run, tasks = begin_sweep(runs), runs.stats["tasks"]
    given = run._arguments(0)
    there = len(pickle.dumps(given))
    back = len(pickle.dumps(work(*given)))
    arrays = [runs.action, runs.error, runs.status, runs.momenta, runs.ends]
    member = sum(x.nbytes for x in arrays) / runs.grid.size
    task = seconds["a pool"] / tasks
    pool, far = seconds.values()
    many = MANY / run.length  # tasks
    return [
        f"The same {runs.grid.size} members in {tasks} tasks by one worker: {pool:.2f} s as a",
        f"process of a pool, {far:.2f} s with Dask's `LocalCluster`, {far / pool - 1:+.1%}.",
        "",
        f"A task takes {task:.2f} s; {there / 1e3:.0f} kB go there, {back / 1e3:.0f} kB come back.",
        f"One that does nothing takes Dask {1e3 * empty:.2f} ms, most of it the scheduler's, which",
        f"does one at a time: it feeds {task / empty:.0f} workers at most.",
        "",
        f"Ten million members are {many:.0f} tasks: {task * many / 3600:.1f} hours of a processor, "
        f"{task * many / 6000:.1f}",
        f"minutes of a hundred; {many * empty:.0f} s of the scheduler, "
        f"{many * back / 1e9:.1f} GB that come back, {MANY * member / 1e9:.1f} GB of",
        "arrays.",
    ]


def _nothing(i: int) -> int:
    """Be a task that does nothing."""
    return i


PARTS = {
    "members": ("One process", members),
    "transfers": ("Maps of two", transfers),
    "processes": ("Several processes", processes),
    "dask": ("One scheduler, and ten million members", dask),
}


def main() -> None:
    """Measure parts, and write them into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", nargs="*", choices=[[], *PARTS], help="all, if none is given")
    parser.add_argument("--quick", action="store_true", help="one turn, and no page")
    given = parser.parse_args()
    for part in given.part or PARTS:
        heading, measure = PARTS[part]
        made = made_by(f"families {part}", *PACKAGES)
        body = [made, "", *measure(1 if given.quick else TURNS)]
        print("\n".join(body))
        if not given.quick:
            _enter(heading, "\n".join(body))


def _enter(heading: str, body: str) -> None:
    """Write a part of the page, and leave the others as they are."""
    _, *parts = PAGE.read_text().split("\n## ")
    known = dict(part.split("\n\n", 1) for part in parts) | {heading: body}
    found = [f"## {name}\n\n{known[name].strip()}\n" for name, _ in PARTS.values() if name in known]
    write(PAGE, "\n".join(["# Many members of a family\n", *found]))


if __name__ == "__main__":
    main()
