"""Laws as sympy writes them: read from its expressions, and written as such.

Both ways an expression is translated operation by operation, and nothing is simplified. `System`
imports this module, and with it sympy, when it is asked for.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce
from types import NoneType
from typing import Any

import casadi as ca
import numpy as np
import sympy
from sympy.core.function import AppliedUndef

from actionopt.mechanics.laws.expressions import Untraceable
from actionopt.mechanics.laws.laws import Laws
from actionopt.mechanics.laws.tracing import NO_VALUE, ParameterTable, column, suggestion
from actionopt.tools.immutable import immutable
from actionopt.tools.tape import Node, Tape

SIMPLE_FRACTION = 100  # numbers that are fractions of so small a denominator are written as such

# Functions of sympy's that CasADi has under another name; it has the others under theirs.
RENAMED = {"Abs": "fabs", "ceiling": "ceil", "Pow": "power"}
PAIRWISE = {
    "Add": operator.add, "Mul": operator.mul, "Min": ca.fmin, "Max": ca.fmax,
    "And": ca.logic_and, "Or": ca.logic_or, "Mod": lambda x, y: x - y * ca.floor(x / y),
}  # fmt: skip
RELATIONS = {
    "StrictLessThan": operator.lt, "LessThan": operator.le, "StrictGreaterThan": operator.gt,
    "GreaterThan": operator.ge, "Equality": operator.eq, "Unequality": operator.ne,
}  # fmt: skip
ELEMENTARY_NAMES = (
    "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log sqrt erf sign atan2 floor"
).split()


# -- from sympy --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Reading:
    """The meaning of sympy's symbols: coordinates q, velocities v, the time; the rest parameters.

    Raises ValueError if these are no symbols or functions of time, one for each.
    """

    q: tuple[Any, ...]
    v: tuple[Any, ...]
    t: Any

    @classmethod
    def of(cls, q: Any, v: Any, t: Any) -> Reading:
        """Return the coordinates, velocities and time that the arguments of `from_sympy` give."""
        coordinates = _row(q)
        if t is None:
            times = {x.args[0] for x in coordinates if getattr(x, "args", ())}
            t = times.pop() if len(times) == 1 else None
        if v is None:
            if t is None or not all(isinstance(x, AppliedUndef) for x in coordinates):
                raise ValueError(
                    "expected velocities, or coordinates that are functions of the time such as "
                    f"Function('x')(t), found from_sympy(L, {q!r}); give v, a symbol for each"
                )
            v = [x.diff(t) for x in coordinates]
        found = cls(coordinates, _row(v), t)
        found._check()
        return found

    def _check(self) -> None:
        """Raise ValueError for arguments that are no symbols, or that do not fit together."""
        for x in (*self.q, *(() if self.t is None else (self.t,))):
            if not isinstance(x, sympy.Symbol | AppliedUndef):
                raise ValueError(
                    "expected symbols of sympy, or functions of the time, as coordinates, found "
                    f"{x!r}"
                )
        rates = all(isinstance(x, sympy.Expr) for x in self.v)
        if len(self.q) != len(self.v) or not self.q or not rates:
            raise ValueError(
                f"expected a velocity for each coordinate, found {len(self.q)} coordinates "
                f"{list(self.q)} and {len(self.v)} velocities {list(self.v)}"
            )

    @property
    def names(self) -> list[str]:
        """Names of the coordinates."""
        return [_name(x) for x in self.q]

    @cached_property
    def _places(self) -> dict[Any, tuple[str, int]]:
        """The place of each symbol's value, and of each function's rate."""
        places: dict[Any, tuple[str, int]] = {}
        for k, (x, rate) in enumerate(zip(self.q, self.v, strict=True)):
            if self.t is not None and isinstance(x, AppliedUndef):
                places[x.diff(self.t)] = "v", k
            places[rate] = "v", k
            places[x] = "q", k
        if self.t is not None:
            places[self.t] = "t", 0
        return places

    def values(self, laws: Mapping[str, Any], given: Any) -> dict[str, Any]:
        """Return the other symbols of the laws by name, with the values that are given.

        Raises ValueError for what no law contains, and for laws that are no expressions.
        """
        names: set[str] = set()
        for role, law in laws.items():
            for row in _row(law):
                self._collect(_expression(row, role), names)
        if not isinstance(given, Mapping | NoneType):
            raise ValueError(f"expected parameters by name or symbol, found {given!r}")
        values = {getattr(key, "name", key): x for key, x in (given or {}).items()}
        for name in values:
            if name not in names:
                raise ValueError(
                    f"parameter {name!r} is in none of the laws, whose other symbols are "
                    f"{', '.join(sorted(names)) or 'none'}{suggestion(str(name), sorted(names))}"
                )
        return dict.fromkeys(sorted(names), NO_VALUE) | values

    def _collect(self, x: Any, found: set[str]) -> None:
        if x in self._places:
            return
        if getattr(x, "is_Symbol", False):
            found.add(x.name)
        for part in x.args:
            self._collect(part, found)

    def law(self, given: Any, role: str) -> Callable[..., Any]:
        """Return a callable of arrays, as `System` takes it, that says what is `given`."""
        rows = [_expression(x, role) for x in _row(given)]
        if role == "lagrangian" and len(rows) != 1:
            raise ValueError(f"expected one expression as the {role}, found {len(rows)}")

        def evaluate(state: dict[str, Any], named: Mapping[str, Any]) -> Any:
            values = {letter: column(x, letter) for letter, x in state.items()}
            made = {x: values[at][k] for x, (at, k) in self._places.items() if at in values}
            parameters = {name: column(x, name) for name, x in named.items()}
            found = [self._value(x, made, parameters) for x in rows]
            return found[0] if role == "lagrangian" else found

        if role in ("constraint", "obstacle"):
            return lambda q, t, /, **named: evaluate({"q": q, "t": t}, named)
        return lambda q, v, t, /, **named: evaluate({"q": q, "v": v, "t": t}, named)

    def _value(self, x: Any, made: dict[Any, ca.SX], named: Mapping[str, ca.SX]) -> ca.SX:
        """Return an expression of sympy's as one of CasADi's, each part of it made once."""
        if x not in made:
            if x in self._places:
                raise Untraceable(f"found the velocity {x} in a law that depends on q and t only")
            if x.is_Symbol:
                made[x] = named[x.name]
            elif x.is_number and not x.has(AppliedUndef):
                made[x] = ca.SX(float(x))
            else:
                made[x] = ca.SX(self._apply(x, lambda part: self._value(part, made, named)))
        return made[x]

    def _apply(self, x: Any, value: Callable[[Any], Any]) -> Any:
        """Return what a function of sympy's makes of its arguments."""
        name = type(x).__name__
        if name == "Derivative" or isinstance(x, AppliedUndef):
            rate = name == "Derivative" and any(part in self._places for part in x.args)
            raise Untraceable(
                f"found {x}, which is neither a coordinate nor its velocity: "
                + (
                    "from here L may depend on q, v and t; one with accelerations is a callable "
                    "L(q, v, a, t) for System"
                    if rate
                    else "give it as an expression of t"
                )
            )
        if name == "Piecewise":
            found: Any = ca.SX.nan()
            for part, condition in reversed(x.args):
                found = ca.if_else(value(condition), value(part), found)
            return found
        if name == "Heaviside":
            return (ca.sign(value(x.args[0])) + 1) / 2
        if name == "BooleanTrue":
            return 1.0
        of = [value(part) for part in x.args]
        if name in RELATIONS:
            return RELATIONS[name](*of)
        if name in PAIRWISE:
            return reduce(PAIRWISE[name], of)
        if name in (*RENAMED, *ELEMENTARY_NAMES):
            return getattr(ca, RENAMED.get(name, name))(*of)
        for kind in (sympy.sin, sympy.cos, sympy.exp):
            other = x.rewrite(kind)
            if not other.has(type(x), sympy.I):
                return value(other)
        raise Untraceable(f"found {x}: CasADi has no function {name}; write it with others")


