"""What the window of `explore` is made of: panels of the path, the missing force, the words."""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from actionopt.plot import _style as style
from actionopt.plot._names import UnitNames, label, planar, symbol
from actionopt.plot.data.exploration import Exploration
from actionopt.plot.data.trial import Trial, free, knots
from actionopt.tools.types import Array

LEFT, RIGHT, WORDS_AT = 0.085, 0.655, 0.705  # of the figure: the panels, and the words beside them
MOST_PANELS = 3  # coordinates against time, one panel each
LEAST_SPAN = 0.05  # of a coordinate's size, that its panel shows
ROOM = 0.3  # of what is drawn, around it, to drag into
DALEMBERT = "LAGRANGE-D\N{RIGHT SINGLE QUOTATION MARK}ALEMBERT"  # their equations
SIGNS = {"minimum": style.GREEN, "saddle": style.BLUE, "degenerate": style.VERMILION}


@dataclass(eq=False)
class Panel:
    """One curve of the trial: coordinate y against coordinate x, or against time."""

    ax: Axes
    x: int | None
    y: int
    colour: str

    def __post_init__(self) -> None:
        self.lines: list[Line2D] = []

        def line(*form: str, **look: Any) -> Line2D:
            self.lines += self.ax.plot([], [], *form, **look)
            return self.lines[-1]

        self.beyond = line(color=style.PALE, linewidth=1.0, linestyle=":")
        self.trial = line(color=self.colour, **style.PATH)
        self.exact = line(color=style.ink(), linewidth=1.3)
        self.foci = line("D", color=style.VERMILION, markersize=5, zorder=4.5)
        self.points = line(
            "o", color=self.colour, markerfacecolor=style.paper(), markersize=8,
            markeredgewidth=1.8, zorder=6,
        )  # fmt: skip
        self.start, self.end = line(**style.start()), line(**style.event())

    def project(self, t: Array, q: Array) -> tuple[Array, Array]:
        """Return what is drawn of the coordinates q (n, K) at the times t."""
        return (t if self.x is None else q[self.x]), q[self.y]

    def knots(self, trial: Trial) -> list[int]:
        """Return the nodes that are points of this panel to be moved."""
        mine = [i for i in (self.x, self.y) if i is not None]
        return [int(k) for k in knots(trial) if any(free(trial, k, i) for i in mine)]

    def target(self, x: float, y: float) -> dict[int, float]:
        """Return the coordinates that a point of the panel stands for."""
        return {self.y: y} if self.x is None else {self.x: x, self.y: y}

    def show(self, now: Exploration) -> None:
        """Draw the trial, and the motion where one is known."""
        trial, exact, motion = now.trial, now.stationary, now.motion
        t, q, at = trial.tr.mesh.nodes, trial.Q.T, self.knots(trial)
        self.trial.set_data(*self.project(t, q))
        self.points.set_data(*self.project(t[at], q[:, at]))
        self.start.set_data(*self.project(t[:1], q[:, :1]))
        self.end.set_data(*self.project(t[-1:], q[:, -1:]))
        if exact is not None and motion is not None:
            later, foci = np.linspace(t[-1], motion.end, 200), np.array(motion.times)
            self.exact.set_data(*self.project(t, exact.Q.T))
            self.beyond.set_data(*self.project(later, motion.path(later)))
            self.foci.set_data(*self.project(foci, motion.path(foci)))


def panels(
    figure: Figure, names: tuple[str, ...], found_path: str, units: UnitNames
) -> list[Panel]:
    """Return one panel of orbits for Cartesian coordinates, else the first ones against time.

    `found_path` is what the path that is solved for is called.
    """
    pairs, high = planar(names), 0.875
    low = 0.395 if pairs else 0.36
    if pairs:
        ax = figure.add_axes((LEFT, low, RIGHT - LEFT, high - low))
        style.plane(ax, names, units)
        found = [Panel(ax, i, j, style.colour(k)) for k, (i, j) in enumerate(pairs)]
    else:
        found = []
        shown = names[:MOST_PANELS]
        height = (high - low + 0.03) / len(shown)
        for k, name in enumerate(shown):
            box = (LEFT, high - (k + 1) * height + 0.03, RIGHT - LEFT, height - 0.03)
            ax = figure.add_axes(box)
            ax.tick_params(labelbottom=False)
            ax.set_ylabel(label(symbol(name), units.coordinate(name)))
            found.append(Panel(ax, None, k, style.colour(k)))
    first = found[0]
    figure.legend(
        [first.trial, first.exact, first.beyond, first.foci],
        ["trial", found_path, "continued", "conjugate points"],
        loc="lower left", bbox_to_anchor=(LEFT - 0.012, high), ncols=4, columnspacing=1.4,
        handlelength=1.6,
    )  # fmt: skip
    return found


def fit(found: list[Panel], sizes: Array, times: tuple[float, float]) -> None:
    """Give each panel room for its curves, and some to drag into; `times` are those to show."""
    for ax in {panel.ax for panel in found}:
        mine = [panel for panel in found if panel.ax is ax]
        lines = [np.array(line.get_data()) for p in mine for line in (p.trial, p.exact)]
        shown = np.concatenate(lines, axis=1).T
        shown = shown[np.isfinite(shown).all(axis=1)]
        ax.dataLim.set_points(Bbox.null().get_points())
        if len(shown):
            # Round-off about a constant is not magnified.
            middle, least = np.mean(shown, axis=0), np.array([0.0, LEAST_SPAN * sizes[mine[0].y]])
            ax.update_datalim([*shown, middle - least, middle + least])
        ax.margins(ROOM)
        ax.autoscale_view()
        if mine[0].x is None:
            ax.set_xlim(*times)


