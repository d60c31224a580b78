"""Formulas typeset, in the browser's own language for it."""

from __future__ import annotations

import ast
import html
import re
from collections.abc import Collection, Sequence

from actionopt.tools.formula import PRIME, Formula, formula
from actionopt.tools.greek import GREEK

# Over a symbol: time derivatives. Combining marks of three and four dots land beside their letter.
DOTS = "&#x2D9;", "&#xA8;", 3 * "&#x2D9;", 4 * "&#x2D9;"
LETTERS = {
    "w": "omega",
    "lamda": "lambda",
    "hbar": "\u0127",
}  # how a name of the code is written in a book
OF_MANY = ("L", "H")  # variables, so that their slopes are partial derivatives
FUNCTIONS = "sin cos tan arcsin arccos arctan sinh cosh tanh log".split()
VECTORS = ("r", "v", "Q")
TIMES_ML, APPLY_ML = "<mo>&#x2062;</mo>", "<mo>&#x2061;</mo>"
PLUS_ML, MINUS_ML, BAR_ML = (
    "<mo>+</mo>",
    "<mo>&#x2212;</mo>",
    '<mo stretchy="false" fence="true">|</mo>',
)
TIME_DERIVATIVE = "<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"
LINE_LETTERS = 38  # letters of a line, about
THIN = '<mspace width="0.17em"/>'


def mathml(given: Formula, scalars: Collection[str]) -> str:
    """Return a formula as MathML; r, v and Q that are not among `scalars` are vectors."""
    write = _Writer(scalars)
    rows = [row for sides in (given.sides, *given.definitions) for row in write.lines(sides)]
    body = "".join(f"<mtr><mtd>{row}</mtd></mtr>" for row in rows)
    body = f'<mtable displaystyle="true">{body}</mtable>'
    return f'<math display="block" alttext="{html.escape(given.text)}">{body}</math>'


def inline(text: str, scalars: Collection[str]) -> str:
    """Return an expression, as docstrings write it, as MathML within a line."""
    (side,) = formula(text).sides
    return f'<math alttext="{html.escape(text)}"><mrow>{_Writer(scalars)(side)}</mrow></math>'


def symbol(name: str) -> str:
    """Return the name of a coordinate or parameter as MathML."""
    node = ast.Name(name.replace("'", PRIME))
    return f'<math alttext="{name}"><mrow>{_Writer([name])(node)}</mrow></math>'


