"""What is printed of an object: one line, in which large arrays are their shapes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from itertools import islice
from typing import Any

import numpy as np

MOST_SHOWN = 4  # items of a sequence that are printed; ad hoc
SCALARS = (int, float, complex, str, type(None))


def row_of(items: Iterable[object], count: int) -> str:
    """Return `count` items in a row, the first of them where they are many.

    >>> row_of("abc", 3), row_of(range(200), 200)
    ('a, b, c', '0, 1, 2, 3, ..., 200 in all')
    """
    row = ", ".join(map(str, islice(items, MOST_SHOWN)))
    return f"{row}, ..., {count} in all" if count > MOST_SHOWN else row


def brief(value: Any) -> str:
    """Return a value in few words: an array as its shape, unless it is a short row.

    >>> brief(np.zeros((3, 4))), brief(np.ones(2)), brief(0.5), brief((1, "x")), brief({"m": 1.0})
    ('array (3, 4)', '[1, 1]', '0.5', "(1, 'x')", '{m: 1}')
    """
    if isinstance(value, np.ndarray) and value.ndim:
        short = value.ndim == 1 and value.size <= MOST_SHOWN and value.dtype.kind in "iuf"
        return f"[{row_of(map(brief, value), value.size)}]" if short else f"array {value.shape}"
    if isinstance(value, (float, np.ndarray)):
        return f"{value:.6g}"
    if isinstance(value, (tuple, list)):
        if value and not isinstance(value[0], SCALARS):
            return f"{len(value)} of {type(value[0]).__name__}"
        return f"({row_of(map(brief, value), len(value))}{',' * (len(value) == 1)})"
    if isinstance(value, Mapping):
        pairs = (f"{name}: {brief(x)}" for name, x in value.items())
        return f"{{{row_of(pairs, len(value))}}}"
    name = getattr(value, "__name__", None)
    return repr(value) if name is None else str(name)


def one_line(self: Any, **shown: Any) -> str:
    """Return a dataclass in one line, `Name(field=value, ...)`: to be its `__repr__`.

    Without what is as by default; fields that are `shown` have the value given there.
    """
    given = [f for f in fields(self) if f.repr and getattr(self, f.name) is not f.default]
    pairs = ((f.name, shown.get(f.name, getattr(self, f.name))) for f in given)
    return f"{type(self).__name__}({', '.join(f'{name}={brief(x)}' for name, x in pairs)})"
