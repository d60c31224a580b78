"""A traced law written as formulas: the Lagrangian, and the equations of motion from it.

They come out as the docstrings of the scenes have them, `l theta'' = -g sin theta`: a space
multiplies, a prime is a time derivative, the multiplier is `lamda`, as in Python's libraries.

An expression is read as a sum of products of powers, multiplied out, in which equal products are
collected and sin^2 + cos^2 = 1; in the equations sums above a power of another are divided by it,
where that leaves no rest. What stands under a root or in a function is left as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from math import ceil
from typing import Any

import casadi as ca

from actionopt.mechanics.laws.laws import Laws
from actionopt.mechanics.laws.tracing import MULTIPLIERS, ParameterTable, stack
from actionopt.tools.tape import Node, Tape

MOST_TERMS = 60  # terms; more are no formula to be read (ad hoc)
ELEMENTARY = {
    ca.OP_SIN: "sin", ca.OP_COS: "cos", ca.OP_TAN: "tan", ca.OP_EXP: "exp", ca.OP_LOG: "log",
    ca.OP_FABS: "abs", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh", ca.OP_TANH: "tanh",
    ca.OP_ASIN: "arcsin", ca.OP_ACOS: "arccos", ca.OP_ATAN: "arctan",
}  # fmt: skip


@dataclass(frozen=True, order=True)
class Symbol:
    """A name, and its place in a product: parameters, coordinates and rates as they are given."""

    place: int
    name: str


# An atom is a Symbol, (function, sum) or (sum,); a product a sorted tuple of (atom, power).
Product = tuple[tuple[Any, Fraction], ...]
Sum = dict[Product, float | Fraction]
UNIT_PRODUCT: Product = ()


def lagrangian(system: Laws, table: ParameterTable) -> str:
    """Return L as a formula. Raises ValueError for one that cannot be written."""
    return f"L = {_text(_read(system, table, ca.vertcat(system.L))[0])}"


def equations(system: Laws, table: ParameterTable) -> list[str]:
    """Return the equations of motion as formulas, one for each coordinate, then the constraints.

    d/dt dL/dv = dL/dq + Q + sum over constraints of lambda df/dq (equation 12.8), what is common
    to all terms and no coordinate's divided out, accelerations to the left; with accelerations in L
    the equations of Euler and Poisson, d/dt (dL/dv - d/dt dL/da) on the left.

    Raises ValueError for a law that cannot be written.

    >>> import numpy as np
    >>> from actionopt.mechanics.system import System
    >>> pendulum = System(
    ...     lambda q, v, t, *, l, g: (l * v[0]) ** 2 / 2 + g * l * np.cos(q[0]),
    ...     ["theta"],
    ...     parameters={"l": 1.0, "g": 9.81},
    ... )
    >>> equations(pendulum, pendulum.table)
    ["l theta'' = -g sin theta"]
    """
    s, n, m = system.symbols, system.n, system.m
    higher, multipliers = ca.SX.sym("a", system.order * n), ca.SX.sym("lamda", m)
    *below, highest = jet = [system.place, *ca.vertsplit(stack(s.q, s.v), n)[1:]]
    rest = ca.gradient(system.L, highest)
    place, ahead = ca.vertcat(*jet, higher), ca.vertcat(*jet[1:], higher, ca.SX.zeros(n))
    for y in reversed(below):
        rate = ca.jtimes(rest, place, ahead) + ca.jacobian(rest, s.t)
        rest = ca.gradient(system.L, y) - rate
    if system.Q.numel():
        rest += system.Q
    if m:
        rest += ca.jacobian(system.f, system.place).T @ multipliers
    found = _read(system, table, ca.vertcat(-rest, system.f), higher, multipliers)
    rows = [_equation(row, {*_entry_names(table)}) for row in found[:n]]
    return rows + [f"{_text(row)} = 0" for row in found[n:]]


def _equation(row: Sum, parameters: set[str]) -> str:
    """Return a row that vanishes as an equation."""
    divided = tuple((x, -k) for x, k in _common(row) if _names(x) <= parameters)
    row = _times(row, {divided: Fraction(1)})
    left = {p: c for p, c in row.items() if any(getattr(x, "name", "")[-2:] == "''" for x, _ in p)}
    right = {p: -c for p, c in row.items() if p not in left}
    left, right = _cancel(left), _cancel(right)
    raised = _common_divisor([*left, *right])
    left, right = _times(left, raised), _times(right, raised)
    numbers = {abs(c) for c in (*left.values(), *right.values())}
    least = min(numbers)
    if len(numbers) == 1 or (least > 1 and all(c / least % 1 == 0 for c in numbers)):
        left, right = _scale(left, 1 / least), _scale(right, 1 / least)
    if sum(c < 0 for c in left.values()) > len(left) / 2:
        left, right = ({p: -c for p, c in side.items()} for side in (left, right))
    if not left:
        left, right = right, {}
    return f"{_text(left)} = {_text(right)}"


def _names(x: Any) -> set[str]:
    """Return the names in an atom."""
    if isinstance(x, Symbol):
        return {x.name}
    return {name for product, _ in x[-1] for y, _ in product for name in _names(y)}


def _entry_names(table: ParameterTable) -> list[str]:
    """Return the names of the entries of the parameters, in their order; of multipliers, kappa."""
    names = []
    for name, value in table.defaults.items():
        own = name == MULTIPLIERS
        name, is_alone = ("kappa", value.size == 1) if own else (name, not value.shape)
        names += [name] if is_alone else [f"{name}_{k + 1}" for k in range(value.size)]
    return names


# -- reading ---------------------------------------------------------------------------------


def _read(system: Laws, table: ParameterTable, expression: ca.SX, *more: ca.SX) -> list[Sum]:
    """Return the entries of a column as sums; `more` are higher derivatives and multipliers."""
    s, names = system.symbols, list(system.coordinates)
    r = system.order
    dots = [
        [name + "'" * k for k in part for name in names]
        for part in (range(r), [r], range(r + 1, 2 * r + 1))
    ]
    lamda = ["lamda"] if system.m == 1 else [f"lamda{k + 1}" for k in range(system.m)]
    known = [dots[0], dots[1], ["t"], _entry_names(table), dots[2], lamda]
    places = [name for k in (5, 3, 2, 0, 1, 4) for name in known[k]]
    tape = Tape([s.q, s.v, s.t, s.p, *more], [ca.densify(expression)])

    def make(node: Node, operands: list[Sum]) -> Sum:
        if node.kind == "constant":
            return {UNIT_PRODUCT: _number(node.value)} if node.value else {}
        if node.kind == "input":
            name = known[node.entry[0]][node.entry[1]]
            return {((Symbol(places.index(name), name), Fraction(1)),): Fraction(1)}
        found = _apply(node.operation, operands)
        if len(found) > MOST_TERMS:
            raise ValueError(f"expected formulas of at most {MOST_TERMS} terms, found longer ones")
        return found

    found = tape.fold(make)
    return [_collect(found[k]) for k in tape.results[0]]


def _number(value: float) -> float | Fraction:
    near = Fraction(value).limit_denominator(100)
    return near if float(near) == value else value


def _apply(op: int, of: Sequence[Sum]) -> Sum:
    """Return what an operation makes of sums. Raises ValueError for one without a formula."""
    a, b = of[0], of[-1]
    match op:
        case ca.OP_ASSIGN:
            return a
        case ca.OP_ADD:
            return _plus(a, b)
        case ca.OP_SUB:
            return _plus(a, _scale(b, -1))
        case ca.OP_NEG:
            return _scale(a, -1)
        case ca.OP_TWICE:
            return _scale(a, 2)
        case ca.OP_MUL:
            return _times(a, b)
        case ca.OP_SQ:
            return _power(a, Fraction(2))
        case ca.OP_INV:
            return _power(a, Fraction(-1))
        case ca.OP_DIV:
            return _times(a, _power(b, Fraction(-1)))
        case ca.OP_SQRT:
            return _power(a, Fraction(1, 2))
        case ca.OP_POW | ca.OP_CONSTPOW if set(b) <= {UNIT_PRODUCT}:
            return _power(a, Fraction(b.get(UNIT_PRODUCT, 0)).limit_denominator(100))
        case _ if op in ELEMENTARY:
            inner, sign = a, Fraction(1)
            if a and all(c < 0 for c in a.values()) and op in (ca.OP_SIN, ca.OP_COS):
                inner, sign = _scale(a, -1), Fraction(-1 if op == ca.OP_SIN else 1)
            return {(((ELEMENTARY[op], _freeze(inner)), Fraction(1)),): sign}
    raise ValueError("expected a law of elementary functions to write, found others in it")


def _freeze(a: Sum) -> tuple:
    return tuple(sorted(a.items(), key=repr))


def _plus(a: Sum, b: Sum) -> Sum:
    found = dict(a)
    for product, c in b.items():
        found[product] = found.get(product, 0) + c
        if not found[product]:
            del found[product]
    return found


def _scale(a: Sum, by: Any) -> Sum:
    return {product: by * c for product, c in a.items()}


def _times(a: Sum, b: Sum) -> Sum:
    """Return the product of two sums."""
    found: Sum = {}
    for p, c in a.items():
        for q, d in b.items():
            powers = dict(p)
            for x, k in q:
                powers[x] = powers.get(x, Fraction(0)) + k
            product = tuple(sorted(((x, k) for x, k in powers.items() if k), key=repr))
            found = _plus(found, {product: c * d})
    return found


def _power(a: Sum, k: Fraction) -> Sum:
    """Return a power: of a product the powers of its factors, of a sum an atom's."""
    if len(a) == 1:
        ((product, c),) = a.items()
        if k.denominator == 1:
            return {tuple((x, j * k) for x, j in product): c ** int(k)}
        if c == 1 and all((j * k).denominator > 1 or j * k < 0 for _, j in product):
            return {tuple((x, j * k) for x, j in product): c}
    least = min(map(abs, a.values()))
    if k < 0 and k.denominator == 1 and least > 1 and all(c / least % 1 == 0 for c in a.values()):
        return {(((_freeze(_scale(a, 1 / least)),), k),): least ** int(k)}
    return {(((_freeze(a),), k),): Fraction(1)}


