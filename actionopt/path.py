"""Curves in configuration space: a mesh in time and a polynomial on each of its elements.

Neighbouring elements share their boundary node, so a path is continuous by construction; its
velocity is continuous only as far as the path is resolved. Guess, solution and forward reference
are all paths.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from actionopt.quadrature import Array, lgl

NDInt = np.ndarray
MAX_DEGREE = 64
ROUNDOFF = 16 * np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class Mesh:
    """How to discretize time: element boundaries and the polynomial degree of each element.

    Parameters
    ----------
    boundaries : (N + 1,) array
        Strictly increasing times; the ends are the times of the two events.
    degrees : int or (N,) array of int
        Polynomial degree of each element, from 1 to 64; one integer serves all.

    Attributes
    ----------
    since : (N + 1,) array
        The boundaries measured from the first of them. Far from zero, where times are rounded
        coarsely, an element may be shorter than `boundaries` can tell.

    Raises
    ------
    ValueError
        If the boundaries do not increase or are not finite, or a degree is out of range.

    Examples
    --------
    >>> mesh = Mesh.uniform(0.0, 1.0, elements=4, degree=6)
    >>> mesh.elements, mesh.nodes.size
    (4, 25)
    """

    boundaries: Array
    degrees: tuple[int, ...]
    since: Array

    def __init__(self, boundaries: ArrayLike, degrees: int | ArrayLike) -> None:
        times = np.array(boundaries, dtype=float)
        since = times - times[0] if times.ndim == 1 and times.size else times
        if times.ndim == 1 and np.all(np.diff(times) > 0):
            # Nearer to zero than the first, times may be told apart that are not from there.
            for k in np.flatnonzero(np.diff(since) <= 0):
                since[k + 1] = np.nextafter(since[k], np.inf)
        self._set(times, since, degrees)

    def _set(self, boundaries: Array, since: Array, degrees: int | ArrayLike) -> None:
        if since.ndim != 1 or since.size < 2 or not np.isfinite(since).all():
            raise ValueError(
                "expected at least two finite element boundaries in one row, "
                f"found an array of shape {since.shape}; give the N + 1 times of N elements"
            )
        if not (since[1:] > since[:-1]).all():
            raise ValueError("expected element boundaries that increase strictly; sort them")
        for name, row in (("boundaries", boundaries), ("since", since)):
            row.setflags(write=False)
            object.__setattr__(self, name, row)
        object.__setattr__(self, "degrees", _degrees(degrees, since.size - 1))

    def __repr__(self) -> str:
        """Show the sizes, not the arrays."""
        low, high = min(self.degrees), max(self.degrees)
        degrees = f"degree {low}" if low == high else f"degrees {low} to {high}"
        first, *_, last = self.boundaries.tolist()
        return f"Mesh(elements {self.elements}, {degrees}, from t = {first:g} to {last:g})"

    @classmethod
    def uniform(cls, start: float, end: float, elements: int, degree: int) -> Mesh:
        """Return `elements` equal elements of one degree over the times [start, end]."""
        duration = end - start
        since = np.arange(elements + 1) * (duration / elements)
        since[-1] = duration
        return cls.over(start, end, since, degree)

    @classmethod
    def over(cls, start: float, end: float, since: Array, degrees: int | ArrayLike) -> Mesh:
        """Return a mesh over [start, end] whose boundaries (N + 1,) are measured from `start`.

        They begin with 0 and end with the duration. Raises ValueError as the class does.
        """
        mesh = object.__new__(cls)
        boundaries = start + since
        boundaries[-1] = end
        mesh._set(boundaries, np.array(since), degrees)
        return mesh

    def cut(self, since: Array, degrees: int | ArrayLike) -> Mesh:
        """Return other elements over the same times; `since` as for `over`."""
        return Mesh.over(self.boundaries[0], self.boundaries[-1], since, degrees)

    @property
    def elements(self) -> int:
        """Number of elements N."""
        return len(self.degrees)

    @cached_property
    def lengths(self) -> Array:
        """Element lengths h, shape (N,)."""
        return self.since[1:] - self.since[:-1]

    @property
    def duration(self) -> float:
        """Time from the first boundary to the last."""
        return float(self.since[-1])

    @cached_property
    def offsets(self) -> NDInt:
        """Index of each element's first node, and of the last node: shape (N + 1,)."""
        return np.concatenate([[0], np.cumsum(self.degrees)])

    @cached_property
    def nodes(self) -> Array:
        """All nodes in time order, shared ones once, shape (sum of degrees + 1,)."""
        times = self.boundaries[0] + self.nodes_since
        times[self.offsets] = self.boundaries
        return times

    @cached_property
    def nodes_since(self) -> Array:
        """The nodes measured from the first of them, as `since`."""
        times = np.empty(self.offsets[-1] + 1)
        for rule, which, index in self.groups:
            mid = (self.since[which] + self.since[which + 1])[:, None] / 2
            times[index] = mid + self.lengths[which][:, None] / 2 * rule.nodes
        times[self.offsets] = self.since
        return times

    @cached_property
    def groups(self):
        """Elements of equal degree together: list of (rule, elements (E,), nodes (E, d + 1))."""
        degrees = np.array(self.degrees)
        result = []
        for d in sorted(set(self.degrees)):
            which = np.flatnonzero(degrees == d)
            result.append((lgl(d), which, self.offsets[which][:, None] + np.arange(d + 1)))
        return result

    def moved(self, start: float, end: float) -> Mesh:
        """Return the same mesh stretched affinely onto the times [start, end]."""
        b = self.boundaries
        if b[0] == start and b[-1] == end:
            return self
        duration = end - start
        since = self.since * (duration / self.duration)
        since[-1] = duration
        return Mesh.over(start, end, since, self.degrees)


