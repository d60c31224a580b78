"""Formulas typeset, in the browser's own language for it."""

from __future__ import annotations

import html
import re
from collections.abc import Collection, Sequence

from actionopt.gallery.formula import (
    Call,
    Formula,
    Fraction,
    Node,
    Number,
    Power,
    Product,
    Rate,
    Size,
    Sum,
    Symbol,
)

LETTERS = {"w": "omega"}  # how a name of the code is written in a book
VECTORS = ("r", "v", "Q")
TIMES, APPLY = "<mo>&#x2062;</mo>", "<mo>&#x2061;</mo>"
LINE = 38  # letters of a line, about
THIN = '<mspace width="0.17em"/>'


def mathml(formula: Formula, scalars: Collection[str]) -> str:
    """Return a formula as MathML; r, v and Q that are not among `scalars` are vectors."""
    write = _Writer(frozenset(scalars))
    rows: list[str] = []
    for sides in (formula.sides, *formula.definitions):
        rows += write.lines(sides)
    body = "".join(f"<mtr><mtd>{row}</mtd></mtr>" for row in rows)
    body = f'<mtable displaystyle="true">{body}</mtable>'
    return f'<math display="block" alttext="{html.escape(formula.text)}">{body}</math>'


def symbol(name: str) -> str:
    """Return the name of a coordinate or parameter as MathML."""
    letters, digits = re.fullmatch(r"([A-Za-z]+)(\d*)", name).groups()  # type: ignore[union-attr]
    written = _Writer(frozenset([name]))(Symbol(letters, digits))
    return f'<math alttext="{name}"><mrow>{written}</mrow></math>'


