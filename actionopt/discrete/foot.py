"""Where a path begins or ends on a surface, on(q, t) = 0: what stands beside its equations.

The multipliers mu of S + mu.on balance the momentum there. With holonomic constraints f the moves
along both are left, and p1 = -mu on_q - nu f_q: the end's own part nu of the constraint's
multiplier is a force that acts for no time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from actionopt.discrete.discrete_path import DiscretePath
from actionopt.mechanics.events import Event
from actionopt.mechanics.problem import Problem
from actionopt.tools.types import Array, NDInt

# Of Newton's method to a surface; ad hoc.
LONGEST_WAY = 60  # steps
FARTHEST = 10.0  # the first step, in the coordinates' sizes; each next one twice as far
REACHED = 1e-9  # the last step: the next would be its square


class Foot(NamedTuple):
    """An end of a path on a surface.

    Attributes
    ----------
    end : int
        0 at the start, 1 at the end.
    free : (k,) array of int
        Coordinates that the event does not give.
    places : (k,) array of int
        Theirs among the unknowns.
    units : (s,) array
        Of the rows: what they change by as the coordinates change by their lengths.
    """

    end: int
    free: NDInt
    places: NDInt
    units: Array

    def rows(self, at: DiscretePath) -> tuple[Array, Array, Array]:
        """Return on (s,) and its derivatives by x (s, k) and by t (s,), in units of the rows."""
        on, by_q, by_t, _ = surface_at(at, self.end)
        scaled = by_q[:, self.free] * at.tr.lengths[self.free] / self.units[:, None]
        return on / self.units, scaled, by_t / self.units

    def curvature(self, at: DiscretePath, mu: Array) -> Array:
        """Return the second derivatives of mu.on by x, (k, k)."""
        event, t = _there(at, self.end)
        found = event.on.curvature(at.Q[-self.end], t, at.problem.packed, mu / self.units)
        lengths = at.tr.lengths[self.free]
        return found[np.ix_(self.free, self.free)] * lengths[:, None] * lengths


def feet(at: DiscretePath) -> tuple[Foot, ...]:
    """Return the ends of a path that lie on surfaces, and are free to move."""
    found = []
    for k, event in enumerate(at.problem.surfaces):
        if event is not None:
            free = np.array([i for i, x in enumerate(event.q) if x is None])
            by_q = surface_at(at, k)[1]
            sizes = np.abs(by_q[:, free] * at.tr.lengths[free]).max(axis=1)
            units = np.where(np.isfinite(sizes) & (sizes > 0), sizes, 1.0)
            found.append(Foot(k, free, at.tr.layout.number[-k, free], units))
    return tuple(found)


def surface_at(at: DiscretePath, k: int) -> tuple[Array, Array, Array, Array]:
    """Return on at the start (k = 0) or the end (1) of a path, and its derivatives: `Surface`."""
    event, t = _there(at, k)
    return event.on.at(at.Q[-k], t, at.problem.packed)


def reactions(at: DiscretePath, k: int) -> tuple[Array, Array]:
    """Return the multipliers mu (s,) of on and nu (m,) of f that balance the momentum at an end.

    Those of least squares where the path is not stationary.
    """
    problem, system = at.problem, at.problem.system
    event, t = _there(at, k)
    free = [i for i, x in enumerate(event.q) if x is None]
    rows = surface_at(at, k)[1]
    if system.m:
        G = system.constraint_jacobian(at.Q[-k], t, parameters=problem.parameters)
        rows = np.concatenate([rows, G])
    p0, p1 = at.tr.momenta(at.z)
    pull = (p1 if k else -p0)[free] * at.tr.lengths[free]
    normals = (rows[:, free] * at.tr.lengths[free]).T
    if not (np.isfinite(normals).all() and np.isfinite(pull).all()):
        return np.zeros(len(rows) - system.m), np.zeros(system.m)
    found = -np.linalg.lstsq(normals, pull, rcond=None)[0]
    return found[: found.size - system.m], found[found.size - system.m :]


def _there(at: DiscretePath, k: int) -> tuple[Event, float]:
    """Return the event that was asked for, and the time there."""
    event = at.problem.surfaces[k]
    assert event is not None
    return event, float(at.mesh.boundaries[-k])


def onto(problem: Problem, event: Event, q: Array, t: float, size: Array) -> Array | None:
    """Return a point of the event's surface, and of the constraints, near q (n,); None if none is.

    By Newton's method, with steps of least length in units of `size` (n,).
    """
    system, given = problem.system, list(event.pinned)
    q = q.copy()
    q[given] = [event.q[i] for i in given]
    free = np.setdiff1d(np.arange(system.n), given)
    for k in range(LONGEST_WAY):
        rows, by_q, _, _ = event.on.at(q, t, problem.packed)
        if system.m:
            f = system.constraint(q, t, parameters=problem.parameters)
            G = system.constraint_jacobian(q, t, parameters=problem.parameters)
            rows, by_q = np.concatenate([rows, f]), np.concatenate([by_q, G])
        by_q = by_q[:, free] * size[free]
        if not (np.isfinite(rows).all() and np.isfinite(by_q).all() and by_q.any(axis=1).all()):
            return None
        step = -np.linalg.pinv(by_q) @ rows
        largest = np.abs(step).max()
        farthest = FARTHEST * 2.0**k
        q[free] += step * (farthest / largest if largest > farthest else 1.0) * size[free]
        if largest < REACHED:
            return q
    return None
