"""The page that tells when a stationary action is a least one."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from string import Template

import numpy as np

from actionopt import plot, scenes
from actionopt.gallery.figures import Figure
from actionopt.gallery.film import beside
from actionopt.gallery.page import Page, frame, rounded
from actionopt.gallery.subject import Subject
from actionopt.plot import SI
from actionopt.plot.live.page import SCRIPTS, figure
from actionopt.solver.solve import solve

SHORT, LONG = 0.7, 1.4  # durations of the two oscillators, in half periods
TEMPLATE = Path(__file__).parent / "templates" / "least.html"
TITLE = "Is it really least?"


def story() -> Page:
    """Return the page."""
    short, long = (_oscillator(share) for share in (SHORT, LONG))
    found = [_landscapes(short, long), _slices(short, long), _fan(long), _spectrum(long)]
    text = TEMPLATE.read_text(encoding="utf-8")
    main = Template(text).substitute(
        {f.name: f'<figure class="wide">{f.html("least/")}' for f in found},
        title=TITLE,
        half=f"{np.pi:.4g}",  # of the scene's mass and spring
        short=f"{SHORT:g}",
        long=f"{LONG:g}",
        projectile=_live(
            "projectile",
            "The ball's path between its two events, with handles at fixed times. Below, the "
            "Lagrangian along the path: the blue area less the vermilion one is the action.",
        ),
        oscillator=_live(
            "oscillator",
            "Place of the mass against time. Arrow keys move a handle, with Shift in small steps.",
        ),
        sum=_live(
            "oscillator",
            "Left, the oscillator's motion among neighbours, each in the colour of its phase. "
            "Right, their arrows end to end; the broad one is the sum, the dashed one "
            "\u221a(2\u03c0i\u0127/S\u2033).",
            arrows=True,
        ),
        relaxing=beside(short, long),
        census=_census(),
    )
    html = frame(
        TITLE,
        main,
        root="",
        description="When a stationary action is a least one: bowl, focus, saddle.",
        scripts=["film.js", *SCRIPTS],
    )
    return Page({"least.html": html, **{f"least/{p.name}.svg": p.svg for p in found}})


def _live(name: str, caption: str, arrows: bool = False) -> str:
    """Return a scene's path to be bent, its motion seen from the start; or its sum over paths."""
    scene = scenes.get(name)
    solution = solve(scene.problem, tol=1e-10)
    return figure(
        *(scene.problem, solution),
        units=SI,
        caption=caption,
        name=f"{name}_sum" if arrows else name,
        shown=True,
        arrows=arrows,
    )


def _oscillator(share: float) -> Subject:
    """Return a part of the oscillator's own motion, or more than all, in half periods."""
    own = scenes.get("oscillator")
    assert own.exact is not None
    scene = scenes.get("oscillator", duration=share * np.pi, end=float(own.exact(share * np.pi)[0]))
    return Subject(scene, solve(scene.problem, tol=1e-10))


def _landscapes(short: Subject, long: Subject) -> Figure:
    both, size = [short.solution, long.solution], (10.4, 4.4)
    return Figure(
        "landscapes",
        plot.svg(lambda f: plot.landscapes(both, list(f.subplots(1, 2)), units=SI), size),
        size,
        "Two contour maps of the action over two variations. Left, after "
        f"{rounded(short.t[-1])} s: closed contours around a lowest point. Right, after "
        f"{rounded(long.t[-1])} s: from the middle the action falls to two sides and rises to the "
        "other two.",
        "The oscillator's action over its two lowest modes, for a short and for a long motion.",
    )


def _slices(short: Subject, long: Subject) -> Figure:
    size = (10.4, 4.2)

    def draw(figure):
        for s, ax in zip((short, long), figure.subplots(1, 2), strict=True):
            plot.slices(s.solution, ax, units=SI)

    return Figure(
        "slices",
        plot.svg(draw, size),
        size,
        f"The action along the two lowest modes. Left, after {rounded(short.t[-1])} s: two "
        f"parabolas that open upward. Right, after {rounded(long.t[-1])} s: the first opens "
        "downward, the second upward.",
        "Cuts through the two landscapes. The action of the oscillator is a parabola, and so the "
        "same as its second variation, dashed.",
    )


def _fan(long: Subject) -> Figure:
    (focus,), size = long.conjugate, (6.4, 4.4)
    return Figure(
        "fan",
        plot.svg(lambda f: plot.fan(long.solution, f.subplots(), units=SI), size),
        size,
        "Motions of the oscillator that leave one event with different velocities and all meet at "
        f"t = {rounded(focus.t, 5)} s; the motion itself goes on to {rounded(long.t[-1])} s.",
        f"The focus was found at {focus.t:.12g} s; half a period is {np.pi:.12g} s.",
    )


def _spectrum(long: Subject) -> Figure:
    (focus,), size = long.conjugate, (6.4, 4.4)
    lowest = plot.spectrum_data(long.solution).eigenvalues[0]
    return Figure(
        "spectrum",
        plot.svg(lambda f: plot.spectrum(long.solution, f.subplots(), units=SI), size),
        size,
        "Three falling curves, the eigenvalues against the duration; the lowest passes zero at "
        f"{rounded(focus.t, 4)} s and reaches {rounded(lowest[-1])} at the end.",
        "In units in which the eigenvalues of a free particle are 1, 4, 9 for every duration.",
    )


def _census() -> str:
    """Return what the scenes are, in words: how many least, how many saddles."""
    kinds: Counter[str] = Counter()
    saddles = []
    for name in scenes.SCENES:
        scene = scenes.get(name)
        if scene.problem.system.structure.forced:
            kinds["drag"] += 1
            continue
        solution = solve(scene.problem, tol=1e-10, guess=scene.guess)
        kinds[solution.kind] += 1
        if solution.kind != "minimum":
            saddles.append(f"{name.replace('_', ' ')} ({solution.morse_index})")
    return (
        f"Of the {len(scenes.SCENES)} scenes, with the numbers they have here, {kinds['minimum']} "
        f"follow a path of least action and {len(saddles)} one that is a saddle: "
        f"{', '.join(saddles)}, with the index in brackets. {kinds['drag']} have drag, and so no "
        "action to be least."
    )
