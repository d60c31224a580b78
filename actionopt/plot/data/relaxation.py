"""A wild path between two events relaxes to the true one, or runs away from it.

Both methods go a share of the way to where the gradient of the discrete action would vanish if it
changed as B says,

    q <- q - share B^-1 grad S.

Descent measures steps by B = K + W / tau^2, the inner product int (v . M v + q . M q / tau^2) dt of
displacements: the gradient in this (Sobolev) metric is a smooth path whatever the mesh, and S falls
along it (Neuberger, *Sobolev Gradients and Differential Equations* (2010), chapter 4). It leads to
minima of S only: next to a saddle what is a way down grows, and S falls below the true path's.
Newton's method takes B = d2S itself and so reaches the true path whether it is a minimum or not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.solution import Solution
from actionopt.analysis.spectra.variation import resolve_eta
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.borders import times_of
from actionopt.discrete.matrices.factors import Factors, diagonal
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.newton import follow
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.trial import weights
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

METHODS = ("descent", "newton")
FIRST_SHARE, GROWTH = 0.08, 1.08  # the first share, and what each next one is larger by, up to 1
MEMORY = 0.2  # tau in parts of the duration: slower wiggles relax more slowly than fast ones
DECREASE = 1e-4  # share of the decrease that the gradient promises which a step must bring
SMALLEST_SHARE = 1e-6  # a smaller share of a step leads nowhere
RUN_AWAY = 3.0  # a path that has left the true one by this many times its size has run away
START_MISS = 1e-9  # of the coordinates' size, by which a start may miss the events
RELAXED = 1e-7  # residual, in parts of the first, at which the relaxation ends
START_WAVES, WILD = 8, 0.35  # waves of the start, and their size in parts of the coordinates'
RELAXATION_TIMES = 201  # times at which paths are kept


@immutable
class Relaxation:
    """R + 1 paths, the first one the start, and what changed from each to the next.

    Attributes
    ----------
    method : str
        "descent" or "newton".
    t : (K,) array
        Equal times.
    paths : (R + 1, n, K) array
    target : (n, K) array
        The true path.
    action, kinetic, potential : (R + 1,) arrays
        S, and the integrals of T and V over time: S is their difference. V = -L at rest.
    target_action : float
        S of the true path.
    residual : (R + 1,) array
        Root of the integral of |dL/dq - d/dt dL/dv|^2 over time, in units of the first: how far
        the path is from fulfilling the equations of motion.
    distance : (R + 1,) array
        Largest |q - target| in units of the largest |q| that the coordinate reaches.
    """

    method: str
    t: Array
    paths: Array
    target: Array
    action: Array
    kinetic: Array
    potential: Array
    target_action: float
    residual: Array
    distance: Array

    __repr__ = one_line

    @property
    def arrived(self) -> bool:
        """Whether the last path is all but the true one."""
        return bool(self.distance[-1] < 0.01 * max(1.0, self.distance[0]))


@check_arguments
def relaxation_data(
    solution: Solution,
    start: Path | Callable[[Array], ArrayLike] | None = None,
    *,
    method: str = "descent",
    steps: int = 120,
) -> Relaxation:
    """Relax the path `start` step by step; it stops early where it arrives or runs away.

    Parameters
    ----------
    solution : Solution
        The true path.
    start : Path or callable, optional
        A path between the same events, (n, K) for K times; the true one with waves on it by
        default. Events whose times or places were found keep them.
    method : str
        "descent" or "newton".
    steps : int

    Raises
    ------
    ValueError
        For another method or a start that misses the events; for non-conservative forces, which
        leave no action to relax, or constraints, which straight steps leave.

    Examples
    --------
    >>> from actionopt import scenes, solve
    >>> solution = solve(scenes.get("oscillator", duration=2.0).problem)
    >>> relaxation_data(solution).arrived
    True
    >>> solution = solve(scenes.get("oscillator", duration=4.0).problem)  # past the first focus
    >>> descent = relaxation_data(solution)
    >>> descent.arrived, relaxation_data(solution, method="newton").arrived
    (False, True)
    """
    system = solution.problem.system
    if method not in METHODS:
        raise ValueError(f"expected a method of {', '.join(METHODS)}, found {method!r}")
    system.check_order("a relaxation")
    system.check_free("a relaxation does not know contact")
    if system.m or system.structure.forced:
        what = "constraints" if system.m else "non-conservative forces"
        raise ValueError(
            f"expected a system without constraints and non-conservative forces, found {what}; "
            "write it in coordinates that need none"
        )
    start = wild(solution) if start is None else start
    mesh = resolve_eta(solution.mesh, start)
    tr = Transcription(solution.problem, mesh, solution.discrete.tr.lengths)
    first = Path.interpolate(start, mesh).values.T
    goal, z = follow(tr, tr.pack(solution(mesh.nodes).T)).z, tr.pack(first)
    missed = float(np.max(np.abs(tr.coordinates(z) - first) / tr.lengths))
    if not missed <= START_MISS:
        raise ValueError(
            "expected a start that joins the solution's events, found that it misses them by "
            f"{missed:.3g} of the coordinates' size"
        )
    return _relaxation_of(tr, _iterates(tr, z, goal, method, steps), goal, method)


def wild(solution: Solution) -> Callable[[Array], Array]:
    """Return a path with waves on it, the same ones always, between the solution's events."""
    lengths = solution.discrete.tr.lengths
    events = times_of(solution.problem)
    i, k = np.arange(lengths.size)[:, None], np.arange(1, START_WAVES + 1)
    shares = WILD * lengths[:, None] * np.cos(2.4 * k + 1.9 * i) / k**0.25

    def curve(t: Array) -> Array:
        leg = np.clip(np.searchsorted(events, t, "right") - 1, 0, len(events) - 2)
        s = (t - events[leg]) / np.diff(events)[leg]
        return solution(t) + shares @ np.sin(np.pi * np.outer(k, s))

    return curve