def _degrees(degrees: int | ArrayLike, count: int) -> tuple[int, ...]:
    """Return one degree for each of `count` elements. Raises ValueError where there are none."""
    if type(degrees) is int and 1 <= degrees <= MAX_DEGREE:
        return (degrees,) * count
    given = np.asarray(degrees)
    if given.ndim > 1 or (given.ndim == 1 and given.size != count):
        raise ValueError(
            f"expected one degree or one for each of the {count} elements, "
            f"found an array of shape {given.shape}"
        )
    if given.dtype.kind not in "iu" or given.min() < 1 or given.max() > MAX_DEGREE:
        raise ValueError(
            f"expected integer degrees from 1 to {MAX_DEGREE}, found {degrees!r}; "
            "use more elements instead of a higher degree"
        )
    return tuple(np.broadcast_to(given, (count,)).tolist())


@dataclass(frozen=True, eq=False)
class Path:
    """A continuous piecewise-polynomial curve q(t).

    Parameters
    ----------
    mesh : Mesh
        Elements and degrees.
    values : (n, K) array
        Coordinates at the K nodes of the mesh (`mesh.nodes`).
    velocities : (n, K) array, optional
        Velocities known at the nodes (a forward integration has them); without them the
        velocity is the derivative of the polynomial, one order less accurate.

    Raises
    ------
    ValueError
        If the shapes do not fit the mesh or a value is not finite.
    """

    mesh: Mesh
    values: Array
    velocities: Array | None = None

    def __post_init__(self) -> None:
        count = self.mesh.offsets[-1] + 1
        for name in ("values", "velocities"):
            given = getattr(self, name)
            if given is None:
                continue
            table = np.array(given, dtype=float, ndmin=2)
            if table.ndim != 2 or table.shape[1] != count:
                raise ValueError(
                    f"expected {name} of shape (n, {count}), one column a node, found {table.shape}"
                )
            if not np.all(np.isfinite(table)):
                raise ValueError(f"expected finite {name}, found NaN or infinity")
            table.setflags(write=False)
            object.__setattr__(self, name, table)

    def __repr__(self) -> str:
        """Show the sizes, not the arrays."""
        return f"Path({self.values.shape[0]} x {self.values.shape[1]} values on {self.mesh})"

    @classmethod
    def interpolate(cls, curve: Callable[[Array], ArrayLike], mesh: Mesh) -> Path:
        """Return the path through `curve(mesh.nodes)`, where `curve` maps (K,) times to (n, K).

        A curve of one coordinate may return (K,). Raises ValueError for any other shape.
        """
        values = np.asarray(curve(mesh.nodes), dtype=float)
        return cls(mesh, values[None, :] if values.ndim == 1 else values)

    def __call__(self, t: ArrayLike) -> Array:
        """Return q(t): shape (n, K) for K times, (n,) for one time.

        Raises ValueError for a time outside the mesh.
        """
        return self._evaluate(self.values, 0, t)

    def velocity(self, t: ArrayLike) -> Array:
        """Return v(t) = dq/dt: shape (n, K) for K times, (n,) for one time."""
        if self.velocities is not None:
            return self._evaluate(self.velocities, 0, t)
        return self._evaluate(self.values, 1, t)

    def acceleration(self, t: ArrayLike) -> Array:
        """Return dv/dt, the derivative of `velocity`: shape (n, K) or (n,)."""
        if self.velocities is not None:
            return self._evaluate(self.velocities, 1, t)
        return self._evaluate(self.values, 2, t)

    def on(self, mesh: Mesh) -> Path:
        """Return this curve interpolated on another mesh over the same times."""
        return Path(mesh, self._since(self.values, 0, mesh.nodes_since))

    def legendre(self) -> list[Array]:
        """Return each element's Legendre coefficients, shape (n, d + 1), in element order."""
        result: list[Array] = [np.empty(0)] * self.mesh.elements
        for rule, which, index in self.mesh.groups:
            block = self.values[:, index] @ rule.to_legendre.T
            for k, e in enumerate(which):
                result[e] = block[:, k]
        return result

    def _evaluate(self, table: Array, derivatives: int, t: ArrayLike) -> Array:
        times = np.asarray(t, dtype=float)
        flat = times.reshape(-1)
        b = self.mesh.boundaries
        slack = ROUNDOFF * max(abs(b[0]), abs(b[-1]), b[-1] - b[0])
        if flat.size and not (flat.min() >= b[0] - slack and flat.max() <= b[-1] + slack):
            raise ValueError(
                f"expected times within [{b[0]}, {b[-1]}], found "
                f"{flat.min()} to {flat.max()}; a path is not extrapolated"
            )
        found = self._since(table, derivatives, flat - b[0])
        return found.reshape(table.shape[0], *times.shape)

    def _since(self, table: Array, derivatives: int, flat: Array) -> Array:
        """Evaluate at times (K,) measured from the path's first: (n, K)."""
        b = self.mesh.since
        where = np.clip(np.searchsorted(b, flat, side="right") - 1, 0, self.mesh.elements - 1)
        result = np.empty((table.shape[0], flat.size))
        position = np.empty(self.mesh.elements, dtype=int)
        for rule, which, index in self.mesh.groups:
            position[which] = np.arange(which.size)
            mine = np.isin(where, which) if len(self.mesh.groups) > 1 else slice(None)
            e = where[mine]
            if e.size == 0:
                continue
            h = self.mesh.lengths[e]
            xi = np.clip(((flat[mine] - b[e]) - (b[e + 1] - flat[mine])) / h, -1.0, 1.0)
            weights = rule.interpolation(xi)
            for _ in range(derivatives):
                weights = (weights @ rule.derivative) * (2 / h)[:, None]
            local = table[:, index[position[e]]]
            result[:, mine] = np.einsum("nkj,kj->nk", local, weights)
        return result
