"""Turn a user's callables into CasADi expressions, and say clearly when that cannot be done."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import FunctionType
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.mechanics.laws.expressions import Expressions, OutOfRange, Untraceable, text_of
from actionopt.tools.checks import by_name, numbers
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import brief
from actionopt.tools.types import Array

# What arguments are called as a rule, and how the rate of one: qdot, q_dot, dq, dq_dt.
USUAL = {
    "q": ("q", "x", "r", "pos", "position", "coordinates"),
    "v": ("v", "qdot", "q_dot", "dq", "qd", "xdot", "x_dot", "dx", "vel", "velocity", "velocities"),
    "a": ("a", "acc", "acceleration", "accelerations", "qddot", "q_ddot", "ddq", "xddot", "ddx"),
    "j": ("j", "jerk"),
    "t": ("t", "time"),
}
STATE = ("q", "v", "a", "j", "s")  # coordinates and their derivatives, as a Lagrangian names them
RATE_NAME = re.compile(r"^(?:d(\w+?)(?:_?dt)?|(\w+?)_?(?:dot|prime))$")
# Parameters of our own: kappa (c,) of L + kappa.g, and the times at which laws of legs take turns.
MULTIPLIERS, SWITCHES = "integral_multipliers", "leg_times"
STARRED = inspect.CO_VARARGS | inspect.CO_VARKEYWORDS
# At how many times the forces along a path are sampled before it is a solution, by how narrow a
# feature they may have (`switches.localized`). Derived for Gauss's points in panels
# (`second_quadrature`): between 2500 the largest gap is 1 / 1600 of the duration, and of a Gaussian
# pulse whose width at half height is 1 / 1000 of it three quarters of the peak are seen at the
# least. A feature with tails is seen six times as far away.
SAMPLES, TAILED_SAMPLES = 2500, 400
COMPARISONS = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR)


@immutable
class Symbols:
    """The arguments of every traced expression: q, v, t and the parameters packed in one column.

    In a law of higher order q holds the coordinates and all their derivatives but the highest, one
    after the other, (order n,), and v the highest, (n,).
    """

    q: ca.SX
    v: ca.SX
    t: ca.SX
    p: ca.SX

    @classmethod
    def of(cls, n: int, table: ParameterTable, order: int = 1) -> Symbols:
        """Return the symbols of a law of n coordinates and an order."""
        *below, highest = (ca.SX.sym(name, n) for name in STATE[: order + 1])
        q = below[0] if order == 1 else stack(*below)
        return cls(q, highest, ca.SX.sym("t"), table.symbols())

    def state(self) -> dict[str, Expressions]:
        """Return the arguments of the user's callables, by name: q, v and so on, and t."""
        n = self.v.numel()
        rows = [*(ca.vertsplit(self.q, n) if self.q.numel() > n else [self.q]), self.v]
        found = {name: Expressions(x, 1) for name, x in zip(STATE, rows, strict=False)}
        return found | {"t": Expressions(self.t, 0)}


class Values(dict[str, Array]):
    """Parameters by name; printed in one line."""

    def __repr__(self) -> str:
        return brief(self)


class NoValue(np.ndarray):
    """The default of a parameter that has none, a 0-d array: a problem gives the value."""


NO_VALUE = np.array(np.nan).view(NoValue)


