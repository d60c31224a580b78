"""Models without a feasible point, and the proof.

The proof is one inequality. If multipliers y make y'c(x) >= least for all x, and y'c <= most for
all c within their bounds, with least > most, then nothing is feasible. Besides, each x violates
some row by (least - most) / |y|_1 at least; x* of these models violates none by more. With linear
rows that is Farkas' lemma: J. Nocedal and S. J. Wright, *Numerical Optimization* (2nd ed. 2006),
section 12.6.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.suite.models.model import KnownAnswer, WrittenModel

NOTHING_FEASIBLE = ("infeasible",)


def chain_too_short(*, links: int = 10, missing: float = 0.1) -> WrittenModel:
    """Return a hanging chain that is too short for its two hooks, by `missing` of its length.

    A row is half of a link's square less what it ought to be. The mean of the squares is at least
    the square of the mean: y = 1 proves it, and equal links on a straight line violate least.
    """
    _positive(links=links, missing=missing)
    length = 1 / links
    x = ca.SX.sym("x", 2 * (links - 1))
    places = ca.horzcat([0, 0], ca.reshape(x, 2, links - 1), [1 + missing, 0])
    steps = places[:, 1:] - places[:, :-1]
    rows = (ca.sum1(steps**2).T - length**2) / 2
    even = np.arange(1, links) / links * (1 + missing)

    def least_violating() -> KnownAnswer:
        straight = np.stack([even, 0 * even], axis=1).ravel()
        least = links / 2 * length**2 * ((1 + missing) ** 2 - 1)
        how = "closed form: mean of squares and square of mean"
        return KnownAnswer(straight, np.ones(links), how, least=least)

    arc = np.stack([even, -np.sin(np.pi * even / (1 + missing)) / 4], axis=1).ravel()
    return WrittenModel(
        "chain_too_short",
        x,
        ca.sum1(x[1::2]) / links,
        rows,
        start=arc,
        answer=least_violating,
        tags=NOTHING_FEASIBLE,
        unit=length,
    )


def bump_too_high(*, elements: int = 20, missing: float = 0.1) -> WrittenModel:
    """Return a taut string of slopes at most 1 over a bump, too high for it by `missing`.

    Rows are slopes, and heights above a bump in the middle: y adds all slopes from an end up to it.
    """
    _positive(elements=elements, missing=missing)
    half = elements // 2
    reach = half / elements  # the height that slopes of 1 come to, from the nearer end
    top = (1 + missing) * reach
    x = ca.SX.sym("x", elements - 1)
    heights = ca.vertcat(0, x, 0)
    slopes = (heights[1:] - heights[:-1]) * elements
    rows = ca.vertcat(slopes, x[half - 1])
    lower = np.append(-np.ones(elements), top)
    upper = np.append(np.ones(elements), np.inf)
    # The sum of the slopes on the way up, over `elements`, is the height on top: y'c = 0.
    y = np.zeros(elements + 1)
    y[:half], y[-1] = 1 / elements, -1.0

    def least_violating() -> KnownAnswer:
        # Slopes 1 + v on the way up, and a height of top - v: v is what all rows are short of.
        high = top - (top - reach) / (1 + reach)
        t = np.arange(1, elements)
        shape = np.minimum(t / half, (elements - t) / (elements - half)) * high
        return KnownAnswer(shape, y, "closed form: Farkas' lemma", least=0.0)

    return WrittenModel(
        "bump_too_high",
        x,
        ca.sumsqr(slopes) / (2 * elements),
        rows,
        rows=(lower, upper),
        start=np.zeros(elements - 1),
        answer=least_violating,
        tags=NOTHING_FEASIBLE,
    )


def arm_in_disc(*, links: int = 6, missing: float = 0.1) -> WrittenModel:
    """Return an arm of links, held in the middle of a disc of radius 1, whose hand is to leave it.

    Its links are too short for that by `missing`. The hand is nowhere farther from the middle than
    all links together, by the triangle inequality.
    """
    _positive(links=links, missing=missing)
    length = (1 - missing) / links
    angles = ca.SX.sym("angle", links)
    hand = length * ca.vertcat(ca.sum1(ca.cos(angles)), ca.sum1(ca.sin(angles)))

    def least_violating() -> KnownAnswer:
        how, least = "closed form: triangle inequality", -((links * length) ** 2)
        return KnownAnswer(np.zeros(links), np.array([-1.0]), how, least=least)

    turning = np.arange(links) * 0.7
    return WrittenModel(
        "arm_in_disc",
        angles,
        ca.sumsqr(angles[1:] - angles[:-1]) + angles[0] ** 2,
        ca.sumsqr(hand),
        rows=(1.0, np.inf),
        start=turning,
        answer=least_violating,
        tags=NOTHING_FEASIBLE,
    )


def _positive(*, missing: float, **counts: int) -> None:
    """Raise ValueError unless something is missing, and counts are whole numbers above 1."""
    for name, count in counts.items():
        if count != int(count) or count < 2:
            raise ValueError(f"expected a whole number of {name}, at least 2, found {count!r}")
    if not 0 < missing < 1:
        raise ValueError(
            f"expected missing between 0 and 1, found {missing!r}; else there is a feasible point"
        )
