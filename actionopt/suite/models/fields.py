"""Fields in the plane: matrices that fill in, up to 1e5 unknowns and more.

All are convex: a point that satisfies the conditions of first order is the least, and the only one.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from actionopt.suite.models.model import KnownAnswer, WrittenModel
from actionopt.tools.types import Array

# Rounds of Newton's method, which needs about ten, or of the active set: 32 to 44 with 200 cells a
# side, in proportion to them.
MOST_ROUNDS = 100
STEP_OF_ROUND_OFF = 1e-13  # a step of Newton's method that is round-off
UNSETTLED = "expected cells whose answer settles, found {0}: it does not in {1} rounds; use fewer"


def torsion(*, cells: int = 12, twist: float = 1.0) -> WrittenModel:
    """Return Prandtl's stress function of a square bar that is twisted, and yields beyond a stress.

    Its slope is at most 1, so that it is at most the distance to the edge: up to a `twist` of about
    1.48 nothing yields.

    Source: T. W. Ting, Trans. Amer. Math. Soc. 123 (1966), 369-401.
    """
    count = _cells(cells)
    if not twist > 0:
        raise ValueError(f"expected a positive twist, found {twist!r}")
    h = 1 / count
    at = np.arange(1, count) * h
    edge = np.minimum(at, 1 - at)
    distance = np.minimum(edge[:, None], edge).ravel()
    x, inside = _unknowns(count)
    f = _stretching(inside) - 2 * twist * h**2 * ca.sum1(x)
    return _quadratic("torsion", x, f, upper=distance, unit=0.5, start=0 * distance)


def membrane(*, cells: int = 12, height: float = 0.3) -> WrittenModel:
    """Return a stretched membrane over a hill, a paraboloid of this height in the middle."""
    count = _cells(cells)
    if not height > 0:
        raise ValueError(f"expected a positive height, found {height!r}")
    at = np.arange(1, count) / count - 0.5
    hill = (height - 4 * (at[:, None] ** 2 + at**2)).ravel()
    x, inside = _unknowns(count)
    return _quadratic(
        "membrane",
        x,
        _stretching(inside),
        lower=hill,
        unit=height,
        start=np.maximum(hill, 0),
    )


def soap_film(*, cells: int = 12, width: float = 2.4) -> WrittenModel:
    """Return a film of least area in a frame of Scherk's surface, log(cos y / cos x).

    It is made of triangles; `width` is that of the square under it, and less than pi.

    Source: H. F. Scherk, J. reine angew. Math. 13 (1835), 185-208.
    """
    count = _cells(cells)
    if not 0 < width < np.pi:
        raise ValueError(f"expected a width below pi, found {width!r}")
    h = width / count
    log = np.log(np.cos(np.linspace(-width / 2, width / 2, count + 1)))
    scherk = log[None] - log[:, None]
    x, heights = _unknowns(count)
    frame = scherk.copy()
    frame[1:-1, 1:-1] = 0
    heights = heights + frame
    a, b = heights[1:, :] - heights[:-1, :], heights[:, 1:] - heights[:, :-1]
    # Triangles at the lower left and the upper right corner of each cell.
    areas = [h / 2 * ca.sqrt(h**2 + a[:, s] ** 2 + b[t, :] ** 2) for s, t in _corners(count)]
    f = ca.sum1(ca.sum2(areas[0] + areas[1]))

    def newton() -> KnownAnswer:
        x_now = scherk[1:-1, 1:-1].ravel(order="F")
        for _ in range(MOST_ROUNDS):
            g, H = film.slope_and_curvature(x_now)
            step = np.array(ca.solve(H, -g, "ldl")).ravel()
            x_now = x_now + step
            if np.max(np.abs(step)) <= STEP_OF_ROUND_OFF:
                how = "high precision: Newton's method, f is convex"
                return KnownAnswer(x_now, np.zeros(0), how)
        raise ValueError(UNSETTLED.format(count, MOST_ROUNDS))

    flat = np.zeros((count - 1) ** 2)
    film = WrittenModel("soap_film", x, f, start=flat, answer=newton, tags=("field",))
    return film


def _cells(cells: int) -> int:
    if cells != int(cells) or cells < 3:
        raise ValueError(f"expected a whole number of cells, at least 3, found {cells!r}")
    return int(cells)


def _corners(count: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    return (slice(0, count), slice(0, count)), (slice(1, count + 1), slice(1, count + 1))


def _unknowns(count: int) -> tuple[ca.SX, ca.SX]:
    """Return x, and the heights at all nodes, (count + 1, count + 1): zero at the edge."""
    x = ca.SX.sym("x", (count - 1) ** 2)
    heights = ca.SX(count + 1, count + 1)
    heights[1:count, 1:count] = ca.reshape(x, count - 1, count - 1)
    return x, ca.densify(heights)


def _stretching(heights: ca.SX) -> ca.SX:
    """Return half the integral of the slope's square."""
    across, along = heights[1:, :] - heights[:-1, :], heights[:, 1:] - heights[:, :-1]
    return (ca.sumsqr(across) + ca.sumsqr(along)) / 2


def _quadratic(
    name: str,
    x: ca.SX,
    f: ca.SX,
    *,
    lower: float | Array = -np.inf,
    upper: float | Array = np.inf,
    **named,
) -> WrittenModel:
    """Return a convex quadratic with bounds, whose answer an active set finds.

    Its matrix has no positive entries but on the diagonal: the set settles, from any beginning.

    Source: M. Hintermueller, K. Ito and K. Kunisch, SIAM J. Optim. 13 (2002), 865-888.
    """
    n = x.numel()
    low, high = (np.broadcast_to(np.asarray(side, dtype=float), (n,)) for side in (lower, upper))

    def active_set() -> KnownAnswer:
        g0, H = field.slope_and_curvature(np.zeros(n))
        found, push, before = np.zeros(n), np.zeros(n), None
        for _ in range(MOST_ROUNDS):
            at_low, at_high = push + found - low < 0, push + found - high > 0
            held = at_low | at_high
            if before is not None and (held == before).all():
                how = "high precision: active set, f is convex"
                return KnownAnswer(found, np.zeros(0), how)
            before = held
            found = np.where(at_low, low, np.where(at_high, high, 0.0))
            rows = np.flatnonzero(~held).tolist()
            given = np.array(g0 + H @ found).ravel()
            found[rows] = -np.array(ca.solve(H[rows, rows], given[rows], "ldl")).ravel()
            push = -np.array(g0 + H @ found).ravel()
            push[rows] = 0.0
        raise ValueError(UNSETTLED.format(int(np.sqrt(n)) + 1, MOST_ROUNDS))

    bounds = low, high
    field = WrittenModel(name, x, f, bounds=bounds, answer=active_set, tags=("field",), **named)
    return field