class ParameterTable:
    """Names, shapes and default values of a system's parameters, packed in a fixed order."""

    def __init__(self, defaults: Mapping[str, ArrayLike] | None) -> None:
        self.defaults: dict[str, Array] = {}
        for name, value in by_name(defaults, "parameters").items():
            self.defaults[name] = value if isinstance(value, NoValue) else _finite(name, value)
        self.needed = [name for name, x in self.defaults.items() if isinstance(x, NoValue)]
        self.shapes = {name: value.shape for name, value in self.defaults.items()}

    def values(self, overrides: Mapping[str, ArrayLike] | None = None) -> dict[str, Array]:
        """Return all parameters by name, `overrides` in place of the defaults.

        Raises
        ------
        ValueError
            For an unknown name (the nearest known one is suggested), a wrong shape, NaN or
            infinity.
        """
        result = Values(self.defaults)
        for name, value in by_name(overrides, "parameters").items():
            if name not in result:
                known = [x for x in result if x not in (MULTIPLIERS, SWITCHES)]
                raise ValueError(
                    f"unknown parameter {name!r}; "
                    + (f"the parameters are {', '.join(known)}" if known else "there are none")
                    + suggestion(name, known)
                )
            if value is result[name]:
                continue  # the default, known to be good
            number = _finite(name, value)
            if number.shape != self.shapes[name]:
                raise ValueError(
                    f"expected parameter {name!r} of shape {self.shapes[name]}, "
                    f"found {number.shape}"
                )
            result[name] = number
        for name in self.needed:
            if isinstance(result[name], NoValue):
                raise ValueError(
                    f"expected a value for the parameter {name!r}, which has no default, found "
                    f"none; give it as parameters={{{name!r}: value}}, here or of the system"
                )
        return result

    def pack(self, values: Mapping[str, Array]) -> Array:
        """Return the parameters as one row (1, P), in the order of the symbols."""
        parts = [values[name].reshape(-1) for name in self.defaults]
        return np.concatenate(parts)[None, :] if parts else np.zeros((1, 0))

    def symbols(self) -> ca.SX:
        """Return the parameters packed in one column of symbols, (P, 1)."""
        columns = [ca.SX.sym(name, math.prod(shape)) for name, shape in self.shapes.items()]
        return columns[0] if len(columns) == 1 else stack(*columns)

    def by_name(self, packed: ca.SX) -> dict[str, Expressions]:
        """Return by name what the user's callables receive, from a column packed as `symbols`."""
        found, first, each = {}, 0, packed.elements()
        for name, shape in self.shapes.items():
            size = math.prod(shape)
            part: Any = packed[first : first + size] if shape else each[first]
            if len(shape) == 2:  # row by row, as numpy stores it
                part = ca.reshape(part, shape[1], shape[0]).T
            found[name] = Expressions(part, len(shape))
            first += size
        return found


def stack(*columns: ca.SX) -> ca.SX:
    """Return columns of expressions in one; so few cost CasADi's vertcat twice the time."""
    sizes = [column.numel() for column in columns]
    whole, first = ca.SX(sum(sizes), 1), 0
    for column, size in zip(columns, sizes, strict=True):
        whole[first : first + size] = column
        first += size
    return whole


def suggestion(name: str, known: Mapping[str, Any] | Sequence[str]) -> str:
    """Return "; did you mean 'x'?" for the known name nearest to `name`, or nothing."""
    import difflib  # slow to import, and needed for mistakes only

    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def _finite(name: str, value: ArrayLike) -> Array:
    """Return a copy of a parameter's value that cannot be changed after a path was solved with it.

    Raises ValueError if it is not finite, or has more than two axes.
    """
    found = numbers(value, f"parameter {name!r}")
    if found.ndim > 2:
        raise ValueError(f"expected parameter {name!r} with at most two axes, found {found.ndim}")
    if not np.isfinite(found).all():
        raise ValueError(f"expected a finite parameter {name!r}, found {value!r}")
    found.setflags(write=False)
    return found


