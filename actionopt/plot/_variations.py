"""What S does around a path: its neighbours, slices, landscapes, and the spectrum of d2S."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from actionopt.analysis.solution import Solution
from actionopt.discrete.meshes.path import Path
from actionopt.plot import _style as style
from actionopt.plot._names import NO_UNITS, UnitNames, label
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.variations import (
    Landscape,
    bundle_data,
    landscape_data,
    slice_data,
    spectrum_data,
    telling,
)
from actionopt.tools.types import Array
from actionopt.tools.words import say

VARIATION_CONTOURS = 14  # contours from 0 to the largest
ABOVE = 2.5  # times the most along either mode: higher is no part of the bowl, but a singularity
MAP_SIZE = (5.8, 4.2)  # of one map
NARROW_ARC = 0.02  # of the duration: an arc too short for a number


@style.styled
@check_arguments
def bundle(
    solution: Solution,
    ax: Axes | None = None,
    *,
    coordinate: int | None = None,
    units: UnitNames = NO_UNITS,
    count: int = 8,
    size: float = 0.25,
) -> Axes:
    """Draw the stationary path among its neighbours, blue where S is lower, vermilion where higher.

    Orbits for Cartesian coordinates, else one `coordinate` against time.
    """
    at = style.coordinate_to_show(solution, coordinate)
    data, names = bundle_data(solution, count, size), solution.problem.system.coordinates
    norm = style.signed_norm(float(np.max(np.abs(data.rise), initial=0.0)) or 1.0)
    ax = style.on(ax)
    for k in np.argsort(-np.abs(data.rise)):  # those that differ most lie at the back
        colour = style.SIGNED(norm(data.rise[k]))
        style.draw(ax, names, data.t, data.varied[k], at, color=colour, linewidth=1.3)
    style.draw(ax, names, data.t, data.q, at, say("stationary path"), **style.true())
    style.frame(ax, solution, units, at)
    occurring, text = np.append(data.rise, 0.0), label("$S - S^*$", units.action)
    style.colour_bar(ax, occurring, norm, style.SIGNED, text)
    words = say("the path and its neighbours")
    style.set_title(ax, solution, words)
    style.legend(ax)
    return ax


@style.styled
@check_arguments
def slices(
    solution: Solution,
    ax: Axes | None = None,
    *,
    etas: Sequence[Path] | None = None,
    reach: float = 0.5,
    units: UnitNames = NO_UNITS,
) -> Axes:
    """Draw S - S* along variations, each with the parabola of its second variation.

    By default along two modes of d2S: the lowest, and the next, or where the lowest goes down
    the first that goes up. alpha is then the largest displacement, in units of how far the
    coordinates range.
    """
    if etas is None:
        chosen, modes = telling(solution)
        named = [(say("mode {k}", k=k + 1), modes[k]) for k in chosen]
    else:
        named = [(say("variation {k}", k=k + 1), eta) for k, eta in enumerate(etas)]
    ax, dashed = style.on(ax), {"linewidth": 1.2, "linestyle": "--"}
    for (name, eta), colour in zip(named, style.COLOURS, strict=False):
        data = slice_data(solution, eta, reach)
        middle = data.parabola[data.alpha.size // 2]
        text = f"{name}: " + say("up" if data.second > 0 else "down")
        broad = {"color": colour, "linewidth": 4}
        ax.plot(data.alpha, data.action - middle, **broad, label=text)
        ax.plot(data.alpha, data.parabola - middle, color=style.ink(), **dashed)
    ax.plot([], [], color=style.ink(), **dashed, label=r"$\alpha^2\delta^2S/2$")
    ax.plot(0, 0, **style.event())
    ax.set_xlabel(label(r"variation $\alpha$ (of the path's size)"))
    ax.set_ylabel(label("$S - S^*$", units.action))
    style.set_title(ax, solution, style.kind(solution))
    style.legend(ax)
    return ax


@style.styled
@check_arguments
def landscape(
    solution: Solution, ax: Axes | None = None, *, reach: float = 0.5, units: UnitNames = NO_UNITS
) -> Axes:
    """Draw S - S* over two modes as a contour map, the stationary path in its middle."""
    data = landscape_data(solution, reach)
    ax, places = style.on(ax, MAP_SIZE), (data.a, data.b, data.rise)
    middle = data.rise.shape[0] // 2
    along = np.abs(np.concatenate([data.rise[middle], data.rise[:, middle]]))
    reach = min(float(np.nanmax(np.abs(data.rise))), ABOVE * float(np.nanmax(along))) or 1.0
    norm, even = style.signed_norm(reach), np.linspace(-1, 1, 2 * VARIATION_CONTOURS + 1)
    levels = reach * even * np.abs(even)
    ax.contourf(*places, levels, cmap=style.AREAS, norm=norm, extend="both")
    lines = ax.contour(*places, levels[::2], colors="white", linewidths=0.6, linestyles="-")
    lines.set_alpha(0.6)
    if data.rise.min() < 0 < data.rise.max():
        ax.contour(*places, [0.0], colors=style.ink(), linewidths=1.2)
    ax.plot(0, 0, **style.event())
    words = label("$S - S^*$", units.action)
    style.colour_bar(ax, data.rise, norm, style.AREAS, words, high=True)
    x, y = (say("mode {k} (of the path's size)", k=k + 1) for k in data.modes)
    edge = float(np.max(data.a))
    ticks = (-edge, 0, edge)  # fixed, or equal axes get wider labels than they were laid out with
    ax.set(xlabel=x, ylabel=y, aspect="equal", xticks=ticks, yticks=ticks)
    ax.grid(False)
    style.set_title(ax, solution, style.kind(solution))
    return ax


def level_lines(data: Landscape, level: float) -> list[Array]:
    """Return the lines on a landscape where S - S* is `level`, each (P, 2)."""
    lines = Figure().subplots().contour(data.a, data.b, data.rise, [level])
    return [line for line in lines.allsegs[0] if len(line) > 1]


@style.styled
@check_arguments
def landscapes(
    solutions: Sequence[Solution],
    axes: Sequence[Axes] | None = None,
    *,
    units: UnitNames = NO_UNITS,
) -> list[Axes]:
    """Draw the landscapes of several solutions side by side."""
    count = len(solutions)
    if not count:
        raise ValueError("expected at least one solution, found none")
    if axes is None:
        figure = style.new_figure((MAP_SIZE[0] * count, MAP_SIZE[1]))
        axes = list(figure.subplots(1, count, squeeze=False).ravel())
    return [landscape(s, ax, units=units) for s, ax in zip(solutions, axes, strict=True)]


@style.styled
@check_arguments
def spectrum(
    solution: Solution, ax: Axes | None = None, *, count: int = 3, units: UnitNames = NO_UNITS
) -> Axes:
    """Draw the lowest eigenvalues against duration; dotted lines are the conjugate times.

    Above each arc between them stands the index.
    """
    data = spectrum_data(solution, count)
    ax, foci = style.on(ax), np.unique(data.conjugate)
    for k, row in enumerate(data.eigenvalues):
        look = {"color": style.COLOURS[k], "linewidth": 2.2}
        ax.plot(data.durations, row, **look, label=say("mode {k}", k=k + 1))
    ax.axhline(0, color=style.ink(), linewidth=1)
    for k, t in enumerate(foci):
        text = None if k else say("conjugate times")
        ax.axvline(t, color=style.GREY, linestyle=":", linewidth=1.4, label=text)
    low, high = float(np.nanmin(data.eigenvalues)), float(np.nanmax(data.eigenvalues))
    low = min(low, -0.08 * high)  # zero is seen, and room for the words
    ax.set_ylim(low - 0.04 * (high - low), high + 0.1 * (high - low))
    ends = [data.durations[0], *foci, data.durations[-1]]
    for k, (begin, end) in enumerate(pairwise(ends)):  # number the arcs
        if end - begin >= NARROW_ARC * ends[-1]:
            index = int(np.sum(data.conjugate <= begin))
            text = f"{index}" if k else say("index {k}", k=index)
            ax.text(
                (begin + end) / 2, 0.98, text, color=style.GREY,
                fontsize="small", ha="center", va="top", transform=ax.get_xaxis_transform(),
                label=style.IF_ROOM,
            )  # fmt: skip
    ax.set_xlabel(label("duration $T$", units.time))
    ax.set_ylabel(label(r"eigenvalue of $\delta^2S$ (of a free body: 1, 4, 9)"))
    words = say("index {k} at the full duration", k=data.index[-1])
    style.set_title(ax, solution, words)
    style.legend(ax, beside=True)
    return ax
