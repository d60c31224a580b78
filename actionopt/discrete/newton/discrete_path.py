"""A path on a mesh: the unknowns of a transcription, and the curve they stand for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from actionopt.discrete.action.action import ActionUnits
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh, with_singular_ends
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.newton import follow
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import NEGLIGIBLE
from actionopt.tools.cached import cached_property
from actionopt.tools.immutable import immutable, make_unchecked
from actionopt.tools.types import Array


class Unknowns(NamedTuple):
    """The numbers of a path on a mesh, z (size,), and what they are measured in."""

    z: Array
    lengths: Array
    units: ActionUnits


@immutable
class DiscretePath:
    """A path on a mesh, with the multipliers of its constraints."""

    tr: Transcription  # the discrete action on the mesh, and the units of the unknowns
    # (size,): coordinates x that are free, node by node, and multipliers mu of the rows, in units
    # of their own: z = [ x_1 ... x_unknowns | mu_1 ... mu_rows ].
    z: Array

    def __repr__(self) -> str:
        return f"DiscretePath({self.mesh!r}, {self.tr.layout.size} unknowns and multipliers)"

    @classmethod
    def of(
        cls, problem: Problem, path: Path, lam: Array | None = None, lengths: Array | None = None
    ) -> DiscretePath:
        """Return a path of `problem` on its own mesh, with multipliers lam (K, m) or none.

        The units are the coordinates' largest values on the way, or one where these are round-off,
        unless `lengths` (n,) are given.
        """
        if path.mesh.singular_ends != problem.singular_ends:
            path = path.on(with_singular_ends(path.mesh, problem.singular_ends))
        if lengths is None:
            largest = np.max(np.abs(path.values), axis=1)
            negligible = NEGLIGIBLE * largest.max()
            zero = largest <= negligible
            if (zero & (largest > 0)).any():  # round-off, unless the events say so
                zero &= (largest == 0) | (problem.scales > negligible)
            lengths = np.where(zero, 1.0, largest)
        tr = Transcription(problem, path.mesh, lengths)
        return cls(tr, tr.pack(path.values.T, lam))

    @classmethod
    def restore(cls, problem: Problem, mesh: Mesh, unknowns: Unknowns) -> DiscretePath:
        """Return the path of which these are the `unknowns`, to the last bit."""
        return cls(Transcription(problem, mesh, unknowns.lengths, like=unknowns.units), unknowns.z)

    @property
    def unknowns(self) -> Unknowns:
        """The numbers that tell the path, given its problem and its mesh."""
        return Unknowns(self.z, self.tr.lengths, self.tr.units)

    @property
    def problem(self) -> Problem:
        """The question."""
        return self.tr.problem

    @property
    def mesh(self) -> Mesh:
        """The elements."""
        return self.tr.mesh

    @property
    def x(self) -> Array:
        """The free coordinates, (unknowns,): the first part of z."""
        return self.z[: self.tr.layout.unknowns]

    @cached_property
    def Q(self) -> Array:
        """Coordinates at the nodes, (K, n)."""
        return self.tr.coordinates(self.z)

    @cached_property
    def path(self) -> Path:
        """The curve."""
        through = self.problem.through
        passed = tuple(event.t for event in through) if through else ()
        if self.tr.order > 1:
            return Path.through(self.mesh, self.Q.T, self.rates[0].T, passed)
        return Path.through(self.mesh, self.Q.T, passed=passed)

    @cached_property
    def left_out(self) -> dict[tuple, Array]:
        """What is known of the sizes of d2S and its fields along the curve, on whatever mesh."""
        return {}

    @cached_property
    def rates(self) -> list[Array]:
        """The derivatives up to that of the Lagrangian's order at the nodes, (K, n) each."""
        place, layout = self.tr.place(self.x), self.tr.layout
        state, n = np.concatenate([place.at, place.v], axis=1), self.problem.system.n
        found = np.empty((layout.node_count, state.shape[1]))
        found[layout.node_of] = state
        return np.split(found[:, n:], self.tr.order, axis=1)

    @property
    def action(self) -> float:
        """S, in the user's units; of L alone, without the terms of integrals that are given."""
        found, problem = self.tr.action(self.x) * self.tr.action_unit, self.problem
        if problem.integral is None:
            return found
        return found - float(problem.kappa @ np.array(problem.integral))

    @cached_property
    def rows(self) -> Array:
        """Multipliers of the constraint rows at the nodes, (K, m); NaN where there is no row."""
        return self.tr.multipliers(self.z)

    @cached_property
    def lam(self) -> Array:
        """Multipliers at all nodes, (K, m): `rows`, and `multipliers` where there is none.

        Pinned ends have no rows. Raises ValueError as `multipliers` does.
        """
        missing = ~np.isfinite(self.rows).all(axis=1)
        if not missing.any():
            return self.rows
        lam = self.rows.copy()
        there = self.multipliers(self.mesh.nodes[missing])
        lam[missing] = np.where(np.isfinite(lam[missing]), lam[missing], there)
        return lam

    def multipliers(self, t: Array) -> Array:
        """Return the multipliers of the motion along the path at times t (K,), (K, m).

        They solve the index-1 form of the equations of motion. Raises ValueError where the
        constraints are not independent.
        """
        system, path = self.problem.system, self.path
        if not system.m:
            return np.zeros((t.size, 0))

        def at(t: Array) -> Array:
            problem = self.problem
            state = path(t), path.velocity(t), t, problem.parameters
            return system.dynamics(*state, problem.active(t))[1].T

        try:
            return at(t)
        except np.linalg.LinAlgError:
            for time in t:
                try:
                    at(time)
                except np.linalg.LinAlgError:
                    raise dependent(time) from None
            raise

    def on(self, mesh: Mesh, lam: Array | None = None) -> DiscretePath:
        """Return the curve interpolated on another mesh, in the same units of length.

        Multipliers lam (K, m) at the new nodes that are not given are interpolated, linearly.
        """
        tr = Transcription(self.problem, mesh, self.tr.lengths)
        z = tr.pack(self.path.on(mesh).values.T, self.rows_on(mesh, lam))
        return self._as_seen_in(DiscretePath(tr, z))

    def in_units(self, lengths: Array) -> DiscretePath:
        """Return the path on its mesh, in other units of length (n,)."""
        rows = self.rows_on(self.mesh)
        return self._as_seen_in(DiscretePath.of(self.problem, self.path, rows, lengths))

    def _as_seen_in(self, other: DiscretePath) -> DiscretePath:
        """Return another path of the same curve, with what is known of that."""
        return make_unchecked(DiscretePath, **vars(other) | {"left_out": self.left_out})

    def rows_on(self, mesh: Mesh, lam: Array | None = None) -> Array | None:
        """Return the multipliers `lam` or, interpolated, these at the nodes of `mesh`, (K, m)."""
        if lam is not None or not self.tr.layout.rows:
            return lam
        nodes, wanted = self.mesh.nodes_since, mesh.nodes_since
        found = np.zeros((wanted.size, self.rows.shape[1]))
        for i, row in enumerate(self.rows.T):
            known = np.isfinite(row)
            if known.any():
                found[:, i] = np.interp(wanted, nodes[known], row[known])
        return found

    def polish(self) -> DiscretePath:
        """Return the stationary path near, or this one where Newton's method finds none."""
        near = follow(self.tr, self.z)
        return DiscretePath(self.tr, near.z) if near.converged else self


def dependent(t: float) -> ValueError:
    """Return the error that says that the constraints restrict less at the time t."""
    return ValueError(
        f"expected independent constraints all along the path, found that they are not at "
        f"t = {t:.6g}, as where a mechanism passes a flat position: multipliers and neighbours are "
        "not determined there; try other elements (mesh=), whose nodes miss that time"
    )
