"""Coulomb friction: what is pulled sticks or slips, a program with complementarity.

    0 <= slip  is perpendicular to  (what friction bears) - (pull) >= 0

For solvers of nonlinear programs that is a product that must not be positive: MFCQ, and with it
LICQ, fails at each feasible point. Those of MPCCs find the pairs in `pairs`.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.suite.member import Stationary
from actionopt.suite.models.expressions import WrittenProgram
from actionopt.suite.models.model import KnownAnswer, WrittenModel
from actionopt.tools.types import Array


class Complementarity(WrittenModel):
    """A program with complementarity: of each pair, an unknown and a row, one is zero."""

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Which unknown x >= 0 and which row c >= 0: their product is a later row."""
        return [(1 + i, i) for i in range(self.m // 2)]

    def as_complementarity(self) -> WrittenProgram:
        """Return the same with the pairs said as such, and without the rows of their products."""
        half, (lower, upper) = self.m // 2, self.constraint_bounds
        return WrittenProgram(
            self.name,
            self.x,
            self.f,
            self.c[:half],
            bounds=self.bounds,
            rows=(lower[:half], upper[:half]),
            complements=self.pairs,
        )


def blocks_by_hand(
    *, blocks: int = 4, effort: float = 0.5, resisting: float = 0.0
) -> Complementarity:
    """Return one hand that pulls blocks by springs of stiffness 1 to their places, all at once.

    Block i, of 1 to `blocks`, rests till the hand is i away, and then follows at that distance; its
    place is 2 i. f is half of the sum of (q_i - 2 i)^2 and of the effort times p^2: of p alone, the
    parabolas between kinks, each of which may have a minimum of its own. Is the last block to stay
    behind, at -`resisting`, a minimum may lie on its kink, where it neither sticks nor slips
    strictly: the pair is biactive.
    """
    if blocks != int(blocks) or blocks < 1:
        raise ValueError(f"expected a whole number of blocks, at least 1, found {blocks!r}")
    if not (effort > 0 and resisting >= 0):
        raise ValueError(
            f"expected a positive effort and a resisting not below 0, found {effort!r} and "
            f"{resisting!r}"
        )
    count = int(blocks)
    r = 1.0 + np.arange(count)
    d = 2 * r
    if resisting:
        d[-1] = -resisting
    p, q = ca.SX.sym("p"), ca.SX.sym("q", count)
    left = q - p + r  # of what friction bears

    def state(hand: float) -> Array:
        return np.append(hand, np.maximum(hand - r, 0))

    def value(hand: float) -> float:
        return float(np.sum((state(hand)[1:] - d) ** 2) + effort * hand**2) / 2

    def slope(hand: float, slipping: int) -> float:
        return (effort + slipping) * hand - float(np.sum((r + d)[:slipping]))

    def minima() -> KnownAnswer:
        found = [0.0]
        for k in range(1, count + 1):
            hand = float(np.sum((r + d)[:k])) / (effort + k)
            if r[k - 1] < hand < np.append(r, np.inf)[k]:
                found.append(hand)
        kinks = (r[k] for k in range(count) if slope(r[k], k) <= 0 <= slope(r[k], k + 1))
        found = sorted([*found, *kinks], key=value)
        best, *others = (Stationary(state(hand), value(hand), 0) for hand in found)
        return KnownAnswer(
            best.x, multipliers(best.x), "closed form: parabolas of the hand", others=others
        )

    def multipliers(x: Array) -> Array:
        hand, slips = x[0], x[1:]
        remains = slips - hand + r
        sticks, moves = (slips == 0) & (remains > 0), slips > 0
        product = np.zeros(count)
        product[sticks] = np.maximum(d[sticks] / remains[sticks], 0)
        product[moves] = np.maximum(d[moves] / slips[moves] - 1, 0)
        row = np.where(moves, d - slips - product * slips, 0.0)
        row[~sticks & ~moves] = slope(hand, int(np.sum(moves)))
        return np.concatenate([row, product])

    zeros, none = np.zeros(count), np.full(count, np.inf)
    return Complementarity(
        "blocks_by_hand",
        ca.vertcat(p, q),
        (ca.sumsqr(q - d) + effort * p**2) / 2,
        ca.vertcat(left, q * left),
        bounds=(0.0, np.inf),
        rows=(np.append(zeros, -none), np.append(none, zeros)),
        start=state(3.0 * count),
        answer=minima,
        tags=("complementarity", "LICQ fails", "MFCQ fails", "several optima"),
    )
