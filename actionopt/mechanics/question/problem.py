"""The question: a system and the two events its path must join."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from actionopt.mechanics.laws.instants import Instant, instants, merge
from actionopt.mechanics.laws.tracing import MULTIPLIERS, SWITCHES
from actionopt.mechanics.question.consistency import (
    check_alike,
    check_constraint_rows,
    check_free_time,
    check_on_surface,
    check_surfaces,
)
from actionopt.mechanics.question.course import (
    check_course,
    check_rates,
    check_rates_on_constraints,
    check_shared,
    take_turns,
)
from actionopt.mechanics.question.events import Bounce, Event, Periodic
from actionopt.mechanics.question.scales import motion_of, scales_of
from actionopt.mechanics.question.singular_ends import singular_ends
from actionopt.mechanics.question.surface import with_parameters, with_surface
from actionopt.mechanics.system import System
from actionopt.tools.cached import cached_property
from actionopt.tools.checks import by_name, entries, numbers
from actionopt.tools.immutable import immutable, make_unchecked
from actionopt.tools.shown import one_line
from actionopt.tools.types import EPS, Array, NDInt

if TYPE_CHECKING:
    from actionopt.mechanics.question.rest import Rest

# Durations T: T^2 and 1 / T^2 leave 100 decades to the limits of floats, 1e-308 and 1e308.
SHORTEST_DURATION, LONGEST_DURATION = 1e-100, 1e100
ALIKE = 6  # powers of two between coordinates that may be measured in one unit; ad hoc


class BetweenEvents:
    """What events say of the paths between them, whatever the system is."""

    start: Event
    end: Event
    through: tuple[Event, ...]

    @property
    def joints_found(self) -> tuple[Event, ...]:
        """The start, the events between and the end, as far as they have been found."""
        return (self.start, *self.through, self.end)

    @cached_property
    def advance(self) -> Array | None:
        """q(t1) - q(t0) where the end is `Periodic`, (n,), else None."""
        return None if self.end.advance is None else np.array(self.end.advance)

    @property
    def order(self) -> tuple[int, ...]:
        """The coordinate at the start that each one at a `Periodic` end goes on as; else none."""
        return self.end.order

    @property
    def has_tails(self) -> bool:
        """Whether the path comes from rest or tends to it beyond a window of finite times."""
        return bool(self.start.side or self.end.side)


@immutable
class Problem(BetweenEvents):
    """A system and two events.

    Parameters
    ----------
    system : System or sequence of System
        The physics; of k + 1 systems of the same coordinates each is the law of one leg, between
        two of the events.
    start, end : Event
        Where the path begins and ends; `start.t < end.t`. The end may be `Periodic`.
    parameters : mapping, optional
        Overrides the system's default parameters by name; nothing is derived again. After
        construction the attribute holds every parameter.
    energy : float, optional
        Where a time is free: S + energy (t1 - t0) is stationary, so that the energy function H is
        `energy` at the events whose times are free. 0 if None.
    through : sequence of k Event or Bounce, optional
        What the path passes between its ends, in order. It goes through the coordinates that are
        given, where its momentum may jump; in those that are free, None, the momentum is
        continuous, and so is the energy where t is None. `on` is a surface on which the place is
        found; a `Bounce` is a reflection off one.
    integral : number or sequence of c numbers, optional
        What the integrals of `system.integral` along the path are to be. S + kappa.(int g dt -
        integral) is stationary, with multipliers kappa (c,) that are found: the problem's `system`
        is that of L + kappa.g, its momenta and its energy are those of this.

    Attributes
    ----------
    asked : Problem or None
        The problem whose times were free, or whose events lay on surfaces, of one in which they
        have been found.

    Raises
    ------
    ValueError
        If the events do not fit the system, lie off its constraint surface or inside its
        obstacle, or the times do not increase, by 1e-100 to 1e100; a parameter is unknown, a
        constraint contains no coordinate, what an event lies on does not fit, or there is no
        system. If events between the ends give nothing, are not as many as the laws of legs less
        one, or go with what is not known of them: an infinite time, a Bounce along an obstacle; a
        force where times or places are to be found. If the values of integrals are not as many as
        the system has, or go with an infinite time.
    """

    system: System
    start: Event
    end: Event
    parameters: Mapping[str, Any] = field(default=None, kw_only=True)  # type: ignore[assignment]
    energy: float | None = field(default=None, kw_only=True)
    through: Sequence[Event] = field(default=(), kw_only=True)
    integral: Sequence[float] | ArrayLike | None = field(default=None, kw_only=True)
    laws: tuple[System, ...] = field(default=(), init=False, repr=False)  # of legs that differ
    plain: System | None = field(default=None, init=False, repr=False)  # without its integrals
    asked: Problem | None = field(default=None, init=False, repr=False)

    if TYPE_CHECKING:  # what is given may be more than what the attributes are

        def __init__(
            self,
            system: System | Sequence[System],
            start: Event,
            end: Event,
            *,
            parameters: Mapping[str, Any] | None = None,
            energy: float | None = None,
            through: Sequence[Event] = (),
            integral: ArrayLike | None = None,
        ) -> None: ...

    def __repr__(self) -> str:
        return one_line(self, parameters=self._given_parameters)

    def __post_init__(self) -> None:
        self._check_types()
        on_surface = (self.start.on, self.end.on) != (None, None)
        self._set_parameters(on_surface)
        self._set_ends()
        self._check_times()
        if self.system.order > 1 or any(e.rates for e in (self.start, self.end)):
            check_rates(self, (self.start, self.end))
        if on_surface:
            check_surfaces(self)
        if self.through:
            object.__setattr__(self, "through", check_course(self))
        if self.system.m and self.system.order > 1:
            check_rates_on_constraints(self)
        if self.system.m:
            check_constraint_rows(self.system)
            check_on_surface(self)
        if self.system.r:
            from actionopt.mechanics.question.obstacle import (
                check_outside,
                check_rates_outside,
                check_rows,
            )

            check_rows(self.system)
            if self.asked is None:  # places that are found are not the question's
                check_outside(self.system, self.packed, self.joints_found, self.joints, self.scales)
                if self.system.order > 1:
                    T = None if self.free_time else self.duration
                    known = self.joints_found, self.scales, T
                    check_rates_outside(self.system, self.packed, *known)
        if isinstance(self.end, Periodic) and self.end.relabel is not None:
            check_alike(self)

    def _check_types(self) -> None:
        """Set the events between the ends, laws and integrals; raise ValueError for other types."""
        if (through := entries(self.through)) is None:
            raise ValueError(
                f"expected a list of Events or Bounces as through, found {self.through!r}"
            )
        object.__setattr__(self, "through", tuple(through))
        if isinstance(self.system, Sequence):
            self._set_laws(self.system)
        for role, event in (("start", self.start), ("end", self.end)):
            if not isinstance(event, Event):
                raise ValueError(f"expected an Event(t, q) as the {role}, found {event!r}")
        if self.integral is not None:
            self._set_integral()
        if not isinstance(self.system, System):
            raise ValueError(
                f"expected a System(lagrangian, coordinates), found {self.system!r}; a Lagrangian "
                "is made one by System"
            )

    def _set_parameters(self, on_surface: bool) -> None:
        """Set the values of the parameters, those that surfaces name too."""
        if on_surface or self.through or self.asked is not None:
            source = self.asked or self  # what was found lies on the surfaces that were asked for
            events = source.start, *source.through, source.end
            system = with_parameters(self.system, events, self.parameters)
            object.__setattr__(self, "system", system)
        given = dict(by_name(self.parameters, "parameters"))
        for name in (SWITCHES, MULTIPLIERS):  # those of another problem, given along with the rest
            if name not in self.system.table.shapes or (self.laws and name == SWITCHES):
                given.pop(name, None)
        if self.laws:
            check_shared(self, given)
        values = self.system.table.values(given)
        if self.laws:
            values[SWITCHES] = np.array([_time(e) for e in self.through])
        object.__setattr__(self, "parameters", values)
        object.__setattr__(self, "packed", self.system.table.pack(values))

    def _set_ends(self) -> None:
        """Set coordinates and surfaces of the ends; raise ValueError where they do not fit."""
        names = self.system.coordinates
        for role, event in (("start", self.start), ("end", self.end)):
            if isinstance(event, Bounce) or (role == "start" and isinstance(event, Periodic)):
                where = "through=[...]" if isinstance(event, Bounce) else "the end of a path"
                raise ValueError(
                    f"expected an Event at the {role}, found a {type(event).__name__}, which "
                    f"belongs in {where}; give the {role} as Event(t, q)"
                )
            if event.q is None:
                object.__setattr__(self, role, event._replace(q=[None] * len(names)))
        if isinstance(self.end, Periodic):
            object.__setattr__(self, "end", self.end.after(self.start, names))
        for role, event in (("start", self.start), ("end", self.end)):
            if len(event.q) != len(names):
                raise ValueError(
                    f"expected {len(names)} coordinates ({', '.join(names)}) at the {role} "
                    f"event, found {len(event.q)}"
                )
            if event.on is not None:
                object.__setattr__(self, role, with_surface(event, self.system))

    def _check_times(self) -> None:
        """Raise ValueError for times that are in no order, or far too near or far apart."""
        if self.free_time or (self.energy is not None and self.asked is None):
            check_free_time(self)
        elif not self.start.t < self.end.t:
            raise ValueError(
                f"expected the end event after the start event, found t1 = {self.end.t} and "
                f"t0 = {self.start.t}; exchange the events, or change a time where both are equal"
            )
        elif self.is_infinite:
            if self.advance is not None:
                raise ValueError(
                    "expected a path that closes after a finite time, found the times "
                    f"{self.start.t} and {self.end.t}; from rest back to rest it is a path between "
                    "an event at -inf and one at inf of the same coordinates"
                )
        elif not SHORTEST_DURATION <= self.duration <= LONGEST_DURATION:
            raise ValueError(
                f"expected a duration t1 - t0 from {SHORTEST_DURATION:g} to {LONGEST_DURATION:g}, "
                f"whose square and its inverse are within the range of numbers, found "
                f"{self.duration:g}; measure time in another unit"
            )

    packed: Array = field(init=False, repr=False)

    def _set_laws(self, laws: Sequence[Any]) -> None:
        """Put one system, whose laws take turns, in the place of one for each leg."""
        if len(laws) != len(self.through) + 1:
            raise ValueError(
                f"expected one system, or one for each of {len(self.through) + 1} legs, found "
                f"{len(laws)}; legs meet at the events of through="
            )
        system = take_turns(laws)
        if system is not laws[0]:
            object.__setattr__(self, "laws", tuple(laws))
        object.__setattr__(self, "system", system)

    def _set_integral(self) -> None:
        """Put the system of L + kappa.g in the place of the one whose integrals are given."""
        system = self.system
        if not isinstance(system, System) or not system.g.numel():
            raise ValueError(
                "expected a System(..., integral=g) where integrals are given, found one without"
            )
        if MULTIPLIERS in system.table.defaults:
            raise ValueError(
                "expected a system as it was defined where integrals are given, found that of "
                "L + kappa.g, which a problem makes of it; give its `problem.question` instead"
            )
        values = numbers(self.integral, "the values of the integrals")
        values = np.atleast_1d(values)
        if values.shape != (system.g.numel(),) or not np.isfinite(values).all():
            raise ValueError(
                "expected as many finite values of integrals as the system has expressions, "
                f"{system.g.numel()}, found {self.integral!r}"
            )
        if self.is_infinite:
            raise ValueError(
                "expected a path between finite events where integrals are given, found an "
                "infinite time: the rest there, and the rates at which a path tends to it, are "
                "those of L + kappa.g, and kappa is found with the path; give a finite time, of "
                "many times in which it decays"
            )
        object.__setattr__(self, "integral", tuple(values.tolist()))
        object.__setattr__(self, "plain", system)
        object.__setattr__(self, "system", system.with_multipliers)

    def __reduce__(self) -> tuple:
        """Ask it anew: what follows from it is made where it is needed."""
        if self.asked is not None:
            found = self.joints_found
            q = [e.q for e in found] if all(e.on is None for e in found) else None
            return _restore_found, (self.asked, [e.t for e in found], q, self.kappa)
        known = (
            self.start,
            self.end,
            self._given_parameters,
            self.energy,
            self.through,
            self.integral,
        )
        return _restore_asked, (self.question, *known)

    @property
    def question(self) -> System | tuple[System, ...]:
        """The system, or those of the legs, as they were given."""
        return self.laws or self.plain or self.system

    @property
    def joints(self) -> tuple[Event, ...]:
        """The start, the events between and the end as they were asked for, with their surfaces."""
        return self.original.joints_found

    def _repr_html_(self) -> str:
        """Show the system's formulas and the events, as a notebook does."""
        from actionopt.tools.notebook import table

        def show(x: float | None) -> str:
            return "free" if x is None else f"{x:.6g}"

        names = self.system.coordinates
        values = self.system.table.values(self.parameters)
        rows = [("t", f"{self.start.t:.6g}", f"{self.end.t:.6g}")]
        rows += [
            (n, show(a), show(b))
            for n, a, b in zip(names, self.start.near, self.end.near, strict=True)
        ]
        given = [(name, np.array2string(np.asarray(x), precision=6)) for name, x in values.items()]
        return (
            self.system._repr_html_()
            + table("The two events", rows)
            + (table("Parameters", given) if given else "")
        )

    def replace(
        self,
        *,
        start: Event | None = None,
        end: Event | None = None,
        parameters: Mapping[str, Any] | None = None,
        energy: float | None = None,
        through: Sequence[Event] | None = None,
        integral: Sequence[float] | ArrayLike | None = None,
    ) -> Problem:
        """Return the problem with other events, parameters, energy or values of integrals.

        Times that were free are so again, if no event says otherwise. All else is kept: parameters
        that are not named, coordinates that are free, and an end that is `Periodic`, which follows
        another start. Raises ValueError as a `Problem` does.

        Examples
        --------
        >>> from actionopt import scenes
        >>> problem = scenes.get("pendulum", l=2.0).problem
        >>> later = problem.replace(end=problem.end.at(3.0), parameters={"g": 1.62})
        >>> later.end.t, float(later.parameters["g"]), float(later.parameters["l"])
        (3.0, 1.62, 2.0)
        """
        old = self.original
        start, end = old.start if start is None else start, old.end if end is None else end
        free = getattr(start, "t", 0.0) is None or getattr(end, "t", 0.0) is None
        return Problem(
            old.question,  # type: ignore[arg-type]
            start,
            end,
            parameters={**self._given_parameters, **by_name(parameters, "parameters")},
            energy=old.energy if energy is None and free else energy,
            through=old.through if through is None else through,
            integral=old.integral if integral is None else integral,
        )

    @property
    def _given_parameters(self) -> dict[str, Any]:
        """The parameters but for those that are found with the path."""
        return {k: x for k, x in self.parameters.items() if k not in (SWITCHES, MULTIPLIERS)}

    def packed_of(self, law: System) -> Array:
        """Return the parameters of one of the `laws` of legs, or of the one of all, packed."""
        if law is self.system:
            return self.packed
        shared = {k: x for k, x in self.parameters.items() if k in law.table.shapes}
        return law.table.pack(law.table.values(shared))

    @property
    def kappa(self) -> Array:
        """The multipliers of the integrals that are given, (c,); of none if there are none."""
        return self.parameters.get(MULTIPLIERS, np.zeros(0))

    @property
    def free_time(self) -> bool:
        """Whether the time of an event is to be found."""
        return self.start.t is None or self.end.t is None

    @property
    def may_cross_kinks(self) -> bool:
        """Whether L has kinks in q that a path may cross, and the question is no other kind."""
        law = self.system
        if law.order > 1 or law.m or law.r or law.structure.forced:
            return False
        return not (self.through or self.closes) and law.branches is not None

    @property
    def on_surface(self) -> bool:
        """Whether an event lies on a surface, where on it is to be found."""
        return self.start.on is not None or self.end.on is not None

    @property
    def has_open_ends(self) -> bool:
        """Whether the time or the place of an end is to be found."""
        return self.free_time or self.on_surface

    @property
    def has_open_events(self) -> bool:
        """Whether the time or the place of an event between the ends is to be found."""
        return any(e.t is None or e.on is not None for e in self.through)

    @property
    def original(self) -> Problem:
        """The problem as it was asked for, with nothing found yet."""
        return self.asked or self

    @property
    def surfaces(self) -> tuple[Event | None, Event | None]:
        """The events as they were asked for where they lie on surfaces; None where they do not."""
        asked = self if self.on_surface or self.asked is None else self.asked
        start, end = asked.start, asked.end
        return start if start.on is not None else None, end if end.on is not None else None

    def found_at(
        self, times: Sequence[float] | Array, q: Any = None, kappa: Array | None = None
    ) -> Problem:
        """Return the problem with times (k + 2,) at its events, one that was `asked` as this.

        Where these lie on surfaces, at coordinates q (k + 2, n), if given; `kappa` (c,) are the
        multipliers of integrals. Itself where all of that is given.

        Raises ValueError as a `Problem` does.
        """
        found = self.joints_found
        sought = q is not None and any(e.on is not None for e in found)
        if self.integral is None and not sought and all(e.t is not None for e in found):
            return self
        events = [e.at(float(t)) for e, t in zip(self.joints_found, times, strict=True)]
        if not (sought or self.through or self.system.m) and self.integral is None:
            return self._at_times(events[0], events[1])
        if q is not None:
            pairs = zip(events, q, strict=True)
            events = [
                e if e.on is None else e._replace(q=[*map(float, row)], on=None) for e, row in pairs
            ]
        given = self._given_parameters
        return _restore_asked(
            self.question,
            *(events[0], events[-1]),
            given if kappa is None else {**given, MULTIPLIERS: kappa},
            *(self.energy, tuple(events[1:-1]), self.integral, self),
        )

    def _at_times(self, start: Event, end: Event) -> Problem:
        """Return the problem with times at its ends, of which the rest is known to be good."""
        laws = {"system": self.system, "laws": self.laws, "plain": self.plain}
        given = {"parameters": self.parameters, "packed": self.packed, "energy": self.energy}
        given |= {"through": self.through, "integral": self.integral, "asked": self}
        problem = make_unchecked(Problem, start=start, end=end, **laws, **given)
        problem._check_times()
        return problem

    @property
    def is_joined(self) -> bool:
        """Whether times or places of events of a course are to be found, or multipliers."""
        if self.integral is not None and self.asked is None:
            return True
        outer = self.has_open_ends
        if not self.through:
            begins_on = self.advance is not None and self.start.on is not None
            return outer and (self.system.order > 1 or begins_on)
        return self.has_open_events or outer

    @property
    def is_course(self) -> bool:
        """Whether all of a path is looked at together: legs, multipliers, accelerations in L."""
        more = self.integral is not None or self.system.order > 1
        return bool(self.through) or more or self.original.is_joined

    @property
    def has_free_boundary(self) -> bool:
        """Whether more than the path is to be found, or was: a duration, where it begins."""
        found = self.asked is not None or self.has_open_ends or self.closes
        return found or self.is_joined

    @property
    def closes(self) -> bool:
        """Whether paths close that may start anywhere along themselves, as L has no clock.

        Events between the ends, a surface or a coordinate at the start tell where they begin; along
        an obstacle that coordinate is held.
        """
        if not self.may_be_shifted or self.system.structure.forced:
            return False
        begun = bool(self.through) or self.joints[0].on is not None
        return not (begun or (self.system.r and self.start.pinned))

    @property
    def may_be_shifted(self) -> bool:
        """Whether paths close and L has no clock: a path moved along itself closes as well."""
        return self.advance is not None and not self.system.structure.depends_on_time

    @property
    def has_moving_surface(self) -> bool:
        """Whether a surface on which the path begins or ends moves."""
        return any(e is not None and e.on.depends_on_time for e in self.surfaces)

    @property
    def phase_coordinates(self) -> tuple[int, ...]:
        """Coordinates at the start that say where a closed path begins along itself."""
        return self.start.pinned if self.closes else ()

    @cached_property
    def loose(self) -> Problem:
        """The problem with nothing given at the start, if its paths close anywhere."""
        if not self.phase_coordinates:
            return self
        start = Event(self.start.t, [None] * self.system.n)
        known = {"parameters": self._given_parameters, "energy": self.energy}
        end, integral = self.end.at(self.end.t), self.integral
        return Problem(self.question, start, end, integral=integral, **known)  # type: ignore[arg-type]

    @property
    def closed_places(self) -> tuple[int, ...]:
        """`order` for coordinates and for derivatives below that of L's order, (order n,)."""
        return tuple(k * self.system.n + i for k in range(self.system.order) for i in self.order)

    def closed_from(self, q: Array) -> Array:
        """Return what coordinates (n,) or (n, K) at the start of a path that closes are at its end.

        Of rates and momenta only the order changes: `p[list(problem.closed_places)]`.
        """
        assert self.advance is not None
        return q[list(self.order)] + self.advance.reshape(-1, *[1] * (q.ndim - 1))

    @property
    def is_infinite(self) -> bool:
        """Whether an event lies at infinite time: `solve` then works on a window."""
        return math.isinf(self.start.t or 0.0) or math.isinf(self.end.t or 0.0)

    @property
    def leads_to_rest(self) -> bool:
        """Whether an end lies at infinite time, or at the edge of a window that stands for one."""
        return self.is_infinite or self.has_tails

    @property
    def is_shifted(self) -> bool:
        """Whether each path may be shifted in time at will, and nothing chooses one of them."""
        timed = self.system.structure.depends_on_time or self.through
        return bool(self.start.side and self.end.side) and not timed and self.start.phase is None

    @property
    def whole(self) -> Problem:
        """The problem with its events at infinite times, where it has windows' edges."""
        if not self.has_tails:
            return self
        return self.replace(start=self.start.limit, end=self.end.limit)

    @cached_property
    def rests(self) -> tuple[Rest | None, Rest | None]:
        """The equilibria beyond either end, None where there is none.

        Raises ValueError if it is no equilibrium or no saddle, or the energies differ.
        """
        return self._rest(self.start), self._rest(self.end)

    def _rest(self, event: Event) -> Rest | None:
        if not event.side:
            return None
        from actionopt.mechanics.question.rest import rest

        near = np.array(event.near, dtype=float)
        return rest(self.system, self.packed, near, event.t, event.side)

    @cached_property
    def boundaries(self) -> tuple[Instant, ...]:
        """Where elements end: the `instants`, events, pulses, and where a phase is set."""
        more, pulses = [e.t for e in self.through], self.system.pulses
        if self.start.phase is not None:
            more.append(self.start.phase.t)
        if pulses is not None:
            from actionopt.mechanics.laws.pulses import centres

            more += centres(pulses, self.start.t, self.end.t, self.packed)
        if not more:
            return self.instants
        apart = 8 * EPS * max(abs(self.start.t), abs(self.end.t), self.duration)
        return tuple(merge([*self.instants, *((t, t) for t in more)], apart))

    @cached_property
    def instants(self) -> tuple[Instant, ...]:
        """The instants at which L, f or Q switch by the clock: a branch in t alone."""
        clock = self.system.clock
        if clock is None:
            return ()
        if self.laws and all(law.clock is None for law in self.laws):  # known without bisection
            times = self.parameters[SWITCHES]
            before, after = (np.nextafter(times, way).tolist() for way in (-np.inf, np.inf))
            return tuple(zip(before, after, strict=True))
        return instants(clock, self.start.t, self.end.t, self.packed)

    @cached_property
    def singular_ends(self) -> tuple[int, int]:
        """Where L is infinite at any velocity, at the start and the end: 1, or 2 with the inertia.

        0 where it is finite, see `mechanics.question.singular_ends`.
        """
        return singular_ends(self)

    @property
    def free(self) -> Problem:
        """The question itself, where contacts with an obstacle are known: see `Held`."""
        return self

    @property
    def touches(self) -> bool:
        """Whether contacts with an obstacle are known, and constraints."""
        return self.free is not self

    def in_force(self, boundaries: Array, offsets: NDInt) -> NDArray[np.bool_] | None:
        """Return which constraints are in force at the nodes of a mesh: None, all of them."""
        return None

    def active(self, t: Array) -> NDArray[np.bool_] | None:
        """Return which constraints are in force at times t (K,): None, all of them."""
        return None

    @property
    def name(self) -> str:
        """The system's name; "problem" if it has none."""
        return self.system.name or "problem"

    @property
    def duration(self) -> float:
        """Time between the events. Raises ValueError where it is to be found."""
        if self.free_time:
            raise ValueError(
                "expected a problem between given times, found one whose duration is to be found; "
                "solve it, and ask the solution's own problem"
            )
        return self.end.t - self.start.t

    @cached_property
    def scales(self) -> Array:
        """Size of each coordinate as far as the events tell, shape (n,): always positive.

        A coordinate that is zero or free at both events is given the size of the largest; so is
        one that may be rounding of another, small beside it in whatever they are measured.
        """
        return scales_of(self)

    @cached_property
    def lengths(self) -> Array:
        """Size of the motion in each coordinate as far as the events tell, (n,): the solver's unit.

        That of the coordinate, `scales`, unless the events lie close together and far from its
        zero. Then it is how far they are apart, or how far the forces on the straight line lead
        away from it if that is more, |a| T^2 / 8 or ten times the distance to rest: where zero is
        has nothing to do with it. Nor is one far smaller than others of equal kinetic energy only
        because the events lie that way.
        """
        return self._motion[0]

    @cached_property
    def measures(self) -> Array:
        """Powers of two near `lengths`, (n,), the same of all if they are alike.

        Units in which distances from an obstacle are measured.
        """
        powers = np.round(np.log2(self.lengths))
        return 2.0 ** (np.full(powers.shape, powers.max()) if np.ptp(powers) <= ALIKE else powers)

    @cached_property
    def origin(self) -> Array | None:
        """The point from which the solver measures coordinates, (n,); None for zero in all."""
        return self._motion[1]

    @cached_property
    def _motion(self) -> tuple[Array, Array | None]:
        return motion_of(self)


def _restore_asked(
    system: System | tuple[System, ...],
    start: Event,
    end: Event,
    parameters: dict[str, Array],
    energy: float | None,
    through: tuple[Event, ...] = (),
    integral: Any = None,
    asked: Problem | None = None,
) -> Problem:
    """Return the problem of these, one whose times and places were `asked` for, if that is given.

    Its energy goes with times that are given then.
    """
    question = {"system": system, "start": start, "end": end, "parameters": parameters}
    question |= {"through": through, "integral": integral, "energy": energy, "asked": asked}
    problem = make_unchecked(Problem, laws=(), plain=None, **question)
    problem.__post_init__()
    return problem


def _restore_found(asked: Problem, times: list[float], q: list[Any], kappa: Array) -> Problem:
    return asked.found_at(times, q, kappa if kappa.size else None)


def _time(event: Any) -> float:
    """Return the time of an event; NaN where it is to be found."""
    t = getattr(event, "t", None)
    return np.nan if t is None else t
