"""A wild path relaxes to the true one: the paths, and S and the residual against the step."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from actionopt.analysis.solution import Solution
from actionopt.discrete.meshes.path import Path
from actionopt.plot import _style as style
from actionopt.plot._film import FPS, film_file, write
from actionopt.plot._names import NO_UNITS, UnitNames, label
from actionopt.plot._strobe import faded
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.relaxation import Relaxation, relaxation_data
from actionopt.tools.types import Array
from actionopt.tools.words import say

RELAXATION_SIZE = (9.6, 5.4)  # inches
SHORTEST_FILM = 3.0  # seconds of a film, ad hoc
# paths shown together, and how strong the first of them is
PATHS_SHOWN, FIRST_PATH_STRENGTH = 14, 0.15
FIRST_STYLE: Any = {"color": style.PALE, "linewidth": 1.4}
NOW: Any = {"color": style.BLUE, "linewidth": 4.0, "zorder": 3.5}  # the true path shows upon it
DOT: Any = {"marker": "o", "markersize": 7, "linestyle": "none", "zorder": 6}
FRONT = NOW["zorder"]  # nothing that moves is further back
VERDICTS = {  # of a method: it reaches the path, passes below it, or neither
    "descent": (
        "descent reaches the {kind}",
        "descent leaves the {kind} below",
        "descent does not reach the {kind}",
    ),
    "newton": (
        "Newton's method reaches the {kind}",
        "Newton's method leaves the {kind} below",
        "Newton's method does not reach the {kind}",
    ),
}

Start = Path | Callable[[Array], ArrayLike] | None


class Panels(NamedTuple):
    """Axes of a relaxation: the paths, and against the step S, its two parts and the residual."""

    paths: Axes
    action: Axes
    parts: Axes
    residual: Axes


@style.styled
@check_arguments
def relaxation(
    solution: Solution,
    start: Start = None,
    axes: Panels | None = None,
    *,
    method: str = "descent",
    coordinate: int | None = None,
    units: UnitNames = NO_UNITS,
) -> Panels:
    """Draw the paths from `start` to where they lead, later ones stronger, and S beside them.

    Orbits for Cartesian coordinates, else one coordinate against time. Start, method and what is
    raised are explained at `relaxation_data`.
    """
    data, at = (
        relaxation_data(solution, start, method=method),
        style.coordinate_to_show(solution, coordinate),
    )
    names, last = solution.problem.system.coordinates, len(data.action) - 1
    panels = _panels(style.new_figure(RELAXATION_SIZE)) if axes is None else Panels(*axes)
    picked = np.unique(np.rint(last * np.linspace(0, 1, PATHS_SHOWN) ** 2).astype(int))[1:]
    for k, strength in zip(picked, np.linspace(FIRST_PATH_STRENGTH, 1, picked.size), strict=True):
        look = {**NOW, "linewidth": 1.4, "color": faded(style.BLUE, strength)}
        text = say("last path") if k == last else None
        style.draw(panels.paths, names, data.t, data.paths[k], at, text, **look)
    _prepare(panels, solution, data, at, units)
    return panels


@check_arguments
def relaxation_film(
    solution: Solution,
    file: str | FilePath,
    start: Start = None,
    *,
    method: str = "descent",
    coordinate: int | None = None,
    fps: int = FPS,
    units: UnitNames = NO_UNITS,
) -> None:
    """Write the relaxation to a film, one step a frame; files and what is raised as in `film`.

    One that runs away takes few steps, and is slowed down to `SHORTEST_FILM` seconds.
    """
    film_file(file)
    data, at = (
        relaxation_data(solution, start, method=method),
        style.coordinate_to_show(solution, coordinate),
    )
    figure, update = _reel(solution, data, at, units)
    steps, count = len(data.action) - 1, frame_count(data, fps)
    write(figure, lambda k: update(k * steps / max(1, count - 1)), count, file, fps, FRONT)


def frame_count(data: Relaxation, fps: int) -> int:
    """Return the number of frames: of steps, but for a path that runs away not too few."""
    steps = len(data.action)
    away = not data.arrived and data.action[-1] < data.target_action
    return max(steps, round(SHORTEST_FILM * fps)) if away else steps


@style.styled
def _reel(
    solution: Solution, data: Relaxation, at: int | None, units: UnitNames
) -> tuple[Figure, Callable[[float], None]]:
    """Return a figure, and the function that turns it to a step, or between two."""
    names = solution.problem.system.coordinates
    figure = Figure(style.figure_size(*RELAXATION_SIZE), layout="constrained")
    panels = _panels(figure)
    lines = style.draw(panels.paths, names, data.t, data.paths[0], at, say("now"), **NOW)
    curves = (data.action, data.kinetic, data.potential, data.residual)
    axes = (panels.action, panels.parts, panels.parts, panels.residual)
    dots = [
        ax.plot(0, y[0], color=style.ink(), **DOT)[0] for ax, y in zip(axes, curves, strict=True)
    ]
    _prepare(panels, solution, data, at, units)
    style.freeze_layout(figure)

    def update(step: float) -> None:
        k = min(int(step), len(data.action) - 2) if len(data.action) > 1 else 0
        share, after = step - k, min(k + 1, len(data.action) - 1)

        def between(values: Array) -> Any:
            return (1 - share) * values[k] + share * values[after]

        now = style.traces(names, data.t, between(data.paths), at)
        for line, (x, y, _) in zip(lines, now, strict=True):
            line.set_data(x, y)
        for dot, values in zip(dots, curves, strict=True):
            dot.set_data([step], [between(values)])

    return figure, update


def _panels(figure: Figure) -> Panels:
    mosaic = figure.subplot_mosaic("qa;qp;qr", width_ratios=(1.4, 1))
    for name in "ap":
        mosaic[name].sharex(mosaic["r"])
        mosaic[name].tick_params(labelbottom=False)
    return Panels(*(mosaic[name] for name in "qapr"))


def _prepare(
    panels: Panels, solution: Solution, data: Relaxation, at: int | None, units: UnitNames
) -> None:
    """Draw what all frames share: the start and the true path, the curves, labels."""
    names, steps = solution.problem.system.coordinates, np.arange(len(data.action))
    paths, action, parts, residual = panels
    style.draw(paths, names, data.t, data.paths[0], at, say("start"), **FIRST_STYLE)
    style.draw(paths, names, data.t, data.target, at, say("true path"), **style.true())
    for q in data.paths:  # room for all, also in a film
        for x, y, _ in style.traces(names, data.t, q, at):
            paths.update_datalim(np.c_[x, y])
    entries = paths.get_legend_handles_labels()
    style.frame(paths, solution, units, at)
    paths.legend(*entries)  # the events need no words here
    paths.set_title(f"{style.heading(solution)}: {verdict(data, solution.kind)}")

    action.axhline(data.target_action, color=style.GREY, linestyle=":", linewidth=1.6)
    action.plot(steps, data.action, color=style.ink(), linewidth=2.2)
    action.set_ylabel(label("$S$", units.action))
    action.set_title(say("$S$ and its true value (dotted), step by step"))
    parts.plot(
        steps, data.kinetic, color=style.BLUE, linewidth=2.2, label=say(r"part with $\dot q$")
    )
    parts.plot(steps, data.potential, **style.POTENTIAL, label=say(r"$-$ part without"))
    parts.set_ylabel(label("parts of $S$", units.action))
    parts.legend()
    residual.semilogy(steps, data.residual, color=style.ink(), linewidth=2.2)
    residual.set(
        xlabel=label("step"),
        ylabel=label("residual"),
        xlim=np.array([-0.03, 1.03]) * max(1, steps[-1]),
    )


def verdict(data: Relaxation, kind: str) -> str:
    """Return in words where the steps lead, for a true path of this kind."""
    reached, below, neither = VERDICTS[data.method]
    fallen = data.action[-1] < data.target_action
    return say(reached if data.arrived else below if fallen else neither, kind=say(kind))
