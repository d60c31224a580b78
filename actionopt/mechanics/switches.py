"""The branches of a Lagrangian: L with the values of its comparisons, signs and roundings held.

They are in the expression as operations of their own. With their values as further arguments c,
L(q, v, t, c) is smooth; on a surface where c changes, L jumps if L(q, v, t, c before) and
L(q, v, t, c after) differ.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from actionopt.mechanics.compiled import Pointwise
from actionopt.mechanics.tracing import Symbols, is_smooth

STEP_CODES = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_SIGN, ca.OP_FLOOR, ca.OP_CEIL)
KINKS = (
    *STEP_CODES,
    ca.OP_FABS,
    ca.OP_FMIN,
    ca.OP_FMAX,
    ca.OP_FMOD,
    ca.OP_REMAINDER,
    ca.OP_COPYSIGN,
)
SUMS = (ca.OP_ADD, ca.OP_SUB, ca.OP_NEG, ca.OP_TWICE)
ENTIRE_CODES = (ca.OP_SQ, ca.OP_SIN, ca.OP_COS)
ROOTS = (ca.OP_SQRT, ca.OP_LOG, ca.OP_POW, ca.OP_CONSTPOW)
STEPPED = r"[<?!]|==|\b(sign|floor|ceil|copysign|fmod|remainder|atan2)\("  # as text


@dataclass(frozen=True, eq=False)
class Switches:
    """The steps of L that depend on q or v.

    Attributes
    ----------
    values : Pointwise
        Of (q, v, t, p): the steps' values c, (K, S).
    held : Pointwise
        Of (q, v, t, p, c): L with these values.
    texts : tuple of S str
        The steps as they are written in the coordinates, such as "0<y".
    """

    values: Pointwise
    held: Pointwise
    texts: tuple[str, ...]


def switches(s: Symbols, L: ca.SX, coordinates: Sequence[str]) -> Switches | None:
    """Return the steps of the Lagrangian L; None where it has none in q or v."""
    if re.search(STEPPED, str(L)) is None:
        return None
    arguments = [s.q, s.v, s.t, s.p]
    f = ca.Function("L", arguments, [L])
    names: list[ca.SX] = []  # the symbols c
    steps: list[ca.SX] = []  # what they stand for
    values: dict[int, tuple[ca.SX, ca.SX, bool]] = {}  # as it is, held, whether of q or v
    held = ca.SX(0)

    def step(value: ca.SX) -> ca.SX:
        names.append(ca.SX.sym(f"c{len(names)}"))
        steps.append(value)
        return names[-1]

    for k in range(f.n_instructions()):
        code, out, into = f.instruction_id(k), f.instruction_output(k), f.instruction_input(k)
        if code == ca.OP_OUTPUT:
            held = values[into[0]][1]
        elif code == ca.OP_INPUT:
            x = arguments[into[0]][into[1]]
            values[out[0]] = (x, x, into[0] < 2)
        elif code == ca.OP_CONST:
            x = ca.SX(f.instruction_constant(k))
            values[out[0]] = (x, x, False)
        else:
            plain, kept, of_path = zip(*[values[i] for i in into], strict=True)
            made = _made(code, plain)
            moves = any(of_path)
            if moves and code in STEP_CODES:
                values[out[0]] = (made, step(made), True)
            elif moves and code == ca.OP_COPYSIGN:
                values[out[0]] = (made, ca.fabs(kept[0]) * step(ca.sign(plain[1])), True)
            elif moves and code == ca.OP_ATAN2:
                side = ca.fabs(kept[0]) * step(ca.sign(plain[0]))  # of the branch cut
                values[out[0]] = (made, ca.atan2(side, kept[1]), True)
            elif moves and code in (ca.OP_FMOD, ca.OP_REMAINDER):
                whole = step((plain[0] - made) / plain[1])
                values[out[0]] = (made, kept[0] - whole * kept[1], True)
            else:
                values[out[0]] = (made, _made(code, kept), moves)
    if not names:
        return None
    c = ca.vertcat(*names)
    named = [[ca.SX.sym(x) for x in coordinates], [ca.SX.sym(f"v_{x}") for x in coordinates]]
    said = ca.substitute(steps, [s.q, s.v], [ca.vertcat(*row) for row in named])
    return Switches(
        Pointwise(ca.Function("steps", arguments, [ca.densify(ca.vertcat(*steps))])),
        Pointwise(ca.Function("held", [*arguments, c], [ca.densify(held)])),
        tuple(re.sub(r"^\((.*)\)$", r"\1", str(x)) for x in said),
    )


def is_smooth_in_path(s: Symbols, expression: ca.SX) -> bool:
    """Return whether no function with a kink or a jump in q or v is in the expression.

    One in t alone hides nothing of what the derivatives by q and v depend on.
    """
    if is_smooth(expression):
        return True
    f = ca.Function("whole", [s.q, s.v, s.t, s.p], [expression])
    of_path: dict[int, bool] = {}
    for k in range(f.n_instructions()):
        code, out, into = f.instruction_id(k), f.instruction_output(k), f.instruction_input(k)
        if code == ca.OP_INPUT:
            of_path[out[0]] = into[0] < 2
        elif code == ca.OP_CONST:
            of_path[out[0]] = False
        elif code != ca.OP_OUTPUT:
            of_path[out[0]] = any(of_path[i] for i in into)
            # Of the two operands of "x where c" only the condition c makes a kink.
            asked = into[:1] if code == ca.OP_IF_ELSE_ZERO else into
            if code in KINKS and any(of_path[i] for i in asked):
                return False
    return True


def is_jumpless(s: Symbols, L: ca.SX) -> bool:
    """Return whether it is plain that L cannot step: where it is finite it varies as widely as q.

    So it is for polynomials, sines and cosines of q and v, with one root, logarithm or quotient of
    a constant by these: where its argument vanishes L has a kink, or is infinite. Quotients of two
    that vanish may step, such as q / sqrt(q^2), functions of a quotient, such as arctan(1 / q), and
    differences, such as that of roots that are large.
    """
    CONSTANT, ENTIRE, ROOT, QUOTIENT, OTHER = range(5)
    f = ca.Function("L", [s.q, s.v, s.t, s.p], [L])
    kinds: dict[int, int] = {}
    for k in range(f.n_instructions()):
        code, out, into = f.instruction_id(k), f.instruction_output(k), f.instruction_input(k)
        if code == ca.OP_OUTPUT:
            return kinds[into[0]] < OTHER
        if code in (ca.OP_INPUT, ca.OP_CONST):
            moves = code == ca.OP_INPUT and into[0] < 2
            kinds[out[0]] = ENTIRE if moves else CONSTANT
            continue
        of = [kinds[i] for i in into]
        low, high = min(of), max(of)
        kind = OTHER
        if high == CONSTANT:
            kind = CONSTANT
        elif code in SUMS:  # of two that are not entire the large parts may cancel
            kind = high if len(of) == 1 or low <= ENTIRE else OTHER
        elif code == ca.OP_MUL:
            kind = high if low == CONSTANT or (low == ENTIRE and high <= ROOT) else OTHER
        elif code in ENTIRE_CODES and high == ENTIRE:
            kind = ENTIRE
        elif code == ca.OP_DIV and of[1] == CONSTANT:
            kind = of[0]
        elif code == ca.OP_INV or (code == ca.OP_DIV and of[0] == CONSTANT):
            kind = QUOTIENT if of[-1] <= ROOT else OTHER
        elif code in ROOTS and of[0] == ENTIRE and (len(of) == 1 or of[1] == CONSTANT):
            kind = QUOTIENT if code in (ca.OP_POW, ca.OP_CONSTPOW) else ROOT
        kinds[out[0]] = kind
    return False


def _made(code: int, x: tuple[ca.SX, ...]) -> ca.SX:
    return ca.SX.unary(code, x[0]) if len(x) == 1 else ca.SX.binary(code, x[0], x[1])