class _Writer:
    """Writes expressions; `scalars` are the names that are no vectors."""

    def __init__(self, scalars: Collection[str]) -> None:
        self.scalars = scalars

    def __call__(self, node: ast.expr, exponent: str = "") -> str:
        """Return a node as MathML, raised to an exponent if there is one."""
        match node:
            case ast.Name() | ast.Subscript():
                return _script(*self.parts(node), exponent)
            case ast.Call(ast.Name(name), [argument]) if name in FUNCTIONS:
                name = _script(f"<mi>{name}</mi>", "", exponent)
                return f"<mrow>{name}{APPLY_ML}{THIN}{self.factor(argument)}</mrow>"
            case _ if exponent:
                plain = isinstance(node, (ast.Constant, ast.Call))
                return _script(self(node) if plain else _bracket(self(node)), "", exponent)
            case ast.Constant(value):
                return f"<mn>{value}</mn>"
            case ast.BinOp(base, ast.Pow(), ast.BinOp(ast.Constant(a), ast.Div(), ast.Constant(b))):
                return self(base, f"<mrow><mn>{a}</mn><mo>/</mo><mn>{b}</mn></mrow>")
            case ast.BinOp(base, ast.Pow(), power):
                return self(base, self(power))
            case ast.BinOp(ast.Constant(top), ast.Div(), ast.Constant(bottom)):
                return f"<mfrac><mn>{top}</mn><mn>{bottom}</mn></mfrac>"
            case ast.BinOp(top, ast.Div(), ast.Constant() as number):  # half of it, as in books
                share = f"<mfrac><mn>1</mn>{self(number)}</mfrac>"
                return f"<mrow>{share}{TIMES_ML}{self.factor(top)}</mrow>"
            case ast.BinOp(top, ast.Div(), bottom):
                return f"<mfrac>{self(top)}{self(bottom)}</mfrac>"
            case ast.BinOp(_, ast.Mult(), _):
                return f"<mrow>{self.product(node)}</mrow>"
            case ast.BinOp():
                return f"<mrow>{''.join(self.terms(node))}</mrow>"
            case ast.Compare(a, [ast.Lt()], [b]):
                return f"{self(a)}<mo>&lt;</mo>{self(b)}"
            case ast.Call(ast.Name("exp"), [argument]):
                return f"<msup><mi>e</mi><mrow>{self(argument)}</mrow></msup>"
            case ast.Call(ast.Name("sqrt"), [argument]):
                return f"<msqrt>{self(argument)}</msqrt>"
            case ast.Call(ast.Name("size"), [argument]):
                return f"<mrow>{BAR_ML}{self(argument)}{BAR_ML}</mrow>"
            case ast.Call(ast.Name("rate"), [argument]):
                return f"{TIME_DERIVATIVE}{THIN}{_bracket(self(argument))}"
            case ast.Call(ast.Name("slope"), [what, by]):
                sign = "&#x2202;" if ast.unparse(what) in OF_MANY else "d"
                top, bottom = (f"<mrow><mi>{sign}</mi>{self(x)}</mrow>" for x in (what, by))
                return f"<mfrac>{top}{bottom}</mfrac>"
            case ast.Call(ast.Name(name) as function, arguments) if len(name) == 1:
                inner = "<mo>,</mo>".join(map(self, arguments))
                return f"<mrow>{self(function)}{APPLY_ML}{_bracket(inner)}</mrow>"
            case ast.Call(ast.Name("over"), [over, term]):
                sign = f"<munder><mo>&#x2211;</mo><mrow>{self(over)}</mrow></munder>"
                return f"{sign}{self.factor(term)}"
        raise ValueError(f"expected a formula, found {ast.unparse(node)!r}")

    def lines(self, sides: Sequence[ast.expr]) -> list[str]:
        """Return an equation, broken before terms, or its sign, where it is long."""
        text, found = "", []
        for side in sides:
            for k, term in enumerate(self.terms(side)):
                part = "<mo>=</mo>" * (k == 0 and side is not sides[0]) + term
                if text and _width(text) + _width(part) > LINE_LETTERS:
                    found.append(text)
                    text = '<mspace width="1.6em"/>'
                text += part
        return [f"<mrow>{row}</mrow>" for row in [*found, text]]

    def parts(self, node: ast.Name | ast.Subscript) -> tuple[str, str]:
        """Return a symbol without its index, and the index."""
        at = self(node.slice) if isinstance(node, ast.Subscript) else ""
        whole = ast.unparse(node).partition("[")[0]
        name, digits, primes = re.fullmatch(rf"(.+?)_?(\d*)({PRIME}*)", whole).groups()  # type: ignore[union-attr]
        if len(name) == 2 and name.isalpha() and name not in GREEK:
            name, at = name[0], f"<mi>{name[1]}</mi>"  # Ex is the x-component of E
        if name in VECTORS and name + digits not in self.scalars:
            body = f'<mi class="vector" mathvariant="normal">{name}</mi>'
        else:
            name = LETTERS.get(name, name)
            body = f"<mi>{GREEK.get(name, name)}</mi>"
        if len(primes) > len(DOTS):
            body = f"<msup>{body}{_bracket(f'<mn>{len(primes)}</mn>')}</msup>"
        elif primes:
            body = f'<mover accent="true">{body}<mo>{DOTS[len(primes) - 1]}</mo></mover>'
        return body, at or (f"<mn>{digits}</mn>" if digits else "")

    def terms(self, node: ast.expr) -> list[str]:
        """Return the terms of a sum with their signs."""
        match node:
            case ast.BinOp(ast.Constant(0), ast.Sub(), term):
                return [MINUS_ML + self.factor(term)]
            case ast.BinOp(before, ast.Add() | ast.Sub() as sign, term):
                sign = PLUS_ML if isinstance(sign, ast.Add) else MINUS_ML
                return [*self.terms(before), sign + self.factor(term)]
        return [self.factor(node)]

    def product(self, node: ast.BinOp) -> str:
        """Return the factors of a product, with air beside those that need it."""
        before, written = node.left, self.factor(node.left)
        if isinstance(before, ast.BinOp) and isinstance(before.op, ast.Mult):
            before, written = before.right, self.product(before)
        air = THIN * (_is_spaced(before) or _is_spaced(node.right))
        return written + TIMES_ML + air + self.factor(node.right)

    def factor(self, node: ast.expr) -> str:
        """Write a node that stands beside others: a sum in brackets."""
        is_sum = isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub))
        return _bracket(self(node)) if is_sum else self(node)


def _script(body: str, index: str, exponent: str) -> str:
    kind = "sub" * bool(index) + "sup" * bool(exponent)
    return f"<m{kind}>{body}{index}{exponent}</m{kind}>" if kind else body


def _width(written: str) -> int:
    """Return about how many letters wide it is."""
    return len(re.sub(r"<[^>]*>|&#x206[12];", "", html.unescape(written)))


def _is_spaced(node: ast.expr) -> bool:
    """Return whether a node is set with space beside it."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        node = node.left
    name = re.sub(rf"[\d{PRIME}]", "", node.id) if isinstance(node, ast.Name) else ""
    return isinstance(node, ast.Call) or (len(name) > 2 and name not in GREEK)


def _bracket(inner: str) -> str:
    """Return what is written between brackets, as tall as it is where that is a fraction."""
    how = "" if "<mfrac>" in inner else ' stretchy="false"'
    return f"<mrow><mo{how}>(</mo><mrow>{inner}</mrow><mo{how}>)</mo></mrow>"
