"""Saddles between minima that are known, and the part of all minima that starts from afar come to.

    python -m benchmarks.saddles [--starts 10]

The page `docs/benchmarks/saddles.md` is written by this command.
"""

from __future__ import annotations

import argparse
import os
import warnings
from collections.abc import Iterator
from time import process_time

from actionopt import suite
from actionopt.suite import learn, solvers
from actionopt.suite.member import Member, Stationary
from actionopt.suite.saddle_search import dimer, elastic_band
from actionopt.suite.verdict import SAME_POINT
from actionopt.suite.ways import score, ways
from actionopt.tools.files import write
from actionopt.tools.process import ONE_THREAD
from benchmarks.results import DOCS, made_by, table

PAGE = DOCS / "benchmarks" / "saddles.md"
WITH_DISCS = ("disc", "discs", "pegs")


def members() -> Iterator[Member]:
    """Yield what has no rows and bounds, with a minimum and a saddle of index 1 that are known."""
    for name in (*suite.find(), *suite.MODELS):
        member = suite.get(name) if name in suite.FAMILIES else suite.model(name)
        if not (member.m or member.has_bounds) and {0, 1} <= {s.index for s in points(member)}:
            yield member


def points(member: Member) -> list[Stationary]:
    """Return all stationary points that are known, the lowest first."""
    return sorted((member.optimum, *member.others), key=lambda s: s.f)


def saddle_row(member: Member) -> list[str]:
    """Return the cells of a member: its barriers, and what both methods come to."""
    minima = [s for s in points(member) if s.index == 0]
    saddles = [s for s in points(member) if s.index == 1]
    # By symmetry several saddles have one height.
    barriers = ", ".join(dict.fromkeys(f"{s.f - minima[0].f:.5g}" for s in saddles))
    cells = [member.name, str(member.n), barriers]
    for path in (False, True):
        member.counts.clear()
        begun = process_time()
        if path and len(minima) < 2:
            cells += ["one minimum", "", ""]
            continue
        if path:
            band, rests = elastic_band(member, minima[0].x, minima[1].x)
            x = max(band, key=member.objective)
        else:
            x, _, rests = dimer(member, member.start())
        seconds, gradients = process_time() - begun, member.counts["grad"]
        near = member.nearest(x, SAME_POINT)
        there = "nothing stationary" if near is None else f"{near.f - minima[0].f:.5g}"
        said = "" if near is None else f", index {near.index}"
        cells += [there + said + ", at rest" * rests, str(gradients), f"{seconds:.1f}"]
    return cells


def score_row(name: str, starts: int) -> list[str]:
    """Return the cells of a member with discs: its minima, and the part that is found."""
    member = suite.get(name)
    begun = process_time()
    found = [solvers.run("ipopt", member, x).x for x in learn.random_starts(member, starts)]
    seconds = process_time() - begun
    known = [way.f for way in ways(member).values()]
    met = f"{score(member, found):.3f}"
    return [name, str(member.n), str(len(known)), f"{min(known):.5g}", met, f"{seconds:.1f}"]


def page(starts: int) -> str:
    """Return the page."""
    method = ("", "gradients", "s")
    head = ("member", "n", "barriers known", "dimer", *method[1:], "elastic band", *method[1:])
    scores = ("member", "n", "minima", "the least", f"part found from {starts} starts", "s")
    lines = [
        "# Saddles and scores",
        "",
        made_by("saddles", "actionopt", "casadi", "numpy"),
        "",
        "Members without rows and bounds of which a minimum and a saddle of index 1 are known. A",
        "barrier is f of the saddle, less that of the least minimum. The dimer begins at x0;",
        "the nudged elastic band, at first straight, joins the two lowest minima, and its highest",
        "point climbs. Told are the stationary point that each comes within 1e-3 of, its height",
        "and index, and whether the method says that it is at rest: a saddle of higher index, or",
        "none, is no answer. Gradients and seconds of the processor are those of the search.",
        "",
        *table(head, map(saddle_row, members()), right=(1, 4, 5, 7, 8)),
        "",
        "Members with discs in the way, of which every minimum is known. Ipopt begins at the",
        "member's start with random waves; counted is the part of the minima that it comes to.",
        "",
        *table(scores, [score_row(name, starts) for name in WITH_DISCS], right=range(1, 6)),
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=10)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    write(PAGE, page(options.starts))


if __name__ == "__main__":
    os.environ.update(ONE_THREAD)
    main()
