"""Pictures of a solution: its path, the forward integration over it, and how far they are apart.

Every function takes axes or makes them, returns them, and shows nothing. What is drawn can be had
as arrays from `curves`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.figure import Figure

from actionopt.analysis.solution import Solution
from actionopt.plot._style import (
    COUNT,
    FORWARD,
    GREY,
    NONE,
    PATH,
    Units,
    frame,
    heading,
    label,
    legend,
    legend_above,
    new_figure,
    number,
    on,
    styled,
    times,
    traces,
)
from actionopt.tools.files import ready, whole
from actionopt.tools.types import Array

BOUND: Any = {"color": GREY, "linewidth": 1.2}


@dataclass(frozen=True, eq=False)
class Curves:
    """What the pictures show, at K times.

    Attributes
    ----------
    t : (K,) array
        Times, both events' included.
    q, forward : (n, K) arrays
        The solution, and the forward integration from its start; NaN where that cannot be followed.
    deviation : (K,) array
        Largest |forward - q| of all coordinates, each in units of the largest |q| it reaches.
    """

    t: Array
    q: Array
    forward: Array
    deviation: Array


def curves(solution: Solution, count: int = COUNT) -> Curves:
    """Return the arrays behind the pictures at `count` equal times; the comparison is made."""
    t = times(solution, count)
    q, forward = solution(t), followed(solution, t)
    size = np.max(np.abs(q), axis=1, keepdims=True)
    size[size <= 1e-12 * np.max(size)] = np.max(size) or 1.0  # zero but for round-off
    return Curves(t, q, forward, np.max(np.abs(forward - q) / size, axis=0))


def followed(solution: Solution, t: Array) -> Array:
    """Return the forward integration at the times t (K,), NaN beyond where it ends: (n, K)."""
    path = solution.compare().path
    result = np.full((solution.problem.system.n, t.size), np.nan)
    if path is not None:
        there = t <= path.mesh.boundaries[-1]
        result[:, there] = path(t[there])
    return result


def overview(
    solution: Solution, axes: Sequence[Axes] | None = None, *, units: Units = NONE
) -> tuple[Axes, Axes]:
    """Draw `paths` above `deviation`, on two axes or in a figure of their own."""
    with styled():
        pair = (
            new_figure(figsize=(6.4, 6.4)).subplots(2, height_ratios=(3, 2))
            if axes is None
            else axes
        )
        above, below = pair
        return paths(solution, above, units=units), deviation(solution, below, units=units)


def paths(
    solution: Solution, ax: Axes | None = None, *, compare: bool = True, units: Units = NONE
) -> Axes:
    """Draw the path, and unless `compare` is False the forward integration over it.

    Cartesian coordinates, pairs named x and y with the same ending, are drawn as orbits in the
    plane; any others against time.
    """
    names = solution.problem.system.coordinates
    t = times(solution, COUNT)
    with styled():
        ax = on(ax)
        for x, y, what in traces(names, t, solution(t)):
            ax.plot(x, y, **PATH, label=what)
        if compare:
            what = "forward integration"
            for x, y, _ in traces(names, t, followed(solution, t)):
                ax.plot(x, y, **FORWARD, label=what)
                what = None  # one entry in the legend stands for all
        frame(ax, solution, units)
        S = f"{number(solution.action, 8)} {units.action}".rstrip()
        ax.set_title(f"{heading(solution)}: $S$ = {S}")
        legend(ax)
    return ax


def deviation(solution: Solution, ax: Axes | None = None, *, units: Units = NONE) -> Axes:
    """Draw the deviation of the forward integration against time, on a logarithmic axis.

    With it the solution's error estimate and the uncertainty of the integration itself: below
    the latter the deviation means nothing.
    """
    data = curves(solution)
    seen = np.where(data.deviation > 0, data.deviation, np.nan)
    with styled():
        ax = on(ax)
        ax.semilogy(data.t, seen, color="black", linewidth=1.2, label="deviation")
        for value, look, text in (
            (solution.error, "--", "error estimate"),
            (solution.compare().reference_error, ":", "uncertainty of integration"),
        ):
            if np.isfinite(value) and value > 0:
                ax.axhline(value, **BOUND, linestyle=look, label=text)
        ax.set(xlabel=label("time $t$", units.time), ylabel="relative deviation")
        legend_above(ax, 3)
    return ax


def save(solution: Solution, file: str | FilePath, *, compare: bool = True) -> None:
    """Write `overview`, or `paths` alone if `compare` is False, to a picture file.

    Raises ValueError for an ending that matplotlib does not know, OSError if it cannot write.
    """
    picture(file)
    with styled():
        figure = Figure((6.4, 6.4), layout="constrained")  # not pyplot's: it needs no display
        if compare:
            overview(solution, figure.subplots(2, height_ratios=(3, 2)))
        else:
            paths(solution, figure.subplots(), compare=False)
        with whole(file) as part:
            figure.savefig(part)


def picture(file: str | FilePath) -> FilePath:
    """Return where a picture goes. Raises as `save`, and before anything is drawn."""
    target = ready(file)
    endings = [f".{ending}" for ending in sorted(FigureCanvasBase.get_supported_filetypes())]
    if target.suffix.lower() not in endings:
        found = f"{target.name!r}" + ("" if target.suffix else ", which has no ending")
        raise ValueError(
            f"expected a picture file that ends in {', '.join(endings)}, found {found}"
        )
    return target
