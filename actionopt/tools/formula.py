"""Formulas as the docstrings of the scenes write them, read as expressions of Python.

    L = m (l theta')^2 / 2 + m g l cos theta

A space multiplies, / divides all of the product before it by the next factor, a prime is a time
derivative, theta1 and x_i have an index. sin, cos and sqrt take the next symbol or bracket;
|x| is the size of x, dL/dv a slope, d/dt (...) a total derivative, F(x,t) a function, and
`sum over i of ...` and `sum over i < j of ...` a sum over bodies, of the next term. r and v that
are no coordinates are the vectors of position and velocity. Further sides and definitions may
follow: `f = x - y = 0, with x = ...`.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass

PRIME = "\u02b9"  # a letter to Python
RULES = (  # from a docstring's way of writing to Python's, in this order
    (r"\bd/dt \(", "rate("),
    (r"\bd([A-Za-z]\d?)/d(\w+)", r"slope(\1, \2)"),
    (r"\b(sin|cos|sqrt) (\w+)", r"\1(\2)"),
    (r"\|(.*?)\|", r"size(\1)"),
    (r"sum over (.*?) of (\(.*\)|.*?)(?= \+ |$)", r"over(\1, \2)"),
    (r"([A-Za-z]+)_(?:\((.*?)\)|(\w+))('*)", r"\1\4[\2\3]"),
    ("'", PRIME),
    (r"\^", "**"),
    (r"^-", "0 - "),  # the sign is the term's, not the first factor's
    (r"(?<![-+/<,(]) (?![-+/<])", " * "),
)


@dataclass(frozen=True)
class Formula:
    """Sides of an equation, definitions of symbols in it (two sides each), and words."""

    text: str
    sides: tuple[ast.expr, ...]
    definitions: tuple[tuple[ast.expr, ...], ...] = ()
    remark: str = ""


def formula(docstring: str) -> Formula:
    """Return the formula in the last paragraph of a docstring.

    Raises ValueError for anything but a formula.

    >>> ast.unparse(formula("Hold f = r - l = 0.").sides[1])
    'r - l'
    """
    text = " ".join(docstring.strip().split("\n\n")[-1].split()).removesuffix(".")
    text, _, remark = re.sub("^(Hold|Keep) ", "", text).partition(": ")
    first, *others = text.split(", ")
    definitions = [part.removeprefix("with ") for part in others if part.startswith("with ")]
    words = [part for part in others if not part.startswith("with ")]
    return Formula(
        text,
        _sides(first),
        tuple(_sides(part) for part in definitions),
        ", ".join(words + [remark] * bool(remark)),
    )


def _sides(text: str) -> tuple[ast.expr, ...]:
    return tuple(_expression(side.strip()) for side in text.split("="))


def _expression(text: str) -> ast.expr:
    written = text
    for pattern, replacement in RULES:
        written = re.sub(pattern, replacement, written)
    try:
        return ast.parse(written, mode="eval").body
    except SyntaxError as error:
        raise ValueError(f"expected a formula, found {text!r}: {error.msg}") from error
