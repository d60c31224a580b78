"""A window on a trial path: drag its points, see its action, solve, slide the end time.

All that is shown is an `Exploration`; the window turns gestures into new ones and draws them.
"""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.backend_bases import Event as Gesture
from matplotlib.backend_bases import KeyEvent, MouseEvent
from matplotlib.backends.backend_webagg_core import FigureCanvasWebAggCore
from matplotlib.backends.registry import BackendFilter, backend_registry
from matplotlib.widgets import Button, Slider

from actionopt.analysis.solution import SolveError
from actionopt.mechanics.question.problem import Problem
from actionopt.plot import _style as style
from actionopt.plot._explore_parts import (
    LEFT,
    RIGHT,
    WORDS_AT,
    Missing,
    Panel,
    Readout,
    fit,
    panels,
)
from actionopt.plot._names import NO_UNITS, UnitNames, label, units_of
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.exploration import Exploration, begin, bend, lasting, restart, to_solution
from actionopt.plot.data.trial import Trial, knots
from actionopt.plot.live.page import whole
from actionopt.scenes import Scene
from actionopt.solver.input.arguments import Guess
from actionopt.tools.words import current, language

REACH = 14  # pixels from a point at which it is taken hold of
SHORTEST_TIME = 0.2  # of the duration
KEYS = {"enter": to_solution, "0": restart}
SNAP = 0.006  # of the slider: nearer than this to a conjugate time it is that time
NO_WINDOW = (
    "no window can be opened: {reason}; run this on a desktop with tkinter, or after `pip install "
    "PyQt6`; a browser needs neither: `actionopt.plot.page(scene, 'page.html')` writes a page on "
    "which the path is dragged, and a notebook shows it for `actionopt.plot.explore(scene)`"
)
FRAME_HEIGHT = 820  # pixels, of the page in a notebook


@check_arguments
def explore(
    question: Scene | Problem, *, guess: Guess | None = None, units: UnitNames | None = None
) -> Explorer:
    """Open a window on a trial path between the events of a scene or a problem; nothing is shown.

    Points of the path, or the line between them, are dragged with the mouse; S, its distance
    from stationary and the missing force follow. A button (or the key enter) solves from there,
    another (or 0) starts over, and a slider moves the end event along the motion that was found,
    through its conjugate points. `show` of what is returned waits for the window to be closed;
    in a notebook `%matplotlib widget` (of the package ipympl) is enough. Without it the notebook
    shows the page that `page` writes, on which the path is dragged as well.

    Parameters
    ----------
    question : Scene or Problem
    guess : Path, callable or array, optional
        The first trial, in place of a scene's guess or the straight line.
    units : UnitNames, optional
        Words for the labels; SI for a scene, none for a problem.

    Raises
    ------
    ValueError
        For a path that closes, or a guess that does not fit.
    RuntimeError
        If matplotlib is set to windows that it cannot open.
    """
    if isinstance(question, Scene):
        problem = question.problem
        guess = question.guess if guess is None else guess
        units = units_of(question) if units is None else units
    else:
        problem, units = question, NO_UNITS if units is None else units
    spoken = current()

    def page() -> str:
        with language(spoken):
            return whole(question, guess=guess, units=units)

    if problem.system.order > 1:
        raise ValueError(
            "expected a Lagrangian without accelerations, found one that has some: trial paths "
            "are moved by their places alone; show a solution with `plot.paths`"
        )
    if any(event.t is None for event in problem.through):
        raise ValueError(
            "expected events at given times, found one whose time is to be found; explore "
            "`solution.problem`, in which it is"
        )
    first = begin(problem, guess)
    try:
        return Explorer(first, units, page)
    except ImportError as error:
        raise RuntimeError(NO_WINDOW.format(reason=error)) from error