def _collect(a: Sum) -> Sum:
    """Return a sum with its whole powers of sums multiplied out and squared sines collected."""
    found = a
    while any(_is_whole(x, k) for product in found for x, k in product):
        found, a = {}, found  # what is multiplied out may leave whole powers of roots
        for product, c in a.items():
            part: Sum = {UNIT_PRODUCT: c}
            for x, k in product:
                for _ in range(int(k) if _is_whole(x, k) else 1):
                    more: Sum = dict(x[0]) if _is_whole(x, k) else {((x, k),): Fraction(1)}
                    part = _times(part, more)
            found = _plus(found, part)
    changed = True
    while changed:
        changed = False
        for p, q in combinations(list(found), 2):
            rest = _pythagoras(p, q) or _pythagoras(q, p)
            if rest is not None and found[p] == found[q]:
                c = found.pop(p)
                del found[q]
                found, changed = _plus(found, {rest: c}), True
                break
    return found


def _is_whole(x: Any, k: Fraction) -> bool:
    """Return whether it is a power of a sum that can be multiplied out."""
    return isinstance(x, tuple) and len(x) == 1 and k.denominator == 1 and k > 0


def _pythagoras(p: Product, q: Product) -> Product | None:
    """Return r where p = r sin(u)^2 and q = r cos(u)^2."""
    for x, k in p:
        if isinstance(x, tuple) and x[0] == "sin" and k >= 2:
            down = _times({p: 1}, {((x, Fraction(-2)),): 1})
            if _times(down, {((("cos", x[1]), Fraction(2)),): 1}).get(q):
                return next(iter(down))
    return None


