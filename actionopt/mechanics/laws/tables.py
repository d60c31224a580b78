"""Tables of numbers as laws: np.interp of an expression, in time at a cost that does not grow.

A table in the time of more than a few points is a function that CasADi calls. It has two results:
the value, and which piece of the table it is from, by which the instants at which the table has its
kinks are found (`instants`).
"""

from __future__ import annotations

import math
import re
from typing import Any
from zlib import crc32

import casadi as ca
import numpy as np

from actionopt.tools.tape import LINEAR_TABLE, PIECE, Tape
from actionopt.tools.types import Array

# Points up to which a table is written out. Measured: a call takes as long as 4 to 16 pieces; what
# is written out can be read as a formula.
MOST_WRITTEN = 16
SPIKE = 3.0  # times the mean change of a table's slope: of a sine it is 1.6 at most. Ad hoc.
PATH_NAMES = ("q", "v", "a", "j", "s")  # of the symbols of a path (`tracing.STATE`)


def interp(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None, period: Any = None):
    """Return np.interp of expressions x, with points of numbers; values may be expressions.

    Parameters
    ----------
    x : casadi.SX
        Of any shape.
    xp : array_like
        (N,), increasing.
    fp : array_like or casadi.SX
        (N,).
    left, right, period
        As those of np.interp.

    Raises
    ------
    ValueError
        For points that are no numbers or do not increase, or another number of values.
    """
    points, values = _numbers(xp), ca.vec(fp) if isinstance(fp, ca.SX) else _numbers(fp)
    if points is None or values is None:
        what = "points" if points is None else "values"
        hint = "" if points is None else "; expressions among them go with `np.stack`"
        raise ValueError(
            f"expected {what} of np.interp that are finite numbers, found others{hint}"
        )
    count = values.numel() if isinstance(values, ca.SX) else values.size
    if points.size != count or not count:
        raise ValueError(f"expected as many values as points, found {count} and {points.size}")
    if period is not None:
        period = abs(period)
        if not period > 0:
            raise ValueError(f"expected a period of np.interp that is not zero, found {period}")
        points, order, which = np.unique(points % period, return_index=True, return_inverse=True)
        if points.size < count and (
            isinstance(values, ca.SX) or (values != values[order][which]).any()
        ):
            raise ValueError(
                "expected one value of np.interp at a time of its period, found points that are a "
                "period apart with two of them; leave one out"
            )
        points = np.r_[points[-1] - period, points, points[0] + period]
        values = values[np.r_[order[-1], order, order[0]].tolist()]
        x = x - period * ca.floor(x / period)
        left = right = None
    if not (np.diff(points) > 0).all():
        raise ValueError("expected points of np.interp that increase, found others")
    if points.size == 1:
        found = ca.SX.ones(x.shape) * values[0]
    elif not _is_of_path(x) and (isinstance(values, ca.SX) or points.size > MOST_WRITTEN):
        found = _lookup(x, points, values)
    else:
        found = _write(x, points, values)
    if left is not None:
        found = ca.if_else(x < points[0], left, found)
    return found if right is None else ca.if_else(x > points[-1], right, found)


def refuse_lost_derivatives(law: Tape) -> None:
    """Raise ValueError for a table of CasADi's whose derivatives by its values are zero there."""
    if law.operations.isdisjoint((ca.OP_CALL, LINEAR_TABLE)):
        return
    for table in [node.function for node in law.nodes if node.function is not None]:
        parametric = table.class_name().endswith("Interpolant") and table.n_in() > 1
        if parametric and not table.reverse(1).nnz_out(1):
            raise ValueError(
                f"expected tables with derivatives by their values, found the interpolant "
                f"{table.name()!r}, whose values are an argument and whose derivatives by these "
                "are zero in CasADi; make a bspline with the option {'inline': True}, or take "
                "np.interp for a linear one"
            )


def pieces(table: ca.Function) -> int:
    """Return how many pieces a table has, 0 where it does not tell."""
    if PIECE not in table.name_out():
        return 0
    return round(float(table.call([math.inf] + [0] * (table.n_in() - 1))[1]))


def knots(table: ca.Function) -> Array:
    """Return where a linear table of CasADi's in one argument bends, as far as samples may miss it.

    All points of a table that is short; of others some of those at which the slope changes far
    more than it does in the mean, as in a spike. None of what is no such table.
    """
    if table.class_name() != "LinearInterpolant" or table.n_in() > 1 or table.numel_in(0) > 1:
        return np.empty(0)
    points, values = read_table(table)
    if points.size <= MOST_WRITTEN:
        return points
    slopes = np.diff(values, axis=0) / np.diff(points)[:, None]
    bends = np.abs(np.diff(slopes, axis=0)).max(axis=1)
    most = np.argsort(bends)[-MOST_WRITTEN:]
    return np.sort(points[1:-1][most[bends[most] > SPIKE * bends.mean()]])