def _iterates(tr: Transcription, z: Array, goal: Array, method: str, steps: int) -> list[Array]:
    """Return the vectors of unknowns from z on, at most `steps` more."""
    visited, first = [z], float(np.linalg.norm(_weighted_residual(tr, z)))
    with np.errstate(all="ignore"):
        for k in range(steps):
            gradient = tr.gradient(z)
            try:
                B = metric(tr, z) if method == "descent" else tr.kkt(z)
                step = -Factors(tr.layout, B).solve(gradient)
            except np.linalg.LinAlgError:
                break
            share = min(1.0, FIRST_SHARE * GROWTH**k)  # short first, for the eye to follow
            if method == "descent":
                slope, action = float(gradient @ step), tr.action(z)
                while not tr.action(z + share * step) <= action + DECREASE * share * slope:
                    share /= 2
                    if share < SMALLEST_SHARE:
                        return visited
            z = z + share * step
            if not np.isfinite(tr.action(z)):
                break
            visited.append(z)
            left = float(np.linalg.norm(_weighted_residual(tr, z)))
            if left < RELAXED * first or np.max(np.abs(z - goal)) > RUN_AWAY:
                break
    return visited


def metric(tr: Transcription, z: Array) -> Array:
    """Return K + W / tau^2 at z stored as the KKT matrix is.

    W has the mean mass of each coordinate along the path on its diagonal, weighted as S is.
    """
    problem, n = tr.problem, tr.problem.system.n
    at = tr.coordinates(z)[tr.layout.node_of]
    M = problem.system.mass_matrix(
        at.T, tr.velocities(at).T, tr.times[:, 0], parameters=problem.parameters
    )
    masses = np.einsum("iik,k->i", M, tr.weight[:, 0]) / problem.duration
    node, coordinate = np.divmod(tr.layout.free, n)
    W = weights(tr)[node] * masses[coordinate] * tr.x_unit**2 / tr.action_unit
    return tr.kinetic(z) + diagonal(tr.layout, W / (MEMORY * problem.duration) ** 2)


def _weighted_residual(tr: Transcription, z: Array) -> Array:
    """Return dL/dq - d/dt dL/dv at the unknowns, times the root of their weights."""
    return tr.gradient(z) / np.sqrt(weights(tr)[tr.layout.free // tr.problem.system.n])


def _relaxation_of(tr: Transcription, visited: list[Array], goal: Array, method: str) -> Relaxation:
    problem, weight = tr.problem, tr.weight[:, 0]
    t = np.linspace(problem.start.t, problem.end.t, RELAXATION_TIMES)
    paths, energies = [], []
    for z in visited:
        Q = tr.coordinates(z)
        at = Q[tr.layout.node_of]
        q, v, times = at.T, tr.velocities(at).T, tr.times[:, 0]
        V = -problem.system.lagrangian(q, 0 * v, times, parameters=problem.parameters)
        L = problem.system.lagrangian(q, v, times, parameters=problem.parameters)
        energies.append((weight @ L, weight @ (L + V), weight @ V))
        paths.append(Path(tr.mesh, Q.T)(t))
    action, kinetic, potential = np.array(energies).T
    residual = np.array([np.linalg.norm(_weighted_residual(tr, z)) for z in visited])
    return Relaxation(
        method,
        t,
        np.array(paths),
        Path(tr.mesh, tr.coordinates(goal).T)(t),
        action,
        kinetic,
        potential,
        tr.action(goal) * tr.action_unit,
        residual / (residual[0] or 1.0),
        np.array([np.max(np.abs(z - goal), initial=0.0) for z in visited]),
    )