def parameter_names(
    callable_: Callable[..., Any], role: str, positional: Sequence[str]
) -> list[str]:
    """Return the keyword-only names of `callable_`; ["**"] stands for every parameter.

    Raises
    ------
    ValueError
        If it does not take the `positional` arguments of its role.
    """
    if type(callable_) is FunctionType and not vars(callable_):  # it is what it says it is
        code = callable_.__code__
        count, starred = code.co_argcount, code.co_flags & STARRED
        if count == len(positional) and not starred:  # the ordinary case, quickly found out
            _check_order(role, positional, code.co_varnames[:count])
            return list(code.co_varnames[count : count + code.co_kwonlyargcount])
    want = f"{role}({', '.join(positional)}, *, parameters by name)"
    if not callable(callable_):
        raise ValueError(f"expected a callable {want}, found {callable_!r}")
    kinds = inspect.Parameter
    try:
        parameters = list(inspect.signature(callable_).parameters.values())
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"expected {want}, found {callable_!r}, which does not say its arguments; write a "
            "lambda round it"
        ) from error
    ahead = [
        p for p in parameters if p.kind in (kinds.POSITIONAL_ONLY, kinds.POSITIONAL_OR_KEYWORD)
    ]
    starred = any(p.kind is kinds.VAR_POSITIONAL for p in parameters)
    needed = [p for p in ahead if p.default is kinds.empty]
    if not starred and not len(needed) <= len(positional) <= len(ahead):
        found = f"{role}({', '.join(p.name for p in ahead)})"
        hint = _mend(role, positional, [p.name for p in needed])
        raise ValueError(f"expected {want}, found {found}{hint}")
    if not starred:
        _check_order(role, positional, [p.name for p in ahead[: len(positional)]])
    names = [p.name for p in parameters if p.kind is kinds.KEYWORD_ONLY]
    return [*names, "**"] if any(p.kind is kinds.VAR_KEYWORD for p in parameters) else names


def _mend(role: str, positional: Sequence[str], needed: list[str]) -> str:
    """Return what to try with a callable that needs arguments other than the `positional`."""
    if role == "constraint" and len(needed) >= 3:
        return (
            "; a holonomic constraint f(q, t) = 0 restricts positions, not velocities: "
            "integrate the velocity condition to one on the coordinates if it can be integrated"
        )
    if role == "length" and len(needed) == 3:
        return "; a length has no clock: time may not be in it"
    if "v" not in positional and len(needed) >= 2 and needed[1] == "v":
        return "; it says where a path may be, not how fast it is: leave out v"
    if len(needed) > len(positional):
        extra = ", ".join(needed[len(positional) :])
        return f"; put a * before the parameters ({extra})"
    return ""


def order_of(callable_: Callable[..., Any]) -> int:
    """Return the highest derivative that a law takes, by how many arguments it has before t.

    L(q, v, t) takes one, L(q, v, a, t) two. What cannot be told is of order one.
    """
    if type(callable_) is FunctionType and not vars(callable_):
        code, defaults = callable_.__code__, len(callable_.__defaults__ or ())
        names = list(code.co_varnames[: code.co_argcount - defaults])
    else:
        try:
            parameters = inspect.signature(callable_).parameters.values()
        except (TypeError, ValueError):
            return 1
        kinds, none = inspect.Parameter, inspect.Parameter.empty
        ahead = kinds.POSITIONAL_ONLY, kinds.POSITIONAL_OR_KEYWORD
        names = [p.name for p in parameters if p.kind in ahead and p.default is none]
    order = len(names) - 2
    # Parameters that stand behind the time without a * are to be told that.
    if not 2 <= order < len(STATE) or "t" in [_likely_meaning(name) for name in names[2:-1]]:
        return 1
    return order


def _check_order(role: str, positional: Sequence[str], given: Sequence[str]) -> None:
    """Raise ValueError where the names of the arguments are clearly in another order.

    That is where two or more of them are the usual names of others, or a rate stands before what
    it is the rate of. Other names are the user's: v, v_t, x are a field, its derivative and where.
    """
    first, second, *_ = (*given, "", "")
    if tuple(given) == tuple(positional) or second.startswith(f"{first}_"):
        return
    meant = [_likely_meaning(name) for name in given]
    misplaced = [k for k, (x, y) in enumerate(zip(meant, positional, strict=False)) if x and x != y]
    swapped = {"q", "v"} <= {*positional[:2]} and RATE_NAME.sub(r"\1\2", first) == second != first
    if len({meant[k] for k in misplaced}) > 1 or swapped:
        raise ValueError(
            f"expected {role}({', '.join(positional)}), its arguments in this order whatever they "
            f"are called, found {role}({', '.join(given)}), whose names are those of another order"
        )