class Explorer:
    """A window; `now` is the `Exploration` that it shows, `figure` what it is drawn on.

    `page` makes the page that stands for it in a notebook without windows.
    """

    @style.styled
    def __init__(self, first: Exploration, units: UnitNames, page: Callable[[], str]) -> None:
        self.now, self.page = first, page
        self.held: tuple[Panel, int, Trial] | None = None
        self.behind: Any = None  # the picture without what moves, while a point is held
        problem = first.trial.tr.problem
        names, t0, t1 = problem.system.coordinates, problem.start.t, problem.end.t
        self.right = t1  # the latest end seen: the axis of time does not shrink again
        self.figure = style.new_figure((10.6, 6.6), layout=None)
        self.figure.explorer = self  # lives as long as its figure
        forced = problem.system.structure.forced
        self.panels = panels(self.figure, names, "motion" if forced else "stationary path", units)
        self.missing = Missing(self.figure, names, forced, units)
        self.words = Readout(self.figure, style.heading(problem), forced, units)
        self.slider = Slider(
            self.figure.add_axes((LEFT + 0.075, 0.03, RIGHT - LEFT - 0.145, 0.03)),
            label("end time", units.time), t0 + SHORTEST_TIME * (t1 - t0), first.latest, valinit=t1,
            valfmt="%.4g", color=style.BLUE, initcolor="none",
            track_color=matplotlib.rcParams["grid.color"],
        )  # fmt: skip
        (self.marks,) = self.slider.ax.plot(
            [], [], "v", color=style.VERMILION, markersize=6, clip_on=False,
            transform=self.slider.ax.get_xaxis_transform(),
        )  # fmt: skip
        self.slider.on_changed(self._slide)
        self.solve = self._button(WORDS_AT, "Solve")
        self.again = self._button(WORDS_AT + 0.145, "Start over")
        self.solve.on_clicked(lambda _: self._become(to_solution(self.now)))
        self.again.on_clicked(lambda _: self._become(restart(self.now)))
        for name, react in (
            ("button_press_event", self._press),
            ("motion_notify_event", self._drag),
            ("button_release_event", self._release),
            ("key_press_event", self._key),
        ):
            self.figure.canvas.mpl_connect(name, react)
        self._become(first)

    def show(self) -> None:
        """Show the window and wait until it is closed.

        Raises RuntimeError if matplotlib draws to files only.
        """
        from matplotlib import pyplot

        backend = matplotlib.get_backend()
        if backend.lower() in backend_registry.list_builtin(BackendFilter.NON_INTERACTIVE):
            reason = f"matplotlib found no display and draws to files only (backend {backend!r})"
            raise RuntimeError(NO_WINDOW.format(reason=reason))
        pyplot.show()

    def _repr_html_(self) -> str | None:
        """Return the page in a frame, for a notebook whose figures are pictures only.

        None, which leaves the picture of the first trial, where a page cannot show the problem.
        """
        from matplotlib import pyplot

        canvas = self.figure.canvas
        if canvas.required_interactive_framework or isinstance(canvas, FigureCanvasWebAggCore):
            return None
        try:
            page = escape(self.page())
        except (ValueError, SolveError):
            return None
        pyplot.close(self.figure)
        look = f'style="width: 100%; height: {FRAME_HEIGHT}px; border: 0"'
        return f'<iframe srcdoc="{page}" {look}></iframe>'

    # -- gestures --------------------------------------------------------------------------------

    def _press(self, event: Gesture) -> None:
        """Take hold of the nearest point, or of the line where no point is near."""
        assert isinstance(event, MouseEvent)
        toolbar = self.figure.canvas.toolbar
        if event.button != 1 or (toolbar is not None and toolbar.mode):
            return
        trial, near = self.now.trial, []
        at_knots = knots(trial)
        line = list(range(at_knots[1], at_knots[-2]))  # nearer to the ends it would bend far away
        for panel in self.panels:
            if event.inaxes is not panel.ax:
                continue
            for first, nodes in enumerate((panel.knots(trial), line)):
                curve = panel.project(trial.tr.mesh.nodes[nodes], trial.Q[nodes].T)
                at = panel.ax.transData.transform(np.transpose(curve))
                away = np.hypot(*(at - (event.x, event.y)).T)
                k = int(np.argmin(away))
                near.append((first, away[k], nodes[k], panel))
        near = [found for found in near if found[1] <= REACH]
        if near:
            _, _, node, panel = min(near, key=lambda found: found[:2])
            self._hold((panel, node, trial))

    def _drag(self, event: Gesture) -> None:
        assert isinstance(event, MouseEvent)
        if self.held is not None:
            panel, node, trial = self.held
            x, y = panel.ax.transData.inverted().transform((event.x, event.y))
            self._become(bend(self.now, trial, node, panel.target(x, y)))

    def _release(self, event: Gesture) -> None:
        if self.held is not None:
            self._hold(None)

    def _key(self, event: Gesture) -> None:
        assert isinstance(event, KeyEvent)
        if event.key in KEYS:
            self._become(KEYS[event.key](self.now))

    def _slide(self, t: float) -> None:
        if self.now.motion is not None:
            t = self.now.motion.near(t, SNAP * (self.slider.valmax - self.slider.valmin))
        self._become(lasting(self.now, t))

    # -- drawing ---------------------------------------------------------------------------------

    def _become(self, now: Exploration) -> None:
        """Show `now`; the panels keep still while a point is held."""
        self.now = now
        tr = now.trial.tr
        start, end = tr.problem.start.t, tr.problem.end.t
        self.right = max(self.right, end)
        times = start - 0.03 * (self.right - start), self.right + 0.12 * (self.right - start)
        for panel in self.panels:
            panel.show(now)
        if self.held is None:
            fit(self.panels, tr.lengths, times)
        self.missing.show(now.trial, None if self.held is None else self.held[1])
        self.missing.ax.set_xlim(*times)
        foci = [] if now.motion is None else now.motion.times
        inside = [t for t in foci if self.slider.valmin <= t <= self.slider.valmax]
        self.marks.set_data(inside, [1.1] * len(inside))
        self.words.show(now)
        if self.slider.val != end:
            self.slider.eventson = False
            self.slider.set_val(end)
            self.slider.eventson = True
        canvas = self.figure.canvas
        if self.behind is None:
            canvas.draw_idle()
            return
        canvas.restore_region(self.behind)
        for artist in self._moving():
            self.figure.draw_artist(artist)
        canvas.blit(self.figure.bbox)

    def _hold(self, held: tuple[Panel, int, Trial] | None) -> None:
        """Take hold of a node, or let go.

        What does not move meanwhile is drawn once: the rest alone takes a fraction of the time.
        """
        self.held, self.behind = held, None
        canvas = self.figure.canvas
        if canvas.supports_blit:
            for artist in self._moving():
                artist.set_animated(held is not None)
            if held is not None:
                canvas.draw()
                self.behind = canvas.copy_from_bbox(self.figure.bbox)
        self._become(self.now)

    def _moving(self) -> list[Artist]:
        """Return what changes while a point is held, from back to front."""
        lines = [line for panel in self.panels for line in panel.lines]
        lines.sort(key=lambda line: line.get_zorder())
        return [*lines, self.missing.ax, *self.words.numbers]

    def _button(self, left: float, text: str) -> Any:
        ax = self.figure.add_axes((left, 0.025, 0.13, 0.055))
        ax.spines[:].set_visible(False)
        face, under = ("#22313c", "#2f4656") if style.dark() else ("#e9f1f7", "#cfe3f0")
        return Button(ax, text, color=face, hovercolor=under)