class Missing:
    """The missing force of each coordinate against time."""

    def __init__(
        self, figure: Figure, names: tuple[str, ...], forced: bool, units: UnitNames
    ) -> None:
        self.ax = ax = figure.add_axes((LEFT, 0.165, RIGHT - LEFT, 0.13))
        self.reach = 0.0
        ax.axhline(0, color=style.ink(), linewidth=0.8)
        looks: list[dict[str, Any]] = [{"color": style.colour(i)} for i in range(len(names))]
        for k, (i, j) in enumerate(planar(names)):  # as the orbits are coloured
            looks[i] = {"color": style.colour(k)}
            looks[j] = {"color": style.colour(k), "linestyle": (0, (4, 2))}
        self.lines = [ax.plot([], [], **look, linewidth=1.6)[0] for look in looks]
        self.when = ax.axvline(0, color=style.GREY, linewidth=0.8, linestyle=":")
        ax.set_xlabel(label(units.clock, units.time))
        used = (units.generalized_force(name) for name in names)
        text = r"missing force  $dp/dt - \partial L/\partial q" + (" - Q$" if forced else "$")
        text = label(text, *used)
        ax.set_title(text, fontsize=style.reader_sizes(9.5)[0], color=style.GREY)
        ax.yaxis.set_major_locator(MaxNLocator(3))

    def show(self, trial: Trial, held: int | None) -> None:
        """Draw it, and the time of the node that is held.

        What vanishes must be seen to vanish: the scale hardly shrinks.
        """
        t = trial.tr.mesh.nodes
        for line, row in zip(self.lines, trial.missing, strict=True):
            line.set_data(t, row)
        self.when.set(visible=held is not None, xdata=[t[held or 0]] * 2)
        now = float(np.nanmax(np.abs(trial.missing), initial=0.0))
        if np.isfinite(now):
            self.reach = max(now, self.reach / 8 if held is None else self.reach)
        self.ax.set_ylim(-1.15 * (self.reach or 1.0), 1.15 * (self.reach or 1.0))


class Readout:
    """The numbers beside the panels, and what they mean."""

    def __init__(self, figure: Figure, name: str, forced: bool, units: UnitNames) -> None:
        def write(y: float, size: float, text: str = "", **look: Any) -> Any:
            look = {
                "fontsize": style.reader_sizes(size)[0],
                "va": "top",
                "linespacing": 1.4,
                **look,
            }
            return figure.text(WORDS_AT, y, text, **look)

        self.ink = style.ink()
        self.units, self.forced, small = units, forced, {"color": style.GREY}
        aim = DALEMBERT if forced else "STATIONARY"
        figure.text(LEFT, 0.975, name, fontsize=style.reader_sizes(14)[0], va="top")
        write(0.915, 9.5, "ACTION OF THE TRIAL", **small)
        self.action, self.rise = write(0.88, 20), write(0.805, 13)
        write(0.715, 9.5, f"DISTANCE FROM {aim}", **small)
        self.slope, self.meaning = write(0.68, 16), write(0.625, 9.5, **small)
        write(0.505, 9.5, "THE MOTION" if forced else "THE STATIONARY PATH", **small)
        self.kind, self.passed = write(0.47, 16), write(0.415, 9.5, **small)
        self.message = write(0.345, 9.5, color=style.VERMILION)
        self.numbers = self.action, self.rise, self.slope, self.meaning, self.message
        write(0.155, 9.5, "Drag a point to bend the path there,\nthe line to bend the whole path.")

    def show(self, now: Exploration) -> None:
        """Write them."""
        unit, S, slope = self.units.action, now.trial.action, now.trial.slope
        self.action.set_text(f"$S$ = {_number(S, 7, unit)}")
        self.slope.set_text(_number(slope, 3, unit))
        self.meaning.set_text(
            "duration times the mean of missing force\nand size; 0 where their equations hold"
            if self.forced
            else "steepest slope of $S$: bent by 1 % of its size,\n"
            f"the path changes $S$ by at most {_number(slope / 100, 2, unit)}"
        )
        if self.forced:  # S is stationary nowhere near
            self.rise.set(text="not stationary: a force acts", color=style.GREY)
        elif now.stationary is None:
            self.rise.set(text="not compared: press Solve", color=style.GREY)
        else:
            rise = S - now.stationary.action
            rise = 0.0 if abs(rise) <= 1e-9 * abs(S) else rise
            colour = style.VERMILION if rise > 0 else style.BLUE if rise < 0 else self.ink
            number = ("+" if rise > 0 else "") + _number(rise, 4, unit)
            self.rise.set(text=f"$S - S^*$ = {number}", color=colour)
        kind, colour, passed = self._kind(now)
        self.kind.set(text=kind, color=colour)
        self.passed.set_text(passed)
        self.message.set_text(fill(now.message[:1].upper() + now.message[1:], 42))

    def _kind(self, now: Exploration) -> tuple[str, str, str]:
        """Return what the stationary path is, its colour, and which conjugate points it passed."""
        if now.motion is None:
            return "not sought yet", style.GREY, ""
        problem = now.trial.tr.problem
        if now.verdict is None:
            why = "with forces that have no potential" if problem.system.structure.forced else ""
            return "no index", style.GREY, why
        kind, index = now.verdict
        passed, text = now.motion.before(problem.end.t), "no conjugate point passed"
        if passed:
            text = f"{len(passed)} conjugate points passed, the last\n"
            text = text if len(passed) > 1 else "a conjugate point passed "
            text += f"at $t$ = {_number(passed[-1], 4, self.units.time)}"
        return f"{kind}, index {index}", SIGNS[kind], text


def _number(value: float, digits: int, unit: str) -> str:
    return f"{value:.{digits}g} {unit}".replace("-", "\N{MINUS SIGN}").rstrip()
