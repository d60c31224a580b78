"""T and V against time: the action is the area under T less the area under V."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from actionopt.analysis.solution import Solution
from actionopt.plot._style import (
    BLUE,
    COUNT,
    NONE,
    VERMILION,
    Units,
    heading,
    label,
    legend,
    legend_above,
    new_figure,
    number,
    on,
    strand,
    styled,
    symbol,
    times,
)
from actionopt.tools.types import Array

FLAT = 1e-6  # change relative to the size of what is drawn that is no change


@dataclass(frozen=True, eq=False)
class Energies:
    """Kinetic and potential energy at K times, (K,): T is even in the velocities, V = T - L.

    T vanishes at rest. In a magnetic field or moving coordinates, where L is partly odd in the
    velocities, V is the potential that depends on velocity (Goldstein, 3rd ed., section 1.5).
    """

    t: Array
    kinetic: Array
    potential: Array


def energies_data(solution: Solution, count: int = COUNT) -> Energies:
    """Return T and V along the path, each (count,), at equal times."""
    t, problem = times(solution, count), solution.problem
    q, v = solution(t), solution.velocity(t)
    L, back, rest = (
        problem.system.lagrangian(q, sign * v, t, parameters=problem.parameters)
        for sign in (1, -1, 0)
    )
    T = (L + back) / 2 - rest
    return Energies(t, T, T - L)


def energies(solution: Solution, ax: Axes | None = None, *, units: Units = NONE) -> Axes:
    """Draw T and V, and between them the areas whose difference is S."""
    data = energies_data(solution)
    V_name = "V" if solution.problem.system.energy_is_mechanical else "U(\\dot q)"
    T, V = data.kinetic, data.potential
    with styled():
        ax = on(ax)
        for where, colour, text in (
            (T >= V, BLUE, "adds to $S$"),
            (V > T, VERMILION, "takes from $S$"),
        ):
            if where.any():
                ax.fill_between(
                    data.t, T, V, where=where, interpolate=True, color=colour, alpha=0.22,
                    linewidth=0, label=text,
                )  # fmt: skip
        ax.plot(data.t, T, color=BLUE, linewidth=2.2, label="$T$")
        ax.plot(
            data.t, V, color=VERMILION, linewidth=2.2, linestyle=(0, (6, 2)), label=f"${V_name}$"
        )
        ax.set(xlabel=label("time $t$", units.time), ylabel=label("energy", units.energy))
        S = f"{number(solution.action)} {units.action}".rstrip()
        ax.set_title(f"{heading(solution)}: $S = \\int (T - {V_name})\\,dt$ = {S}")
        ax.margins(x=0)
        legend_above(ax, 4)
    return ax


@dataclass(frozen=True, eq=False)
class Conserved:
    """Energy function and momenta at K times.

    Attributes
    ----------
    t, energy : (K,) arrays
    momentum : (n, K) array
    flat : tuple of bool
        Whether H, and each momentum, stays the same.
    """

    t: Array
    energy: Array
    momentum: Array
    flat: tuple[bool, ...]


def conserved_data(solution: Solution, count: int = COUNT) -> Conserved:
    """Return H and p along the path at equal times, and which of them are constant."""
    t = times(solution, count)
    H, p, v = solution.energy(t), solution.momentum(t), solution.velocity(t)
    work = np.max(np.abs(p * v))  # v . p is the part of H that momenta make up
    speeds = np.maximum(np.max(np.abs(v), axis=1), 1e-300)
    sizes = [max(work, np.max(np.abs(H))), *np.maximum(work / speeds, np.max(np.abs(p), axis=1))]
    rows = [H, *p]
    flat = [bool(np.ptp(x) <= FLAT * size) for x, size in zip(rows, sizes, strict=True)]
    return Conserved(t, H, p, tuple(flat))


def conserved(
    solution: Solution, axes: Sequence[Axes] | None = None, *, units: Units = NONE
) -> tuple[Axes, Axes]:
    """Draw the energy above the momenta; what is conserved is a broad straight line."""
    data = conserved_data(solution)
    names = solution.problem.system.coordinates
    with styled():
        pair = new_figure(figsize=(6.4, 5.4)).subplots(2, sharex=True) if axes is None else axes
        above, below = pair
        _constant(above, data.t, data.energy, data.flat[0], "$H$", strand(0))
        for i, name in enumerate(names):
            what = f"$p_{{{symbol(name)[1:-1]}}}$"
            _constant(below, data.t, data.momentum[i], data.flat[i + 1], what, strand(i + 1))
        above.set_ylabel(label("energy function $H$", units.energy))
        used = {units.momentum(name) for name in names}
        below.set_ylabel(label("momenta $p$", ", ".join(sorted(used)) if any(used) else ""))
        below.set_xlabel(label("time $t$", units.time))
        above.set_title(f"{heading(solution)}: energy and momenta along the path")
        for ax in (above, below):
            ax.margins(x=0)
            _no_magnified_rounding(ax)
            legend(ax, beside=True)
    return above, below


def _constant(ax: Axes, t: Array, values: Array, flat: bool, what: str, look: Any) -> None:
    text = f"{what}, conserved" if flat else what
    ax.plot(t, values, **look, linewidth=3.2 if flat else 1.6, label=text)


def _no_magnified_rounding(ax: Axes) -> None:
    """Leave room around lines that are all but constant."""
    low, high = ax.get_ylim()
    size = max(abs(low), abs(high)) or 1.0
    if high - low < 0.2 * size:
        middle = (low + high) / 2
        ax.set_ylim(middle - 0.25 * size, middle + 0.25 * size)
