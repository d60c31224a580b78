"""The last answer of a function is kept: a figure and its caption ask the same in turn."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from inspect import signature
from typing import Any, ParamSpec, TypeVar

import numpy as np

from actionopt.analysis.solution import Solution

P = ParamSpec("P")
T = TypeVar("T")


def latest(ask: Callable[P, T]) -> Callable[P, T]:
    """Return a function of a solution that keeps its last answer as long as that solution lives.

    The arrays of the answer, a dataclass, cannot be written to.
    """
    bound = signature(ask).bind
    kept: list[tuple[weakref.ref[Solution], dict[str, Any], T]] = []

    @wraps(ask)
    def call_or_recall(*args: P.args, **options: P.kwargs) -> T:
        call = bound(*args, **options)
        call.apply_defaults()
        name, *others = call.arguments
        solution, rest = call.arguments[name], {key: call.arguments[key] for key in others}
        for ref, before, answer in kept[:]:
            if ref() is solution and before == rest:
                return answer
        answer = ask(*args, **options)
        for field in fields(answer):  # type: ignore[arg-type]
            if isinstance(value := getattr(answer, field.name), np.ndarray):
                value.flags.writeable = False
        kept[:] = [(weakref.ref(solution, lambda _: kept.clear()), rest, answer)]
        return answer

    return call_or_recall
