"""The instants of pulses and steps: where a law varies in a moment, between all samples.

A force such as exp(-((t - c) / w)^2) is seen by no sample if w is small, but the exponent is, from
any distance. Where a function f(u(t)) of the time, or along a path, can be narrow there is a g(t)
that is least in the middle of what is narrow, and whose slope points there from both sides:

    exp u, a^u         g = -u, a pulse; and u^2: where 1 / (1 + exp u) is a step
    tanh u, erf u, ..  g = u^2
    1 / u, u^a, log u  g = log |u|
    u < w, |u - w|     g = (u - w)^2, much enlarged; so where a table of u bends, at w

The pulse is as wide as the distance s at which s |g'(c + s)| is one, also where g'' is zero, as of
exp(-((t - c) / w)^4). Elements that end at c and at either foot see it, and refinement finds the
rest; with c alone two sums over the same long element may miss it alike. Two pulses of one g within
one interval of the samples are not found. What depends on q is found along a path.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.columns import UFUNCS
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.switches import POWERS, QUOTIENTS, ROOTS, SUMS
from actionopt.mechanics.laws.tables import knots
from actionopt.mechanics.laws.tracing import SAMPLES, Symbols
from actionopt.tools.bisection import BISECTIONS, bisect
from actionopt.tools.tape import LINEAR_TABLE, Node, Tape
from actionopt.tools.types import Array, NDInt

EXPONENTIALS = {ca.OP_EXP, ca.OP_EXPM1}
SIGMOIDS = {ca.OP_TANH, ca.OP_ERF, ca.OP_SINH, ca.OP_COSH, ca.OP_ATAN, ca.OP_ASINH}
TAILS = {*QUOTIENTS, *POWERS, *ROOTS}
PULSES = EXPONENTIALS | SIGMOIDS | TAILS
SWITCHED = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_SIGN, ca.OP_FABS, ca.OP_FMIN, ca.OP_FMAX}
MAY_STEP = PULSES | SWITCHED
SIZED = TAILS | SWITCHED  # that step where their arguments vanish, in whatever unit
RATES_PLACE = 1  # the place of v among the arguments of a law
# On what an expression depends; of the state are q and v.
OF_NONE, OF_TIME, OF_PLACE, OF_STATE = range(4)
# Parts of the duration; a Gaussian of this s has three times the width at half its height that the
# samples are promised to see. Elements that end where they need not do no harm.
HIDDEN = 5.0 / SAMPLES
GROWN = 0.03  # 2 (h / s)^2 of a pulse one and a half times as wide, h being the distance of samples
# From one sample to the next: an argument that changes by less is of what they see. Ad hoc.
SAMPLED_CHANGE = 0.1
FOOT = 8.0  # of the distance s: a Gaussian is 1e-14 there, the force of a hyperbolic step 5e-5
ABRUPT = 1e-30  # width, squared, of what has none: shorter than any unit of length; ad hoc


def pulses(s: Symbols, *laws: Tape) -> Pointwise | None:
    """Return the derivatives by t of all g(t) of these laws, as a function of (t, p); or None."""
    slopes = [slope for slope in _slopes(s, laws, OF_TIME) if ca.depends_on(slope, s.t)]
    if not slopes:
        return None
    return Pointwise(ca.Function("pulses", [s.t, s.p], [ca.densify(ca.vertcat(*slopes))]))


def steps_along(s: Symbols, law: Tape) -> Pointwise | None:
    """Return the rates of all g(q, t) of a law, as a function of (q, v, t, p); or None."""
    slopes = _slopes(s, [law], OF_PLACE)
    if not slopes:
        return None
    arguments = [s.q, s.v, s.t, s.p]
    return Pointwise(ca.Function("steps", arguments, [ca.densify(ca.vertcat(*slopes))]))


def may_hide(law: Tape) -> bool:
    """Return whether a law of (q, v, t, p) may have steps that no sample along a path shows.

    A step alone has two sides, on which L differs: it takes two, or one that is crossed twice.
    """
    steps = 0

    def kind_of(node: Node, operands: list[tuple[int, bool]]) -> tuple[int, bool]:
        """Return on what a value depends, and whether it is affine in q and t."""
        nonlocal steps
        if node.kind == "constant":
            return OF_NONE, True
        if node.kind == "input":
            return (OF_PLACE, OF_STATE, OF_TIME, OF_NONE)[node.entry[0]], True
        code, (depends, affine) = node.operation, (max(x[0] for x in operands), operands[-1][1])
        affine &= operands[0][1]
        if depends == OF_PLACE and code == LINEAR_TABLE:
            steps += 2 * (knots(node.function).size > 0)
        if depends == OF_PLACE and code in MAY_STEP:
            steps += 1 if affine else 2
        if code in (ca.OP_MUL, ca.OP_DIV):
            affine &= operands[-1][0] == OF_NONE or (code == ca.OP_MUL and not operands[0][0])
        return depends, affine and (code in (*SUMS, ca.OP_MUL, ca.OP_DIV) or not depends)

    law.fold(kind_of)
    return steps > 1


class StepArguments:
    """The arguments u of all functions in a law of (q, v, t, p) that may be steps along a path."""

    def __init__(self, law: Tape) -> None:
        known = law.fold(_is_known)
        steps = [k for k, node in enumerate(law.nodes) if known[k] and node.operation in MAY_STEP]
        # And whether they vanish at a step, and in which unit they are.
        self._arguments: list[tuple[list[int], bool, float]] = []
        needed: set[int] = set()
        for node in law.nodes:
            if node.operation != LINEAR_TABLE or not known[node.operands[0]]:
                continue
            bends = knots(node.function)
            if bends.size:
                self._arguments.append((list(node.operands), False, np.diff(bends).min(initial=1)))
                needed.update(node.operands)
        for node in (law.nodes[k] for k in steps):
            of = node.operands[-1:] if node.operation in QUOTIENTS else node.operands[:1]
            if node.operation in (*SWITCHED, *POWERS):
                of = node.operands
            self._arguments.append((list(of), node.operation in SIZED, 1.0))
            needed.update(of)
        for k in range(len(law.nodes) - 1, -1, -1):
            if k in needed:
                needed.update(law.nodes[k].operands)
        self._program = [(k, law.nodes[k]) for k in sorted(needed)]

    @np.errstate(all="ignore")
    def may_be_narrow(self, arguments: Sequence[Array], since: Array, gap: Array) -> Array:
        """Return on which of C paths a step may be narrower than the `gap` between samples, (C,).

        As u changes by one from one sample to the next, or by as much as it is. `arguments` are q
        (n, K, C), none, the time (1, K, C) and the parameters (P, 1, C); K times since the start,
        (K, C), and gaps (C,).
        """
        values: dict[int, Any] = {}
        for k, node in self._program:
            if node.kind == "constant":
                values[k] = node.value
            elif node.kind == "input":
                values[k] = arguments[node.entry[0]][node.entry[1]]
            else:
                values[k] = UFUNCS[node.operation](*[values[i] for i in node.operands], out=None)
        narrow, most = np.zeros(gap.size, dtype=bool), None
        for of, sized, unit in self._arguments:
            u = values[of[0]] if len(of) == 1 else values[of[0]] - values[of[-1]]
            if not isinstance(u, np.ndarray) or len(u) == 1:
                continue
            change = np.abs(u[1:] - u[:-1])
            if sized:
                size = np.abs(u)
                narrow |= (change > np.minimum(size[1:], size[:-1])).any(axis=0)
                continue
            if most is None:
                most = SAMPLED_CHANGE * (since[1:] - since[:-1]) / gap
            narrow |= (change > most * unit).any(axis=0)
        return narrow


def _is_known(node: Node, operands: list[bool]) -> bool:
    """Return whether a value depends on q, t and parameters by functions that numpy has."""
    if node.kind != "operation":
        return node.kind == "constant" or node.entry[0] != RATES_PLACE
    return all(operands) and node.operation in UFUNCS and node.operation != ca.OP_IF_ELSE_ZERO


def _slopes(s: Symbols, laws: Sequence[Tape], wanted: int) -> list[ca.SX]:
    """Return the rates of all g that depend on the time alone, or on q as well, as is `wanted`."""
    arguments = [s.q, s.v, s.t, s.p]
    slopes: list[ca.SX] = []

    def rate_of(u: ca.SX) -> ca.SX:
        by_time = ca.jacobian(u, s.t)
        return by_time if wanted == OF_TIME else ca.jtimes(u, s.q, s.v) + by_time

    def expression(node: Node, operands: list[tuple[ca.SX, int] | None]) -> Any:
        """Return an expression and on what it depends; None if on more than is `wanted`."""
        if node.kind == "constant":
            return ca.SX(node.value), OF_NONE
        if node.kind == "input":
            of, row = node.entry
            depends = (OF_PLACE, OF_STATE, OF_TIME, OF_NONE)[of]
            return None if depends > wanted else (arguments[of][row], depends)
        slopes.extend(_slopes_of(node, operands, wanted, rate_of))
        plain = [operand for operand in operands if operand is not None]
        if len(plain) < len(operands):
            return None
        return node.of([x for x, _ in plain]), max(depends for _, depends in plain)

    for law in laws:
        law.fold(expression)
    return slopes


def _slopes_of(
    node: Node,
    operands: list[tuple[ca.SX, int] | None],
    wanted: int,
    rate_of: Callable[[ca.SX], ca.SX],
) -> Iterator[ca.SX]:
    """Yield the rates of the g of one operation; of each operand its expression, and on what."""
    code, plain = node.operation, [operand for operand in operands if operand is not None]
    known = len(plain) == len(operands)
    if code in POWERS and known and plain[1][1] == wanted:
        (base, _), (power, _) = plain
        yield -rate_of(power * ca.log(base))
    if code in SWITCHED and wanted == OF_PLACE and known and max(of for _, of in plain) == wanted:
        u = plain[0][0] - plain[1][0] if len(plain) == 2 else plain[0][0]
        yield u * rate_of(u) / ABRUPT
    argument = operands[-1 if code in QUOTIENTS else 0]
    if argument is None or argument[1] != wanted:
        return
    u = argument[0]
    if code in EXPONENTIALS:
        yield -rate_of(u)
    if code in TAILS:
        yield rate_of(u) / u
    elif code in PULSES:
        yield 2 * u * rate_of(u)
    elif code == LINEAR_TABLE and wanted == OF_PLACE:
        for w in knots(node.function):
            yield (u - w) * rate_of(u) / ABRUPT


def centres(known: Pointwise, start: float, end: float, packed: Array) -> list[float]:
    """Return middles and feet of all pulses from `start` to `end` that samples may miss, in order.

    What lies outside is left out; a pulse centred at an end is told by its inner foot.
    """
    times = np.linspace(start, end, SAMPLES)

    def slopes(t: Array) -> Array:
        return known(t[:, None], packed)[0]

    with np.errstate(all="ignore"):
        found, apart, _ = narrow_places(slopes, times, slopes(times), HIDDEN * (end - start))
    if not 0 < found.size < SAMPLES:
        return []
    feet = np.concatenate([found - FOOT * apart, found + FOOT * apart])
    feet = feet[(feet > start) & (feet < end)]
    return np.unique(
        np.append(feet, found[np.minimum(found - start, end - found) > apart])
    ).tolist()


def narrow_places(
    slopes: Callable[[Array], Array], times: Array, at_times: Array, narrow: float
) -> tuple[Array, Array, NDInt]:
    """Return where each g is least in less than `narrow`, how wide it is there, and after which.

    `slopes` returns those of all g at times (K,), (K, G): `at_times` (K, G) at the `times` (K,), in
    order, between which the least is sought.
    """
    # Across the least of what is hidden g' grows by h g'' (a logarithm's by 4 / h).
    rising = (at_times[:-1] <= 0) & (at_times[1:] >= 0)
    rising &= np.diff(at_times, axis=0) * np.diff(times)[:, None] > GROWN
    k, which = np.nonzero(rising)
    if not k.size:
        return np.empty(0), np.empty(0), k

    def rises(which: NDInt, middle: Array, apart: Array) -> Array:
        """Return by how much each g rises so `apart` from its least value, on the steeper side."""
        each = np.arange(which.size)
        sides = [slopes(middle + by)[each, which].copy() for by in (-apart, apart)]
        return apart * np.fmax.reduce(np.abs(sides))

    each = np.arange(k.size)
    _, b = bisect(times[k], times[k + 1], lambda t: ~(slopes(t)[each, which] > 0))
    hidden = rises(which, b, np.full(b.size, narrow)) > 1
    found, which, k = b[hidden], which[hidden], k[hidden]
    apart = np.full(found.size, narrow)
    for _ in range(BISECTIONS):  # to its width
        narrower = rises(which, found, apart / 2) > 1
        if not narrower.any():
            break
        apart = np.where(narrower, apart / 2, apart)
    return found, apart, k
