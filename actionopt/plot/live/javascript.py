"""CasADi functions as JavaScript: one line for each of their instructions."""

from __future__ import annotations

import casadi as ca

from actionopt.tools.tape import instructions

UNARY_JS = {
    ca.OP_ASSIGN: "{0}", ca.OP_NEG: "-{0}", ca.OP_SQ: "{0}*{0}", ca.OP_TWICE: "2*{0}",
    ca.OP_INV: "1/{0}", ca.OP_NOT: "+!{0}", ca.OP_ERF: "erf({0})",
    **{
        getattr(ca, f"OP_{name.upper()}"): f"Math.{call}({{0}})"
        for name, call in {
            **{f: f for f in "sqrt sin cos tan asin acos atan sinh cosh tanh exp log".split()},
            **{f: f for f in "asinh acosh atanh floor ceil sign log1p expm1".split()},
            "fabs": "abs",
        }.items()
    },
}  # fmt: skip
BINARY_JS = {
    ca.OP_ADD: "{0}+{1}", ca.OP_SUB: "{0}-{1}", ca.OP_MUL: "{0}*{1}", ca.OP_DIV: "{0}/{1}",
    ca.OP_POW: "Math.pow({0},{1})", ca.OP_CONSTPOW: "Math.pow({0},{1})",
    ca.OP_ATAN2: "Math.atan2({0},{1})", ca.OP_HYPOT: "Math.hypot({0},{1})",
    ca.OP_FMIN: "Math.min({0},{1})", ca.OP_FMAX: "Math.max({0},{1})", ca.OP_FMOD: "{0}%{1}",
    ca.OP_COPYSIGN: "(({1}<0||Object.is({1},-0))?-1:1)*Math.abs({0})",
    ca.OP_LT: "+({0}<{1})", ca.OP_LE: "+({0}<={1})", ca.OP_EQ: "+({0}=={1})",
    ca.OP_NE: "+({0}!={1})", ca.OP_AND: "{0}&&{1}?1:0", ca.OP_OR: "{0}||{1}?1:0",
    ca.OP_IF_ELSE_ZERO: "{0}?{1}:0",
}  # fmt: skip


def body(function: ca.Function) -> str:
    """Return the body of a JavaScript function of (x, o, w): arguments, results, working memory.

    `x[i][k]` is entry k of argument i, `o[i][k]` nonzero k of result i, and `w` an array of
    `function.sz_w()` numbers. A function that CasADi has and JavaScript has not, `erf`, is asked
    of whoever runs the text.

    Raises ValueError for an operation that has no counterpart here.
    """
    lines = []
    for what, into, of, value in instructions(function):
        if what == ca.OP_OUTPUT:
            lines.append(f"o[{into[0]}][{into[1]}]=w[{of[0]}]")
            continue
        if what == ca.OP_INPUT:
            right = f"x[{of[0]}][{of[1]}]"
        elif what == ca.OP_CONST:
            right = number(value)
        elif what in UNARY_JS:
            right = UNARY_JS[what].format(f"w[{of[0]}]")
        elif what in BINARY_JS:
            right = BINARY_JS[what].format(*(f"w[{i}]" for i in of))
        else:
            raise ValueError(
                "expected a law of arithmetic, powers, exponentials, trigonometric functions and "
                f"comparisons, found CasADi's operation {what} in {function.name()}, which a page "
                "cannot compute; write it with those"
            )
        lines.append(f"w[{into[0]}]={right}")
    return ";".join(lines)


def number(value: float) -> str:
    """Return a number as JavaScript reads it, to the last bit.

    >>> number(0.1), number(2.0), number(float("inf"))
    ('0.1', '2', 'Infinity')
    """
    text = repr(float(value)).replace("inf", "Infinity").replace("nan", "NaN")
    return text.removesuffix(".0")
