"""Where the time of a cold solve goes: CasADi's and Ipopt's fixed costs against our own Python.

    python -m benchmarks.profile_cold [--tol 1e-9] [--problems pendulum,double_pendulum]

A profiler charges each moment to the innermost function; here built-in functions of CasADi
(tracing, deriving, compiling, factorizing, Ipopt itself) stand against numpy's and Python's own.
The profiler slows Python down, and cannot tell from it what runs without a function call: the
arithmetic of arrays, and CasADi's compiled functions read and written in place. So the shares are
upper bounds for Python; the total without the profiler is given beside them.
"""

from __future__ import annotations

import argparse
import cProfile
import os
import pstats
import statistics

from actionopt.tools.process import ONE_THREAD

PROBLEMS = ("pendulum", "double_pendulum", "chain_angles")
REPEATS = 9


def kind(file: str, function: str) -> str:
    """Return the column to which a profiled function's own time belongs."""
    if "Linsol" in function:
        return "factorize"
    if "Function_call" in function or "FunctionBuffer" in function:
        return "evaluate and Ipopt"
    if "casadi" in function or file.endswith("casadi.py"):
        return "derive and build"
    if "numpy" in file or "numpy" in function or function.startswith("<method 'reduce"):
        return "numpy"
    return "our Python"


def shares(work) -> dict[str, float]:
    """Return seconds by kind under the profiler."""
    profiler = cProfile.Profile()
    profiler.enable()
    work()
    profiler.disable()
    found: dict[str, float] = {}
    for (file, _, function), (_, _, own, _, _) in pstats.Stats(profiler).stats.items():
        column = kind(file, function)
        found[column] = found.get(column, 0.0) + own
    return found


def rows(names, tol: float) -> list[str]:
    """Return the table's lines."""
    from benchmarks import peers, problems
    from benchmarks.results import table
    from benchmarks.worker import _attempt

    columns = ("derive and build", "evaluate and Ipopt", "factorize", "numpy", "our Python")
    cells = []
    peer, cases = peers.get("actionopt_"), problems.load()
    for name in names:
        case = cases[name]
        ends = case.ends()[0]

        def work(case=case, ends=ends):
            return peer.cold(case, ends, case.starts[0], tol)

        total = statistics.median(_attempt(work)[1] for _ in range(REPEATS))
        every = [shares(lambda work=work: _attempt(work)) for _ in range(REPEATS)]
        mean = {c: statistics.median(s.get(c, 0.0) for s in every) for c in columns}
        whole = sum(mean.values())
        parts = (f"{mean[c] / whole:.0%}" for c in columns)
        cells.append([case.title, f"{total * 1e3:.1f}", *parts])
    return table(["problem", "cold, ms", *columns], cells, right=range(1, 7))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tol", type=float, default=1e-9)
    parser.add_argument("--problems", default=",".join(PROBLEMS))
    options = parser.parse_args()
    print("\n".join(rows(options.problems.split(","), options.tol)))


if __name__ == "__main__":
    os.environ.update(ONE_THREAD)
    main()
