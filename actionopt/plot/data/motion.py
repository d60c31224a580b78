"""A motion in space as arrays: the shapes of a scene at equal times, trails, forces on bodies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.plot.data.along import CURVE_TIMES, times
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.variations import sizes
from actionopt.scenes import Shape, project
from actionopt.tools.checks import entries
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

Draw = Callable[[Array, float], Sequence[Shape]]

TRAIL_TIMES = CURVE_TIMES // 2  # times of a trail
PLACE_STEP = 1e-4  # of a coordinate's size, to differentiate bodies' places by
STILL = 1e-9  # of the picture's size: what moves less does not move
UNEXPLAINED = 1e-6  # share of the generalized forces that forces on bodies may leave over
# A spring that is drawn: its turns, and its breadth in parts of the picture's size.
SPRING_TURNS, SPRING_BREADTH = 8, 0.03
LONGEST_ARROW = 0.25  # of the picture's size: the longest arrow
DATA_UNITS = 2000  # a picture's size in the units to which plain data are rounded


@immutable
class Motion:
    """What is seen at K times; S shapes, B of them bodies.

    Attributes
    ----------
    t : (K,) array
        Equal times, both events' included.
    kinds : tuple of str
        Kind of each shape, back to front: "body", "rod", "spring" or "ground".
    points : tuple of (K, d, P) arrays
        Points of each shape, P of its own, in the plane (d = 2) or in space (d = 3).
    trails : (B, d, M) array
        Where each body has been, at M equal times over the motion.
    box : (4,) array
        Left, right, bottom and top of everything as it is seen, trails and arrows included.
    forces : (B, d, K) array or None
        Force of constraint on each body; see `motion_data`.
    arrow : float
        Length at which a force of one unit is drawn, the same at all times.
    """

    t: Array
    kinds: tuple[str, ...]
    points: tuple[Array, ...]
    trails: Array
    box: Array
    forces: Array | None = None
    arrow: float = 0.0

    __repr__ = one_line

    @property
    def space(self) -> bool:
        """Whether it is drawn in space, and so has to be projected to be seen."""
        return self.points[0].shape[1] == 3

    @cached_property
    def bodies(self) -> Array:
        """Where the bodies are, (B, d, K)."""
        places = [p[:, :, 0].T for p, kind in self._shapes if kind == "body"]
        return np.array(places).reshape(-1, self.trails.shape[1], self.t.size)

    @cached_property
    def flat(self) -> Motion:
        """The same in the plane, as it is seen."""
        if not self.space:
            return self
        forces = None if self.forces is None else project(self.forces)
        points, trails = tuple(map(project, self.points)), project(self.trails)
        return replace(self, points=points, trails=trails, forces=forces)

    @cached_property
    def still(self) -> tuple[bool, ...]:
        """Whether each shape stays where it is."""
        return tuple(bool(np.ptp(p, axis=0).max() <= STILL * self.size) for p in self.points)

    @cached_property
    def size(self) -> float:
        """Diagonal of the box."""
        left, right, bottom, top = self.box
        return float(np.hypot(right - left, top - bottom)) or 1.0

    def plain(self) -> dict[str, Any]:
        """Return it as numbers, lists and strings, for JSON and a player in another language.

        `t` and `box`; `shapes`, each with its `kind`, whether it is `still`, and `points`, a row
        of [x, y] at each time, at one time only if it is still; `trails`, rows of [x, y]; and if
        there are forces, `arrows`: for each body a [x, y] to draw from it at each time.
        Lengths are rounded to half a thousandth of the picture's size.
        """
        digits = max(0, int(np.ceil(np.log10(DATA_UNITS / self.size))))

        def rows(points: Array) -> Any:  # (..., d, P) to P rows of d, without -0.0
            return (np.round(np.swapaxes(points, -1, -2), digits) + 0.0).tolist()

        shapes = [
            {"kind": kind, "still": still, "points": rows(p[:1] if still else p)}
            for (p, kind), still in zip(self._shapes, self.still, strict=True)
        ]
        found: dict[str, Any] = {
            "t": self.t.tolist(),
            "box": (np.round(self.box, digits) + 0.0).tolist(),
            "shapes": shapes,
            "trails": rows(self.trails),
        }
        if self.forces is not None:
            found["arrows"] = rows(self.arrow * self.forces)
        return found

    @property
    def _shapes(self) -> list[tuple[Array, str]]:
        return list(zip(self.points, self.kinds, strict=True))


@check_arguments
def motion_data(solution: Solution, draw: Draw, count: int = 9, force: bool = False) -> Motion:
    """Return the shapes at `count` equal times, and the forces of constraint if asked for.

    A generalized force Q(t) of constraint does the virtual work Q . dq; forces F on the bodies
    at r(q, t) do F . dr = F . (dr/dq) dq. So (dr/dq)' F = Q, with the least F that fulfils it:
    exactly the force on each body where the coordinates place the bodies freely, as Cartesian
    ones do, else the part of it that works. A coordinate that moves no body, as the angle of a
    wheel about its middle, takes a torque instead, which no arrow shows.

    Parameters
    ----------
    solution : Solution
    draw : callable
        `draw(q, t)` for q of shape (n,): the shapes at one time, the same ones in the same order
        at all times; a scene has it as `scene.draw`.
    count : int
        Number of times, at least 2.
    force : bool

    Raises
    ------
    ValueError
        If `draw` does not fit, or forces are asked for that bodies cannot show.
    """
    if not callable(draw):
        raise ValueError(
            f"expected draw(q, t) that returns shapes, as `scene.draw`, found {draw!r}"
        )
    if count < 2:
        raise ValueError(f"expected at least 2 times, found {count}")
    t = times(solution, count)
    kinds, points = _shapes_over_time(solution, draw, t)
    _, finely = _shapes_over_time(solution, draw, times(solution, TRAIL_TIMES))
    trails = np.array([p[:, :, 0].T for p, k in zip(finely, kinds, strict=True) if k == "body"])
    d = points[0].shape[1]
    seen = np.concatenate([_row(project(p)) for p in points + finely], axis=1)
    data = Motion(t, kinds, points, trails.reshape(-1, d, TRAIL_TIMES), _box(seen))
    if not force:
        return data
    forces = _forces(solution, draw, t)
    strongest = float(np.max(np.linalg.norm(forces, axis=1), initial=0.0))
    arrow = LONGEST_ARROW * data.size / strongest if strongest else 0.0
    tips = _row(project(data.bodies + arrow * forces))
    box = _box(np.concatenate([seen, tips], axis=1))
    return Motion(t, kinds, points, data.trails, box, forces, arrow)


def _row(points: Array) -> Array:
    """Return points (K, 2, P) as one row, (2, K P)."""
    return np.swapaxes(points, 0, 1).reshape(2, -1)


def _shapes_over_time(
    solution: Solution, draw: Draw, t: Array
) -> tuple[tuple[str, ...], tuple[Array, ...]]:
    """Return the kinds of the shapes, and the points of each at all times, (K, d, P)."""
    frames = [_shapes(draw(q, time)) for q, time in zip(solution(t).T, t, strict=True)]
    looks = [[(s.kind, s.points.shape) for s in shapes] for shapes in frames]
    for k, (look, later) in enumerate(pairwise(looks)):
        if later != look:
            raise ValueError(
                f"expected the same shapes in the same order at all times, found {look} at "
                f"t = {t[k]:g} and {later} at t = {t[k + 1]:g}"
            )
    if not looks[0]:
        raise ValueError("expected draw(q, t) to return shapes, found none")
    points = tuple(np.array([s.points for s in row]) for row in zip(*frames, strict=True))
    if len({p.shape[1] for p in points}) > 1:
        raise ValueError(
            "expected shapes that are all in the plane or all in space, found some of each from "
            "draw(q, t); give every point a third coordinate"
        )
    for p in points:
        if not np.isfinite(p).all():
            raise ValueError("expected finite points from draw(q, t), found NaN or infinity")
    return tuple(kind for kind, _ in looks[0]), points


def _shapes(drawn: Any) -> list[Shape]:
    """Return the shapes that `draw` returned. Raises ValueError for anything but shapes."""
    shapes = entries(drawn)
    if shapes is None or not all(isinstance(shape, Shape) for shape in shapes):
        raise ValueError(
            "expected draw(q, t) to return a list of shapes, such as [body([x, y])], found "
            f"{drawn!r}; actionopt.scenes has body, rod, spring, ground and circle"
        )
    return shapes


def _box(points: Array) -> Array:
    low, high = points.min(axis=1), points.max(axis=1)
    return np.array([low[0], high[0], low[1], high[1]])


def _forces(solution: Solution, draw: Draw, t: Array) -> Array:
    """Return the forces of constraint on the bodies, (B, d, K), as `motion_data` explains."""
    names, units = solution.problem.system.coordinates, sizes(solution)
    if not solution.problem.system.m:
        raise ValueError(
            "expected a system with constraints, found none, and so no forces of constraint; "
            "write one as constraint(q, t), as the scene rod_pendulum does with its rod"
        )
    Q, forces = solution.constraint_force(t), []
    for k, (time, q) in enumerate(zip(t, solution(t).T, strict=True)):
        J = np.array(
            [
                (_places(draw, q + h, time) - _places(draw, q - h, time)) / (2 * PLACE_STEP)
                for h in np.diag(PLACE_STEP * units)
            ]
        )  # (n, d B), each coordinate in units of its size
        if not J.size:
            raise ValueError("expected draw(q, t) to return bodies for forces to act on")
        work = Q[:, k] * units
        moving = np.linalg.norm(J, axis=1) > UNEXPLAINED * np.linalg.norm(J)
        F = np.linalg.lstsq(J[moving], work[moving], rcond=UNEXPLAINED)[0]
        left = np.abs(J @ F - work)[moving]
        if np.max(left, initial=0.0) > UNEXPLAINED * np.max(np.abs(work)):
            worst = names[np.flatnonzero(moving)[np.argmax(left)]]
            raise ValueError(
                f"expected forces on the bodies to do the work of the constraints, "
                f"found that the one on {worst} at t = {time:g} does work that they cannot; "
                "draw without forces"
            )
        forces.append(F.reshape(len(_bodies(draw, q, time)), -1))
    return np.moveaxis(np.array(forces), 0, -1)


def _places(draw: Draw, q: Array, t: float) -> Array:
    """Return where the bodies are, (d B,)."""
    return np.array(_bodies(draw, q, t)).ravel()


def _bodies(draw: Draw, q: Array, t: float) -> list[Array]:
    return [s.points[:, 0] for s in draw(q, t) if s.kind == "body"]
