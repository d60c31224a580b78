"""Classes of values that do not change: dataclasses, made in a third of the time.

For each class `dataclass` compiles four functions, of which three are the same in all of them: an
import of a hundred classes waits for them longer than for what they are to do.
"""

from dataclasses import MISSING, FrozenInstanceError, dataclass, field, fields
from functools import cache
from reprlib import recursive_repr
from typing import Any, Never, TypeVar, dataclass_transform

T = TypeVar("T")


class _Factory:
    """Stands for a default that is made, in signatures."""

    def __repr__(self) -> str:
        return "<factory>"


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
def immutable(cls: type[T]) -> type[T]:
    """Return a class as `dataclass(frozen=True, eq=False)` makes it; only `__init__` is compiled.

    An `__init__` that the class has is kept. Its subclasses are to be made by `immutable`, too:
    `dataclass(frozen=True)` takes this class for one that is not frozen.
    """
    made: Any = dataclass(init=False, repr=False, eq=False)(cls)
    if "__init__" not in cls.__dict__:
        made.__init__ = _initializer(made)
    made.__setattr__ = made.__delattr__ = _refuse
    if made.__repr__ is object.__repr__:
        made.__repr__ = _repr
    return made


def make_unchecked(cls: type[T], **values: Any) -> T:
    """Return a value of the class with these attributes, which are known to be good.

    Neither `__init__` nor `__post_init__` runs.
    """
    made = object.__new__(cls)
    made.__dict__.update(values)
    return made


def change(value: T, **attributes: Any) -> T:
    """Return a value of the same class with other attributes, which are known to be good.

    As `dataclasses.replace`, without `__init__` and `__post_init__`: what was worked out of the old
    attributes is left behind.
    """
    known = vars(value)
    return make_unchecked(type(value), **{k: known[k] for k in _names(type(value))} | attributes)


@cache
def _names(cls: Any) -> tuple[str, ...]:
    """Return the names of a class's attributes."""
    return tuple([f.name for f in fields(cls)])


def _initializer(cls: Any) -> Any:
    """Return `__init__(self, FIELDS)` with their defaults, which ends with `__post_init__`."""
    known: dict[str, Any] = {"_missing": _Factory()}
    positional, named, lines, types = ["self"], ["*"], ["_values = self.__dict__"], {}
    for f in fields(cls):
        value, made = f.name, f.default_factory is not MISSING
        if made:
            known[f"_make_{f.name}"] = f.default_factory
            value = f"_make_{f.name}()"
        if f.init:
            types[f.name], default = f.type, ""
            if made:
                value, default = f"{value} if {f.name} is _missing else {f.name}", "=_missing"
            elif f.default is not MISSING:
                known[f"_default_{f.name}"], default = f.default, f"=_default_{f.name}"
            (named if f.kw_only else positional).append(f.name + default)
        if f.init or made:  # another default is found in the class
            lines.append(f"_values[{f.name!r}] = {value}")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    given = ", ".join(positional + named * (len(named) > 1))
    exec(f"def __init__({given}):\n " + "\n ".join(lines), known)
    init: Any = known["__init__"]
    init.__qualname__, init.__module__ = f"{cls.__qualname__}.__init__", cls.__module__
    init.__annotations__ = {**types, "return": None}
    return init


def _refuse(self: object, name: str, *_: object) -> Never:
    """Raise `FrozenInstanceError`."""
    raise FrozenInstanceError(f"cannot assign to field {name!r}, nor delete it")


@recursive_repr()
def _repr(self: Any) -> str:
    """Return `Class(field=value, ...)`."""
    shown = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in fields(self) if f.repr)
    return f"{type(self).__qualname__}({shown})"
