"""Curves in configuration space: a mesh in time and a polynomial on each of its elements.

Neighbouring elements share their boundary node, so a path is continuous by construction; its
velocity is continuous only as far as the path is resolved. Guess, solution and forward reference
are all paths.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.tools.checks import numbers
from actionopt.tools.immutable import immutable, make_unchecked
from actionopt.tools.lobatto import RESTING
from actionopt.tools.types import EPS, Array

# A time that a user computes from the ends in a few operations may miss them by some spacings.
TIME_SLACK = 16 * EPS


@immutable
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
    passed : tuple of float
        When it passes the events between its ends, where that is known; the places alone do not
        tell it of a path that comes to one of them several times.

    Raises
    ------
    ValueError
        If the shapes do not fit the mesh or a value is not finite.
    """

    mesh: Mesh
    values: Array
    velocities: Array | None = None
    passed: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, Mesh):
            raise ValueError(f"expected Path(mesh, values), found {self.mesh!r} as the mesh")
        count = self.mesh.offsets[-1] + 1
        for name in ("values", "velocities"):
            given = getattr(self, name)
            if given is None:
                continue
            given = numbers(given, name)
            given = given if given.ndim > 1 else np.atleast_2d(given)
            if given.ndim != 2 or given.shape[1] != count:
                raise ValueError(
                    f"expected {name} of shape (n, {count}), one column a node, found {given.shape}"
                )
            if not np.isfinite(given).all():
                raise ValueError(f"expected finite {name}, found NaN or infinity")
            given.setflags(write=False)
            object.__setattr__(self, name, given)

    def __reduce__(self) -> tuple:
        """Return how to make it anew from the same numbers."""
        return Path, (self.mesh, self.values, self.velocities, self.passed)

    def __repr__(self) -> str:
        """Show the sizes, not the arrays."""
        return f"Path({self.values.shape[0]} x {self.values.shape[1]} values on {self.mesh})"

    @classmethod
    def through(
        cls,
        mesh: Mesh,
        values: Array,
        velocities: Array | None = None,
        passed: tuple[float, ...] = (),
    ) -> Path:
        """Return the path of arrays (n, K) that were made for it, which it keeps.

        Raises ValueError if a value is not finite.
        """
        for given in (values, velocities):
            if given is not None and not np.logical_and.reduce(np.isfinite(given), axis=None):
                raise ValueError("expected finite values, found NaN or infinity")
            if given is not None:
                given.setflags(write=False)
        return make_unchecked(cls, mesh=mesh, values=values, velocities=velocities, passed=passed)

    @classmethod
    def interpolate(cls, curve: Callable[[Array], ArrayLike], mesh: Mesh) -> Path:
        """Return the path through `curve(mesh.nodes)`, where `curve` maps (K,) times to (n, K).

        A curve of one coordinate may return (K,). Raises ValueError for any other shape.
        """
        if not callable(curve) or not isinstance(mesh, Mesh):
            raise ValueError(
                f"expected interpolate(curve, mesh), curve a callable, found {curve!r}, {mesh!r}"
            )
        values = numbers(curve(mesh.nodes), "a curve at the nodes")
        return cls(mesh, values[None, :] if values.ndim == 1 else values)

    @staticmethod
    def from_ppoly(pieces: Any) -> Path:
        """Return piecewise polynomials of scipy's as a path, exactly.

        Parameters
        ----------
        pieces : PPoly, BPoly, CubicSpline, PchipInterpolator, BSpline, ...
            Of n coordinates along either axis, or of one.

        Raises ValueError for anything else, and where pieces do not meet.
        """
        from actionopt.discrete.meshes.splines import read_pieces

        return Path(*read_pieces(pieces))

    def to_ppoly(self) -> Any:
        """Return the path as a `scipy.interpolate.PPoly`, which maps (K,) times to (n, K).

        It is differentiated, integrated and searched for roots there. (Its velocity is the
        derivative of the polynomial, whether or not the path knows another.)

        Raises ImportError if scipy is not installed.
        """
        from actionopt.discrete.meshes.splines import make_ppoly

        return make_ppoly(self.mesh, self.legendre())

    def __call__(self, t: ArrayLike) -> Array:
        """Return q(t): shape (n, K) for K times, (n,) for one time.

        Raises ValueError for a time outside the mesh.
        """
        return self._evaluate(self.values, 0, t)

    def at(self, since: Array) -> Array:
        """Return q (n, K) at times (K,) since the first, which are not checked."""
        return self._since(self.values, 0, since)

    def velocity(self, t: ArrayLike) -> Array:
        """Return v(t) = dq/dt: shape (n, K) for K times, (n,) for one time."""
        if self.velocities is not None:
            return self._evaluate(self.velocities, 0, t)
        return self._evaluate(self.values, 1, t)

    def node_velocities(self) -> Array:
        """Return v at the nodes, (n, K): where two elements meet that of one of them."""
        if self.velocities is not None:
            return self.velocities
        found = np.empty(self.values.shape)
        for g in self.mesh.groups:
            rates = self.values[:, g.nodes] @ g.rule.derivative.T
            found[:, g.nodes] = rates * (2 / self.mesh.lengths[g.elements, None])
        return found

    def acceleration(self, t: ArrayLike) -> Array:
        """Return dv/dt, the derivative of `velocity`: shape (n, K) or (n,)."""
        if self.velocities is not None:
            return self._evaluate(self.velocities, 1, t)
        return self._evaluate(self.values, 2, t)

    def on(self, mesh: Mesh) -> Path:
        """Return this curve interpolated on another mesh over the same times.

        Where the mesh is that of a path which begins or ends at rest, and the curve does not, the
        curve is run through more slowly in the element there.
        Raises ValueError for anything but a mesh.
        """
        if not isinstance(mesh, Mesh):
            raise ValueError(f"expected a Mesh(boundaries, degrees), found {mesh!r}")
        since = mesh.nodes_since
        for end, kind in enumerate(mesh.singular_ends):
            if kind == RESTING != self.mesh.singular_ends[end]:
                since = self._slow_down(since, end, mesh.lengths[-end])
        return Path(mesh, self._since(self.values, 0, since))

    def _slow_down(self, since: Array, end: int, h: float) -> Array:
        """Return times since the start, those within h of an end nearer to it if it moves there."""
        at = (0.0, self.mesh.duration)[end]
        way = self._since(self.values, 0, np.abs(at - np.array([0.0, h])))
        rate = self._since(self.values, 1, np.array([at]))
        if not np.abs(rate).max() * h > np.abs(np.diff(way)).max() / 2:
            return since
        u = np.minimum(np.abs(since - at) / h, 1.0)
        return np.where(u < 1, np.abs(at - h * u * u * (2 - u)), since)

    def carried_on(self, since: Array, reach: float, order: int = 1) -> tuple[Array, Array]:
        """Return q and v (n, K) at times since the first, on the polynomials, also beyond the ends.

        That is as far as `reach` half lengths of the last element from its middle. For an `order`
        above one, q stands for all derivatives below that one, (order n, K), and v for that one.
        """
        *below, highest = self._all_since(self.values, range(order + 1), since, reach)
        return below[0] if order == 1 else np.concatenate(below), highest

    def legendre(self) -> list[Array]:
        """Return each element's Legendre coefficients, shape (n, d + 1), in element order."""
        result: list[Array] = [np.empty(0)] * self.mesh.elements
        for g in self.mesh.groups:
            block = self.values[:, g.nodes] @ g.rule.to_legendre.T
            for k, e in enumerate(g.elements):
                result[e] = block[:, k]
        return result

    def _evaluate(self, values: Array, derivatives: int, t: ArrayLike) -> Array:
        """Evaluate nodal values (n, nodes), or a derivative of them, at times t: (n, *t.shape)."""
        times = t if isinstance(t, np.ndarray) and t.dtype.char == "d" else numbers(t, "the times")
        flat = times.reshape(-1)
        first, last = self.mesh.boundaries[[0, -1]].tolist()
        slack = TIME_SLACK * max(abs(first), abs(last), last - first)
        if flat.size:
            low, high = np.minimum.reduce(flat), np.maximum.reduce(flat)
            if not (low >= first - slack and high <= last + slack):
                raise ValueError(
                    f"expected times within [{first}, {last}], found {low} to {high}; a path is "
                    "not extrapolated"
                )
        found = self._since(values, derivatives, flat - first)
        return found.reshape(values.shape[0], *times.shape)

    def _since(self, values: Array, derivatives: int, flat: Array) -> Array:
        """Evaluate the same at times (K,) measured from the path's first: (n, K)."""
        return self._all_since(values, (derivatives,), flat)[0]

    def _all_since(
        self, values: Array, orders: Sequence[int], flat: Array, reach: float = 1.0
    ) -> list[Array]:
        """Evaluate derivatives of increasing orders, (n, K) each."""
        b, groups = self.mesh.since, self.mesh.groups
        where = b[1:-1].searchsorted(flat, side="right")
        kinds = where  # the group of each time
        if len(groups) > 1:
            known = np.empty(self.mesh.elements, dtype=np.intp)
            for k, g in enumerate(groups):
                known[g.elements] = k
            kinds = known[where]
        results = [np.empty((values.shape[0], flat.size)) for _ in orders]
        for k, g in enumerate(groups):
            mine = slice(None) if len(groups) == 1 else kinds == k
            e, t = where[mine], flat[mine]
            if e.size == 0:
                continue
            h = self.mesh.lengths[e]
            xi = ((t - b[e]) - (b[1:][e] - t)) / h
            xi = np.minimum(np.maximum(xi, -reach), reach)
            weights, order = g.rule.interpolation(xi), 0
            local = values[:, self.mesh.offsets[e][:, None] + np.arange(g.rule.degree + 1)]
            for wanted, result in zip(orders, results, strict=True):
                if wanted and not order:
                    weights, order = g.rule.slopes(xi) * (2 / h)[:, None], 1
                while order < wanted:
                    weights, order = (weights @ g.rule.derivative) * (2 / h)[:, None], order + 1
                result[:, mine] = np.einsum("nkj,kj->nk", local, weights)
        return results
