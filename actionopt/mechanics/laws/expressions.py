"""What a user's callable receives: arrays of expressions that behave as numpy's do.

CasADi's own array view knows all of numpy, at some thirty microseconds an operation, which for a
small Lagrangian is longer than solving it. What Lagrangians are mostly made of, arithmetic,
elementary functions, indexing and sums of numbers and vectors, is done here directly; the rest is
handed to CasADi's view and taken back.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import casadi as ca
import numpy as np

from actionopt.mechanics.laws.tables import interp

NUMBERS = (int, float, np.integer)
BINARY_CODES = {
    np.add: ca.OP_ADD,
    np.subtract: ca.OP_SUB,
    np.multiply: ca.OP_MUL,
    np.divide: ca.OP_DIV,
    np.power: ca.OP_POW,
    np.arctan2: ca.OP_ATAN2,
}
UNARY_CODES = {
    np.negative: ca.OP_NEG,
    np.absolute: ca.OP_FABS,
    np.square: ca.OP_SQ,
    np.sqrt: ca.OP_SQRT,
    np.exp: ca.OP_EXP,
    np.log: ca.OP_LOG,
    np.sin: ca.OP_SIN,
    np.cos: ca.OP_COS,
    np.tan: ca.OP_TAN,
    np.arcsin: ca.OP_ASIN,
    np.arccos: ca.OP_ACOS,
    np.arctan: ca.OP_ATAN,
    np.sinh: ca.OP_SINH,
    np.cosh: ca.OP_COSH,
    np.tanh: ca.OP_TANH,
}

PROBED = ("this", "tocsc")  # what CasADi looks for in whatever it is given

PLACE = r"^\.\.\./casadi/\S+: "  # in CasADi's sources, before what it has to say
NOT_THERE = "no implementation found|returned NotImplemented"
INSTEAD = {
    "einsum": "write the sum with @, np.sum and indices",
    "tensordot": "write the sum with @, np.sum and indices",
    "cross": "of two vectors (x, y) it is a[0] * b[1] - a[1] * b[0]",
}
OTHERWISE = "use arithmetic, @, np.sum, np.stack and indices"


class Untraceable(TypeError):
    """A function of numpy's that does not take expressions; the text says what to use."""


class OutOfRange(IndexError):
    """A part that an array does not have: of `whole`, the one at `index`."""

    def __init__(self, whole: Expressions, index: Any) -> None:
        where = ", ".join(map(str, index)) if isinstance(index, tuple) else index
        self.whole, self.part = whole, f"[{where}]"
        super().__init__(f"{self.part} of an array of shape {whole.shape}")


def _operators(code: int, general: Callable[[Any, Any], Any]) -> tuple[Any, Any]:
    """Return the methods of an operator, x * y, and of the same from the right, y * x."""
    return (
        lambda self, other: _binary(code, general, self, other),
        lambda self, other: _binary(code, general, other, self),
    )


