"""Attributes that are worked out when they are first asked for, and kept."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

T = TypeVar("T")


class cached_property(Generic[T]):
    """As functools.cached_property from Python 3.12 on, in a third of the calls.

    That of 3.11 holds a lock, one for all objects of a class: other threads wait for what has
    nothing to do with them. Here two threads may work out the same, and either is kept.
    """

    def __init__(self, build: Callable[[Any], T]) -> None:
        self.build, self.name = build, build.__name__
        self.__doc__ = build.__doc__

    @overload
    def __get__(self, instance: None, owner: type) -> cached_property[T]: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: object | None, owner: type) -> cached_property[T] | T:
        """Work it out; from then on it is found before this is asked."""
        if instance is None:
            return self
        found = instance.__dict__[self.name] = self.build(instance)
        return found

    if TYPE_CHECKING:  # it is not there, and what is set is found before this is asked

        def __set__(self, instance: object, value: T) -> None: ...
