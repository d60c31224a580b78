"""Lengths: functions homogeneous of degree one in the velocities, which know no time."""

from __future__ import annotations

from contextlib import suppress

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.evaluation import NumericLaws
from actionopt.mechanics.laws.identity import GENERIC, general_states, negligible, remainder
from actionopt.tools.types import Array


def is_length(system: NumericLaws) -> bool:
    """Whether L(q, s v) = s L(q, v) for s > 0."""
    if system.order > 1:
        return False
    with suppress(ValueError):  # finite nowhere where it is tried
        return _doubles(*_at_twice_speed(system, "value"))
    return False


def check_length(system: NumericLaws) -> None:
    """Raise ValueError unless F is homogeneous, and somewhere finite and positive."""
    once, twice = _at_twice_speed(system, "length")
    if not _doubles(once, twice):
        raise ValueError(
            "expected a length homogeneous of degree one in v, length(q, s v) = s length(q, v) "
            "for s > 0, such as np.sqrt(v @ v) or a travel time, found one that is not; where "
            "it is the Lagrangian of a motion, use System(lagrangian, coordinates)"
        )
    if not np.any(once[:GENERIC] > 0):
        raise ValueError(
            "expected a length that is positive where v is not zero, such as np.sqrt(v @ v), "
            f"found none that is at {GENERIC} places and velocities"
        )


def square(F: ca.SX) -> ca.SX:
    """Return F^2, without the roots that are factors of F: smooth where they vanish."""
    code = F.op()
    if code == ca.OP_SQRT:
        return F.dep(0)
    if code == ca.OP_TWICE:
        return ca.SX.binary(ca.OP_MUL, 4, square(F.dep(0)))
    if code in (ca.OP_MUL, ca.OP_DIV):
        return ca.SX.binary(code, square(F.dep(0)), square(F.dep(1)))
    return ca.SX.unary(ca.OP_SQ, F)


def _at_twice_speed(system: NumericLaws, name: str) -> tuple[Array, Array]:
    """Return F(q, v) and F(q, 2 v) of the function `name` in general position, both (K, 1)."""
    (q, v, t), packed = general_states(system.n), system.table.pack(system.table.defaults)
    F = system.pointwise(name)
    return F(q, v, t, packed)[0].copy(), F(q, 2 * v, t, packed)[0]


def _doubles(once: Array, twice: Array) -> bool:
    """Whether the values F(q, 2 v) are 2 F(q, v), (K, 1): their round-off, too, whatever cancels.

    Raises ValueError if none is finite.
    """
    return negligible(remainder(np.hstack([twice, -2 * once])[None]))
