"""Guard the speed: ratios of times to scipy's `solve_bvp`, and to solves of what is beside them.

    python -m benchmarks.guard            # compare; exit status 1 if slower
    python -m benchmarks.guard --update   # keep today's ratios as the baseline

They are compared with those kept in a file. Ratios on one machine in one run are steadier than
times; a slowdown by `SLACK` is reported.
"""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path

from actionopt.tools.files import write
from benchmarks import beside
from benchmarks.runner import Bench

FILE = Path(__file__).with_name("baseline.json")
PROBLEMS = ("pendulum", "kepler", "double_pendulum")
TOLERANCE = 1e-9
REPEATS = 9
SLACK = 1.5
OURS, THEIRS = "actionopt_", "scipy_bvp"


def ratios() -> dict[str, float]:
    """Return time of `solve_bvp` / ours for every problem, cold and again."""
    bench = Bench((OURS, THEIRS), limit=30.0)
    found = {}
    try:
        for case in PROBLEMS:
            for kind in ("cold", "again"):
                pairs = [
                    [_time(bench, p, case, kind) for p in (OURS, THEIRS)] for _ in range(REPEATS)
                ]
                ours, theirs = (statistics.median(t) for t in zip(*pairs, strict=True))
                found[f"{case}, {kind}"] = theirs / ours
    finally:
        bench.close()
    return found


def _time(bench: Bench, peer: str, case: str, kind: str) -> float:
    start = bench.starts(case)[0]
    request = {"case_name": case, "start": start, "setting": TOLERANCE, "kind": kind}
    reply = bench.ask(peer, request)
    if reply["status"]:
        raise SystemExit(f"{peer} failed on {case}: {reply['status']}")
    return reply["time"]


def _against(name: str) -> str:
    return "the solve" if name.endswith("beside") else "solve_bvp"


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true")
    options = parser.parse_args()
    now = ratios() | beside.guards()
    before = json.loads(FILE.read_text()) if FILE.exists() else {}
    slower = []
    for name, ratio in now.items():
        old = before.get(name)
        print(
            f"{name:28s} {ratio:7.2f} times as fast as {_against(name)}"
            + (f", {old:.2f} in the baseline" if old else "")
        )
        if old and ratio < old / SLACK:
            slower.append(name)
    if options.update:
        write(FILE, json.dumps({k: round(v, 3) for k, v in now.items()}, indent=1) + "\n")
    elif slower:
        raise SystemExit(f"slower than the baseline: {', '.join(slower)}")


if __name__ == "__main__":
    main()
