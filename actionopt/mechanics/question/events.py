"""Where a path begins and ends: points of configuration space-time, and what stands for them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any, ClassVar, NamedTuple, Never, Self

import numpy as np
from numpy.typing import ArrayLike

from actionopt.tools.checks import items, number, numbers
from actionopt.tools.immutable import immutable, make_unchecked
from actionopt.tools.shown import MOST_SHOWN, brief, one_line
from actionopt.tools.types import Array

RATES = ("v", "a", "j")  # derivatives of coordinates, as events name them
TIME = "the time of an event"


@immutable
class Event:
    """A point of configuration space-time: a time and the coordinates there.

    Parameters
    ----------
    t : float or None
        Time; None leaves it free, and the energy function H is that of the problem there. With
        -math.inf at the start the path comes from the equilibrium q, with math.inf at the end it
        tends to it: a saddle of the equations of motion, along its unstable or stable manifold.
    q : sequence of n numbers or None, or None
        Coordinates; None leaves that coordinate free, and the natural condition p = 0 holds. None
        in place of them all leaves every one free: how many there are, the system says.
    on : callable, optional
        `on(q, t, *, ...)`: one expression or a sequence of them, written as a constraint is, that
        vanishes at the event: it lies on that surface, and the momentum is normal to it
        (transversality; Gelfand and Fomin, *Calculus of Variations* (1963), section 14). Where t
        is None, p.dq - (H - energy) dt = 0 for all moves along it. Parameters that only `on`
        contains are given by the problem (`Problem(..., parameters=)`).
    v, a, j : sequence of n numbers or None, optional
        Derivatives of the coordinates at the event, of a path whose Lagrangian contains the next
        ones: v where that is L(q, v, a, t), v and a where it is L(q, v, a, j, t), and so on. None
        leaves one free, and its momentum is continuous there, or vanishes at an end.

    Raises
    ------
    ValueError
        If the time or a coordinate is no number, the coordinates are not finite, or in a set or a
        mapping, which have no order, or one is free at infinite time; if `on` is not callable, or
        leaves nothing to decide. In a problem, for derivatives that its Lagrangian leaves free.
    TypeError
        For further arguments.
    """

    t: float
    q: tuple[float | None, ...]
    on: Any = field(repr=False)  # a callable; in a problem, the surface traced
    rates: tuple[tuple[float | None, ...] | None, ...]  # v, a, j; as far as they are given
    # What only a path that closes has at its end, and one that comes to rest beyond a window.
    advance: ClassVar[tuple[float, ...] | None] = None
    order: ClassVar[tuple[int, ...]] = ()
    side: ClassVar[int] = 0
    phase: ClassVar[Phase | None] = None

    def __init__(
        self,
        t: float | None,
        q: Sequence[float | None] | ArrayLike | None,
        *others: Never,
        on: Callable[..., Any] | None = None,
        v: Sequence[float | None] | ArrayLike | None = None,
        a: Sequence[float | None] | ArrayLike | None = None,
        j: Sequence[float | None] | ArrayLike | None = None,
        **named: Never,
    ) -> None:
        if others or named:
            found = [*map(repr, others), *(f"{name}={x!r}" for name, x in named.items())]
            raise TypeError(
                "expected Event(t, q), a time and the coordinates there, found also "
                f"{', '.join(found)}; None leaves a coordinate free, v= gives velocities of a path "
                "whose Lagrangian contains accelerations, and a motion from initial values is "
                "actionopt.integrate(system, State(t, q, v), t_end)"
            )
        # A time that is free is None: it is known before anything reckons with it.
        infinite = isinstance(t, float) and math.isinf(t)
        known = t if t is None or infinite else number(t, TIME)
        object.__setattr__(self, "t", known)
        given = () if q is None else items(q, "the coordinates of an event")
        row = tuple(
            [
                None if x is None else number(x, f"coordinate {i} of an event")
                for i, x in enumerate(given)
            ]
        )
        # They are None until a problem knows how many there are.
        object.__setattr__(self, "q", None if q is None else row)
        object.__setattr__(self, "on", on)
        rates = () if v is a is j is None else _rates(v=v, a=a, j=j)
        object.__setattr__(self, "rates", rates)
        if on is not None:
            self._check_on(infinite)
        if infinite and (q is None or None in row):
            raise ValueError(
                "expected all coordinates of the equilibrium at infinite time, found "
                f"{None if q is None else list(row)}; give the numbers, or a finite time"
            )

    def _check_on(self, infinite: bool) -> None:
        """Raise ValueError where no surface is given, or it has no say."""
        if not callable(self.on):
            raise ValueError(
                f"expected on as a callable on(q, t, *, parameters), found {self.on!r}; return "
                "what vanishes there, such as q[0] - 1"
            )
        if infinite:
            raise ValueError(
                "expected an equilibrium at infinite time, found a surface on which to choose: "
                "leave out `on`, or give a finite time"
            )
        if self.q is not None and None not in self.q:
            raise ValueError(
                f"expected a coordinate that is free where `on` says where it lies, found all of "
                f"them given, {list(self.q)}; leave out `on`, or give None for what it decides"
            )

    def __repr__(self) -> str:
        """Show what was given, and whether the event lies on a surface."""
        on = ", on=..." if self.on is not None else ""
        q = self.q if self.q is None or len(self.q) <= MOST_SHOWN else brief(self.q)
        pairs = zip(RATES, self.rates, strict=False)
        rates = "".join(f", {name}={brief(row)}" for name, row in pairs if row is not None)
        return f"Event(t={self.t}, q={q}{rates}{on})"

    @property
    def near(self) -> tuple[float | None, ...]:
        """The coordinates as far as they are known: those given, or of the equilibrium."""
        return self.q

    @property
    def limit(self) -> Event:
        """The event of which it is the edge of a window: itself."""
        return self

    @property
    def pinned(self) -> tuple[int, ...]:
        """Indices of the coordinates that are given."""
        return tuple([i for i, x in enumerate(self.q or ()) if x is not None])

    @classmethod
    def of_places(cls, t: float, places: Array, n: int) -> Event:
        """Return the event where n coordinates and their derivatives are `places`, (order n,)."""
        q, *rates = places.reshape(-1, n)
        named: dict[str, Any] = dict(zip(RATES, rates, strict=False))
        return cls(t, q, **named)

    def _with_rates_of(self, other: Event) -> Event:
        """Return the same event with the derivatives of another."""
        return self._replace(**other._given_rates)

    def places(self, order: int) -> tuple[float | None, ...]:
        """Return the coordinates and their derivatives below that of an order, (order n,)."""
        found = list(self.q)
        for k in range(order - 1):
            row = self.rates[k] if k < len(self.rates) else None
            found += [None] * len(self.q) if row is None else row
        return tuple(found)

    @property
    def _given_rates(self) -> dict[str, Any]:
        return dict(zip(RATES, self.rates, strict=False))

    def pinned_places(self, order: int) -> tuple[int, ...]:
        """Return the indices of the `places` that are given."""
        if order == 1:
            return self.pinned
        return tuple(i for i, x in enumerate(self.places(order)) if x is not None)

    def _replace(self, **changes: Any) -> Event:
        """Return the same event with another t, q or on."""
        known = {"t": self.t, "q": self.q, "on": self.on, **self._given_rates} | changes
        return Event(known.pop("t"), known.pop("q"), **known)

    def at(self, t: float | None) -> Self:
        """Return the same event at another time."""
        if type(self) is Event and isinstance(t, float) and math.isinf(t):
            return self._replace(t=t)  # type: ignore[return-value]
        known = None if t is None else number(t, TIME)
        return make_unchecked(type(self), **self.__dict__ | {"t": known})

    def shifted(self, by: Sequence[float] | ArrayLike) -> Event:
        """Return the event with its coordinates moved by `by` (n,); free ones stay free."""
        if self.q is None:
            return self
        pairs = zip(self.q, _shift(by, len(self.q)), strict=True)
        return self._replace(q=[None if x is None else x + d for x, d in pairs])


def _rates(**given: Any) -> tuple[tuple[float | None, ...] | None, ...]:
    """Return the derivatives that are given, up to the highest. Raises ValueError for no numbers.

    Rows of None alone are left out.
    """
    found: list[tuple[float | None, ...] | None] = []
    for name, row in given.items():
        values = () if row is None else items(row, f"{name} of an event")
        known = tuple(
            None if x is None else number(x, f"{name}[{i}] of an event")
            for i, x in enumerate(values)
        )
        found.append(None if all(x is None for x in known) else known)
    while found and found[-1] is None:
        found.pop()
    return tuple(found)


def _shift(by: Sequence[float] | ArrayLike, n: int | None) -> Array:
    """Return a shift of n coordinates, or of as many as it has. Raises ValueError for others."""
    row = numbers(items(by, "a shift of an event"), "a shift of an event")
    if row.ndim != 1 or n not in (None, row.size):
        raise ValueError(f"expected a shift of {n or 'all'} coordinates, found {by!r}")
    return row


@immutable
class Bounce(Event):
    """An elastic reflection off the surface on(q, t) = 0, between the ends of a path.

    The path stays where on > 0. Its momentum jumps along the normal of the surface, and H is
    continuous where the surface does not move.

    Parameters
    ----------
    on : callable
        `on(q, t, *, ...)`, as that of an `Event`; positive where the path is.
    t : float, optional
        The time of the reflection; to be found if None.
    q : sequence of n numbers or None, optional
        Coordinates that are given; all of them are to be found if None.

    Raises
    ------
    ValueError, TypeError
        As an `Event` does.
    """

    def __init__(
        self,
        on: Callable[..., Any],
        t: float | None = None,
        q: Sequence[float | None] | ArrayLike | None = None,
    ) -> None:
        if on is None:
            raise ValueError("expected a callable on(q, t) to bounce off, found None")
        super().__init__(t, q, on=on)

    def _replace(self, **changes: Any) -> Event:
        """Return the reflection with another t, q or on; a plain event if its place is given."""
        known = {"t": self.t, "q": self.q, "on": self.on} | changes
        if known["on"] is None:
            return Event(known["t"], known["q"])
        return Bounce(known["on"], known["t"], known["q"])

    def __repr__(self) -> str:
        """Show what was given."""
        q = self.q if self.q is None or len(self.q) <= MOST_SHOWN else brief(self.q)
        return f"Bounce(on=..., t={self.t}, q={q})"


@immutable
class Periodic(Event):
    """The end of a path that closes: q(t1) = q(t0) + advance, and p(t1) = p(t0).

    With `relabel` it closes in another order, q_i(t1) = q_relabel[i](t0) + advance_i, and so do the
    momenta: where bodies are alike, each may go on where another one began.

    A path without a clock may start anywhere along itself: a coordinate that the start gives says
    where. (With a clock or an obstacle that coordinate returns, and its momentum is left alone.)

    Parameters
    ----------
    t : float or None
        Time; None leaves the period to be found, from the energy of the problem.
    advance : sequence of n numbers, optional
        Whole turns of coordinates that are angles, say; zero if None.
    relabel : sequence of n names or indices of coordinates, optional
        For each coordinate the one that it goes on as; itself if None. L must not tell them apart.

    Raises
    ------
    ValueError
        If a number is not finite; in a problem, if `relabel` does not name each coordinate once or
        changes L.

    Examples
    --------
    >>> end = Periodic(2.0, advance=[0.0, 6.5]).after(Event(0.0, [None, 0.5]))
    >>> end.q
    (None, 7.0)
    """

    advance: tuple[float, ...] | None
    relabel: tuple[str | int, ...] | None

    __repr__ = one_line

    def __init__(
        self,
        t: float | None,
        advance: Sequence[float] | ArrayLike | None = None,
        *,
        relabel: Sequence[str | int] | ArrayLike | None = None,
    ) -> None:
        super().__init__(t, [])
        given = () if advance is None else items(advance, "the advance of a periodic end")
        row = tuple(number(x, f"advance {i} of a periodic end") for i, x in enumerate(given))
        object.__setattr__(self, "advance", None if advance is None else row)
        names = None if relabel is None else tuple(items(relabel, "the order of a periodic end"))
        object.__setattr__(self, "relabel", names)

    @property
    def order(self) -> tuple[int, ...]:
        """The coordinate at the start that each one goes on as, of a problem's end: (n,)."""
        return tuple(range(len(self.q))) if self.relabel is None else self.relabel  # type: ignore[return-value]

    def after(self, start: Event, names: Sequence[str] = ()) -> Periodic:
        """Return the end of a path from `start`, with its coordinates, which may have names.

        Raises ValueError for an advance of fewer or more coordinates, or an invalid order.
        """
        n = len(start.q)
        advance = (0.0,) * n if self.advance is None else self.advance
        if len(advance) != n:
            raise ValueError(f"expected the advance of {n} coordinates, found {len(advance)}")
        order = None
        if self.relabel is not None:
            order = [names.index(x) if x in names else x for x in self.relabel]
            if not all(isinstance(i, (int, np.integer)) for i in order) or sorted(order) != [
                *range(n)
            ]:
                raise ValueError(
                    f"expected relabel= to name each of {', '.join(names) or n} once, or to have "
                    f"each index from 0 to {n - 1} once, found {list(self.relabel)}"
                )
            order = [int(i) for i in order]
        end = Periodic(self.t, advance, relabel=order)
        row = start.q if order is None else [start.q[i] for i in order]
        pairs = zip(row, advance, strict=True)
        object.__setattr__(end, "q", tuple(None if x is None else x + a for x, a in pairs))
        return end

    def shifted(self, by: Sequence[float] | ArrayLike) -> Periodic:
        """Return the end of a path that advances by `by` (n,) more."""
        row = _shift(by, None if self.advance is None else len(self.advance))
        row = row if self.advance is None else self.advance + row
        return Periodic(self.t, row, relabel=self.relabel)