def _row(given: Any) -> tuple[Any, ...]:
    """Return what is given, one expression or several in any sequence or matrix, as a tuple."""
    if isinstance(given, sympy.MatrixBase):
        return tuple(given.flat())
    try:
        return tuple(given)
    except TypeError:  # one expression, or what has none, such as a matrix of CasADi's
        return (given,)


def _name(x: Any) -> str:
    """Return the name of a symbol or of a function of time."""
    return x.func.__name__ if isinstance(x, AppliedUndef) else x.name


def _expression(x: Any, role: str) -> Any:
    """Return an expression of sympy's. Raises ValueError for anything else."""
    try:
        found = sympy.sympify(x, strict=True)
    except Exception as error:  # of another package's objects it may be any
        raise ValueError(f"expected the {role} as an expression of sympy, found {x!r}") from error
    if not isinstance(found, sympy.Expr) or found.has(sympy.I, sympy.nan):
        raise ValueError(f"expected the {role} as a real expression of sympy, found {x!r}")
    return found


# -- to sympy ----------------------------------------------------------------------------------


@immutable
class Formulas:
    """A system as sympy writes it; `L, q, v, t = formulas` are the arguments of `from_sympy`."""

    lagrangian: Any  # L; also `L`
    # q, v: coordinates, functions of time, and their derivatives.
    q: tuple[Any, ...]
    v: tuple[Any, ...]
    t: Any
    # By name; those of parameters that are arrays, of symbols `m_1`, `m_2`, ... row by row.
    parameters: Mapping[str, Any]
    constraint: tuple[Any, ...] = ()  # f(q, t), which vanish
    force: tuple[Any, ...] = ()  # Q(q, v, t); empty without
    multipliers: tuple[Any, ...] = ()  # lambda of L + lambda.f, functions of time
    order: int = 1  # the order of the highest derivative in L: 2 with accelerations

    def __iter__(self):
        """Yield L, q, v and t."""
        return iter((self.lagrangian, self.q, self.v, self.t))

    @property
    def L(self) -> Any:
        """The Lagrangian."""
        return self.lagrangian

    @cached_property
    def equations(self) -> tuple[Any, ...]:
        """d/dt dL/dv - dL/dq - Q - sum lambda df/dq = 0, n of sympy.Eq, and f = 0, m more.

        With accelerations d^2/dt^2 dL/da is taken away on the left, and so on.
        """
        L, t = self.lagrangian, self.t
        forces = self.force or (sympy.Integer(0),) * len(self.q)
        rows = []
        for x, force in zip(self.q, forces, strict=True):
            pull = sum(
                (y * f.diff(x) for y, f in zip(self.multipliers, self.constraint, strict=True)),
                sympy.Integer(0),
            )
            inertia = sum(
                (
                    (-1) ** (k + 1) * L.diff(x.diff(t, k)).diff(t, k)
                    for k in range(1, self.order + 1)
                ),
                sympy.Integer(0),
            )
            rows.append(sympy.Eq(inertia - L.diff(x) - force - pull, 0))
        return (*rows, *(sympy.Eq(f, 0) for f in self.constraint))

    def latex(self) -> str:
        """Return the Lagrangian and the equations of motion in LaTeX, a line each."""
        rows = [rf"L &= {sympy.latex(self.lagrangian)}"]
        rows += [f"{sympy.latex(x.lhs)} &= {sympy.latex(x.rhs)}" for x in self.equations]
        return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}"

    def _repr_latex_(self) -> str:
        return f"$\\displaystyle {self.latex()}$"