class Expressions:
    """Expressions in an array of no, one or two axes.

    Parameters
    ----------
    sx : casadi.SX
        Their values: a column where there is one axis.
    ndim : int
    """

    __array_priority__ = 2000.0  # above those of CasADi's matrices, whose operators yield
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, sx: ca.SX, ndim: int) -> None:
        self.sx, self.ndim = sx, ndim
        self._items: list[Any] | None = None

    def __SX__(self) -> ca.SX:
        """Return what CasADi's functions take."""
        return self.sx

    def __getattr__(self, name: str) -> Any:
        """Return what only CasADi's view has: `reshape`, `mean`, ..."""
        if name.startswith("_") or name in PROBED:
            raise AttributeError(name)
        found = getattr(_to_casadi(self), name)
        return _calling(found) if callable(found) else _from_casadi(found)

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes."""
        return (self.sx.size1(), self.sx.size2())[: self.ndim]

    @property
    def size(self) -> int:
        """Number of expressions."""
        return self.sx.numel()

    @property
    def T(self) -> Expressions:
        """The transpose."""
        return self if self.ndim < 2 else Expressions(self.sx.T, 2)

    # -- parts -----------------------------------------------------------------------------------

    def __len__(self) -> int:
        """Return the length of the first axis."""
        if not self.ndim:
            raise TypeError("a number has no length")
        return self.sx.size1()

    def __iter__(self) -> Iterator[Expressions]:
        """Return an iterator over the first axis."""
        if self.ndim == 1:
            return (Expressions(item, 0) for item in self._elements())
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: Any) -> Expressions:
        """Return a part, as numpy does."""
        if self.ndim == 1:
            if isinstance(index, int):
                try:
                    return Expressions(self._elements()[index], 0)
                except IndexError:
                    raise OutOfRange(self, index) from None
            if isinstance(index, slice):
                return Expressions(self.sx[index, 0], 1)  # a column, even of one or none
        try:
            return _from_casadi(_to_casadi(self)[index])
        except IndexError:
            raise OutOfRange(self, index) from None

    def __setitem__(self, index: Any, value: Any) -> None:
        """Replace a part, here only: the symbols are nobody's to change."""
        whole = _to_casadi(self)
        whole[index] = _to_casadi(value)
        self.sx, self._items = whole.to_casadi(), None

    def _elements(self) -> list[Any]:
        items = self._items
        if items is None:
            items = self._items = self.sx.elements()
        return items

    # -- numbers ---------------------------------------------------------------------------------

    def __repr__(self) -> str:
        """Show the expressions as CasADi writes them."""
        return str(self.sx)

    def __bool__(self) -> bool:
        """Refuse: an expression is neither true nor false."""
        return bool(self.sx)

    def __float__(self) -> float:
        """Return the value of a constant, NaN for an expression."""
        return float(self.sx)

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        """Refuse: there are no numbers yet."""
        raise TypeError("cannot convert expressions to a numpy array of numbers")

    # -- arithmetic ------------------------------------------------------------------------------

    def __neg__(self) -> Expressions:
        """Return -x."""
        return Expressions(ca.SX.unary(ca.OP_NEG, self.sx), self.ndim)

    def __pos__(self) -> Expressions:
        """Return x."""
        return self

    def __abs__(self) -> Expressions:
        """Return |x|."""
        return Expressions(ca.SX.unary(ca.OP_FABS, self.sx), self.ndim)

    # Each operator, and the same from the right; comparisons are expressions as well.
    __add__, __radd__ = _operators(ca.OP_ADD, operator.add)
    __sub__, __rsub__ = _operators(ca.OP_SUB, operator.sub)
    __mul__, __rmul__ = _operators(ca.OP_MUL, operator.mul)
    __truediv__, __rtruediv__ = _operators(ca.OP_DIV, operator.truediv)
    __pow__, __rpow__ = _operators(ca.OP_POW, operator.pow)
    __and__, __rand__ = _operators(ca.OP_AND, operator.and_)
    __or__, __ror__ = _operators(ca.OP_OR, operator.or_)
    __lt__, __gt__ = _operators(ca.OP_LT, operator.lt)
    __le__, __ge__ = _operators(ca.OP_LE, operator.le)
    __eq__, _ = _operators(ca.OP_EQ, operator.eq)
    __ne__, _ = _operators(ca.OP_NE, operator.ne)

    def __mod__(self, other: Any) -> Any:
        """Return the remainder."""
        return _from_casadi(_to_casadi(self) % _to_casadi(other))

    def __invert__(self) -> Any:
        """Return "not x" of a comparison."""
        return Expressions(ca.SX.unary(ca.OP_NOT, self.sx), self.ndim)

    def __matmul__(self, other: Any) -> Any:
        """Return the product of vectors or matrices."""
        if isinstance(other, Expressions) and self.ndim and other.ndim:
            if self.ndim == other.ndim == 1 and self.sx.size1() == other.sx.size1():
                return Expressions(ca.dot(self.sx, other.sx), 0)
            left = self.sx if self.ndim == 2 else self.sx.T
            if left.size2() == other.sx.size1():  # CasADi takes one entry for a number
                product = ca.mtimes(left, other.sx)
                if self.ndim == 1 and other.ndim == 2:
                    product = product.T
                return Expressions(product, self.ndim + other.ndim - 2)
        return _from_casadi(_to_casadi(self) @ _to_casadi(other))

    def __rmatmul__(self, other: Any) -> Any:
        """Return the product with what is no expression."""
        return _from_casadi(_to_casadi(other) @ _to_casadi(self))

    def sum(self, axis: Any = None) -> Any:
        """Return the sum over an axis, or over all."""
        if self.ndim == 1 and axis in (None, 0, -1):
            return Expressions(ca.sum1(self.sx), 0)
        return _from_casadi(_to_casadi(self).sum(axis))

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        """Return what one of numpy's elementwise functions gives."""
        if method == "__call__" and not kwargs:
            if ufunc in UNARY_CODES:
                return Expressions(ca.SX.unary(UNARY_CODES[ufunc], self.sx), self.ndim)
            if ufunc in BINARY_CODES:
                return _binary(BINARY_CODES[ufunc], ufunc, *inputs)
        with _naming(ufunc):
            return _from_casadi(getattr(ufunc, method)(*_to_casadi(inputs), **kwargs))

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        """Return what another of numpy's functions gives."""
        if func is np.sum and not kwargs and len(args) == 1:
            return self.sum()
        if func is np.dot and not kwargs and self.ndim == 1:
            return operator.matmul(*args)
        if func is np.interp:
            with _naming(func):
                return _interp(*args, **kwargs)
        if func.__name__ == "cross":
            func = np.cross  # np.linalg.cross is the same for vectors of three components
        named = {name: _to_casadi(value) for name, value in kwargs.items()}
        with _naming(func):
            return _from_casadi(func(*_to_casadi(args), **named))


