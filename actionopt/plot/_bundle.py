"""The bundle of varied paths: neighbours between the same events, coloured by S - S*."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from actionopt.analysis.solution import Solution
from actionopt.analysis.variation import variation
from actionopt.plot._modes import directions
from actionopt.plot._style import (
    COUNT,
    NONE,
    SIGNED,
    TRUE,
    Units,
    colour_bar,
    frame,
    heading,
    label,
    legend,
    on,
    shown,
    signed,
    styled,
    times,
    traces,
)
from actionopt.tools.types import Array

MODES = 3


@dataclass(frozen=True, eq=False)
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


def bundle_data(solution: Solution, count: int = 8, size: float = 0.25) -> Bundle:
    """Return neighbours along each of the three lowest modes of d2S, `count` a mode.

    They are displaced by at most `size`, in units of how far the coordinates range. Raises
    ValueError for non-conservative forces, which leave no functional to compare.
    """
    _, modes = directions(solution, MODES)
    t = times(solution, COUNT // 2)
    varied, rise = [], []
    for mode in modes:
        S = variation(solution, mode)
        for alpha in np.linspace(-size, size, count):
            try:
                path, action = S.path(alpha), float(S(alpha))
            except ValueError:  # too far from the constraint surface
                continue
            varied.append(path(t))
            rise.append(action - float(S(0.0)))
    return Bundle(t, solution(t), np.array(varied), np.array(rise))


def bundle(
    solution: Solution,
    ax: Axes | None = None,
    *,
    coordinate: int | None = None,
    units: Units = NONE,
    count: int = 8,
    size: float = 0.25,
) -> Axes:
    """Draw the stationary path among its neighbours, blue where S is lower, vermilion where higher.

    Orbits for Cartesian coordinates, else one `coordinate` against time.
    """
    at = shown(solution, coordinate)
    data = bundle_data(solution, count, size)
    names = solution.problem.system.coordinates
    norm = signed(float(np.max(np.abs(data.rise), initial=0.0)) or 1.0)
    with styled():
        ax = on(ax)
        # Those that differ most lie at the back.
        for k in np.argsort(-np.abs(data.rise)):
            for x, y, _ in traces(names, data.t, data.varied[k], at):
                ax.plot(x, y, color=SIGNED(norm(data.rise[k])), linewidth=1.3)
        what = "stationary path"
        for x, y, _ in traces(names, data.t, data.q, at):
            ax.plot(x, y, **TRUE, label=what)
            what = None
        frame(ax, solution, units, at)
        occurring = np.append(data.rise, 0.0)
        colour_bar(ax, occurring, norm, SIGNED, label("$S - S^*$", units.action))
        ax.set_title(f"{heading(solution)}: the path and its neighbours")
        legend(ax)
    return ax
