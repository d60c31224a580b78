"""Validation of what a user gives: numbers, tables of numbers, and mappings."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping, Set
from typing import Any

import numpy as np

# Tolerances: below 1e-14 is the round-off of S itself, some 50 spacings of floats; above 0.1 (ad
# hoc) an answer has not one digit.
FINEST, COARSEST = 1e-14, 0.1
PLAIN_TYPES = (float, int, list, tuple, np.ndarray, np.generic)  # numbers that say nothing else
TOLERANCE = f"tol between {FINEST:g} (round-off) and {COARSEST:g}"


def number(value: object, what: str) -> float:
    """Return a finite real number.

    Raises ValueError for anything else; text is no number, nor is one with a unit.

    >>> number(np.float32(0.5), "the time")
    0.5
    """
    if type(value) is float and math.isfinite(value):
        return value
    try:
        if isinstance(value, (str, bytes, np.complexfloating)) or getattr(value, "ndim", 0):
            raise TypeError("not a real number")
        found = float(value)  # type: ignore[arg-type]
    except Exception as error:  # of another package's numbers it may be any
        raise ValueError(f"expected a number for {what}, found {value!r}") from error
    if not math.isfinite(found):
        raise ValueError(f"expected a finite number for {what}, found {found}")
    return found


LARGEST_COUNT = 1_000_000  # far more than can be drawn, or solved together; ad hoc


def whole(value: Any, what: str, least: int) -> int:
    """Return a whole number from the least to `LARGEST_COUNT`; raise ValueError for others."""
    try:
        found = operator.index(value)
    except Exception:  # a TypeError, as a rule; some libraries raise what they like
        found = least - 1
    if not least <= found <= LARGEST_COUNT or isinstance(value, bool):
        raise ValueError(
            f"expected a whole number from {least} to {LARGEST_COUNT:,} for {what}, found {value!r}"
        )
    return found


def flag(value: object, name: str) -> bool:
    """Return True or False; raise ValueError for anything else that `name` is given."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"expected {name}=True or {name}=False, found {value!r}")
    return bool(value)


def among(value: object, names: Iterable[str]) -> bool:
    """Whether a value is one of some names; an array, which compares entry by entry, is not."""
    return isinstance(value, str) and value in names


def flat_index(value: Any, shape: tuple[int, ...]) -> int:
    """Return the number of the entry at indices (one for each axis) of an array, row by row.

    Raises IndexError for anything but whole numbers within the shape.
    """
    whole_numbers = all(isinstance(k, (int, np.integer)) and type(k) is not bool for k in value)
    if not (
        len(value) == len(shape)
        and whole_numbers
        and all(-count <= k < count for k, count in zip(value, shape, strict=True))
    ):
        raise IndexError(
            f"expected a place in an array of shape {shape}, a whole number for each axis, found "
            f"{value}"
        )
    return int(np.arange(math.prod(shape)).reshape(shape)[value])


def numbers(value: object, what: str) -> np.ndarray:
    """Return a new array of real numbers, of the shape given.

    Raises ValueError for text, complex numbers, rows of different lengths and other objects, for
    numbers with units, and for tables that are labelled by anything but 0, 1, 2, ...
    """
    _check_bare(value, what)
    try:
        found = np.array(value)
        if value is None or found.dtype.kind not in "biufO":
            raise TypeError(f"{found.dtype} is no real type")
        return found if found.dtype.char == "d" else found.astype(float)
    except Exception as error:  # of another package's arrays it may be any
        raise ValueError(
            f"expected a number or an array of numbers for {what}, found {value!r}"
        ) from error


def _check_bare(value: Any, what: str) -> None:
    """Raise ValueError for what says more than numbers: units, labels (pandas, ...), or masks."""
    if type(value) in (float, int):
        return
    parts = value if isinstance(value, (list, tuple)) else [value]
    masks = [getattr(x, "mask", None) for x in parts if isinstance(x, np.ndarray)]
    if any([mask is not None and np.any(mask) for mask in masks]):
        raise ValueError(
            f"expected numbers for {what}, found {value!r}: masked entries are no "
            "numbers; leave them out"
        )
    if isinstance(value, PLAIN_TYPES):
        return
    if hasattr(value, "magnitude") or hasattr(value, "unit"):
        raise ValueError(
            f"expected plain numbers for {what}, found {value!r}: units are not converted; give "
            "its magnitude in the unit of your choice"
        )
    labels = getattr(value, "axes", None) if hasattr(value, "iloc") else None
    if labels is not None and any(list(axis) != list(range(len(axis))) for axis in labels):
        raise ValueError(
            f"expected numbers for {what} whose order says what they are, found labels "
            f"{', '.join(str(list(axis)) for axis in labels)}, which are not read; put them in "
            "order, and give to_numpy()"
        )


def tolerance(tol: object) -> float:
    """Return `tol`. Raises ValueError if it is no number, or not between 1e-14 and 0.1."""
    found = number(tol, TOLERANCE)
    if not FINEST <= found <= COARSEST:
        raise ValueError(
            f"expected {TOLERANCE}, found {found:g}; it is relative to each coordinate's own size "
            "along the path"
        )
    return found


def by_name(values: object, what: str) -> Mapping[str, Any]:
    """Return a mapping of names to values, empty for None. Raises ValueError for anything else."""
    if values is None:
        return {}
    if not isinstance(values, Mapping) or not all(isinstance(name, str) for name in values):
        raise ValueError(
            f"expected {what} by name, such as {{'m': 1.0}}, found {values!r}; put each value "
            "behind the name that the callables use"
        )
    return values


def items(row: Any, what: str) -> list[Any]:
    """Return the items of a sequence; one number is a sequence of one.

    Raises ValueError for a set or a mapping: their items have no order that means anything. So it
    does for numbers with units or labels.
    """
    if type(row) in (list, tuple):
        return list(row)
    _check_bare(row, what)
    if isinstance(row, (Mapping, Set)):
        raise ValueError(
            f"expected {what} in the order of the coordinates of the system, found {row!r}, which "
            "has no such order; give a list"
        )
    try:
        return [row] if isinstance(row, str) else list(row)
    except TypeError:
        return [row]


def entries(value: Any) -> list[Any] | None:
    """Return what a sequence or an iterator contains; None of text, and of what contains nothing.

    An array without axes says that it can be iterated over, and cannot.
    """
    if isinstance(value, (str, bytes)):
        return None
    try:
        return list(value)
    except TypeError:
        return None


def check_jobs(jobs: int) -> None:
    """Raise ValueError unless there is one job or more."""
    if jobs < 1:
        raise ValueError(f"expected one job or more, found {jobs}")
