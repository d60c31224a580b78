"""Measure run time against error, and write the report.

    python -m benchmarks.work_precision [--quick] [--problems A,B] [--peers A,B]
        [--rounds 5] [--limit 20] [--fresh] [--report-only]

Every peer runs in a process of its own on one thread; their solves are interleaved, round after
round, one at a time, and medians are reported. Results are kept in `docs/benchmarks/` after
every group of measurements: an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
from itertools import zip_longest

from actionopt.tools.progress import steps
from benchmarks import peers, problems
from benchmarks.results import Results, brief
from benchmarks.runner import Bench

SLOW = 0.3  # seconds above which a measurement is not repeated
USEFUL = 1e-2  # a larger error is another path, or none


def main(arguments: list[str] | None = None) -> None:
    """Run the command."""
    from benchmarks import report  # here, as the peers' processes import this module too

    options = _options(arguments)
    file = report.FOLDER / options.data
    results = Results.open(file, fresh=options.fresh)
    if not options.report_only:
        bench = Bench(options.peers, options.limit)
        try:
            results.describe(bench.versions())
            for case in steps(options.problems):
                measure(bench, results, case, options.rounds)
        finally:
            bench.close()
    report.write(Results.open(file))  # of what is kept, which is rounded


def measure(bench: Bench, results: Results, case: str, rounds: int) -> None:
    """Measure all peers on one problem, and keep what was found."""
    todo = [p for p in bench.names if not results.has(case, p)]
    if not todo:
        return
    ladders = [_useful(bench, results, case, peer) for peer in todo]
    jobs = [job for step in zip_longest(*ladders) for job in step if job]  # interleaved
    for round_ in range(1, rounds):
        for job in jobs:
            if job.seconds < (SLOW if round_ < 3 else SLOW / 10):
                job.run(bench)
    for peer in todo:
        results.add(case, peer, [job.row() for job in jobs if job.peer == peer])
    results.save()


class Job:
    """One curve's point: a peer, a setting, a first guess and cold or again."""

    def __init__(self, case: str, peer: str, start: str, setting, kind: str) -> None:
        self.peer, self.kind = peer, kind
        self.request = {"case_name": case, "start": start, "setting": setting, "kind": kind}
        self.times: list[float] = []
        self.error, self.status = float("inf"), ""

    def run(self, bench: Bench) -> bool:
        """Measure once more; return whether it came to an answer of use."""
        reply = bench.ask(self.peer, self.request)
        self.times.append(reply["time"])
        self.status = reply["status"]
        self.error = reply.get("error", float("inf"))
        if not self.status and not self.error < USEFUL:
            self.status = f"another path (error {self.error:.1e})"
        return not self.status

    @property
    def seconds(self) -> float:
        """Median time."""
        return sorted(self.times)[len(self.times) // 2]

    def row(self) -> dict:
        """Return what is kept."""
        rest = {k: v for k, v in self.request.items() if k != "case_name"}
        return {
            **rest,
            "time": self.seconds,
            "error": self.error if self.error < float("inf") else None,
            "status": brief(self.status),
        }


def _useful(bench: Bench, results: Results, case: str, peer: str) -> list[Job]:
    """Try every setting once; return the jobs that came to an answer, and keep the failures."""
    good, lost = [], []
    misses = 0
    for start in bench.starts(case):
        for setting in bench.settings(peer):
            cold = Job(case, peer, start, setting, "cold")
            if cold.run(bench):
                good.append(cold)
                misses = 0
                again = Job(case, peer, start, setting, "again")
                (good if again.run(bench) else lost).append(again)
            else:
                lost.append(cold)
                misses += 1
            if (misses == 2 and cold.seconds > SLOW) or "unable" in cold.status:
                break  # finer settings cost more and will not do better
        if good or "unable" in cold.status:
            break
    results.add(case, peer, [job.row() for job in lost])
    return good


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.work_precision", description=__doc__
    )
    parser.add_argument("--quick", action="store_true", help="few problems and peers")
    parser.add_argument("--problems", help="names, separated by commas")
    parser.add_argument("--peers", help="names of files in benchmarks/peers")
    parser.add_argument("--rounds", type=int, default=0, help="repetitions (5; quick 3)")
    parser.add_argument("--limit", type=float, default=0.0, help="seconds a solve (20; quick 5)")
    parser.add_argument("--fresh", action="store_true", help="forget earlier results")
    parser.add_argument("--report-only", action="store_true", help="measure nothing")
    options = parser.parse_args(arguments)
    quick = options.quick
    options.data = "quick" if quick else "full"
    options.fresh = options.fresh or (quick and not options.report_only)
    options.rounds = options.rounds or (3 if quick else 5)
    options.limit = options.limit or (5.0 if quick else 20.0)
    for kind, known, few in (
        ("problems", list(problems.load()), problems.QUICK),
        ("peers", peers.NAMES, peers.QUICK),
    ):
        given = getattr(options, kind)
        chosen = given.split(",") if given else list(few if quick else known)
        unknown = [name for name in chosen if name not in known]
        if unknown:
            parser.error(f"unknown {kind} {', '.join(unknown)}; known are {', '.join(known)}")
        setattr(options, kind, chosen)
    return options


if __name__ == "__main__":
    main()
