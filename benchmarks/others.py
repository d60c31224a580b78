"""Other stationary paths between the same end points, found by the peers themselves.

A saddle of the action often has other paths beside it, and a peer that returns one of them has
answered the question. `python -m benchmarks.others` asks some peers for paths, polishes what
they return by shooting and keeps the first velocities of paths not yet known in `others.json`;
`python -m benchmarks.reference` then integrates those at thirty digits.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from actionopt.tools.files import write
from benchmarks import peers, problems
from benchmarks.peers.dop853 import shoot
from benchmarks.peers.scipy_bvp import solve
from benchmarks.results import text

FILE = Path(__file__).with_name("others.json")
ASKED = ("actionopt_", "scipy_bvp", "dop853")
ROUGH, FINER, POLISHED = 1e-6, 1e-9, 1e-12
NODES = 400
SAME = 1e-4  # paths nearer to each other, relative to the largest |q|, are one


def known() -> dict[str, list[list[list[float]]]]:
    """Return by problem, for either pair of ends, the first velocities of other paths."""
    return json.loads(FILE.read_text()) if FILE.exists() else {}


def velocity_at_start(case: problems.Case, curve) -> np.ndarray:
    """Return dq/dt(0) of a curve from a few of its points, (n,)."""
    t = case.duration / 50 * (1 - np.cos(np.pi * np.arange(9) / 8)) / 2
    fit = np.polynomial.Polynomial.fit
    return np.array([fit(t, row, 8).deriv()(0.0) for row in np.asarray(curve(t))])


def candidates(case: problems.Case):
    """Yield (which ends, curve) as the peers return them."""
    both = case.ends()
    for name in ASKED:
        peer = peers.get(name)
        for start in case.starts:
            try:
                first = peer.cold(case, both[0], start, ROUGH)
                yield 0, first.curve
                yield 1, peer.again(first, case, both[1], ROUGH).curve
                yield 1, peer.cold(case, both[1], start, ROUGH).curve
            except Exception as error:
                print(f"{case.name}, {name}, {start}: {error}", file=sys.stderr)


def polished(case: problems.Case, ends: problems.Ends, curve) -> peers.Answer:
    """Return the path near a curve: finer by `solve_bvp`, then by shooting."""
    x = np.linspace(0.0, case.duration, NODES)
    q = np.asarray(curve(x))
    y = np.concatenate([q, np.gradient(q, x, axis=1, edge_order=2) * case.time_unit])
    finer = solve(case, ends, x, y, FINER)
    return shoot(case, ends, velocity_at_start(case, finer.curve), POLISHED)


def search(case: problems.Case, found: list[list[list[float]]]) -> None:
    """Add to `found` the first velocities of paths that are not known."""
    both = case.ends()
    paths = [[ends.exact] for ends in both]
    for which in (0, 1):
        for v in found[which]:
            paths[which].append(shoot(case, both[which], np.array(v), POLISHED).curve(case.times))
    for which, curve in candidates(case):
        size = np.max(np.abs(both[which].exact))

        def is_new(q, which=which, size=size):
            return all(np.max(np.abs(q - p)) > SAME * size for p in paths[which])

        if not is_new(np.asarray(curve(case.times))):
            continue
        try:
            answer = polished(case, both[which], curve)
        except peers.Failed as error:
            print(f"{case.name}: not a path, or not to be shot: {error}", file=sys.stderr)
            continue
        q = answer.curve(case.times)
        if is_new(q):
            paths[which].append(q)
            found[which].append(answer.state.tolist())
            print(f"{case.name}: another path, ends {which}", file=sys.stderr)


def main() -> None:
    """Search every problem between given times, or those named."""
    every = known()
    for name, case in problems.load().items():
        if case.asks != "ends" or (sys.argv[1:] and name not in sys.argv[1:]):
            continue
        found = every.get(name, [[], []])
        search(case, found)
        if any(found):
            every[name] = found
        write(FILE, text(every, 3) + "\n")


if __name__ == "__main__":
    main()
