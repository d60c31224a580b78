"""The instants of pulses: where a law varies in a moment of the time alone, between all samples.

A force such as exp(-((t - c) / w)^2) is seen by no sample if w is small, but the exponent is, from
any distance. Where a function of the time f(u(t)) can be narrow there is a g(t) that is least in
the middle of what is narrow, and whose slope points there from both sides:

    exp u, a^u         g = -u, a pulse; and u^2: where 1 / (1 + exp u) is a step
    tanh u, erf u, ..  g = u^2
    1 / u, u^a, log u  g = log |u|

The pulse is as wide as the distance s at which s |g'(c + s)| is one, also where g'' is zero, as of
exp(-((t - c) / w)^4). Elements that end at c and at either foot see it, and refinement finds the
rest; with c alone two sums over the same long element may miss it alike. Two pulses within one
interval of the samples are not found, nor is what depends on q as well.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from actionopt.mechanics.compiled import Pointwise
from actionopt.mechanics.switches import POWERS, QUOTIENTS, ROOTS
from actionopt.mechanics.tracing import SAMPLES, Symbols
from actionopt.tools.tape import Node, Tape, apply
from actionopt.tools.types import Array, NDInt

EXPONENTIALS = {ca.OP_EXP, ca.OP_EXPM1}
SIGMOIDS = {ca.OP_TANH, ca.OP_ERF, ca.OP_SINH, ca.OP_COSH, ca.OP_ATAN, ca.OP_ASINH}
TAILS = {*QUOTIENTS, *POWERS, *ROOTS}
PULSES = EXPONENTIALS | SIGMOIDS | TAILS
# Parts of the duration; a Gaussian of this s has three times the width at half its height that the
# samples are promised to see. Elements that end where they need not do no harm.
HIDDEN = 5.0 / SAMPLES
GROWN = 0.03  # 2 (h / s)^2 of a pulse one and a half times as wide, h being the distance of samples
FOOT = 8.0  # of the distance s: a Gaussian is 1e-14 there, the force of a hyperbolic step 5e-5
BISECTIONS = 60  # between two samples there are no more floats to halve


def pulses(s: Symbols, *laws: ca.SX) -> Pointwise | None:
    """Return the derivatives by t of all g of these laws, as a function of (t, p); or None."""
    arguments = [s.q, s.v, s.t, s.p]
    slopes: list[ca.SX] = []

    def of_time(node: Node, operands: list[tuple[ca.SX, bool] | None]) -> Any:
        """Return an expression and whether it depends on the time; None if on the path."""
        if node.kind == "constant":
            return ca.SX(node.value), False
        if node.kind == "input":
            of, row = node.entry
            return None if of < 2 else (arguments[of][row], of == 2)
        u = operands[-1 if node.operation in QUOTIENTS else 0]
        base, power = operands[0], operands[-1]
        if node.operation in POWERS and base is not None and power is not None and power[1]:
            slopes.append(-ca.jacobian(power[0] * ca.log(base[0]), s.t))
        if u is not None and u[1]:
            rate = ca.jacobian(u[0], s.t)
            if node.operation in EXPONENTIALS:
                slopes.append(-rate)
            if node.operation in TAILS:
                slopes.append(rate / u[0])
            elif node.operation in PULSES:
                slopes.append(2 * u[0] * rate)
        plain = [operand for operand in operands if operand is not None]
        if len(plain) < len(operands):
            return None
        return apply(node.operation, [x for x, _ in plain]), any(timed for _, timed in plain)

    Tape(arguments, laws).fold(of_time)
    varied = [slope for slope in slopes if ca.depends_on(slope, s.t)]
    if not varied:
        return None
    return Pointwise(ca.Function("pulses", [s.t, s.p], [ca.densify(ca.vertcat(*varied))]))


def centres(known: Pointwise, start: float, end: float, packed: Array) -> list[float]:
    """Return middles and feet of all pulses from `start` to `end` that samples may miss, in order.

    What lies outside is left out; a pulse centred at an end is told by its inner foot.
    """
    times, narrow = np.linspace(start, end, SAMPLES), HIDDEN * (end - start)

    def rises(which: NDInt, middle: Array, apart: Array) -> Array:
        """Return by how much each g rises so `apart` from its least value, on the steeper side."""
        each = np.arange(which.size)
        sides = [known((middle + by)[:, None], packed)[0][each, which] for by in (-apart, apart)]
        return apart * np.fmax.reduce(np.abs(sides))

    with np.errstate(all="ignore"):
        slope = known(times[:, None], packed)[0]
        # Across the least of what is hidden g' grows by h g'' (a logarithm's by 4 / h).
        grown = np.diff(slope, axis=0) * (times[1] - times[0]) > GROWN
        k, which = np.nonzero(grown & (slope[:-1] <= 0) & (slope[1:] >= 0))
        if not 0 < k.size < SAMPLES:
            return []
        a, b, each = times[k], times[k + 1], np.arange(k.size)
        for _ in range(BISECTIONS):
            middle = a + (b - a) / 2
            beyond = known(middle[:, None], packed)[0][each, which] > 0
            a, b = np.where(beyond, a, middle), np.where(beyond, middle, b)
        hidden = rises(which, b, np.full(b.size, narrow)) > 1
        found, which = b[hidden], which[hidden]
        apart = np.full(found.size, narrow)
        for _ in range(BISECTIONS):  # to its width
            narrower = rises(which, found, apart / 2) > 1
            if not narrower.any():
                break
            apart = np.where(narrower, apart / 2, apart)
    feet = np.concatenate([found - FOOT * apart, found + FOOT * apart])
    feet = feet[(feet > start) & (feet < end)]
    return np.unique(
        np.append(feet, found[np.minimum(found - start, end - found) > apart])
    ).tolist()
