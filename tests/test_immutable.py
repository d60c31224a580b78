"""Values that do not change are dataclasses to all that asks."""

import inspect
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, fields, replace
from typing import Any

import pytest

from actionopt.tools.cached import cached_property
from actionopt.tools.immutable import change, immutable, make_unchecked


def written():
    """Return a class with every kind of field."""

    class Point:
        """A point."""

        x: float
        y: float = 2.0
        names: list[str] = field(default_factory=list)
        unit: str = field(default="m", kw_only=True)
        hidden: dict = field(default_factory=dict, init=False, repr=False)
        sum: float = field(init=False, repr=False)

        def __post_init__(self):
            """Set what follows from the others."""
            object.__setattr__(self, "sum", self.x + self.y)

    Point.__qualname__ = "Point"
    return Point


REFERENCE: Any = dataclass(frozen=True, eq=False)(written())
Point: Any = immutable(written())


@immutable
class Place(Point):
    """One that inherits fields."""

    z: float = 0.0


def test_it_is_what_dataclass_makes():
    assert [f.name for f in fields(Point)] == [f.name for f in fields(REFERENCE)]
    assert str(inspect.signature(Point)) == str(inspect.signature(REFERENCE))
    assert repr(Point(1.0, unit="s")) == "Point(x=1.0, y=2.0, names=[], unit='s')"
    assert repr(Point(1.0)) == repr(REFERENCE(1.0))
    point = Point(1.0)
    assert point != Point(1.0) and hash(point) != hash(Point(1.0))
    assert point.names is not Point(1.0).names and point.hidden is not Point(1.0).hidden
    moved = replace(point, x=3.0)
    assert (moved.x, moved.sum, moved.names is point.names) == (3.0, 5.0, True)
    assert vars(pickle.loads(pickle.dumps(moved))) == vars(moved)
    place = Place(1.0, z=4.0)
    assert (place.y, place.z, place.sum) == (2.0, 4.0, 3.0)


@pytest.mark.parametrize("name", ["x", "other"])
def test_it_does_not_change(name):
    point = Place(1.0)
    with pytest.raises(FrozenInstanceError, match=name):
        setattr(point, name, 2.0)
    with pytest.raises(FrozenInstanceError, match="x"):
        del point.x


@pytest.mark.parametrize(
    "given, named, sentence",
    [((), {}, "'x'"), ((1.0,), {"sum": 2.0}, "'sum'"), ((1, 2, [], "s"), {}, "positional")],
)
def test_arguments_are_told_as_of_any_function(given, named, sentence):
    with pytest.raises(TypeError, match=sentence):
        Point(*given, **named)


def test_unchecked_sets_what_is_given_and_derives_nothing():
    """A value that is known to be good is made without `__init__` and `__post_init__`."""
    made = make_unchecked(Point, x=1.0, sum=7.0)
    assert (type(made), made.x, made.y, made.sum) == (Point, 1.0, 2.0, 7.0)
    assert not hasattr(made, "names")
    with pytest.raises(FrozenInstanceError):
        made.x = 2.0


def test_what_was_worked_out_of_other_attributes_is_left_behind():
    @immutable
    class Square:
        """One whose area is worked out."""

        side: float
        unit: str = "m"

        @cached_property
        def area(self) -> float:
            """The area."""
            return self.side**2

    small = Square(2.0)
    assert small.area == 4.0 and vars(small)["area"] == 4.0
    large = change(small, side=3.0)
    assert (large.area, large.unit, small.area) == (9.0, "m", 4.0)
    assert isinstance(Square.area, cached_property)