def _likely_meaning(name: str) -> str:
    """Return which argument a name stands for as a rule: q, v, a, j, t; nothing of most names."""
    return next((x for x, usual in USUAL.items() if name.lower() in usual), "")


def call(
    callable_: Callable[..., Any],
    role: str,
    arguments: Mapping[str, Any],
    parameters: Mapping[str, Any],
) -> tuple[Any, set[str]]:
    """Call a user's function on symbols; return its result and the parameters it used.

    Raises
    ------
    ValueError
        If a parameter it names is missing, or it uses a function CasADi cannot trace.
    """
    names = parameter_names(callable_, role, list(arguments))
    kwargs = {}
    for name in names:
        if name == "**":
            kwargs.update(parameters)
        elif name in parameters:
            kwargs[name] = parameters[name]
        elif inspect.signature(callable_).parameters[name].default is inspect.Parameter.empty:
            raise ValueError(
                f"the {role} needs the parameter {name!r}, which is missing from parameters="
                f"{{{', '.join(map(repr, parameters))}}}{suggestion(name, parameters)}"
            )
    try:
        return callable_(*arguments.values(), **kwargs), set(kwargs)
    except Exception as error:
        why = _why(error, arguments, parameters)
        raise ValueError(f"the {role} could not be traced{why}") from error


def _why(error: Exception, arguments: Mapping[str, Any], parameters: Mapping[str, Any]) -> str:
    """Return why a callable cannot be traced and what to write instead, behind "traced"."""
    text = text_of(error)
    if isinstance(error, OutOfRange):
        return f": {_missing(error, arguments, parameters)}; indices begin at 0"
    if isinstance(error, Untraceable):
        return f": {text}"
    q = arguments.get("q")
    if isinstance(error, ValueError) and "values to unpack" in text and q is not None:
        return f": {text}; q and v have one entry for each coordinate, and there are {len(q)}"
    if isinstance(error, TypeError) and "for ^" in text:
        return f": {text}; a power is x**2, and ^ is none"
    if isinstance(error, TypeError) and (name := _function_of_numbers(error)):
        return f": {name} was given a list of expressions; make it an array by np.stack first"
    return (
        f" ({type(error).__name__}: {text}); write it with arithmetic and numpy or casadi "
        "functions of its arguments: no math module, no branches on their values (use "
        "np.where), no np.array of them (use np.stack), no float()"
    )


def _missing(error: OutOfRange, arguments: Mapping[str, Any], parameters: Mapping[str, Any]) -> str:
    """Return what was asked for and how much there is: "1 coordinate, q[1] asked for"."""
    for name, value in {**arguments, **parameters}.items():
        if value is not error.whole:
            continue
        if value.ndim != 1:
            there = f"{name} of shape {value.shape}"
        elif name in STATE and name in arguments:
            there = f"{len(value)} coordinate{'s' if len(value) > 1 else ''}"
        else:
            there = f"parameter {name!r} of length {len(value)}"
        return f"{there}, {name}{error.part} asked for"
    return f"an array of shape {error.whole.shape}, {error.part} of it asked for"


def _function_of_numbers(error: TypeError) -> str:
    """Return the function of numpy's that wanted numbers for expressions, or nothing."""
    import traceback  # for mistakes only

    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    if not frames or frames[-1].f_code is not Expressions.__array__.__code__:
        return ""
    for frame in frames:
        room = frame.f_globals.get("__name__", "")
        name = frame.f_code.co_name
        if room.partition(".")[0] == "numpy" and hasattr(np, name):
            return f"np.{name}"
    return ""


def column(result: Any, role: str, rows: int | None = None) -> ca.SX:
    """Return a user's result, one expression or a sequence of them, as an SX column.

    Raises ValueError if it is no expression, contains NaN, or its length is not `rows`.
    """
    value = _in_column(result, role)
    # Not by its text, whose printing ends the process where thousands of operations are nested.
    f = ca.Function("nan", [], [value], {"allow_free": True})
    codes = map(f.instruction_id, range(f.n_instructions()))
    at = [k for k, code in enumerate(codes) if code == ca.OP_CONST]
    refuse_nan([f.instruction_constant(k) for k in at], role)
    if rows is not None and value.numel() != rows:
        what = "a scalar" if rows == 1 else f"{rows} values"
        raise ValueError(f"expected the {role} to return {what}, found {value.numel()}")
    return value


