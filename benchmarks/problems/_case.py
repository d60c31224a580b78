"""What a benchmark problem is: the question in the words of every peer, and its answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.arithmetic import NUMPY

SAMPLES = 201  # uniform times at which the error is measured


@dataclass(frozen=True, eq=False)
class Ends:
    """One pair of end points and the exact path between them.

    Attributes
    ----------
    start, end : (n,) arrays
        Coordinates at the times 0 and `Case.duration`.
    exact : (n, K) array
        The path at `Case.times`.
    others : (P, n, K) array
        Other stationary paths between the same end points, as far as they are known.
    duration : float, optional
        The exact one, where it is to be found; `exact` is then at the same parts of it.
    """

    start: np.ndarray
    end: np.ndarray
    exact: np.ndarray
    others: np.ndarray | tuple = ()
    duration: float | None = None


@dataclass(frozen=True, eq=False)
class Case:
    """A problem, as actionopt is told it and as its peers are.

    Attributes
    ----------
    name, title : str
    lagrangian, coordinates, parameters, constraint
        What `actionopt.System` takes.
    acceleration : callable
        `acceleration(q, v, t, x)` in the arithmetic x, q and v of shape (n, ...): the equations
        of motion derived by hand. With constraints, those of the index-1 form.
    partials : callable
        `partials(q, v, t)` for q and v (n, K): its derivatives in q and v, each (n, n, K).
    duration : float
    ends : callable
        Returns the two `Ends`: the first and, for solving again, the other.
    normals : callable, optional
        `normals(q)` for q (n,): the constraints' derivatives, (m, n).
    layer : float
        Width of a layer at either end in which the error is sampled too; 0 for none.
    time_unit : float
        What the peers may scale velocities with.
    starts : sequence of str
        First guesses in the order tried: "line", the straight line, which is no guess to those
        who can do without; "straight", the same line as a guess; "bent", a polyline through
        five points of the exact path that are rounded to a tenth of the largest |q|.
    size : str
        "small" or "large": peers that need minutes on large problems leave them out.
    asks : str
        "ends": of given times. "energy": how long it takes is to be found. "orbit": closed, and
        so is that; `start` says where it begins. "infinity": from rest at `start` to rest at `end`,
        half way at half of `duration`, which is the window in which the error is measured.
    energy : float, optional
        Given where the duration is not: `duration` is then known to one digit.
    length : callable, optional
        What `System.geodesic` takes; `lagrangian` is half its square.
    """

    name: str
    title: str
    lagrangian: Callable[..., Any]
    coordinates: Sequence[str]
    parameters: Mapping[str, Any]
    acceleration: Callable[..., Any]
    partials: Callable[..., Any]
    duration: float
    ends: Callable[[], tuple[Ends, Ends]]
    constraint: Callable[..., Any] | None = None
    normals: Callable[[np.ndarray], np.ndarray] | None = None
    layer: float = 0.0
    time_unit: float = 1.0
    starts: Sequence[str] = ("line", "bent")
    size: str = field(default="small")
    asks: str = "ends"
    energy: float | None = None
    length: Callable[..., Any] | None = None

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def times(self) -> np.ndarray:
        """Times at which the error is measured, (K,)."""
        return sample_times(self.duration, self.layer)

    def guess(self, ends: Ends, start: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the waypoints of a first guess: times (P,) and coordinates (n, P)."""
        if start != "bent":
            return np.array([0.0, self.duration]), np.stack([ends.start, ends.end], axis=1)
        times = np.linspace(0.0, self.duration, 5)
        at = [int(np.argmin(np.abs(self.times - t))) for t in times]
        scale = np.max(np.abs(ends.exact)) / 10
        points = np.round(ends.exact[:, at] / scale) * scale
        points[:, 0], points[:, -1] = ends.start, ends.end
        return times, points

    def rhs(self, t: np.ndarray | float, y: np.ndarray) -> np.ndarray:
        """Return d(q, v)/dt for y = (q, v) of shape (2 n, K) or (2 n,)."""
        q, v = y[: self.n], y[self.n :]
        return np.concatenate([v, self.acceleration(q, v, t, NUMPY)])

    def jacobian(self, t: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the derivative of `rhs`, (2 n, 2 n, K), for y (2 n, K)."""
        n = self.n
        J = np.zeros((2 * n, 2 * n, y.shape[1]))
        J[np.arange(n), n + np.arange(n)] = 1.0
        J[n:, :n], J[n:, n:] = self.partials(y[:n], y[n:], t)
        return J

    def error(
        self,
        curve: Callable[[np.ndarray], np.ndarray],
        ends: Ends,
        duration: float | None = None,
    ) -> float:
        """Return max |q - exact| over `times`, relative to the largest |exact|.

        If another stationary path is nearer, the error is the distance to that one. A duration that
        was found adds its relative error; q is compared at equal parts of it.
        """
        part, off = 1.0, 0.0
        if ends.duration is not None and duration is not None:
            part, off = duration / self.duration, abs(duration / ends.duration - 1)
        q = np.asarray(curve(part * self.times))
        return off + min(
            float(np.max(np.abs(q - path)) / np.max(np.abs(path)))
            for path in (ends.exact, *ends.others)
        )


def sample_times(duration: float, layer: float = 0.0) -> np.ndarray:
    """Return 201 uniform times and, if there is a layer, 100 more within it at either end."""
    times = np.linspace(0.0, duration, SAMPLES)
    if layer:
        within = np.linspace(0.0, layer, 100)
        times = np.unique(np.concatenate([times, within, duration - within]))
    return times


def along(exact: Callable[[np.ndarray], np.ndarray] | None, times: np.ndarray) -> Ends:
    """Return the ends of a path known in closed form."""
    assert exact is not None
    q = np.asarray(exact(times))
    return Ends(q[:, 0].copy(), q[:, -1].copy(), q)


def no_partials(q: np.ndarray) -> np.ndarray:
    """Return the derivative of what does not depend on q (n, K): zeros (n, n, K)."""
    return np.zeros((q.shape[0], *q.shape))
