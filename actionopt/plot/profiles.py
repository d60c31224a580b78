"""Profiles of solvers: the fraction of problems solved, against the cost allowed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from actionopt.plot import _style as style
from actionopt.tools.files import whole
from actionopt.tools.types import Array


@style.styled
def profiles(
    steps: Mapping[str, tuple[Array, Array] | None],
    *,
    ax: Any = None,
    xlabel: str = "",
    least: float = 1.0,
) -> Any:
    """Draw staircases, one for each name: where they rise, and how high they are then.

    Parameters
    ----------
    steps : mapping of str to (positions, heights)
        Increasing positions and the fractions reached there, as `suite.profile` has them. Where
        there are none at all, None: the name keeps its colour.
    ax : matplotlib Axes, optional
    xlabel : str
        What the positions are.
    least : float
        Left end of the logarithmic axis.

    Returns
    -------
    Axes
    """
    if ax is None:
        ax = Figure(layout="constrained").add_subplot()  # not pyplot's: it needs no display
    drawn = {(i, name): s for i, (name, s) in enumerate(steps.items()) if s is not None}
    reach = max((x[-1] for x, _ in drawn.values() if x.size), default=10 * least)
    reach = max(reach, 2 * least)
    for (i, name), (x, y) in drawn.items():
        ends = np.concatenate([[least], np.maximum(x, least), [reach]])
        heights = np.concatenate([[0.0], y, [y[-1] if y.size else 0.0]])
        ax.step(ends, heights, where="post", label=name, **style.strand(i))
    ax.set(xscale="log", xlim=(least, reach), ylim=(0, 1.02), ylabel="fraction solved")
    ax.set_xlabel(xlabel)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


@style.styled
def dial(
    found: Mapping[str, tuple[Array, Array, Array] | None], *, ax: Any = None, xlabel: str = ""
) -> Any:
    """Draw what solvers cost along a parameter: filled where the answer is right.

    Parameters
    ----------
    found : mapping of str to (values, costs, right)
        Of each solver, at each value it gave an answer at; `right` are booleans. None of one that
        is not drawn.
    ax : matplotlib Axes, optional
    xlabel : str
        What the values are.

    Returns
    -------
    Axes
    """
    if ax is None:
        ax = Figure(layout="constrained").add_subplot()
    for i, (name, points) in enumerate(found.items()):
        if points is None:
            continue
        (values, costs, right), strand = points, style.strand(i)
        (line,) = ax.plot(values, costs, label=name, **strand)
        for mine, face in ((right, line.get_color()), (~right, "none")):
            ax.plot(values[mine], costs[mine], "o", mfc=face, mec=line.get_color(), ls="none")
    ax.set(yscale="log", ylabel="gradients evaluated")
    ax.set_xlabel(xlabel)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


@style.styled
def save(ax: Any, file: str | Path) -> None:
    """Write the figure of `ax`; the same data give the same file, with its words as text."""
    with rc_context({"svg.fonttype": "none"}), whole(file) as part:
        ax.figure.savefig(part, metadata={"Date": None})
