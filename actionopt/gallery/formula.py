"""Formulas as the docstrings of the scenes write them, read into trees.

    L = m (l theta')^2 / 2 + m g l cos theta

A space multiplies, / divides all of the product before it by the next factor, a prime is a time
derivative, theta1 and x_i have an index. sin, cos and sqrt take the next symbol or bracket;
|x| is the size of x, d/dt (...) a total derivative, `sum over i of ...` and `sum over i < j of
...` a sum over bodies, of the next term. r and v that are no coordinates are the vectors of
position and velocity. Further sides and definitions may follow: `f = x - y = 0, with x = ...`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

FUNCTIONS = ("sin", "cos", "sqrt")
TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+(?:\.\d+)?)|(?P<rate>d/dt)|(?P<sum>sum over (?P<over>[^|()]*?) of)"
    r"|(?P<name>[A-Za-z]+)(?P<index>\d+|_\w+|_\([^)]*\))?(?P<primes>'*)|(?P<sign>[-+/^()|]))"
)


@dataclass(frozen=True)
class Number:
    """A number, as it is written."""

    text: str


@dataclass(frozen=True)
class Symbol:
    """A name, with an index and time derivatives."""

    name: str
    index: str = ""
    primes: int = 0


@dataclass(frozen=True)
class Sum:
    """Terms and whether each is subtracted."""

    terms: tuple[tuple[bool, Node], ...]


@dataclass(frozen=True)
class Product:
    """Factors."""

    factors: tuple[Node, ...]


@dataclass(frozen=True)
class Fraction:
    """One over the other."""

    top: Node
    bottom: Node


@dataclass(frozen=True)
class Power:
    """A base and its exponent."""

    base: Node
    exponent: Node


@dataclass(frozen=True)
class Call:
    """sin, cos or sqrt of something."""

    function: str
    argument: Node


@dataclass(frozen=True)
class Size:
    """|x|."""

    argument: Node


@dataclass(frozen=True)
class Rate:
    """A total time derivative."""

    argument: Node


@dataclass(frozen=True)
class Over:
    """A sum over bodies, `over` the index "i" or the pairs "i < j"."""

    over: str
    term: Node


Node = Number | Symbol | Sum | Product | Fraction | Power | Call | Size | Rate | Over


@dataclass(frozen=True)
class Formula:
    """Sides of an equation, definitions of symbols in it (two sides each), and words."""

    text: str
    sides: tuple[Node, ...]
    definitions: tuple[tuple[Node, ...], ...] = ()
    remark: str = ""


def formula(docstring: str) -> Formula:
    """Return the formula in the last paragraph of a docstring.

    >>> formula("Hold f = r - l = 0.").sides[2]
    Number(text='0')

    Raises
    ------
    ValueError
        If it is none, with the place at which reading stopped.
    """
    text = " ".join(docstring.strip().split("\n\n")[-1].split()).removesuffix(".")
    text, _, remark = text.removeprefix("Hold ").partition(": ")
    first, *others = text.split(", ")
    definitions = [part.removeprefix("with ") for part in others if part.startswith("with ")]
    words = [part for part in others if not part.startswith("with ")]
    return Formula(
        text,
        _sides(first),
        tuple(_sides(part) for part in definitions),
        ", ".join(words + [remark] * bool(remark)),
    )


def _sides(text: str) -> tuple[Node, ...]:
    return tuple(_Reader(side).whole() for side in text.split("="))


class _Reader:
    """Reads one expression by recursive descent."""

    def __init__(self, text: str) -> None:
        self.text, self.tokens, at = text, [], 0
        while at < len(text.rstrip()):
            token = TOKEN.match(text, at)
            if token is None:
                raise ValueError(f"expected a formula, found {text[at:]!r} in {text!r}")
            self.tokens.append(token)
            at = token.end()
        self.at, self.bars = 0, 0

    def whole(self) -> Node:
        node = self.sum()
        if self.at < len(self.tokens):
            raise self.error("the end")
        return node

    def sum(self) -> Node:
        terms = [(self.take("-"), self.term())]
        while self.sees("+", "-"):
            terms.append((self.take("-") or not self.take("+"), self.term()))
        return terms[0][1] if len(terms) == 1 and not terms[0][0] else Sum(tuple(terms))

    def term(self) -> Node:
        if self.sees_kind("sum"):
            over = self.next()["over"]
            return Over(over, self.term())
        node = self.factor()
        while self.starts_factor() or self.sees("/"):
            if self.take("/"):
                node = Fraction(node, self.factor())
            elif isinstance(node, Product):
                node = Product((*node.factors, self.factor()))
            else:
                node = Product((node, self.factor()))
        return node

    def factor(self) -> Node:
        node = self.atom()
        return Power(node, self.atom()) if self.take("^") else node

    def atom(self) -> Node:
        if self.take("("):
            node = self.sum()
            self.expect(")")
            return node
        if self.take("|"):
            self.bars += 1
            node = Size(self.sum())
            self.bars -= 1
            self.expect("|")
            return node
        if self.sees_kind("number"):
            return Number(self.next()["number"])
        if self.sees_kind("rate"):
            self.next()
            return Rate(self.atom())
        if self.sees_kind("name"):
            token = self.next()
            if token["name"] in FUNCTIONS:
                return Call(token["name"], self.atom())
            index = (token["index"] or "").lstrip("_").strip("()")
            return Symbol(token["name"], index, len(token["primes"]))
        raise self.error("a symbol or a bracket")

    def starts_factor(self) -> bool:
        bar = self.sees("|") and not self.bars
        kinds = ("number", "rate", "name")
        return bar or self.sees("(") or any(map(self.sees_kind, kinds))

    def sees(self, *signs: str) -> bool:
        return self.at < len(self.tokens) and self.tokens[self.at]["sign"] in signs

    def sees_kind(self, kind: str) -> bool:
        return self.at < len(self.tokens) and self.tokens[self.at][kind] is not None

    def next(self) -> re.Match[str]:
        self.at += 1
        return self.tokens[self.at - 1]

    def take(self, sign: str) -> bool:
        seen = self.sees(sign)
        self.at += seen
        return seen

    def expect(self, sign: str) -> None:
        if not self.take(sign):
            raise self.error(repr(sign))

    def error(self, wanted: str) -> ValueError:
        found = self.tokens[self.at][0].strip() if self.at < len(self.tokens) else "the end"
        return ValueError(f"expected {wanted}, found {found!r} in {self.text!r}")