def _cancel(a: Sum) -> Sum:
    """Return a sum in which what stands over a power of a sum is divided by it while it can."""
    found: Sum = {}
    for below, above in _over(a).items():
        for k, (x, power) in enumerate(below):
            times = 0
            while times < -ceil(power) and (quotient := _divide(above, dict(x[0]))):
                above, times = quotient, times + 1
            below = (*below[:k], (x, power + times), *below[k + 1 :])
        found = _plus(found, _times(above, {tuple((x, j) for x, j in below if j): Fraction(1)}))
    return found


def _divide(a: Sum, by: Sum) -> Sum | None:
    """Return a sum divided by another, None where that leaves a rest.

    The largest products are divided by each other, in the order of their powers of one atom after
    the other, and what is left is divided on: of two sums of powers at most as many times as the
    quotient has terms.
    """
    atoms = sorted(
        {x for products in (a, by) for product in products for x, _ in product}, key=repr
    )

    def largest(of: Sum) -> tuple[Product, Any]:
        return max(of.items(), key=lambda item: [dict(item[0]).get(x, 0) for x in atoms])

    first, c = largest(by)
    inverse = {tuple((x, -k) for x, k in first): 1 / c}
    quotient, rest = {}, a
    for _ in range(len(a)):
        part = _times(dict([largest(rest)]), inverse)
        quotient, rest = _plus(quotient, part), _plus(rest, _scale(_times(part, by), -1))
        if not rest:
            return quotient
    return None


