"""The vocabulary of pictures: a few shapes as data, for any plotter to draw.

`draw(q, t)` of a scene returns them back to front, the same ones in the same order at every
time: so the k-th body's points at successive times are its trail.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.expressions import Expressions
from actionopt.mechanics.laws.tracing import column
from actionopt.tools.checks import number, numbers, whole
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

Point = Sequence[float] | Array
BACK = 0.35  # height at which a point at unit depth is seen
SHAPE_KINDS = ("body", "rod", "spring", "ground")


@immutable
class Shape:
    """A point or a polyline in the plane, x to the right and y up, or in space, z up.

    Parameters
    ----------
    kind : str
        "body", a point mass; "rod", a rigid polyline; "spring", a spring between two points;
        "ground", scenery: a surface, a wall, an axis, a centre of force.
    points : (2, P) or (3, P) array
        Its P points in the scene's unit of length; P is 1 for a body and 2 for a spring. Of a
        `draw` that is traced, expressions.

    Raises
    ------
    ValueError
        For an unknown kind or points that do not fit it.
    """

    kind: str
    points: Array

    __repr__ = one_line

    def __post_init__(self) -> None:
        traced = isinstance(self.points, Expressions)
        points = self.points if traced else numbers(self.points, "the points of a shape")
        if not isinstance(self.kind, str):
            raise ValueError(
                f"expected a shape of kind {', '.join(SHAPE_KINDS)}, found {self.kind!r}"
            )
        count = {"body": 1, "spring": 2}.get(self.kind, points.shape[-1] if points.ndim else 0)
        if self.kind not in SHAPE_KINDS or points.shape not in ((2, count), (3, count)):
            raise ValueError(
                f"expected a shape of kind {', '.join(SHAPE_KINDS)} with points of shape (2, P), "
                f"or (3, P) in space, one for a body, two for a spring; found {self.kind!r} with "
                f"{points.shape}"
            )
        object.__setattr__(self, "points", points)


def body(point: Point) -> Shape:
    """Return a point mass at (x, y) or (x, y, z). Raises ValueError, as all these, for others."""
    return Shape("body", _columns(point))


def rod(*points: Point) -> Shape:
    """Return a rigid polyline through the points."""
    return Shape("rod", _columns(*points))


def spring(a: Point, b: Point) -> Shape:
    """Return a spring from a to b."""
    return Shape("spring", _columns(a, b))


def ground(*points: Point) -> Shape:
    """Return scenery: a polyline through the points, or a single point."""
    return Shape("ground", _columns(*points))


def circle(radius: float, center: Point = (0.0, 0.0), points: int = 61) -> Shape:
    """Return a circle of a radius about a point in the plane, as scenery."""
    whole(points, "the points of a circle", 1)
    if not isinstance(radius, Expressions):
        radius = number(radius, "the radius of circle(radius, (x, y))")
    middle = _columns(center)
    if middle.shape != (2, 1):
        raise ValueError(
            "expected circle(radius, (x, y)), a number and a point in the plane, found "
            f"circle({radius!r}, {center!r})"
        )
    angle = np.linspace(0.0, 2 * np.pi, points)
    round_ = radius * np.stack([np.cos(angle), np.sin(angle)])
    return Shape("ground", middle + round_)


def project(points: Array) -> Array:
    """Return where points (..., 3, P) in space are seen, (..., 2, P): x right, z up, y inward.

    Seen from a little above: what lies farther back stands higher, and circles about z are
    ellipses that lie level. Points in the plane are seen where they are.
    """
    if not isinstance(points, Expressions):
        points = numbers(points, "points to be seen")
    if points.ndim < 2 or points.shape[-2] not in (2, 3):
        raise ValueError(f"expected points (..., 2 or 3, P), found the shape {points.shape}")
    if points.shape[-2] == 2:
        return points
    x, y, z = points if isinstance(points, Expressions) else np.moveaxis(points, -2, 0)
    return np.stack([x, z + BACK * y], axis=-2)


def _columns(*points: Point) -> Array:
    """Return the points as columns, (2, P) or (3, P)."""
    try:
        if any(isinstance(x, Expressions) for p in points for x in (p, *p)):
            return _trace_points(points)  # type: ignore[return-value]
        rows = [np.asarray(p, dtype=float).ravel() for p in points]
        if {row.size for row in rows} not in ({2}, {3}):
            raise ValueError
        return np.stack(rows, axis=1)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(
            "expected points (x, y) in the plane or (x, y, z) in space, found "
            f"{', '.join(map(repr, points)) or 'none'}"
        ) from error


def _trace_points(points: tuple[Point, ...]) -> Expressions:
    """Return the points of a `draw` that is traced, as columns, (2, P) or (3, P)."""
    rows = [column(p if isinstance(p, Expressions) else list(p), "draw") for p in points]
    if {row.numel() for row in rows} not in ({2}, {3}):
        raise ValueError
    return Expressions(ca.horzcat(*rows), 2)
