"""Obstacles, f(q, t) >= 0: when a path is in contact with one, and events that lie outside of it.

Along a path of least action S - int nu f dt is stationary, nu >= 0 and nu f = 0: an obstacle
presses, and where it does not touch it does nothing. (Karush, Kuhn and Tucker's conditions; as the
equilibrium of a string with the potential energy S they say that the obstacle only pushes.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from actionopt.mechanics.canonical import rate_of
from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.laws import keep
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.system import System
from actionopt.tools.types import Array

# How far, relative to the obstacle's own scale, an event may lie inside: as for the surface of a
# constraint.
EVENT_TOLERANCE = 1e-8


@dataclass(frozen=True)
class Arc:
    """A part of a path that is in contact with an obstacle.

    Attributes
    ----------
    row : int
        Index of the row of the obstacle.
    begin, end : float
        The times between which it is zero; both belong to the arc. They are one where the obstacle
        gives an impulse: at a free end, or where it has a kink in time.
    """

    row: int
    begin: float
    end: float

    @property
    def point(self) -> bool:
        """Whether contact lasts for a moment only."""
        return self.begin == self.end


@keep
def rates_of_rows(system: System) -> Pointwise:
    """Return the function of df/dt, its derivatives by (q, v) and by t, and of d2f/dt2.

    Those of the constraints (m,) of a Lagrangian with accelerations, of (q, v), a, t and p.
    """
    s = system.symbols
    rate = rate_of(system, system.f)
    outputs = rate, ca.jacobian(rate, s.q).T, ca.jacobian(rate, s.t), rate_of(system, rate)
    arguments = [s.q, s.v, s.t, s.p]
    return Pointwise(ca.Function("rates", arguments, [ca.densify(x) for x in outputs]))


def check_rows(system: System) -> None:
    """Raise ValueError for a row of the obstacle that contains no coordinate."""
    rows, _ = system.with_contact.pointwise("constraint_jacobian").sparsity(0)
    count = np.bincount(rows, minlength=system.m + system.r)[system.m :]
    if not count.all():
        raise ValueError(
            "expected an obstacle whose rows each contain a coordinate, found that row "
            f"{np.argmin(count)} contains none; remove it, or correct it"
        )


def put_on_obstacle(system: System, places: Array, t: float, packed: Array) -> Array:
    """Return q and v (2 n,) without their round-off off the rows, of a path that lies on all."""
    if not system.r:
        return places
    held, n, found = system.with_contact, system.n, places.copy()
    jacobian, time = held.pointwise("constraint_jacobian"), np.array([[t]])
    G, f = (x.copy() for x in jacobian(found[None, :n], time, packed))
    inverse = np.linalg.pinv(jacobian.full(0, G)[0])
    found[:n] -= inverse @ f[0]
    found[n:] -= inverse @ rates_of_rows(held)(found[None], np.zeros((1, n)), time, packed)[0][0]
    return found


def check_rates_outside(
    system: System, packed: Array, events: Sequence[Event], scales: Array, duration: float | None
) -> None:
    """Raise ValueError where velocities that are given lead into the obstacle from events on it.

    And where none is given at an event on it that is passed: the path touches it there. The
    duration is None if it is to be found; what moves is then decided along the path.
    """
    held, n = system.with_contact, system.n
    function, jacobian = rates_of_rows(held), held.pointwise("constraint_jacobian")
    for k, event in enumerate(events):
        places, t = event.places(2), np.array([[event.t or 0.0]])
        moves = event.t is None and held.structure.depends_on_time
        if None in places[:n] or moves:
            continue
        q = np.array([places[:n]], dtype=float)
        G, f = (x.copy() for x in jacobian(q, t, packed))
        sizes = np.abs(jacobian.full(0, G)[0]) @ scales
        on = f[0] <= EVENT_TOLERANCE * sizes
        if not on.any():
            continue
        inner, first = 0 < k < len(events) - 1, k == 0
        if None in places:
            if inner:
                raise ValueError(
                    f"expected the velocity at event {k - 1} of through, which lies on the "
                    f"obstacle, found none at t = {event.t}, q = {event.q}: a path touches the "
                    "obstacle there; give v=, along the obstacle"
                )
            continue
        rate = function(np.array([places], dtype=float), np.zeros((1, n)), t, packed)[0][0]
        least = EVENT_TOLERANCE * np.abs(jacobian.full(0, G)[0] @ places[n:])
        if duration is not None:
            least = EVENT_TOLERANCE * sizes / duration + least
        wrong = on & (np.abs(rate) > least if inner else (rate if first else -rate) < -least)
        if wrong.any():
            raise ValueError(
                f"expected a velocity that does not lead into the obstacle, found v = "
                f"{event.rates[0]} at t = {event.t}, q = {event.q}, which lies on row "
                f"{np.argmax(wrong)} of it; give one along the obstacle, or away from it"
            )


def check_outside(
    system: System, packed: Array, events: Sequence[Event], asked: Sequence[Event], scales: Array
) -> None:
    """Raise ValueError if an event lies inside the obstacle, or on it at an infinite time.

    Rows that contain a coordinate which the event leaves free, or the time where that was `asked`
    for, are decided along the path. The coordinates have the sizes `scales` (n,).
    """
    held, m = system.with_contact, system.m
    q = np.array([[0.0 if x is None else x for x in event.q] for event in events])
    t = np.array([[event.t or 0.0] for event in events])
    duration = max((abs(b - a) for a, b in pairwise(t[:, 0]) if np.isfinite(b - a)), default=0.0)
    jacobian = held.pointwise("constraint_jacobian")
    rows, cols = jacobian.sparsity(0)
    G, f = jacobian(q, t, packed)
    rate = held.pointwise("constraint_rate")(q, t, packed)[0]
    sizes = np.where(np.isfinite(t), np.abs(rate), 0.0) * duration
    for k, row in enumerate(np.abs(G)):
        np.add.at(sizes[k], rows, row * scales[cols])
    sizes = EVENT_TOLERANCE * np.maximum(sizes, np.finfo(float).tiny)
    inside = ~(f >= np.where(np.isfinite(t), -sizes, sizes))
    moving, _ = ca.jacobian_sparsity(held.f, held.symbols.t).get_triplet()
    for k, (event, open_) in enumerate(zip(events, asked, strict=True)):
        free = np.array([x is None for x in event.q])
        inside[k, rows[free[cols]]] = False
        if open_.t is None:
            inside[k, moving] = False
        for i in np.flatnonzero(inside[k, m:]):
            role = f"event {k - 1} of through"
            if k in (0, len(events) - 1):
                role = "the end event" if k else "the start event"
            place = "" if event.t is None else f"t = {event.t}, "
            found = f"found row {i} = {f[k, m + i]:.6g} at {place}q = {event.q}"
            if not np.isfinite(event.t or 0.0):
                raise ValueError(
                    f"expected {role} outside of the obstacle, f(q, t) > 0, {found}: what "
                    "rests in contact is held there by a force, and comes to it in a finite time; "
                    "give the time"
                )
            raise ValueError(
                f"expected {role} outside of the obstacle, f(q, t) >= 0, {found}; move "
                "the event, or change the sign of the obstacle if its inside and outside are "
                "exchanged"
            )
