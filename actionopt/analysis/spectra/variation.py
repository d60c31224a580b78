"""A path and its neighbours: the action along q + alpha eta.

The chapter's proof of the Euler-Lagrange equations as something to compute: S(alpha) of a varied
path has a stationary point at alpha = 0, and its second derivative there is the second variation
of eta. Both are those of the discrete action on a mesh that resolves eta as well as the path, so
that the first derivative vanishes to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.quadratic.second_variation import Form, are_units, form
from actionopt.analysis.solution import Solution, question
from actionopt.discrete.action.projection import project
from actionopt.discrete.borders.surfaces import onto
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.meshes.resolution import resolution
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.checks import number, numbers
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

# Ad hoc: near round-off.
ETA_RESOLUTION = 1e-10  # omitted Legendre coefficients of eta, relative to its size
KINK_HALVINGS = 8  # of an element; a kink of eta is then closed in on to 1/256 of it
PINNED_ETA = 1e-10  # |eta| at a pinned end, relative to its size
ON_CONSTRAINT = 1e-12  # |f| of a varied path, relative to its change by the coordinates' own size


@immutable
class Variation:
    """The action S(alpha) along q + alpha eta; call it with alpha.

    With constraints, eta is the part of the variation asked for that the constraints allow,
    G eta = 0, and the varied path is moved back onto the surface: to first order in alpha it is
    q + alpha eta.

    Attributes
    ----------
    form : Form
        The second variation on the mesh used.
    lam : (K, m) array
        Multipliers of the path at the nodes.
    eta : Path
        The variation.
    """

    form: Form
    lam: Array
    eta: Path

    def __repr__(self) -> str:
        """Show the derivatives of S by alpha, not the path."""
        return f"Variation(S' = {self.first:.3g}, S'' = {self.second:.8g} at alpha = 0)"

    def __call__(self, alpha: ArrayLike) -> Array:
        """Return S(alpha), of the shape of `alpha`.

        Raises ValueError where no varied path on the constraint surface is near.
        """
        values = numbers(alpha, "alpha")
        tr = self.form.tr
        actions = [tr.action_and_gradient(self.nodes(a))[0] for a in values.ravel()]
        return np.array(actions).reshape(values.shape)

    def path(self, alpha: float) -> Path:
        """Return the varied path. Raises ValueError as a call does."""
        return Path(self.form.tr.mesh, self.nodes(alpha).T)

    @cached_property
    def first(self) -> float:
        """dS/dalpha at alpha = 0: int (eta . L_q + eta' . L_v) dt = 0."""
        _, gradient = self.form.tr.action_and_gradient(self.form.at.Q)
        return float(gradient @ self.eta.values.T.ravel())

    @cached_property
    def cancelling(self) -> float:
        """Size of what cancels in `first`: int (|eta . L_q| + |eta' . L_v|) dt."""
        tr, problem = self.form.tr, self.form.tr.problem
        at, eta = (x[tr.layout.node_of] for x in (self.form.at.Q, self.eta.values.T))
        v, rate = tr.velocities(at), tr.velocities(eta)
        Lq, Lv, _ = problem.system.pointwise("first")(at, v, tr.times, problem.packed)
        return float(np.sum(tr.weight * (np.abs(Lq * eta) + np.abs(Lv * rate))))

    @cached_property
    def second(self) -> float:
        """d2S/dalpha2 at alpha = 0: the second variation d2S[eta]."""
        form, offsets = self.form, self.form.tr.mesh.offsets
        a = np.einsum("knr,kn->kr", form.basis, self.eta.values.T / form.units)
        rows = [a[i : j + 1].ravel() for i, j in pairwise(offsets)]
        return float(sum(x @ E @ x for x, E in zip(rows, form.elements, strict=True)))

    def nodes(self, alpha: float) -> Array:
        """Return the coordinates of the varied path at the nodes, (K, n)."""
        tr, alpha = self.form.tr, number(alpha, "alpha")
        Q = self.form.at.Q + alpha * self.eta.values.T
        system, problem = tr.problem.system, tr.problem
        if alpha == 0:
            return Q
        with np.errstate(all="ignore"):  # what is not finite is refused
            moved = self.moved(Q)
            if not system.m:
                return moved
            f = system.pointwise("constraint")(moved, tr.mesh.nodes[:, None], problem.packed)[0]
        if not np.max(np.abs(f) / tr.row_units) <= ON_CONSTRAINT:
            raise ValueError(
                f"expected a path on the constraint surface near q + alpha eta, found none for "
                f"alpha = {alpha}; try a smaller alpha"
            )
        return moved

    def moved(self, Q: Array) -> Array:
        """Return coordinates (K, n) moved onto the constraints, and the ends onto their surfaces.

        Raises ValueError where an end is not near its surface.
        """
        tr, problem = self.form.tr, self.form.tr.problem
        if problem.system.m:
            Q = project(tr, Q)
        for k, event in enumerate(problem.surfaces):
            if event is not None:
                t = tr.mesh.boundaries[[-k]]
                end = onto(problem, event, Q[[-k]], t, tr.lengths)[0]
                if not np.isfinite(end).all():
                    raise ValueError(
                        "expected the varied path to end near the surface at t = "
                        f"{t[0]:.6g}, found no point of it there; try a smaller variation"
                    )
                Q = Q.copy()
                Q[-k] = end
        return Q


def variation(
    solution: Solution, eta: Path | Callable[[Array], ArrayLike], *, unit: ArrayLike = 1.0
) -> Variation:
    """Return S(alpha) along q + alpha eta, with its first two derivatives at alpha = 0.

    Parameters
    ----------
    solution : Solution
        The path q.
    eta : Path or callable
        The variation, (n, K) for K times, in the coordinates' units; zero where the events pin
        the path. Modes of `index.second_variation` are such paths.
    unit : float or (n,) array
        Units of the coordinates that decide, with constraints, which part of eta is along the
        surface: one where all coordinates have the same unit.

    Raises
    ------
    ValueError
        If eta does not vanish where events pin the path, close with a closed path or fit the
        coordinates, or the system has non-conservative forces: its paths make no functional
        stationary.

    References
    ----------
    *Competitive Physics: Mechanics and Waves* (2018), section 12.2, p. 624; Gelfand and Fomin,
    *Calculus of Variations* (1963), section 24.

    Examples
    --------
    >>> from actionopt import scenes, solve
    >>> problem = scenes.get("oscillator", duration=2.0).problem
    >>> S = variation(solve(problem), lambda t: [t * (2.0 - t)])
    >>> abs(S.first) < 1e-12, bool(S(0.1) > S(0.0))
    (True, True)
    """
    problem = question(solution)
    if not callable(eta):
        raise ValueError(
            f"expected a Path or a callable of times that returns (n, K), found {eta!r} as eta"
        )
    mesh, known = resolve_eta(solution.mesh, eta), solution.discrete
    at = known.on(mesh, known.multipliers(mesh.nodes)).polish()
    units = numbers(unit, "the unit")
    if not are_units(units, problem.system.n):
        raise ValueError(
            f"expected one positive unit, or one of each of {problem.system.n} coordinates, found "
            f"{unit!r}"
        )
    found = form(at, np.broadcast_to(units, (problem.system.n,)), through=True)
    return Variation(found, at.lam, Path(mesh, _allowed_part(found, Path.interpolate(eta, mesh)).T))


def resolve_eta(mesh: Mesh, eta) -> Mesh:
    """Return the mesh with elements halved until it resolves eta as well."""
    for _ in range(KINK_HALVINGS):
        values = Path.interpolate(eta, mesh).values.T
        size = float(np.max(np.abs(values))) or 1.0
        coarse = resolution(mesh, values, np.full(values.shape[1], size)).omitted > ETA_RESOLUTION
        if not coarse.any():
            break
        mesh = mesh.divide(np.where(coarse, 2, 1))
    return mesh


def _allowed_part(form: Form, eta: Path) -> Array:
    """Return the part of eta that events and constraints allow at the nodes, (K, n)."""
    problem: Problem = form.tr.problem
    names, values = problem.system.coordinates, eta.values.T
    if values.shape[1] != len(names):
        raise ValueError(f"expected eta of {len(names)} coordinates, found {values.shape[1]}")
    size = np.max(np.abs(values))
    ends = ((0, problem.start), (-1, problem.end))
    for k, found in (*ends, *zip(form.passed, problem.through, strict=True)):
        event = (problem.surfaces[k] if k in (0, -1) else None) or found
        for i in event.pinned:
            if abs(values[k, i]) > PINNED_ETA * size:
                raise ValueError(
                    f"expected eta({found.t}) = 0 in {names[i]}, which the event pins, found "
                    f"{values[k, i]:.3g}; multiply eta by a function that vanishes there"
                )
    if form.closed:
        open_by = np.abs(values[-1] - values[0, list(problem.order)])
        if np.any(open_by > PINNED_ETA * size):
            i = int(np.argmax(open_by))
            raise ValueError(
                f"expected eta(t1) = eta(t0) for a path that closes, found that {names[i]} differs "
                f"by {open_by[i]:.3g}"
            )
    a = np.einsum("knr,kn->kr", form.basis, values / form.units)
    for k, count in ((0, form.pinned[0]), (-1, form.pinned[1]), *form.passed.items()):
        a[k, :count] = 0.0
    return form.units * np.einsum("knr,kr->kn", form.basis, a)
