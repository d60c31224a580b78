"""S(alpha) along variations of a path: a bowl at a minimum, one way down at a saddle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from actionopt.analysis.solution import Solution
from actionopt.analysis.variation import variation
from actionopt.discrete.path import Path
from actionopt.plot._modes import both_ways, directions
from actionopt.plot._style import COLOURS, EVENT, NONE, Units, heading, label, legend, on, styled
from actionopt.tools.types import Array

LOWEST = 12  # modes among which one that raises S is looked for


@dataclass(frozen=True, eq=False)
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
    return Slice(alpha, action, float(S(0.0)) + S.second * alpha**2 / 2, S.second)


def slices(
    solution: Solution,
    ax: Axes | None = None,
    *,
    etas: Sequence[Path] | None = None,
    reach: float = 0.5,
    units: Units = NONE,
) -> Axes:
    """Draw S - S* along variations, each with the parabola of its second variation.

    By default along two modes of d2S: the lowest, and the next, or where the lowest goes down
    the first that goes up. alpha is then the largest displacement, in units of how far the
    coordinates range.
    """
    if etas is None:
        values, modes = directions(solution, LOWEST)
        chosen = both_ways(values)
        etas = [modes[k] for k in chosen]
        names = [f"mode {k + 1}" for k in chosen]
    else:
        names = [f"variation {k + 1}" for k in range(len(etas))]
    with styled():
        ax = on(ax)
        for eta, name, colour in zip(etas, names, COLOURS, strict=False):
            data = slice_data(solution, eta, reach)
            middle = data.parabola[data.alpha.size // 2]
            way = "up" if data.second > 0 else "down"
            ax.plot(
                data.alpha, data.action - middle, color=colour, linewidth=4, alpha=0.55,
                label=f"{name}: {way}",
            )  # fmt: skip
            ax.plot(data.alpha, data.parabola - middle, color=colour, linewidth=1.2, linestyle="--")
        ax.plot(
            [], [], color="black", linewidth=1.2, linestyle="--", label=r"$\alpha^2\delta^2S/2$"
        )
        ax.plot(0, 0, **EVENT)
        ax.set(
            xlabel=r"variation $\alpha$ (of the path's size)",
            ylabel=label("$S - S^*$", units.action),
        )
        ax.set_title(f"{heading(solution)}: a {solution.kind}, index {solution.morse_index}")
        legend(ax)
    return ax