def formulas(laws: Laws, table: ParameterTable) -> Formulas:
    """Return the laws of a system as expressions of sympy.

    Raises ValueError where an operation has no counterpart there, as an interpolated table.
    """
    t = sympy.Symbol("t")
    q = tuple(sympy.Function(name)(t) for name in laws.coordinates)
    v = tuple(x.diff(t) for x in q)
    parameters, packed = {}, []
    for name, value in table.defaults.items():
        if value.shape:
            entries = [sympy.Symbol(f"{name}_{k + 1}") for k in range(value.size)]
            parameters[name] = sympy.Matrix(entries).reshape(*(*value.shape, 1)[:2])
        else:
            entries = [sympy.Symbol(name)]
            parameters[name] = entries[0]
        packed.append(np.array(entries, dtype=object).reshape(value.shape))
    symbols = [x for entries in packed for x in entries.ravel()]
    s = laws.symbols
    tape = Tape([s.q, s.v, s.t, s.p], [ca.densify(x) for x in (laws.L, laws.f, laws.Q)])
    state = [tuple(x.diff(t, k) for x in q) for k in range(laws.order + 1)]
    inputs: list[Sequence[Any]] = [sum(state[:-1], ()), state[-1], (t,), symbols]

    def make(node: Node, operands: list[Any]) -> Any:
        if node.kind == "input":
            return inputs[node.entry[0]][node.entry[1]]
        if node.kind == "constant":
            return _exact(node.value)
        operation = _operations().get(node.operation)
        if operation is None:
            what = f"number {node.operation}" if node.function is None else "a function's call"
            raise ValueError(
                "expected a law of elementary functions to write, found an operation of CasADi "
                f"without a counterpart in sympy, {what}"
            )
        return operation(*operands)

    found = tape.fold(make)
    L, f, Q = ([found[k] for k in row] for row in tape.results)
    lam = [f"lamda{k + 1 if len(f) > 1 else ''}" for k in range(len(f))]
    multipliers = tuple(sympy.Function(name)(t) for name in lam)
    return Formulas(L[0], q, v, t, parameters, tuple(f), tuple(Q), multipliers, laws.order)


