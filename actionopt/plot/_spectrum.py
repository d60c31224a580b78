"""The lowest eigenvalues of d2S as a path grows: each crosses zero at a conjugate time."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from actionopt.analysis.conjugate import conjugate_points
from actionopt.analysis.index import inertia_of
from actionopt.analysis.modes import lowest
from actionopt.analysis.second_variation import form
from actionopt.analysis.solution import Solution
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.mechanics.problem import Event
from actionopt.plot._modes import sizes
from actionopt.plot._style import COLOURS, GREY, NONE, Units, heading, label, legend, on, styled
from actionopt.tools.types import Array

DEGREE = 8
ELEMENTS = 12
NARROW = 0.02  # of the duration: an arc too short for a number
SHORTEST = 0.12  # of the duration: the kinetic part alone tells below


@dataclass(frozen=True, eq=False)
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


def spectrum_data(solution: Solution, count: int = 3, points: int = 60) -> Spectrum:
    """Return the lowest eigenvalues of the path's first parts.

    A part of a stationary path is stationary, so nothing is solved. Raises ValueError for
    non-conservative forces or events with free coordinates.
    """
    problem, t0 = solution.problem, solution.problem.start.t
    if len(problem.start.pinned) + len(problem.end.pinned) < 2 * problem.system.n:
        raise ValueError("expected events that pin all coordinates, found a free one; try `slices`")
    units = sizes(solution)
    durations = np.linspace(SHORTEST, 1.0, points) * problem.duration
    values, index = np.full((count, points), np.nan), np.zeros(points, dtype=int)
    for k, T in enumerate(durations):
        mesh = Mesh.uniform(t0, t0 + T, ELEMENTS, DEGREE)
        Q = solution(mesh.nodes).T
        part = problem.replace(start=Event(t0, Q[0]), end=Event(t0 + T, Q[-1]))
        lam = solution.multipliers(mesh.nodes).T if problem.system.m else None
        found = form(DiscretePath.of(part, Path(mesh, Q.T), lam, units), units)
        kinetic = float(np.mean(found.legendre))
        lowest_values = lowest(found, count)[0] * T**2 / (np.pi**2 * kinetic)
        values[: lowest_values.size, k] = lowest_values
        index[k] = inertia_of(found).index
    times = [p.t - t0 for p in conjugate_points(solution) for _ in range(p.multiplicity)]
    return Spectrum(durations, values, index, np.array(times))


def spectrum(
    solution: Solution, ax: Axes | None = None, *, count: int = 3, units: Units = NONE
) -> Axes:
    """Draw the lowest eigenvalues against duration; dotted lines are the conjugate times.

    Above each arc between them stands the index.
    """
    data = spectrum_data(solution, count)
    with styled():
        ax = on(ax)
        for k, row in enumerate(data.eigenvalues):
            ax.plot(data.durations, row, color=COLOURS[k], linewidth=2.2, label=f"mode {k + 1}")
        ax.axhline(0, color="black", linewidth=1)
        what = "conjugate times"
        for t in np.unique(data.conjugate):
            ax.axvline(t, color=GREY, linestyle=":", linewidth=1.4, label=what)
            what = None
        low, high = float(np.nanmin(data.eigenvalues)), float(np.nanmax(data.eigenvalues))
        low = min(low, -0.08 * high)  # zero is seen, and room for the words
        ax.set_ylim(low - 0.04 * (high - low), high + 0.1 * (high - low))
        _number_arcs(ax, data)
        ax.set(
            xlabel=label("duration $T$", units.time),
            ylabel=r"eigenvalue of $\delta^2S$  ($\times\,T^2/\pi^2M$)",
        )
        ax.set_title(f"{heading(solution)}: index {data.index[-1]} at the full duration")
        legend(ax, beside=True)
    return ax


def _number_arcs(ax: Axes, data: Spectrum) -> None:
    """Write the index at the top of each arc between conjugate times."""
    ends = [data.durations[0], *np.unique(data.conjugate), data.durations[-1]]
    for k, (begin, end) in enumerate(pairwise(ends)):
        if end - begin < NARROW * ends[-1]:
            continue
        index = int(np.sum(data.conjugate <= begin))
        ax.text(
            (begin + end) / 2, 0.98, f"index {index}" if k == 0 else f"{index}", color=GREY,
            fontsize="small", ha="center", va="top", transform=ax.get_xaxis_transform(),
        )  # fmt: skip
