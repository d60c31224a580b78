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


def _made(code: int, x: tuple[ca.SX, ...]) -> ca.SX:
    return ca.SX.unary(code, x[0]) if len(x) == 1 else ca.SX.binary(code, x[0], x[1])
