"""The second variation of any path as one full matrix, on what its conditions allow.

W'' in everything unknown - the path, and what is found beside it (`discrete.borders.borders`) - on
the null space of the rows that have multipliers: those of constraints, of surfaces, of integrals
that are given. Its negative eigenvalues are the index. It costs the cube of what is unknown, and
serves where the forms of `second_variation`, eliminated element by element, do not: where L
contains accelerations, and where one row goes through the whole path.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.bordered import Bordered, null_space
from actionopt.discrete.borders.borders import times_of
from actionopt.discrete.borders.contact_times import bend_of_contacts, restrict
from actionopt.discrete.matrices.factors import full
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.question.held import Held
from actionopt.mechanics.question.obstacle import Arc
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

FORM_ROUNDS = (
    5  # how often elements are halved until what is told of a path stays what it is; ad hoc
)


@immutable
class FullForm:
    """d2S of a path, or of its part from the start to some time at which nothing varies."""

    equations: Bordered | Transcription
    z: Array  # (size,): their unknowns

    @cached_property
    def basis(self) -> Array:
        """Variations of all unknowns, (size, c), that span those allowed: orthonormal."""
        found = null_space(self.equations, self.matrix)
        return found if self._contacts is None else restrict(found, self._contacts[1])

    @cached_property
    def _contacts(self) -> tuple[Array, Array] | None:
        if self.tr.order == 1 or not self.tr.problem.touches:
            return None
        return bend_of_contacts(DiscretePath(self.tr, self.z[: self.tr.layout.size]))

    @cached_property
    def matrix(self) -> Array:
        """The second derivatives of W, (size, size)."""
        equations = self.equations
        nonzeros = equations.symmetric_kkt(self.z)
        if self._contacts is not None:
            nonzeros[: self._contacts[0].size] += self._contacts[0]
        return full(equations.layout, nonzeros)

    @property
    def tr(self) -> Transcription:
        """The discrete action."""
        return self.equations.at(self.z)

    def relative(self) -> Array:
        """Return eigenvalues (c,) against the kinetic part, and a little of what has no rates."""
        kinetic = full(self.equations.layout, self.equations.kinetic(self.z))
        return np.linalg.eigvalsh(self._against(kinetic + np.eye(len(kinetic)))[0])

    def lowest(self, units: Array) -> tuple[Array, Array]:
        """Return eigenvalues (c,) and vectors (size, c) in the norm int |eta / units|^2 dt.

        Eigenvalues are in the user's units of action. Times and multipliers do not vary.
        """
        tr, mass = self.tr, np.zeros_like(self.matrix)
        values = self.variations(np.eye(tr.layout.unknowns)) / units[:, None]
        rows = values[:, :, tr.layout.node_of] * np.sqrt(tr.weight[:, 0])
        rows = rows.reshape(len(rows), -1)
        mass[: len(rows), : len(rows)] = rows @ rows.T / tr.action_unit
        whole, root = self._against(mass)
        values, vectors = np.linalg.eigh(whole)
        return values, self.basis @ np.linalg.solve(root.T, vectors) / np.sqrt(tr.action_unit)

    def _against(self, mass: Array) -> tuple[Array, Array]:
        """Return the form by a basis that is orthonormal in a mass, and the root of that."""
        root = np.linalg.cholesky(self.basis.T @ mass @ self.basis)
        half = np.linalg.solve(root, self.basis.T @ self.matrix @ self.basis)
        whole = np.linalg.solve(root, half.T)
        return (whole + whole.T) / 2, root

    def variations(self, x: Array) -> Array:
        """Return eta at the nodes, (c, n, K), of variations of the unknowns, (c, unknowns)."""
        tr = self.tr
        rest = tr.coordinates(np.zeros(tr.layout.unknowns))
        return np.array([(tr.coordinates(row) - rest).T for row in x])


def form_until(solution: Solution, t: float | None, rounds: int = 0) -> FullForm:
    """Return d2S of a path up to a time t at which it is held; up to its end if t is None.

    The ends have their times; places on surfaces, and all that is found at events before t, varies.
    Each element is halved `rounds` times.
    """
    problem, asked = solution.problem, solution.problem.original
    mesh = _halve(_until(solution.mesh, t), rounds)
    path = solution.path.on(mesh)
    start, end = (_at(e, f.t) for e, f in ((asked.start, problem.start), (asked.end, problem.end)))
    times, through = times_of(problem)[:-1], asked.through
    if t is not None:
        before = int(np.sum(times[1:] < t))
        times, through = np.append(times[: before + 1], t), through[:before]
        end = _hold(solution, path, t)
    else:
        times = np.append(times, problem.end.t)
    laws = problem.question
    part = Problem(
        laws[: len(through) + 1] if isinstance(laws, tuple) else laws,
        start,
        end,
        parameters=problem._given_parameters,
        through=through,
        integral=problem.integral,
    )
    lam, lengths = _forces(solution, mesh), solution.discrete.tr.lengths
    if problem.system.order > 1 and solution.contacts:
        last = mesh.boundaries[-1]
        cut = (Arc(x.row, x.begin, min(x.end, last)) for x in solution.contacts if x.begin < last)
        part, lam = Held(part, tuple(cut)), np.zeros((mesh.nodes.size, problem.system.r))
    if part.is_joined:
        kappa = problem.kappa if problem.integral is not None else None
        return FullForm(*Bordered.around(part, path, lam, lengths, times=times, kappa=kappa))
    tr = Transcription(part, mesh, lengths)
    return FullForm(tr, tr.pack(path.values.T, lam))


def _at(event: Event, t: float) -> Event:
    """Return an event with its time as it was found."""
    return event if event.t is not None else event.at(t)


def _hold(solution: Solution, path: Path, t: float) -> Event:
    """Return the event of what a path is at a time t, all of it given."""
    order, places = solution.problem.system.order, path(t)
    if order > 1:
        rates = path.carried_on(np.array([path.mesh.duration]), 1.0, order - 1)
        places = np.concatenate(rates)[:, 0]
    return Event.of_places(t, places, path.values.shape[0])


def _forces(solution: Solution, mesh: Mesh) -> Array | None:
    """Return the constraints' multipliers of the motion at the nodes of a part, (K, m).

    Where the law or a momentum jumps they do, and the node there has their mean, by its weights in
    the elements on both sides.
    """
    if not solution.problem.system.m:
        return None
    if not solution.problem.through or solution.problem.system.order > 1:
        return solution.multipliers(mesh.nodes).T
    t, d = mesh.nodes, np.array(mesh.degrees)
    share = mesh.lengths / (d * (d + 1))  # what an end weighs in its element
    found, whole = np.zeros((t.size, solution.problem.system.m)), np.zeros((t.size, 1))
    for leg in solution.parts:
        first, last = np.searchsorted(mesh.boundaries, (leg.problem.start.t, leg.problem.end.t))
        last = min(int(last), mesh.elements)
        if first >= last:
            break
        here = slice(mesh.offsets[first], mesh.offsets[last] + 1)
        weight = np.ones((t[here].size, 1))
        weight[[0, -1], 0] = share[[first, last - 1]]
        found[here] += weight * leg.multipliers(t[here]).T
        whole[here] += weight
    return found / whole


def _until(mesh: Mesh, t: float | None) -> Mesh:
    """Return the elements up to a time t, the last one cut there."""
    if t is None:
        return mesh
    k = int(np.searchsorted(mesh.boundaries, t))
    return Mesh(np.append(mesh.boundaries[:k], t), mesh.degrees[:k])


def _halve(mesh: Mesh, rounds: int) -> Mesh:
    """Return a mesh whose elements are halved some times."""
    for _ in range(rounds):
        mesh = mesh.divide(np.full(mesh.elements, 2))
    return mesh
