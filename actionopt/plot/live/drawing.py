"""How a system looks, for a page to draw of any path: traced as a law is, or else seen once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.mechanics.laws.expressions import Expressions
from actionopt.plot._names import planar
from actionopt.plot.data.motion import Draw, motion_data
from actionopt.plot.live.javascript import body
from actionopt.scenes import Shape, project

FRAMES = 121
MOVED_BY = 1e-3  # of a coordinate's size: far above round-off, small beside a picture; ad hoc


def drawing(solution: Solution, draw: Draw) -> dict[str, Any]:
    """Return the picture for JSON: `box`, and `shapes`, each with its `kind`.

    A shape that moves has `count` points, which the function `body` of x = (q, t) computes one
    after the other; one that does not has `points`. Where `draw` cannot be traced, `frames` has the
    pictures of the solution, and no other path has one.
    """
    seen = motion_data(solution, draw, FRAMES)
    try:
        shapes, function = trace_shapes(solution.problem.system.n, draw)
        code = {"body": body(function), "work": function.sz_w(), "sizes": [function.nnz_out(0)]}
    except Exception:  # whatever a function of numbers raises for symbols
        plain = seen.plain()
        return {"box": plain["box"], "frames": plain["shapes"], "shapes": []}
    return {
        "box": [round(float(x), 6) for x in seen.box],
        "draw": {**code, "places": []},
        "shapes": [
            {"kind": shape.kind, "count": shape.points.shape[1]}
            if isinstance(shape.points, Expressions)
            else {"kind": shape.kind, "points": np.round(project(shape.points).T, 6).tolist()}
            for shape in shapes
        ],
    }


def is_upside_down(solution: Solution, draw: Draw) -> bool:
    """Whether the picture moves down where the second coordinate of the plane grows."""
    start, t = solution.start, solution.problem.start.t
    pairs = planar(solution.problem.system.coordinates)
    if not pairs:
        return False
    moved = np.array(start.q)
    moved[pairs[0][1]] += MOVED_BY * solution.problem.lengths[pairs[0][1]]
    before, after = (
        np.hstack([project(np.asarray(shape.points, float)) for shape in draw(q, t)])
        for q in (np.array(start.q), moved)
    )
    return before.shape == after.shape and float(np.sum(after[1] - before[1])) < 0


def trace_shapes(n: int, draw: Draw) -> tuple[Sequence[Shape], ca.Function]:
    """Return shapes of n coordinates as expressions, and the points of those that move.

    The function takes (q, t) and returns them one after the other. Raises whatever `draw` does if
    it is a function of numbers alone.
    """
    q, t = ca.SX.sym("q", n), ca.SX.sym("t")
    shapes = draw(Expressions(q, 1), Expressions(t, 0))  # type: ignore[arg-type]
    points = [project(shape.points) for shape in shapes]
    moving = [ca.vec(x.sx) for x in points if isinstance(x, Expressions)]
    return shapes, ca.Function("draw", [q, t], [ca.densify(ca.vertcat(*moving, ca.SX(0, 1)))])
