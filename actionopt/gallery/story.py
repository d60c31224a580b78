"""The page that tells when a stationary action is a least one."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from actionopt import plot, scenes
from actionopt.gallery.figures import Figure, one, pair
from actionopt.gallery.film import beside
from actionopt.gallery.page import Page, frame
from actionopt.gallery.subject import Subject
from actionopt.plot import SI
from actionopt.plot.live.page import SCRIPTS, figure
from actionopt.solver.solve import solve
from actionopt.tools.texts import read
from actionopt.tools.words import number, say

SHORT_DURATION, LONG_DURATION = 0.7, 1.4  # durations of the two oscillators, in half periods
TEMPLATE = Path(__file__).parent / "templates" / "least.html"
PARAGRAPH = re.compile(r"(?s)(<(h1|h2|p)\b[^>]*>)(.*?)(?=</\2>)")


def story() -> Page:
    """Return the page."""
    short, long = (_oscillator(share) for share in (SHORT_DURATION, LONG_DURATION))
    found = [_landscapes(short, long), _slices(short, long), _fan(long), _spectrum(long)]
    values = {
        "half": f"{np.pi:.4g}",  # of the scene's mass and spring
        "short": f"{SHORT_DURATION:g}",
        "long": f"{LONG_DURATION:g}",
    }
    pictures = {f.name: f'<figure class="wide">{f.html("least/")}' for f in found}
    projectile = _live(
        "projectile",
        say(
            "The ball's path between its two events, with handles at fixed times. Below, the "
            "Lagrangian along the path: the blue area less the vermilion one is the action."
        ),
        parts=("lagrangian",),
    )
    oscillator = _live(
        "oscillator",
        say("Place of the mass against time. Arrow keys move a handle, with Shift in small steps."),
        parts=("bend", "wave"),
    )
    arrows = _live(
        "oscillator",
        say(
            "Left, the oscillator's motion among neighbours, each in the colour of its phase. "
            "Right, their arrows end to end; the broad one is the sum, the dashed one "
            "\u221a(2\u03c0i\u0127/S\u2033)."
        ),
        arrows=True,
    )
    main = PARAGRAPH.sub(_translate, read(TEMPLATE)).format(
        **values,
        **pictures,
        projectile=projectile,
        oscillator=oscillator,
        sum=arrows,
        relaxing=beside(short, long),
        census=f"<p>{_census()}</p>",
    )
    html = frame(
        say("Is it really least?"),
        main,
        root="",
        description=say("When a stationary action is a least one: bowl, focus, saddle."),
        scripts=["film.js", *SCRIPTS],
    )
    files = {"least.html": html}
    for f in found:
        files |= f.files("least/")
    return Page(files)


def _translate(paragraph: re.Match[str]) -> str:
    """Return a paragraph of the template in the current language, its braces not yet filled."""
    return paragraph[1] + say(" ".join(paragraph[3].split()))


def _live(name: str, caption: str, arrows: bool = False, parts: Sequence[str] = ()) -> str:
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
        parts=parts,
    )


def _oscillator(share: float) -> Subject:
    """Return a part of the oscillator's own motion, or more than all, in half periods."""
    own = scenes.get("oscillator")
    assert own.exact is not None
    scene = scenes.get("oscillator", duration=share * np.pi, end=float(own.exact(share * np.pi)[0]))
    return Subject(scene, solve(scene.problem, tol=1e-10))


def _landscapes(short: Subject, long: Subject) -> Figure:
    both = [short.solution, long.solution]
    return pair(
        "landscapes",
        lambda axes: plot.landscapes(both, axes, units=SI),
        say(
            "Two contour maps of the action over two variations. Left, after {short} s: closed "
            "contours around a lowest point. Right, after {long} s: from the middle the action "
            "falls to two sides and rises to the other two.",
            short=number(short.t[-1], 3),
            long=number(long.t[-1], 3),
        ),
        say(
            "The oscillator's action over its two lowest modes, for a short and for a long motion."
        ),
    )


def _slices(short: Subject, long: Subject) -> Figure:
    def draw(axes: Sequence[Any]) -> None:
        for s, ax in zip((short, long), axes, strict=True):
            plot.slices(s.solution, ax, units=SI)

    return pair(
        "slices",
        draw,
        say(
            "The action along the two lowest modes. Left, after {short} s: two parabolas that open "
            "upward. Right, after {long} s: the first opens downward, the second upward.",
            short=number(short.t[-1], 3),
            long=number(long.t[-1], 3),
        ),
        say(
            "Cuts through the two landscapes. The action of the oscillator is a parabola, and so "
            "the same as its second variation, dashed."
        ),
    )


def _fan(long: Subject) -> Figure:
    (focus,) = long.conjugate
    return one(
        "fan",
        lambda ax: plot.fan(long.solution, ax, units=SI),
        say(
            "Motions of the oscillator that leave one event with different velocities and all meet "
            "at t = {focus} s; the motion itself goes on to {end} s.",
            focus=number(focus.t, 5),
            end=number(long.t[-1], 3),
        ),
        say(
            "The focus was found at {focus} s; half a period is {half} s.",
            focus=f"{focus.t:.12g}",
            half=f"{np.pi:.12g}",
        ),
    )


def _spectrum(long: Subject) -> Figure:
    (focus,) = long.conjugate
    lowest = plot.spectrum_data(long.solution).eigenvalues[0]
    return one(
        "spectrum",
        lambda ax: plot.spectrum(long.solution, ax, units=SI),
        say(
            "Three falling curves, the eigenvalues against the duration; the lowest passes zero at "
            "{focus} s and reaches {last} at the end.",
            focus=number(focus.t, 4),
            last=number(lowest[-1], 3),
        ),
        say("In units in which the eigenvalues of a free particle are 1, 4, 9 for every duration."),
    )


def _census() -> str:
    """Return what the scenes are, in words: how many least, how many saddles."""
    kinds: Counter[str] = Counter()
    saddles = []
    for name in scenes.SCENES:
        scene = scenes.get(name)
        if scene.problem.system.structure.forced:
            kinds["forced"] += 1
            continue
        solution = solve(scene.problem, tol=1e-10, guess=scene.guess)
        kinds[solution.kind] += 1
        if solution.kind != "minimum":
            saddles.append(f"{say(scene.title)} ({solution.morse_index})")
    return say(
        "Of the {count} scenes, with the numbers they have here, {least} follow a path of least "
        "action and {more} one that is a saddle: {names}, with the index in brackets. {forced} "
        "have a force beside L, and their motion is not where the action is stationary.",
        count=len(scenes.SCENES),
        least=kinds["minimum"],
        more=len(saddles),
        names="; ".join(saddles),
        forced=kinds["forced"],
    )
