"""All the paths between two events, and the mesh of one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from actionopt.analysis.solution import Solution
from actionopt.plot._style import (
    BLUE,
    BOX,
    COUNT,
    GREY,
    NONE,
    PALE,
    PATH,
    UNSIGNED,
    Units,
    colour_bar,
    frame,
    heading,
    label,
    legend,
    new_figure,
    number,
    on,
    shown,
    strand,
    styled,
    symbol,
    times,
    traces,
)
from actionopt.tools.types import Array


def family_data(solutions: Iterable[Solution], count: int = COUNT) -> tuple[Array, Array, Array]:
    """Return times (K,), paths (P, n, K) and actions (P,) of several solutions."""
    found = list(solutions)
    if not found:
        raise ValueError("expected at least one solution, found none")
    t = times(found[0], count)
    return t, np.array([s(t) for s in found]), np.array([s.action for s in found])


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
    names = found[0].problem.system.coordinates
    forced = found[0].problem.system.structure.forced
    place = shown(found[0], coordinate)
    norm = Normalize(actions.min(), actions.max() if np.ptp(actions) else actions.min() + 1.0)
    with styled():
        ax = on(ax)
        for k, (solution, q, S) in enumerate(zip(found, paths, actions, strict=True)):
            rows = traces(names, t, q, place)
            for x, y, _ in rows:
                ax.plot(x, y, color=UNSIGNED(norm(S)), linewidth=2.4)
            frame(ax, solution, units, place)  # a path with windings has an end of its own
            if forced:
                continue
            x, y, _ = max(rows, key=lambda row: np.hypot(np.ptp(row[0]), np.ptp(row[1])))
            # Labels stand at different times, so that they do not lie on one another.
            at = int(t.size * (0.3 + 0.4 * (k + 0.5) / len(found)))
            ax.annotate(
                str(solution.morse_index), (x[at], y[at]), ha="center", va="center", zorder=6,
                fontsize="small",
                bbox={**BOX, "boxstyle": "circle,pad=0.2", "alpha": 1.0, "edgecolor": GREY},
            )  # fmt: skip
        if len(found) > 1:
            colour_bar(ax, actions, norm, UNSIGNED, label("action $S$", units.action))
        many = "1 path" if len(found) == 1 else f"{len(found)} paths"
        ax.set_title(f"{heading(found[0])}: {many}{'' if forced else ', numbered by index'}")
    return ax


def mesh_data(solution: Solution) -> tuple[Array, Array]:
    """Return the element boundaries (N + 1,) and degrees (N,) of the adaptive mesh."""
    return np.array(solution.mesh.boundaries), np.array(solution.mesh.degrees)


def mesh(
    solution: Solution, axes: Sequence[Axes] | None = None, *, units: Units = NONE
) -> tuple[Axes, Axes]:
    """Draw the path with its nodes, and below it the degree of each element."""
    boundaries, degrees = mesh_data(solution)
    names = solution.problem.system.coordinates
    t, nodes = times(solution), solution.mesh.nodes
    with styled():
        if axes is None:
            axes = new_figure(figsize=(6.4, 5.2)).subplots(2, sharex=True, height_ratios=(3, 2))
        above, below = axes  # type: ignore[misc]
        for i, (name, q, dots) in enumerate(zip(names, solution(t), solution(nodes), strict=True)):
            look = strand(i)
            above.plot(t, q, **{**PATH, "linewidth": 2.5}, **look, label=symbol(name))
            above.plot(nodes, dots, ".", color=look["color"], markersize=4)
        below.stairs(degrees, boundaries, fill=True, color=BLUE, alpha=0.25)
        below.stairs(degrees, boundaries, color=BLUE, linewidth=1.5)
        for ax in (above, below):
            for b in boundaries:
                ax.axvline(b, color=PALE, linewidth=0.6, zorder=1)
            ax.margins(x=0)
            ax.grid(visible=False, axis="x")
        below.set_ylim(0, 1.15 * degrees.max())
        below.yaxis.set_major_locator(MaxNLocator(5, integer=True))
        below.set(xlabel=label("time $t$", units.time), ylabel="degree")
        used = sorted({units.coordinate(name) for name in names})
        above.set_ylabel(label("coordinates", ", ".join(used) if any(used) else ""))
        legend(above, beside=True)
        error = number(solution.error, 1)
        above.set_title(f"{heading(solution)}: {degrees.size} elements, error about {error}")
    return above, below