def _interp(x: Any, xp: Any, fp: Any, *args: Any, **kwargs: Any) -> Expressions:
    """Return np.interp, of expressions or with them as values."""
    ndim, given = np.ndim(x) if not isinstance(x, Expressions) else x.ndim, ca.SX(_sx(x))
    named = {name: _sx(value) for name, value in kwargs.items()}
    return Expressions(interp(given, _sx(xp), _sx(fp), *map(_sx, args), **named), ndim)


def _sx(x: Any) -> Any:
    """Return expressions as CasADi's, others as they are."""
    return x.sx if isinstance(x, Expressions) else x


@contextmanager
def _naming(function: Any) -> Iterator[None]:
    """Raise Untraceable, with the function's name and what to use, for what it raises."""
    try:
        yield
    except Untraceable:
        raise
    except Exception as error:
        name = function.__name__
        room = getattr(function, "__module__", None) or "numpy"  # functions by element have none
        if room == "numpy" and getattr(np, name, None) is not function:
            room = ""  # of another package
        shown = ".".join(filter(None, [room.replace("numpy", "np", 1), name]))
        found, advice = f"failed on expressions ({text_of(error)})", INSTEAD.get(name)
        if isinstance(error, TypeError) and re.search(NOT_THERE, str(error)):
            found, advice = "does not take expressions", advice or OTHERWISE
        raise Untraceable("; ".join(filter(None, [f"{shown} {found}", advice]))) from error


def text_of(error: BaseException) -> str:
    """Return the text of an error in one line, without the place in CasADi's sources."""
    place, _, text = str(error).strip().partition("\n")
    if not text:
        return re.sub(PLACE, "", place)
    return text.replace("\n", " ") if re.match(PLACE, place) else f"{place} {text}"


def _binary(code: int, general: Callable[[Any, Any], Any], a: Any, b: Any) -> Any:
    """Return an elementwise operation: by its CasADi `code`, or by the function `general`."""
    if isinstance(a, Expressions):
        if isinstance(b, NUMBERS):
            return Expressions(ca.SX.binary(code, a.sx, b), a.ndim)
        if isinstance(b, Expressions):
            ndim = max(a.ndim, b.ndim)
            if ndim < 2 or a.sx.size() == b.sx.size():
                return Expressions(ca.SX.binary(code, a.sx, b.sx), ndim)
    elif isinstance(a, NUMBERS):
        return Expressions(ca.SX.binary(code, a, b.sx), b.ndim)
    return _from_casadi(general(_to_casadi(a), _to_casadi(b)))


def _to_casadi(x: Any) -> Any:
    """Return expressions as arrays of CasADi's, also those in lists and tuples; others as is."""
    if isinstance(x, Expressions):
        return ca.ArrayInterface.SX(x.sx, shape=x.shape)
    if isinstance(x, (list, tuple)):
        return type(x)([_to_casadi(item) for item in x])
    return x


def _from_casadi(x: Any) -> Any:
    """Return arrays of CasADi's as `Expressions`, also those in lists and tuples; others as is."""
    if isinstance(x, ca.ArrayInterface):
        value = x.to_casadi() if x.ndim <= 2 else None
        return Expressions(value, x.ndim) if isinstance(value, ca.SX) else x
    if isinstance(x, (list, tuple)):
        return type(x)([_from_casadi(item) for item in x])
    return x


def _calling(method: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method of CasADi's view as one that takes and returns ours."""

    def call(*args: Any, **kwargs: Any) -> Any:
        named = {name: _to_casadi(value) for name, value in kwargs.items()}
        return _from_casadi(method(*_to_casadi(args), **named))

    return call
