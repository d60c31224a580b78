"""Pictures of a solution: its path, the forward integration over it, and how far they are apart.

Then all the paths between two events, and the mesh of one. Every function takes axes or makes
them, returns them, and shows nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from actionopt.analysis.solution import Solution
from actionopt.plot import _style as style
from actionopt.plot._names import NONE, Units, label, symbol
from actionopt.plot.data.along import curves, family_data, followed, mesh_data, times

BADGE: Any = {"boxstyle": "circle,pad=0.2", "edgecolor": style.GREY}
BOUND: Any = {"color": style.GREY, "linewidth": 1.2}


@style.styled
def overview(
    solution: Solution, axes: Sequence[Axes] | None = None, *, units: Units = NONE
) -> tuple[Axes, Axes]:
    """Draw `paths` above `deviation`, on two axes or in a figure of their own."""
    if axes is None:
        axes = style.new_figure(figsize=(6.4, 6.4)).subplots(2, height_ratios=(3, 2))
    above, below = axes  # type: ignore[misc]
    return paths(solution, above, units=units), deviation(solution, below, units=units)


@style.styled
def paths(
    solution: Solution, ax: Axes | None = None, *, compare: bool = True, units: Units = NONE
) -> Axes:
    """Draw the path, and unless `compare` is False the forward integration over it.

    Cartesian coordinates, pairs named x and y with the same ending, are drawn as orbits in the
    plane; any others against time.
    """
    names, t = solution.problem.system.coordinates, times(solution)
    ax = style.on(ax)
    for x, y, what in style.traces(names, t, solution(t)):
        ax.plot(x, y, **style.PATH, label=what)
    if compare:
        forward = followed(solution, t)
        style.draw(ax, names, t, forward, None, "forward integration", **style.forward())
    style.frame(ax, solution, units)
    S = f"{style.number(solution.action, 8)} {units.action}".rstrip()
    ax.set_title(f"{style.heading(solution)}: $S$ = {S}")
    style.legend(ax)
    return ax


@style.styled
def deviation(solution: Solution, ax: Axes | None = None, *, units: Units = NONE) -> Axes:
    """Draw the deviation of the forward integration against time, on a logarithmic axis.

    With it the solution's error estimate and the uncertainty of the integration itself: below
    the latter the deviation means nothing.
    """
    data, ax = curves(solution), style.on(ax)
    seen = np.where(data.deviation > 0, data.deviation, np.nan)
    ax.semilogy(data.t, seen, color=style.ink(), linewidth=1.2, label="deviation")
    for value, look, text in (
        (solution.error, "--", "error estimate"),
        (solution.compare().reference_error, ":", "uncertainty of integration"),
    ):
        if np.isfinite(value) and value > 0:
            ax.axhline(value, **BOUND, linestyle=look, label=text)
    ax.set(xlabel=label("time $t$", units.time), ylabel="relative deviation")
    style.legend_above(ax, 3)
    return ax


@style.styled
def family(
    solutions: Iterable[Solution],
    ax: Axes | None = None,
    *,
    coordinate: int | None = None,
    units: Units = NONE,
) -> Axes:
    """Draw all the paths between two events, coloured by action and labelled by index.

    `solutions` is what `solve_all` returns, or any solutions between the same events. Orbits for
    Cartesian coordinates, else one `coordinate` against time.
    """
    found = list(solutions)
    t, paths, actions = family_data(found)
    system = found[0].problem.system
    names, forced = system.coordinates, system.structure.forced
    place = style.shown(found[0], coordinate)
    norm = Normalize(actions.min(), actions.max() if np.ptp(actions) else actions.min() + 1.0)
    ax = style.on(ax)
    for k, (solution, q, S) in enumerate(zip(found, paths, actions, strict=True)):
        style.draw(ax, names, t, q, place, color=style.unsigned()(norm(S)), linewidth=2.4)
        style.frame(ax, solution, units, place)  # a path with windings has an end of its own
        if forced:
            continue
        rows = style.traces(names, t, q, place)
        x, y, _ = max(rows, key=lambda row: np.hypot(np.ptp(row[0]), np.ptp(row[1])))
        # Labels stand at different times, so that they do not lie on one another.
        at = int(t.size * (0.3 + 0.4 * (k + 0.5) / len(found)))
        ax.annotate(
            str(solution.morse_index), (x[at], y[at]), ha="center", va="center", zorder=6,
            fontsize="small",
            bbox={**BADGE, "facecolor": style.paper()},
        )  # fmt: skip
    if len(found) > 1:
        text = label("action $S$", units.action)
        style.colour_bar(ax, actions, norm, style.unsigned(), text)
    many = "1 path" if len(found) == 1 else f"{len(found)} paths"
    numbered = "" if forced else ", numbered by index"
    ax.set_title(f"{style.heading(found[0])}: {many}{numbered}")
    return ax


@style.styled
def mesh(
    solution: Solution, axes: Sequence[Axes] | None = None, *, units: Units = NONE
) -> tuple[Axes, Axes]:
    """Draw the path with its nodes, and below it the degree of each element."""
    boundaries, degrees = mesh_data(solution)
    names = solution.problem.system.coordinates
    t, nodes = times(solution), solution.mesh.nodes
    if axes is None:
        figure = style.new_figure(figsize=(6.4, 5.2))
        axes = figure.subplots(2, sharex=True, height_ratios=(3, 2))
    above, below = axes  # type: ignore[misc]
    for i, (name, q, dots) in enumerate(zip(names, solution(t), solution(nodes), strict=True)):
        look = style.strand(i)
        above.plot(t, q, **{**style.PATH, "linewidth": 2.5}, **look, label=symbol(name))
        above.plot(nodes, dots, ".", color=look["color"], markersize=4)
    below.stairs(degrees, boundaries, fill=True, color=style.BLUE, alpha=0.25)
    below.stairs(degrees, boundaries, color=style.BLUE, linewidth=1.5)
    for ax in (above, below):
        for b in boundaries:
            ax.axvline(b, color=style.PALE, linewidth=0.6, zorder=1)
        ax.margins(x=0)
        ax.grid(visible=False, axis="x")
    below.set_ylim(0, 1.15 * degrees.max())
    below.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    below.set(xlabel=label("time $t$", units.time), ylabel="degree")
    above.set_ylabel(label("coordinates", *map(units.coordinate, names)))
    style.legend(above, beside=True)
    error = style.number(solution.error, 1)
    above.set_title(f"{style.heading(solution)}: {degrees.size} elements, error about {error}")
    return above, below
