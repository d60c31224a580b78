"""Obstacles, f(q, t) >= 0: when a path is in contact with one, and events that lie outside of it.

Along a path of least action S - int nu f dt is stationary, nu >= 0 and nu f = 0: an obstacle
presses, and where it does not touch it does nothing. (Karush, Kuhn and Tucker's conditions; as the
equilibrium of a string with the potential energy S they say that the obstacle only pushes.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
        """Whether it is a moment only."""
        return self.begin == self.end


def check_rows(system: System) -> None:
    """Raise ValueError for a row of the obstacle that contains no coordinate."""
    rows, _ = system.with_contact.pointwise("constraint_jacobian").sparsity(0)
    count = np.bincount(rows, minlength=system.m + system.r)[system.m :]
    if not count.all():
        raise ValueError(
            "expected an obstacle whose rows each contain a coordinate, found that row "
            f"{np.argmin(count)} contains none; remove it, or correct it"
        )


def check_outside(
    system: System,
    packed: Array,
    ends: Sequence[tuple[str, float, Sequence[float | None]]],
    scales: Array,
    duration: float,
) -> None:
    """Raise ValueError if an event, (role, t, q), lies inside the obstacle.

    Rows that contain a coordinate which the event leaves free are decided along the path. The
    coordinates have the sizes `scales` (n,).
    """
    held, m = system.with_contact, system.m
    q = np.array([[0.0 if x is None else x for x in event] for _, _, event in ends])
    t = np.array([[time] for _, time, _ in ends])
    jacobian = held.pointwise("constraint_jacobian")
    rows, cols = jacobian.sparsity(0)
    G, f = jacobian(q, t, packed)
    sizes = np.abs(held.pointwise("constraint_rate")(q, t, packed)[0]) * duration
    for k, row in enumerate(np.abs(G)):
        np.add.at(sizes[k], rows, row * scales[cols])
    inside = ~(f >= -EVENT_TOLERANCE * np.maximum(sizes, np.finfo(float).tiny))
    for k, (role, time, event) in enumerate(ends):
        free = np.array([x is None for x in event])
        inside[k, rows[free[cols]]] = False
        for i in np.flatnonzero(inside[k, m:]):
            raise ValueError(
                f"expected the {role} event outside of the obstacle, f(q, t) >= 0, found row {i} "
                f"= {f[k, m + i]:.6g} at t = {time}, q = {tuple(event)}; move the event, or change "
                "the sign of the obstacle if its inside and outside are exchanged"
            )