def points_of(table: ca.Function) -> Array:
    """Return the points (N,) of a table whose values are an argument (`_lookup`)."""
    numbers = range(table.numel_in(1))
    found = [x for x, y in _read_all(table) if y.tolist() == [*numbers]]
    return found[0] if found else np.empty(0)


def read_table(table: ca.Function) -> tuple[Array, Array]:
    """Return the points (N,) of a linear table in one argument, and the values (N, results).

    Both are empty where they cannot be read.
    """
    known = _read_all(table)
    points, values = known[-1] if known else (np.empty(0), np.empty(0))
    return points, values.reshape(points.size, -1)


def _read_all(table: ca.Function) -> list[tuple[Array, Array]]:
    """Return the points and the values of all linear tables in one argument in a function.

    CasADi tells them in the program in C of it alone.
    """
    program = ca.CodeGenerator("table")
    program.add(table)
    text = program.dump()
    numbers = {
        name: np.array(given.split(","), dtype=float)
        for name, given in re.findall(r"casadi_real (\w+)\[\d+\] =\s*\{(.*?)\};", text, re.DOTALL)
    }
    names = re.findall(r"casadi_interpn\(\w+\[0\], 1, (\w+), \w+, (\w+),", text)
    return [(numbers[x], numbers[y]) for x, y in names if x in numbers and y in numbers]


def _numbers(given: Any) -> Array | None:
    """Return finite numbers, (N,), or None where it has others."""
    try:
        found = np.array(given, dtype=float)
    except (TypeError, ValueError):
        return None
    return found if found.ndim == 1 and np.isfinite(found).all() else None


def _is_of_path(x: ca.SX) -> bool:
    """Return whether it may depend on the path: there narrow steps are sought in what is written.

    A parameter may have the name of a coordinate or of a rate as well.
    """
    return any(one.name().partition("_")[0] in PATH_NAMES for one in ca.symvar(x))


def _write(x: ca.SX, points: Array, values: Array | ca.SX) -> ca.SX:
    """Return a table as nested branches."""
    found = ca.SX(values[-1])
    for k in range(points.size - 2, -1, -1):
        slope = (values[k + 1] - values[k]) / (points[k + 1] - points[k])
        found = ca.if_else(x < points[k + 1], values[k] + (x - points[k]) * slope, found)
    return ca.if_else(x < points[0], values[0], found)


def _lookup(x: ca.SX, points: Array, values: Array | ca.SX) -> ca.SX:
    """Return a table as the call of a function."""
    at, grid, last = ca.MX.sym("x"), points.tolist(), points.size - 1
    # The slope is the right one, as within: a path that begins with the table is in its piece.
    inside = ca.if_else(at < grid[0], grid[0], ca.if_else(at < grid[-1], at, grid[-1]))
    of_table = [at]
    if isinstance(values, ca.SX):  # CasADi's parametric tables have no derivatives by the values
        y = ca.MX.sym("y", points.size)
        of_table.append(y)
        place = _line(points, np.arange(points.size))(inside)
        first = ca.fmin(ca.floor(place), last - 1)
        value = y[first] + (place - first) * (y[first + 1] - y[first])
    else:
        value = _line(points, values)(inside)
    # The slope of another table is the number of the piece: each call would copy a constant.
    ends = np.r_[2 * grid[0] - grid[1], points, 2 * grid[-1] - grid[-2]]
    rising = np.cumsum(np.r_[0, np.arange(points.size + 1) * np.diff(ends)])
    piece = ca.jacobian(_line(ends, rising)(at), at)
    names = ["x", "y"][: len(of_table)], ["value", PIECE]
    # Derivatives are called by this name, and another table with other points by another.
    name = f"interp_{crc32(points.tobytes()):x}"
    table = ca.Function(name, of_table, [value, piece], *names, {"never_inline": True})
    of = [values] if isinstance(values, ca.SX) else []
    return ca.reshape(
        ca.vertcat(*[table(one, *of)[0] for one in ca.vertsplit(ca.vec(x))]), *x.shape
    )


def _line(points: Array, values: Array) -> ca.Function:
    return ca.interpolant("line", "linear", [points.tolist()], values.tolist())
