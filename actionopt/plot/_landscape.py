"""The action as a landscape over two modes: the true path at the bottom of a bowl, or on a pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from actionopt.analysis.solution import Solution
from actionopt.analysis.variation import variation
from actionopt.discrete.projection import project
from actionopt.plot._modes import both_ways, directions
from actionopt.plot._slices import LOWEST
from actionopt.plot._style import (
    EVENT,
    NONE,
    SIGNED,
    Units,
    colour_bar,
    heading,
    label,
    new_figure,
    on,
    signed,
    styled,
)
from actionopt.tools.types import Array

LEVELS = 14  # contours from 0 to the largest
CLOSER = 1.5  # power by which the points of the map crowd in the middle, where S is flat
ABOVE = 2.5  # times the most along either mode: higher is no part of the bowl, but a singularity
SIZE = (5.8, 4.2)  # of one map


@dataclass(frozen=True, eq=False)
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


def landscape_data(solution: Solution, reach: float = 0.5, count: int = 35) -> Landscape:
    """Return the action over the two modes that tell most.

    Raises ValueError for non-conservative forces, or for a path with a single variation.
    """
    values, modes = directions(solution, LOWEST)
    chosen = both_ways(values)
    if len(chosen) < 2:
        raise ValueError("expected a path with two independent variations, found one; try `slices`")
    S = variation(solution, modes[chosen[0]])
    tr, Q = S.form.tr, S.form.at.Q
    first, second = (modes[k](tr.mesh.nodes).T for k in chosen)
    even = np.linspace(-1, 1, count)
    steps = reach * np.sign(even) * np.abs(even) ** CLOSER
    rise = np.empty((count, count))
    for i, b in enumerate(steps):
        for j, a in enumerate(steps):
            moved = Q + a * first + b * second
            if tr.problem.system.m:
                moved = project(tr, moved)
            rise[i, j] = tr.action_and_gradient(moved)[0]
    rise -= tr.action_and_gradient(Q)[0]
    return Landscape(steps, steps, rise, (chosen[0], chosen[1]))


def landscape(
    solution: Solution, ax: Axes | None = None, *, reach: float = 0.5, units: Units = NONE
) -> Axes:
    """Draw S - S* over two modes as a contour map, the stationary path in its middle."""
    data = landscape_data(solution, reach)
    with styled():
        ax = on(ax, figsize=SIZE)
        middle = data.rise.shape[0] // 2
        along = np.abs(np.concatenate([data.rise[middle], data.rise[:, middle]]))
        reach = min(float(np.nanmax(np.abs(data.rise))), ABOVE * float(np.nanmax(along))) or 1.0
        norm, even = signed(reach), np.linspace(-1, 1, 2 * LEVELS + 1)
        levels = reach * even * np.abs(even)
        ax.contourf(data.a, data.b, data.rise, levels, cmap=SIGNED, norm=norm, extend="both")
        lines = ax.contour(
            data.a, data.b, data.rise, levels[::2], colors="white", linewidths=0.6, linestyles="-"
        )
        lines.set_alpha(0.6)
        if data.rise.min() < 0 < data.rise.max():
            ax.contour(data.a, data.b, data.rise, [0.0], colors="black", linewidths=1.2)
        ax.plot(0, 0, **EVENT)
        colour_bar(ax, data.rise, norm, SIGNED, label("$S - S^*$", units.action))
        ax.set(
            xlabel=f"mode {data.modes[0] + 1} (of the path's size)",
            ylabel=f"mode {data.modes[1] + 1} (of the path's size)",
            aspect="equal",
        )
        ax.grid(False)
        ax.set_title(f"{heading(solution)}: {solution.kind}, index {solution.morse_index}")
    return ax


def landscapes(
    solutions: Sequence[Solution], axes: Sequence[Axes] | None = None, *, units: Units = NONE
) -> list[Axes]:
    """Draw the landscapes of several solutions side by side."""
    count = len(solutions)
    if not count:
        raise ValueError("expected at least one solution, found none")
    with styled():
        if axes is None:
            size = (SIZE[0] * count, SIZE[1])
            axes = list(new_figure(figsize=size).subplots(1, count, squeeze=False).ravel())
        return [landscape(s, ax, units=units) for s, ax in zip(solutions, axes, strict=True)]