# -- writing ---------------------------------------------------------------------------------


def _common(a: Sum) -> Product:
    """Return the factors that all products of a sum have."""
    if not a:
        return UNIT_PRODUCT
    first, *others = (dict(product) for product in a)
    least = {x: min([k] + [o.get(x, Fraction(0)) for o in others]) for x, k in first.items()}
    return tuple((x, k) for x, k in least.items() if k > 0)


def _text(a: Sum) -> str:
    """Return a sum as text, products over the same root together."""
    terms: list[tuple[bool, str]] = []
    for roots, inner in _over(a).items():
        if len(inner) == 1 or not roots:
            terms += [_term(_join(p, roots), c) for p, c in inner.items()]
            continue
        common = _common(inner)
        size = min((abs(c) for c in inner.values()), key=float)
        sign = -1 if next(iter(inner.values())) < 0 else 1
        left = _times(inner, {tuple((x, -k) for x, k in common): Fraction(1) / (sign * size)})
        whole = (((_order(left),), Fraction(1)),)
        terms.append(_term(_join(_join(common, whole), roots), sign * size))
    terms.sort(key=lambda term: term[0])  # one that is added first, if there is any
    (minus, first), *others = terms or [(False, "0")]
    return "-" * minus + first + "".join(f" {'-' if minus else '+'} {x}" for minus, x in others)


def _over(a: Sum) -> dict[Product, Sum]:
    """Return what stands over each product of powers of sums."""
    groups: dict[Product, Sum] = {}
    for product, c in a.items():
        below = tuple((x, k) for x, k in product if isinstance(x, tuple) and len(x) == 1 and k < 0)
        rest = tuple((x, k) for x, k in product if (x, k) not in below)
        groups.setdefault(below, {})[rest] = c
    return groups


def _common_divisor(products: Sequence[Product]) -> Sum:
    """Return the powers of sums below all products, as what is multiplied by them."""
    powers = [dict(product) for product in products]
    sums = {x for product in products for x, k in product if isinstance(x, tuple) and len(x) == 1}
    least = {x: max(p.get(x, Fraction(0)) for p in powers) for x in sums}
    return {tuple((x, -k) for x, k in sorted(least.items(), key=repr) if k < 0): Fraction(1)}


def _order(a: Sum) -> tuple:
    return tuple(a.items())


def _join(p: Product, q: Product) -> Product:
    return (*p, *q)


def _term(product: Product, c: float | Fraction) -> tuple[bool, str]:
    """Return whether a term is subtracted, and its text without the sign."""
    size = abs(c)
    top, bottom = (size.numerator, size.denominator) if isinstance(size, Fraction) else (size, 1)
    above, below = (
        [_factor(x, abs(k)) for x, k in sorted(product, key=_place) if (k > 0) == over]
        for over in (True, False)
    )
    above = [f"{top:g}"] * (top != 1 or not above) + above
    if below and bottom != 1:
        below, bottom = [f"{bottom}", *below], 1
    text = " ".join(above)
    if below:
        text += f" / ({' '.join(below)})" if len(below) > 1 else f" / {below[0]}"
    return c < 0, text + (f" / {bottom}" if bottom != 1 else "")


def _place(factor: tuple[Any, Fraction]) -> tuple[int, Any]:
    """Return where a factor stands: symbols first, then sums, then functions."""
    x, _ = factor
    return (0, x) if isinstance(x, Symbol) else (3 - len(x) % 2, repr(x))


def _factor(x: Any, k: Fraction) -> str:
    """Return the text of a factor: an atom with its power."""
    if isinstance(x, Symbol):
        text = x.name
    elif len(x) == 1:
        if k == Fraction(1, 2):
            return f"sqrt({_text(dict(x[0]))})"
        text = f"({_text(dict(x[0]))})"
    else:
        name, inner = x[0], _text(dict(x[1]))
        if name == "abs":
            text = f"|{inner}|"
        else:
            plain = inner.isidentifier() and k == 1 and name in ("sin", "cos")
            text = f"{name} {inner}" if plain else f"{name}({inner})"
    if k == 1:
        return text
    return f"{text}^{k}" if k.denominator == 1 else f"{text}^({k.numerator}/{k.denominator})"