class Phase(NamedTuple):
    """A choice among paths that differ by a shift of time: normal . (q - center) = 0 at t.

    `weight` is in units of action.
    """

    t: float
    normal: tuple[float, ...]
    center: tuple[float, ...]
    weight: float


@immutable
class Tail(Event):
    """The edge of a window in time, beyond which a path comes from rest or tends to it.

    `solve` puts it in the place of an event at infinite time. The coordinates are free there; the
    path lies on the linear manifold of the equilibrium.

    Parameters
    ----------
    t : float
        Where the window ends.
    rest : sequence of n numbers
        The equilibrium.
    side : int
        -1 at the start, 1 at the end.
    phase : Phase, optional
        What sets the origin of time; of a start.
    """

    rest: tuple[float, ...]
    side: int
    phase: Phase | None

    def __init__(
        self, t: float, rest: Sequence[Any] | ArrayLike, side: int, phase: Phase | None = None
    ) -> None:
        row = tuple(number(x, "a coordinate at rest") for x in items(rest, "an equilibrium"))
        super().__init__(t, [None] * len(row))
        for name, value in (("rest", row), ("side", side), ("phase", phase)):
            object.__setattr__(self, name, value)

    @property
    def near(self) -> tuple[float | None, ...]:
        """The coordinates of the equilibrium."""
        return self.rest

    @property
    def limit(self) -> Event:
        """The event at infinite time."""
        return Event(self.side * math.inf, self.rest)

    def shifted(self, by: Sequence[float] | ArrayLike) -> Tail:
        """Return the tail of an equilibrium that is moved by `by` (n,)."""
        moved = [x + d for x, d in zip(self.rest, items(by, "a shift of an event"), strict=True)]
        return Tail(self.t, moved, self.side, self.phase)


@immutable
class State:
    """A whole initial-value problem: time, coordinates (n,) and velocities (n,).

    Raises ValueError if the shapes differ or a number is not finite.
    """

    t: float
    q: Array
    v: Array

    __repr__ = one_line

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", number(self.t, "the time of a state"))
        for name in ("q", "v"):
            row = np.atleast_1d(numbers(getattr(self, name), f"{name} of a state"))
            if row.ndim != 1 or not np.all(np.isfinite(row)):
                raise ValueError(f"expected finite {name} of shape (n,), found {row}")
            row.setflags(write=False)
            object.__setattr__(self, name, row)
        if self.q.shape != self.v.shape:
            raise ValueError(
                f"expected q and v of one shape, found {self.q.shape} and {self.v.shape}"
            )

    def __reduce__(self) -> tuple:
        """Return how to make it anew from the same numbers."""
        return State, (self.t, self.q, self.v)
