"""The discrete problem: the action with its KKT system, and how well a mesh resolves a path."""

from __future__ import annotations

from copy import copy

import numpy as np

from actionopt.discrete.action import assemble_blocks, second_quadrature
from actionopt.discrete.action.action import Action
from actionopt.discrete.matrices.factors import expected_seconds
from actionopt.discrete.meshes.mesh import rise
from actionopt.mechanics.question.scales import diagonal
from actionopt.tools.cached import cached_property
from actionopt.tools.median import median
from actionopt.tools.types import Array

# Of the largest force left at a node: from which on the end element's tell that its own do not
# count. Measured: singular ends have .1 and more, boundary layers at most 5e-4.
LEFT_NEAR = 1e-2


class Transcription(Action):
    """A problem on one mesh, as a system of equations: r(z) = 0 and its derivative.

    Parameters and vectors z are those of `Action`.
    """

    # -- second derivatives, put together --------------------------------------------------------

    def hessian(self, z: Array) -> Array:
        """Return the upper triangle's nonzeros (nnz,) of the Hessian of S + sum w lam f."""
        from actionopt.discrete.action import assemble_sparse

        return assemble_sparse.hessian(self, z)

    def kkt(self, z: Array) -> Array:
        """Return the nonzeros of the derivative of `residual`, stored as the layout says.

        Raises OutOfTime if a step by its factors will take longer than what is left.
        """
        nonzeros = self._assembly.kkt(self, z)
        if self.watch is not None:
            self.watch.check(expected_seconds(self.layout))
        return nonzeros

    symmetric_kkt = kkt  # as that of `Bordered`

    @property
    def is_multiplier(self) -> Array:
        """Which unknowns are multipliers of rows, (size,)."""
        return np.arange(self.layout.size) >= self.layout.unknowns

    def kinetic(self, z: Array) -> Array:
        """Return the kinetic part of the KKT matrix, D' w M D alone, stored as `kkt` is.

        Positive definite where the mass matrix is: the metric in which a step changes the
        velocities least. Only for systems without forces.
        """
        return self.memoize_if_constant("kinetic", lambda: self._assembly.kinetic(self, z))

    def momentum(self, y: Array) -> Array:
        """Return the kinetic part of the KKT matrix times the variation y, both (unknowns,).

        The mass matrix is the same at all nodes: `inertia`, that half way on the straight line.
        """
        layout, second = self.layout, self.problem.system.pointwise("second")
        mass = second.full(2, self.inertia[None], symmetric=True)[0]
        rest = self.coordinates(np.zeros(layout.unknowns))
        if self.order > 1:
            p = self.state(self.places(y) - self.places(0 * y))[1] @ mass
            parts = self.pull_back(np.zeros((len(p), layout.width)), p)
            return self.free_part(
                np.bincount(layout.scatter, parts.ravel(), layout.node_count * layout.width)
            )
        p = self.velocities((self.coordinates(y) - rest)[layout.node_of]) @ mass
        return self.at_unknowns(self.add_work(np.zeros_like(p), p))

    @cached_property
    def probe(self) -> Array:
        """The variation (unknowns,) that inverse iteration begins with.

        As large in each coordinate, measured by the momentum: what hardly moves along the path has
        short units, and would have no part in it beside what is solved for.
        """
        return self.layout.probe[: self.layout.unknowns] * self.kinetic_unit

    @cached_property
    def probe_momentum(self) -> Array:
        """Its `momentum`."""
        return self.momentum(self.probe)

    @cached_property
    def kinetic_unit(self) -> Array:
        """The sizes of unknowns of the same inertia, (unknowns,), one for the least of them."""
        if self.problem.system.n == 1:
            return np.ones(self.layout.unknowns)
        mass = diagonal(self.problem.system, 2, self.inertia[None])[0]
        inertia, least = mass * self.lengths**2, second_quadrature.MASSLESS
        largest = inertia.max()
        # What hardly moves has a small inertia for its size alone, and is not massless for that.
        inertia[(inertia <= least * largest) & (mass <= least * mass.max())] = largest
        return np.sqrt(largest / inertia)[self.layout.free % inertia.size]

    @property
    def _assembly(self):
        if self.layout.storage == "blocks":
            return assemble_blocks
        from actionopt.discrete.action import assemble_sparse

        return assemble_sparse

    # -- what the mesh may have missed -----------------------------------------------------------

    @cached_property
    def between_nodes(self) -> list[second_quadrature.Batch]:
        """The other points at which the equations are summed."""
        return second_quadrature.batches(self)

    def quadrature_defect(self, z: Array, *, followed: bool = True) -> tuple[Array, float]:
        """Return the KKT residual that another quadrature adds to this one's, (size,).

        It shows forces that vary faster than the path. That of the constraints is left out. And the
        drift that the momentum missed with it gives to a free body, in units of `lengths`. It is
        summed where the forces lead between the nodes, or on the path if it is not `followed`.
        """
        x = z[: self.layout.unknowns]
        miss, drift = second_quadrature.quadrature_defect(
            self, self.between_nodes, x, followed=followed
        )
        if self.layout.rows:
            miss = np.concatenate([miss, np.zeros(self.layout.rows)])
        return miss, drift

    def missed_action(self, z: Array) -> float:
        """Return by how much another quadrature changes S, relative to that of |L|."""
        if not self.problem.system.structure.adds_time:
            return 0.0
        x = z[: self.layout.unknowns]
        return float(second_quadrature.missed_action(self, self.between_nodes, x).sum())

    def uneven(self, z: Array) -> Array:
        """Return how much of it is each element's, (N,)."""
        return second_quadrature.uneven(self, self.between_nodes, z[: self.layout.unknowns])

    def cuts(self, z: Array) -> list[Array]:
        """Return for each element the times since the start at which to cut it to miss less."""
        return second_quadrature.cuts(self, self.between_nodes, z[: self.layout.unknowns])

    def misread(self, z: Array) -> Array:
        """Return the change of `residual`, (size,), as what it reads moves to the next floats.

        That are the times, and the coordinates whose origin is far from zero.
        """

        def away(values: Array) -> Array:  # no way is preferred
            pattern = np.where(np.cos(np.arange(values.size)) > 0, np.inf, -np.inf)
            return np.nextafter(values, pattern.reshape(values.shape))

        other, Q = copy(self), self.place(z).Q
        other.times = times = away(self.times)
        if self.sides is not None:
            for g in self.layout.groups:
                times[g.span] = self.element_times(g.elements, times[g.span].reshape(g.nodes.shape))
        if self.origin is not None:
            Q = np.where(self.origin != 0.0, away(Q), Q)
        change = other.action_and_gradient(Q)[1] - self.action_and_gradient(self.place(z).Q)[1]
        return np.concatenate([self.free_part(change), np.zeros(self.layout.rows)])

    def turns(self, z: Array) -> float:
        """Return the typical rate of change of motions near x, sqrt(L_qq / L_vv), times T.

        The median in time for each coordinate, and the largest of these.
        """
        system = self.problem.system
        A, _, C = self.second(z[: self.layout.unknowns])
        with np.errstate(all="ignore"):
            square = median(diagonal(system, 0, A) / diagonal(system, 2, C), self.weight[:, 0])
        rate = square[np.isfinite(square)].max(initial=0.0) ** (0.5 / self.order)
        return self.mesh.duration * float(rate)

    # -- what follows at the events ---------------------------------------------------------------

    def momenta(self, z: Array) -> tuple[Array, Array]:
        """Return p(t0) = -dS/dq0 and p(t1) = +dS/dq1, each (n,): Hamilton and Jacobi's identities.

        Where L contains accelerations, those by the velocities stand behind (Ostrogradsky).
        With constraints they are known only up to the constraints' normals. Where the first or last
        element is short, or open, an end may move along a line: what Newton's method leaves in the
        forces at single nodes there, as small as it is in their places, does not count then. Not
        beside a boundary layer, where more is left in the stiff middle.
        """
        gradient = self._first(z[: self.layout.unknowns])[1].reshape(self.layout.node_count, -1)
        mesh, joints = self.mesh, self.joints
        p0, p1 = -gradient[0], gradient[-1].copy()
        if self.order > 1 or self.layout.rows or self.nodal or not mesh.moves_along_lines:
            return p0, p1
        (begin, end), since = mesh.singular_ends, mesh.nodes_since
        first, last = slice(joints[1] + 1), slice(joints[-2], None)
        one = len(joints) == 2
        done, left = since[first], since[joints[1]] - since[first]
        along = -rise(done, left, (begin, end if one else 0))[1] @ gradient[first]
        p0 = np.where(_is_near(gradient[1 : joints[1]], mesh.degrees[0]), along, p0)
        done, left = since[last] - since[joints[-2]], since[-1] - since[last]
        along = rise(done, left, (begin if one else 0, end))[0] @ gradient[last]
        back = gradient[joints[-2] + 1 : -1][::-1]
        return p0, np.where(_is_near(back, mesh.degrees[-1]), along, p1)

    def pulls(self, z: Array) -> Array:
        """Return dS/dq at all events, (k + 2, n): between the ends p before them minus p after."""
        gradient = self._first(z[: self.layout.unknowns])[1].reshape(self.layout.node_count, -1)
        return gradient[self.joints]


def _is_near(left: Array, degree: int) -> Array:
    """Return of which forces (K, n) left at nodes some of the largest are among the first, (n,)."""
    left = np.abs(left)
    return left[:degree].max(axis=0, initial=0.0) >= LEFT_NEAR * left.max(axis=0, initial=0.0)