def refuse_nan(constants: Sequence[float], role: str) -> None:
    """Raise ValueError if one of the numbers in an expression is NaN."""
    if any([x != x for x in constants]):
        raise ValueError(
            f"the {role} contains NaN: a function of the math module, or float(), cannot see a "
            "symbol and gives NaN for it; use numpy or casadi functions"
        )


def refuse_foreign(law: ca.SX, arguments: Sequence[ca.SX], role: str) -> None:
    """Raise ValueError if an expression contains symbols that are not among its arguments."""
    known = {x.element_hash() for x in ca.symvar(ca.veccat(*arguments))}
    foreign = [x.name() for x in ca.symvar(law) if x.element_hash() not in known]
    if foreign:
        raise ValueError(
            f"expected expressions of the arguments, found {foreign[0]!r} in the {role}, a symbol "
            "of CasADi's own: give parameters by name, System(..., parameters={name: number}), and "
            "take them as arguments after a star"
        )


def _in_column(result: Any, role: str) -> ca.SX:
    """Return it without a look at what it contains."""
    try:
        if isinstance(result, (list, tuple)):
            value = ca.vertcat(*[ca.vec(_sx(item)) for item in result]) if result else ca.SX(0, 1)
        else:
            value = _sx(result)
            value = value if value.is_column() else ca.vec(value)
    except Exception as error:
        raise ValueError(
            f"expected the {role} to return numbers or expressions, found {type(result).__name__}"
        ) from error
    return value if value.is_dense() else ca.densify(value)


def surface(result: Any, role: str) -> ca.SX:
    """Return expressions whose zeros are a surface, as a `column`.

    Raises ValueError as that does, and for a comparison, which is 0 or 1 and has no slope.
    """
    rows = column(result, role)
    for i, row in enumerate(ca.vertsplit(rows)):
        if any(row.is_op(code) for code in COMPARISONS):
            raise ValueError(
                f"expected the {role} to return expressions that vanish on a surface, found the "
                f"comparison {row} as number {i}; return the difference of its two sides"
            )
    return rows


def _sx(item: Any) -> ca.SX:
    """Return an expression or number as SX; CasADi asks ours for what only its view has."""
    return item.sx if isinstance(item, Expressions) else ca.SX(item)


def scalar(result: Any, role: str) -> ca.SX:
    """Return a user's result, one expression without axes, as SX of shape (1, 1).

    It may contain NaN. Raises ValueError if it is no expression, or a list or an array of them, be
    it of one.
    """
    in_list = isinstance(result, (list, tuple))
    # CasADi's own scalars are matrices of one entry.
    if in_list or (getattr(result, "ndim", 0) and result.shape != (1, 1)):
        what = f"a {type(result).__name__}" if in_list else f"an array of shape {result.shape}"
        count = len(result) if in_list else result.size
        raise ValueError(
            f"expected the {role} to return a scalar, found {count} in {what}; return one "
            "expression, such as v @ v / 2 or v[0] ** 2 / 2"
        )
    return _in_column(result, role)


@contextmanager
def deriving(what: str) -> Iterator[None]:
    """Raise ValueError, "expected `what`", where CasADi has no derivatives of what is called."""
    try:
        yield
    except RuntimeError as error:
        why = str(error).strip().splitlines()[-1]
        raise ValueError(
            f"expected {what}, found that it cannot: {why}; give a function that is called there "
            "its derivatives, as get_jacobian of a Callback, jac_ functions of an external library "
            "or the option enable_fd, or make a table of its values smooth by "
            'casadi.interpolant("V", "bspline", [x], values)'
        ) from error
