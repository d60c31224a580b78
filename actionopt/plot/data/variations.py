"""The action around a path: the lowest modes of d2S, and S along them and over them.

Modes and variations are in the path's own size, how far each coordinate ranges.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.quadratic.index import inertia_of
from actionopt.analysis.quadratic.second_variation import form
from actionopt.analysis.solution import Solution
from actionopt.analysis.spectra.conjugate import conjugate_points
from actionopt.analysis.spectra.modes import lowest, second_variation
from actionopt.analysis.spectra.variation import variation
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.course import check_whole
from actionopt.mechanics.question.problem import Event
from actionopt.plot.data.along import CURVE_TIMES, times
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.latest import latest
from actionopt.tools.blas import one_thread
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

BUNDLE_MODES = 3  # of a bundle
CROWDING_POWER = 1.5  # power by which the points of the map crowd in the middle, where S is flat
SPECTRUM_DEGREE, SPECTRUM_ELEMENTS = 8, 12  # of the meshes of a spectrum
SHORTEST_SPAN = 0.12  # of the duration: the kinetic part alone tells below


def sizes(solution: Solution) -> Array:
    """Return how far each coordinate ranges along the path, (n,): units to vary it by."""
    q = solution(times(solution, 201))
    span, size = np.ptp(q, axis=1), np.max(np.abs(q), axis=1)
    span = np.where(span > 1e-6 * np.max(size, initial=0.0), span, size)
    # What is zero but for round-off has the size of its events.
    return np.where(span > 1e-12 * np.max(size), span, solution.problem.scales)


def directions(solution: Solution, count: int = 2) -> tuple[Array, list[Path]]:
    """Return the lowest eigenvalues of d2S, (count,), and modes that reach 1 in units of `sizes`.

    Each mode's sign makes its largest displacement positive. Raises ValueError as
    `index.second_variation` does.
    """
    units = sizes(solution)
    found = second_variation(solution, count, units=units)
    modes = []
    for mode in found.modes:
        shares = mode.values / units[:, None]
        largest = shares.ravel()[np.argmax(np.abs(shares))]
        modes.append(Path(mode.mesh, mode.values / largest))
    return found.eigenvalues, modes


def telling(solution: Solution, count: int = 2) -> tuple[list[int], list[Path]]:
    """Return which `count` modes tell most, and the modes that these numbers are of.

    The lowest, but the last of them is one that raises S: the action is never a maximum.
    """
    falling = solution.inertia.index + solution.inertia.nullity
    values, modes = directions(solution, max(count, falling + 1))
    return both_ways(values, count), modes


def both_ways(eigenvalues: Array, count: int = 2) -> list[int]:
    """Return the numbers of the lowest eigenvalues, the last one positive if there is one.

    >>> both_ways(np.array([-2.0, -1.0, 3.0])), both_ways(np.array([1.0, 2.0]))
    ([0, 2], [0, 1])
    """
    up, last = np.flatnonzero(eigenvalues > 0), min(count, eigenvalues.size) - 1
    return [*range(last), max(last, int(up[0])) if up.size else last]


@immutable
class Bundle:
    """Varied paths at K times.

    Attributes
    ----------
    t : (K,) array
    q : (n, K) array
        The stationary path.
    varied : (B, n, K) array
        Its neighbours, between the same events.
    rise : (B,) array
        S - S* of each.
    """

    t: Array
    q: Array
    varied: Array
    rise: Array

    __repr__ = one_line


@check_arguments
@latest
def bundle_data(solution: Solution, count: int = 8, size: float = 0.25) -> Bundle:
    """Return neighbours along the lowest modes of d2S, `count` a mode.

    These are the three lowest, or where all three lower S the two lowest and the first that
    raises it. The neighbours are displaced by at most `size`, in units of how far the
    coordinates range. Raises ValueError for non-conservative forces, which leave no functional
    to compare.
    """
    chosen, modes = telling(solution, BUNDLE_MODES)
    t = times(solution, CURVE_TIMES // 2)
    varied, rise = [], []
    for mode in (modes[k] for k in chosen):
        S = variation(solution, mode)
        for alpha in np.linspace(-size, size, count):
            try:
                path, action = S.path(alpha), float(S(alpha))
            except ValueError:  # too far from the constraint surface
                continue
            varied.append(path(t))
            rise.append(action - float(S(0.0)))
    _check_finite(rise, "size", size)
    return Bundle(t, solution(t), np.array(varied), np.array(rise))


@immutable
class Slice:
    """S along q + alpha eta at K values of alpha.

    Attributes
    ----------
    alpha : (K,) array
    action : (K,) array
        S(alpha); NaN where no varied path on the constraint surface is near.
    parabola : (K,) array
        S(0) + d2S[eta] alpha^2 / 2.
    second : float
        The second variation d2S[eta].
    """

    alpha: Array
    action: Array
    parabola: Array
    second: float

    __repr__ = one_line


@check_arguments
def slice_data(solution: Solution, eta: Path, reach: float = 1.0, count: int = 61) -> Slice:
    """Return S(alpha) along `eta` for |alpha| <= reach. Raises ValueError as `variation` does."""
    S = variation(solution, eta)
    alpha = np.linspace(-reach, reach, count)
    action = np.full(count, np.nan)
    for k, a in enumerate(alpha):
        try:
            action[k] = S(a)
        except ValueError:
            continue
    with np.errstate(over="ignore"):
        parabola = float(S(0.0)) + S.second * alpha**2 / 2
    _check_finite(parabola, "reach", reach)
    return Slice(alpha, action, parabola, S.second)


def _check_finite(values: ArrayLike, name: str, given: float) -> None:
    """Raise ValueError if varied paths go so far that numbers overflow."""
    if not np.all(np.isfinite(values)):
        raise ValueError(f"expected {name} with finite actions, found {given:g}; try a smaller one")


@immutable
class Landscape:
    """S - S* over q + a eta_1 + b eta_2.

    Attributes
    ----------
    a, b : (K,) arrays
        Sizes of the two modes, in units of how far the coordinates range.
    rise : (K, K) array
        S - S*, row i for b[i].
    modes : (int, int)
        Which modes of d2S, counted from 0.
    """

    a: Array
    b: Array
    rise: Array
    modes: tuple[int, int]

    __repr__ = one_line


@check_arguments
@latest
def landscape_data(solution: Solution, reach: float = 0.5, count: int = 35) -> Landscape:
    """Return the action over the two modes that tell most.

    Raises ValueError for non-conservative forces, or for a path with a single variation.
    """
    chosen, modes = telling(solution)
    if len(chosen) < 2:
        raise ValueError("expected a path with two independent variations, found one; try `slices`")
    S = variation(solution, modes[chosen[0]])
    tr, Q = S.form.tr, S.form.at.Q
    first, second = (modes[k](tr.mesh.nodes).T for k in chosen)
    even = np.linspace(-1, 1, count)
    steps = reach * np.sign(even) * np.abs(even) ** CROWDING_POWER
    rise = np.empty((count, count))
    for i, b in enumerate(steps):
        for j, a in enumerate(steps):
            rise[i, j] = np.nan
            with suppress(ValueError):  # far from the surface on which it ends
                moved = S.moved(Q + a * first + b * second)
                rise[i, j] = tr.value(moved)
    rise -= tr.value(Q)
    return Landscape(steps, steps, rise, (chosen[0], chosen[1]))


def over_modes(solution: Solution, t: Array, q: Array) -> Array:
    """Return where paths q (R, n, K) at the times t stand on the landscape, (R, 2).

    That is how much of its two modes their deviation from the path has, by least squares.
    """
    chosen, modes = telling(solution)
    shapes = np.stack([modes[k](t).ravel() for k in chosen], axis=1)
    away = (q - solution(t)).reshape(len(q), -1)
    return np.linalg.lstsq(shapes, away.T, rcond=None)[0].T


@immutable
class Spectrum:
    """Eigenvalues of d2S on the first part of a path, as a function of its duration.

    Attributes
    ----------
    durations : (K,) array
    eigenvalues : (count, K) array
        Times the duration squared, in units of pi^2 times the kinetic part's mean: the k-th of
        a free particle is k^2 at any duration.
    index : (K,) array of int
    conjugate : (C,) array
        Conjugate times less the start's, each as often as its multiplicity.
    """

    durations: Array
    eigenvalues: Array
    index: Array
    conjugate: Array

    __repr__ = one_line


@check_arguments
@latest
@one_thread
def spectrum_data(solution: Solution, count: int = 3, points: int = 48) -> Spectrum:
    """Return the lowest eigenvalues of the path's first parts.

    A part of a stationary path is stationary, so nothing is solved. Raises ValueError for
    non-conservative forces or events with free coordinates.
    """
    problem, t0 = solution.problem, solution.problem.start.t
    check_whole(problem, "how the eigenvalues change with the end time")
    if len(problem.start.pinned) + len(problem.end.pinned) < 2 * problem.system.n:
        raise ValueError(
            "expected events at finite times that give all coordinates, found one that does not; "
            "try `slices`"
        )
    units = sizes(solution)
    durations = np.linspace(SHORTEST_SPAN, 1.0, points) * problem.duration
    values, index = np.full((count, points), np.nan), np.zeros(points, dtype=int)
    for k, T in enumerate(durations):
        mesh = Mesh.uniform(t0, t0 + T, SPECTRUM_ELEMENTS, SPECTRUM_DEGREE)
        Q = solution(mesh.nodes).T
        part = problem.replace(start=Event(t0, Q[0]), end=Event(t0 + T, Q[-1]))
        lam = solution.multipliers(mesh.nodes).T if problem.system.m else None
        found = form(DiscretePath.of(part, Path(mesh, Q.T), lam, units), units)
        kinetic = float(np.mean(found.legendre))
        lowest_values = lowest(found, count)[0] * T**2 / (np.pi**2 * kinetic)
        values[: lowest_values.size, k] = lowest_values
        index[k] = inertia_of(found).index
    foci = [p.t - t0 for p in conjugate_points(solution) for _ in range(p.multiplicity)]
    return Spectrum(durations, values, index, np.array(foci))