def _exact(value: float) -> Any:
    """Return a number of sympy's: a simple fraction where it is one, else a Float."""
    if not np.isfinite(value):
        return sympy.Float(value)
    near = Fraction(value).limit_denominator(SIMPLE_FRACTION)
    if float(near) == value:
        return sympy.Rational(near.numerator, near.denominator)
    return sympy.Float(value)


def _operations() -> dict[int, Callable[..., Any]]:
    """Return what sympy has for CasADi's operations, by their numbers."""
    found: dict[int, Callable[..., Any]] = {
        getattr(ca, f"OP_{name.upper()}"): getattr(sympy, name) for name in ELEMENTARY_NAMES
    }
    return found | {
        ca.OP_ASSIGN: lambda x: x, ca.OP_ADD: operator.add, ca.OP_SUB: operator.sub,
        ca.OP_MUL: operator.mul, ca.OP_DIV: operator.truediv, ca.OP_NEG: operator.neg,
        ca.OP_SQ: lambda x: x**2, ca.OP_TWICE: lambda x: 2 * x, ca.OP_INV: lambda x: 1 / x,
        ca.OP_POW: operator.pow, ca.OP_CONSTPOW: operator.pow,
        ca.OP_HYPOT: lambda x, y: sympy.sqrt(x**2 + y**2),
        ca.OP_LOG1P: lambda x: sympy.log(1 + x), ca.OP_EXPM1: lambda x: sympy.exp(x) - 1,
        ca.OP_FABS: sympy.Abs, ca.OP_CEIL: sympy.ceiling,
        ca.OP_FMIN: sympy.Min, ca.OP_FMAX: sympy.Max,
        ca.OP_LT: sympy.Lt, ca.OP_LE: sympy.Le, ca.OP_EQ: sympy.Eq, ca.OP_NE: sympy.Ne,
        ca.OP_NOT: sympy.Not, ca.OP_AND: sympy.And, ca.OP_OR: sympy.Or,
        # A branch is multiplied by its condition, and is zero where that does not hold.
        ca.OP_IF_ELSE_ZERO: lambda c, x: sympy.Piecewise((x, c), (0, True)),
    }  # fmt: skip
