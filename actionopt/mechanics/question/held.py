"""The question of a path whose contacts with an obstacle are known: they are constraints then."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from actionopt.mechanics.laws.evaluation import solve_motion
from actionopt.mechanics.question.obstacle import Arc
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.cached import cached_property
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array, NDInt

if TYPE_CHECKING:
    from actionopt.mechanics.question.rest import Rest


@immutable
class Held(Problem):
    """A problem with an obstacle, rows of which are constraints while they are in contact.

    Parameters
    ----------
    free : Problem
        The question itself.
    arcs : sequence of Arc, optional
        When each row is in force, times that are boundaries of elements; always if None.
    sought : bool
        Whether the obstacle's rows are those that tell the distance, to first order: `sought` of
        the system. They are zero where its own are.
    span : (float, ...), optional
        The times of all events for which those of the arcs are; the question's own, if it has them.
    """

    _free: Problem
    arcs: tuple[Arc, ...] | None
    sought: bool
    span: tuple[float, ...]

    def __init__(
        self,
        free: Problem,
        arcs: tuple[Arc, ...] | None = None,
        *,
        sought: bool = False,
        span: tuple[float, ...] | None = None,
    ) -> None:
        for name in ("start", "end", "parameters", "packed", "energy", "through", "integral"):
            object.__setattr__(self, name, getattr(free, name))
        system, span = free.system.with_contact, span or tuple(e.t for e in free.joints_found)
        if sought:
            system = free.system.with_contact_distance(tuple(free.measures.tolist()))
        told = sought and not (free.asked and free.asked.has_open_ends)
        asked = free.asked and Held(free.asked, arcs, sought=told, span=span)
        known = {"system": system, "_free": free, "arcs": arcs, "sought": sought, "span": span}
        for name, value in (known | {"asked": asked}).items():
            object.__setattr__(self, name, value)

    @property
    def free(self) -> Problem:
        """The question itself, whatever is in contact."""
        return self._free

    def found_at(
        self, times: Sequence[float] | Array, q: Any = None, kappa: Array | None = None
    ) -> Held:
        """Return the question at other times of events, its arcs at the same fractions of legs."""
        before, now, arcs = np.array(self.span), np.asarray(times, dtype=float), self.arcs

        def later(t: float) -> float:
            if t in self.span:
                return float(now[self.span.index(t)])
            k = int(np.searchsorted(before, t)) - 1
            return float(now[k] + (t - before[k]) * (np.diff(now) / np.diff(before))[k])

        if arcs is not None and (before != now).any():
            arcs = tuple(Arc(x.row, later(x.begin), later(x.end)) for x in arcs)
        return Held(self.free.found_at(times, q, kappa), arcs, sought=self.sought)

    def holding(self, arcs: tuple[Arc, ...]) -> Held:
        """Return the question with other parts in contact."""
        other = Held(self.free, arcs, sought=self.sought)
        object.__setattr__(other, "instants", self.instants)  # they are found but once
        return other

    @property
    def closes(self) -> bool:
        """Whether paths close that may start anywhere, as those of the question do."""
        return self.free.closes

    @property
    def is_course(self) -> bool:
        """Always true: what is in contact is held there on the mesh of the path."""
        return True

    @property
    def scales(self) -> Array:
        """Sizes of the coordinates, (n,): those of the question."""
        return self.free.scales

    @property
    def measures(self) -> Array:
        """Units in which distances from an obstacle are measured: those of the question."""
        return self.free.measures

    @property
    def _motion(self) -> tuple[Array, Array | None]:
        return self.free._motion  # which does not depend on constraints

    @cached_property
    def rests(self) -> tuple[Rest | None, Rest | None]:
        """The equilibria beyond either end: those of the question."""
        return self.free.rests

    @cached_property
    def fixed_times(self) -> Array:
        """The times of the events, and those between at which a law switches, in order."""
        t0, t1 = self.start.t, self.end.t
        found = np.array([t0, *(t for _, t in self.instants if t0 < t < t1), t1])
        return np.union1d(found, [e.t for e in self.through]) if self.through else found

    @cached_property
    def knots(self) -> Array:
        """The times that stay where they are as those of contact move, in order."""
        t0, t1 = self.start.t, self.end.t
        return np.array([t0, *(t for _, t in self.boundaries if t0 < t < t1), t1])

    @cached_property
    def contact_times(self) -> Array:
        """The times at which contact begins or ends but for the `fixed_times` ones, in order."""
        times = {t for arc in self.arcs or () for t in (arc.begin, arc.end)}
        return np.array(sorted(times - set(self.fixed_times.tolist())))

    @cached_property
    def divisions(self) -> Array:
        """The `knots` and the `contact_times` together, in order."""
        return np.array(sorted({*self.knots.tolist(), *self.contact_times.tolist()}))

    def __reduce__(self) -> tuple:
        """Return how to make it anew from the question."""
        return partial(Held, sought=self.sought, span=self.span), (self.free, self.arcs)

    def in_force(self, boundaries: Array, offsets: NDInt) -> NDArray[np.bool_] | None:
        """Return which rows are in force at the nodes of a mesh, (K, m + r); None for all.

        The mesh is given by the boundaries of its elements and the nodes there, both (N + 1,).
        Where L contains accelerations (K, 2 (m + r)): those of df/dt stand behind. They are in
        force where f is zero on both sides, and at events: where contact begins and ends df/dt = 0
        tells that time.
        """
        if self.arcs is None:
            return None
        if self.system.order > 1:
            return self._in_force(boundaries, offsets)
        m, middle = self.free.system.m, (boundaries[:-1] + boundaries[1:]) / 2
        found = np.zeros((offsets[-1] + 1, self.system.m), dtype=bool)
        found[:, :m] = True
        for arc in self.arcs:
            inside = ((arc.begin < middle) & (middle < arc.end)).nonzero()[0]
            if inside.size:
                found[offsets[inside[0]] : offsets[inside[-1] + 1] + 1, m + arc.row] = True
            elif arc.point:
                b = int(np.argmin(np.abs(boundaries - arc.begin)))
                found[offsets[b], m + arc.row] = True
        return found

    def _in_force(self, boundaries: Array, offsets: NDInt) -> NDArray[np.bool_]:
        """Return what `in_force` does where L contains accelerations: nothing but the obstacle."""
        r, middle = self.system.m, (boundaries[:-1] + boundaries[1:]) / 2
        found = np.zeros((offsets[-1] + 1, 2 * r), dtype=bool)
        for arc in self.arcs or ():
            inside = np.flatnonzero((arc.begin < middle) & (middle < arc.end))
            if inside.size:
                first, last = inside[0], inside[-1] + 1
                found[offsets[first] : offsets[last] + 1, arc.row] = True
                first += arc.begin not in self.fixed_times
                last -= arc.end not in self.fixed_times
                found[offsets[first : last + 1], r + arc.row] = True
            elif arc.point:
                b = int(np.argmin(np.abs(boundaries - arc.begin)))
                found[offsets[b], arc.row] = True
        return found

    def acceleration(self, q: Array, v: Array, t: Array, *, parameters=None) -> Array:
        """Return the accelerations of motions held where contact is, (n, K) or (n,)."""
        return self._dynamics(q, v, t, parameters)[0]

    def multipliers(self, q: Array, v: Array, t: Array, *, parameters=None) -> Array:
        """Return the multipliers of the constraints, (m, K) or (m,)."""
        return self._dynamics(q, v, t, parameters)[1][: self.free.system.m]

    def constraint_force(self, q: Array, v: Array, t: Array, *, parameters=None) -> Array:
        """Return the generalized forces of constraint, (n, K) or (n,): no contact forces."""
        G = self.free.system.constraint_jacobian(q, t, parameters=parameters)
        lam = self.multipliers(q, v, t, parameters=parameters)
        return np.einsum("mn...,m...->n...", G, lam)

    def contact_force(self, q: Array, v: Array, t: Array, *, parameters=None) -> Array:
        """Return what the obstacle's rows push with, (r, K) or (r,)."""
        return 0.0 - self._dynamics(q, v, t, parameters)[1][self.free.system.m :]

    def row_multipliers(self, q: Array, v: Array, t: Array) -> Array:
        """Return the multipliers of the constraints and of the obstacle's rows, (m + r, K).

        At q and v (K, n) and t (K,), which are not checked.
        """
        M, bias, G, gamma = self.system.pointwise("motion")(q, v, t[:, None], self.packed)
        return solve_motion(M, bias, G, gamma, self.active(t).T)[:, q.shape[1] :].T

    def rows(self, q: Array, t: Array) -> Array:
        """Return the obstacle's rows (r, K) at q (K, n) and t (K,)."""
        f = self.system.pointwise("constraint")(q, t[:, None], self.packed)[0]
        return f[:, self.free.system.m :].T.copy()

    def _dynamics(self, q: Array, v: Array, t: Array, parameters: Any) -> tuple[Array, Array]:
        return self.system.dynamics(q, v, t, parameters, self.active(np.atleast_1d(t)))

    def active(self, t: Array) -> NDArray[np.bool_]:
        """Return which rows are in force at times t (K,), (m + r, K).

        Both ends of an arc belong to it. A moment of contact has an impulse, and no force.
        """
        found = np.ones((self.system.m, t.size), dtype=bool)
        if self.arcs is not None:
            found[self.free.system.m :] = False
            for arc in self.arcs:
                found[self.free.system.m + arc.row] |= (
                    (arc.begin <= t) & (t <= arc.end) & (not arc.point)
                )
        return found


def contacts_of(problem: Problem) -> Held:
    """Return a problem whose contacts are known as what it is, for what asks it for these."""
    assert isinstance(problem, Held)
    return problem


def arcs_of(on: NDArray[np.bool_], boundaries: Array, offsets: NDInt) -> tuple[Arc, ...]:
    """Return the parts in contact, in order of time, from where rows are in force, (r, K).

    The inverse of `Held.in_force`; pinned events, which have no rows, are told by the elements.
    """
    found = []
    for i, row in enumerate(on):
        inside = [bool(row[a + 1 : b].all()) and b > a + 1 for a, b in pairwise(offsets.tolist())]
        change = np.flatnonzero(np.diff([False, *inside, False]))
        times = boundaries[change].reshape(-1, 2).tolist()
        beside = np.array([False, *inside]) | np.array([*inside, False])
        times += [[t, t] for t in boundaries[row[offsets] & ~beside].tolist()]
        found += [Arc(i, begin, end) for begin, end in times]
    return tuple(sorted(found, key=lambda arc: (arc.begin, arc.row)))
