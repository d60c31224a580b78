"""The floor of a cold solve: what CasADi and LAPACK alone take of it, whoever calls them.

    python -m benchmarks.floor [--error 1e-6] [--rounds 15]

The page `docs/benchmarks/floor.md` is written by this command.
"""

from __future__ import annotations

import argparse
import gc
import os
import warnings
from collections.abc import Callable
from statistics import geometric_mean, median
from time import process_time

import casadi as ca
import numpy as np

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.laws.expressions import Expressions
from actionopt.mechanics.laws.tracing import ParameterTable
from actionopt.tools.files import write
from actionopt.tools.process import ONE_THREAD
from benchmarks import peers, problems
from benchmarks.problems import Case
from benchmarks.results import DOCS, made_by, table

PAGE = DOCS / "benchmarks" / "floor.md"
PARTS = ("trace", "derive", "build", "evaluate", "factorize")
PEERS = ("actionopt_", "scipy_bvp")
EVICTED = 6 * 2**20  # numbers that are changed before each: more than a processor's caches hold


def bare(case: Case, mesh: Mesh, iterates: int) -> list[float]:
    """Return the seconds of each of `PARTS`, with nothing between the calls that is not needed.

    The second derivatives are evaluated at every node, and the blocks of all elements factorized,
    as often as there are iterates; numbers in the blocks are any.
    """
    n, clock = case.n, [process_time()]
    parameters = ParameterTable(case.parameters)
    q, v, t, p = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("t"), parameters.symbols()
    state = Expressions(q, 1), Expressions(v, 1), Expressions(t, 0)
    L = case.lagrangian(*state, **parameters.by_name(p)).sx
    clock.append(process_time())
    H, g = ca.hessian(L, ca.vertcat(q, v))
    clock.append(process_time())
    count = sum(d + 1 for d in mesh.degrees)
    function = ca.Function("L", [q, v, t, p], [L, g, ca.triu(H)]).map(count)
    buffer, evaluate = function.buffer()
    given = [np.ones(function.nnz_in(i)) for i in range(4)]
    found = [np.empty(function.nnz_out(i)) for i in range(3)]
    for i, numbers in enumerate(given):
        buffer.set_arg(i, memoryview(numbers))  # type: ignore[call-arg]
    for i, numbers in enumerate(found):
        buffer.set_res(i, memoryview(numbers))  # type: ignore[call-arg]
    clock.append(process_time())
    for _ in range(iterates):
        evaluate()
    clock.append(process_time())
    sizes = [(len(x.elements), n * (x.rule.degree + 1)) for x in mesh.groups]
    blocks = [np.eye(size) + np.ones((several, size, size)) for several, size in sizes]
    right = [np.ones((several, size, 1)) for several, size in sizes]
    clock.append(process_time())  # making them is not counted
    for _ in range(iterates):
        for A, b in zip(blocks, right, strict=True):
            np.linalg.solve(A, b)
    clock.append(process_time())
    parts = np.diff(clock).tolist()
    return [*parts[:4], parts[5]]


def ready(peer: peers.Peer, case: Case, error: float) -> Callable[[], peers.Answer] | None:
    """Return the cold solve at the roughest setting that comes to the error; None if none does."""
    ends = case.ends()[0]
    for start in case.starts:
        for setting in peer.settings:
            try:
                answer = peer.cold(case, ends, start, setting)
            except peers.Failed:
                continue
            if case.error(answer.curve, ends, answer.duration) <= error:
                return lambda: peer.cold(case, ends, start, setting)
    return None


def measured(case: Case, error: float, rounds: int) -> tuple[list[float], list[float], str]:
    """Return the medians of the seconds of `PARTS` and of `PEERS`, one by one, and the mesh."""
    solves = [ready(peers.get(name), case, error) for name in PEERS]
    assert solves[0] is not None
    solution = solves[0]().state
    iterates = max(sum(solution.stats["iterations"].values()), 1)
    memory = np.ones(EVICTED)

    def seconds(work: Callable[[], object]) -> float:
        memory[:] += 1.0
        started = process_time()
        work()
        return process_time() - started

    parts, whole = [], []
    for _ in range(rounds):
        memory[:] += 1.0
        parts.append(bare(case, solution.mesh, iterates))
        whole.append([np.inf if x is None else seconds(x) for x in solves])
    shown = f"{sum(d + 1 for d in solution.mesh.degrees)} x {iterates}"
    own, others = ([median(x) for x in zip(*rows, strict=True)] for rows in (parts, whole))
    return own, others, shown


def page(error: float, rounds: int) -> str:
    """Return the page."""
    head = ["problem", "nodes x iterates", *PARTS, "floor", "actionopt", "times floor", "solve_bvp"]
    cells, ratios = [], []
    for case in problems.load().values():
        if case.asks != "ends" or case.constraint is not None or case.size != "small":
            continue
        parts, whole, shown = measured(case, error, rounds)
        floor = sum(parts)
        ratios.append(whole[0] / floor)
        times = [f"{x * 1e3:.2f}" for x in (*parts, floor, whole[0])]
        bvp = f"{whole[1] * 1e3:.2f}" if np.isfinite(whole[1]) else "not reached"
        cells.append([case.title, shown, *times, f"{ratios[-1]:.1f}", bvp])
    lines = [
        "# The floor of a cold solve",
        "",
        made_by("floor", "actionopt", "casadi", "numpy", "scipy"),
        "",
        "What no implementation on CasADi can save, in milliseconds of the processor: the calls",
        "that trace the Lagrangian, derive its gradient and second derivatives, build the",
        "function of all nodes, evaluate it and factorize the blocks of all elements by LAPACK,",
        "the last two as often as actionopt iterates, on the mesh where it ends. Beside it the",
        "whole cold solve, from the Lagrangian to the path with its estimated error, and",
        "`solve_bvp`'s with derivatives by hand, either at its roughest setting that comes to an",
        f"error of {error:g}. Medians of {rounds} rounds, in turn, on one thread, the processor's",
        "caches emptied before each.",
        "",
        *table(head, cells, right=range(1, len(head))),
        "",
        f"In the geometric mean a cold solve takes {geometric_mean(ratios):.1f} times the floor:",
        "what is above it is ours, in Python and numpy. Where `solve_bvp`, which is told the",
        "derivatives, takes less than the floor, no way that derives them by CasADi comes to it.",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--error", type=float, default=1e-6)
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    gc.collect()
    gc.freeze()
    write(PAGE, page(options.error, options.rounds))


if __name__ == "__main__":
    os.environ.update(ONE_THREAD)
    main()