class _Writer:
    """Writes nodes; `scalars` are the names that are no vectors."""

    def __init__(self, scalars: frozenset[str]) -> None:
        self.scalars = scalars

    def __call__(self, node: Node) -> str:
        if isinstance(node, Number):
            return f"<mn>{node.text}</mn>"
        if isinstance(node, Symbol):
            body, index = self.parts(node)
            return f"<msub>{body}{index}</msub>" if index else body
        if isinstance(node, Sum):
            return self.sum(node)
        if isinstance(node, Product):
            return self.product(node)
        if isinstance(node, Fraction):
            return self.fraction(node)
        if isinstance(node, Power):
            return self.power(node)
        if isinstance(node, Call):
            return self.call(node)
        if isinstance(node, Size):
            bar = '<mo stretchy="false" fence="true">|</mo>'
            return f"<mrow>{bar}{self(node.argument)}{bar}</mrow>"
        if isinstance(node, Rate):
            by = "<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"
            return f"{by}{THIN}{_bracket(self(node.argument))}"
        over = "".join(
            f"<mo>{html.escape(c)}</mo>" if c == "<" else f"<mi>{c}</mi>" for c in node.over.split()
        )
        sign = f"<munder><mo>&#x2211;</mo><mrow>{over}</mrow></munder>"
        return f"{sign}{self.factor(node.term)}"

    def lines(self, sides: Sequence[Node]) -> list[str]:
        """Return an equation, broken before the terms of its last side where it is long."""
        *heads, last = sides
        text = "".join(f"{self(head)}<mo>=</mo>" for head in heads)
        found = []
        for k, term in enumerate(self.terms(last) if isinstance(last, Sum) else [self(last)]):
            if k and _width(text) + _width(term) > LINE:
                found.append(text)
                text = '<mspace width="1.6em"/>'
            text += term
        return [f"<mrow>{row}</mrow>" for row in [*found, text]]

    def parts(self, node: Symbol) -> tuple[str, str]:
        """Return a symbol without its index, and the index."""
        name, index = node.name, node.index
        if len(name) == 2 and name not in GREEK:
            name, index = name[0], name[1]  # Ex is the x-component of E
        name = LETTERS.get(name, name)
        vector = name in VECTORS and name + index not in self.scalars
        if vector:
            body = f'<mi class="vector" mathvariant="normal">{name}</mi>'
        else:
            body = f"<mi>{GREEK.get(name, name)}</mi>"
        if node.primes:
            dots = "&#x2D9;" if node.primes == 1 else "&#xA8;"
            body = f'<mover accent="true">{body}<mo>{dots}</mo></mover>'
        if not index:
            return body, ""
        pieces = re.findall(r"\d+|[A-Za-z]|[-+]", index)
        kinds = ("mn" if p.isdigit() else "mi" if p.isalpha() else "mo" for p in pieces)
        row = "".join(f"<{k}>{p}</{k}>" for k, p in zip(kinds, pieces, strict=True))
        return body, f"<mrow>{row}</mrow>" if len(pieces) > 1 else row

    def sum(self, node: Sum) -> str:
        return f"<mrow>{''.join(self.terms(node))}</mrow>"

    def terms(self, node: Sum) -> list[str]:
        """Return the terms of a sum with their signs."""
        rows = []
        for k, (minus, term) in enumerate(node.terms):
            sign = "<mo>&#x2212;</mo>" if minus else "<mo>+</mo>" if k else ""
            rows.append(sign + self.factor(term))
        return rows

    def product(self, node: Product) -> str:
        rows = [self.factor(node.factors[0])]
        for before, factor in zip(node.factors, node.factors[1:], strict=False):
            rows.append(TIMES + THIN * (_named(before) or _named(factor)) + self.factor(factor))
        return f"<mrow>{''.join(rows)}</mrow>"

    def fraction(self, node: Fraction) -> str:
        if isinstance(node.bottom, Number):  # half of it, as books write it
            share = f"<mfrac><mn>1</mn>{self(node.bottom)}</mfrac>"
            return f"<mrow>{share}{TIMES}{self.factor(node.top)}</mrow>"
        return f"<mfrac>{self(node.top)}{self(node.bottom)}</mfrac>"

    def power(self, node: Power) -> str:
        exponent = self(node.exponent)
        if isinstance(node.base, Symbol):
            body, index = self.parts(node.base)
            kind = "msubsup" if index else "msup"
            return f"<{kind}>{body}{index}{exponent}</{kind}>"
        if isinstance(node.base, Call):
            return self.call(node.base, exponent)
        plain = isinstance(node.base, (Number, Size))
        base = self(node.base) if plain else _bracket(self(node.base))
        return f"<msup>{base}{exponent}</msup>"

    def call(self, node: Call, exponent: str = "") -> str:
        if node.function == "sqrt":
            return f"<msqrt>{self(node.argument)}</msqrt>"
        name = f"<mi>{node.function}</mi>"
        name = f"<msup>{name}{exponent}</msup>" if exponent else name
        return f"<mrow>{name}{APPLY}{THIN}{self.factor(node.argument)}</mrow>"

    def factor(self, node: Node) -> str:
        """Write a node that stands beside others: a sum in brackets."""
        return _bracket(self(node)) if isinstance(node, Sum) else self(node)


def _width(written: str) -> int:
    """Return about how many letters wide it is."""
    return len(re.sub(r"<[^>]*>|&#x206[12];", "", html.unescape(written)))


def _named(node: Node) -> bool:
    """Return whether a node is one that needs air beside it."""
    inner = node.base if isinstance(node, Power) else node
    word = isinstance(inner, Symbol) and len(inner.name) > 2 and inner.name not in GREEK
    return word or isinstance(inner, (Call, Size, Rate))


def _bracket(inner: str) -> str:
    return f'<mrow><mo stretchy="false">(</mo>{inner}<mo stretchy="false">)</mo></mrow>'


NAMES = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi omicron pi rho "
    "final sigma tau upsilon phi chi psi omega"
).split()
GREEK = {name: chr(0x3B1 + k) for k, name in enumerate(NAMES)}
