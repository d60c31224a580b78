"""A page of its own for any problem: one file, that needs neither network nor server."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from actionopt import __version__
from actionopt.analysis.solution import Solution
from actionopt.mechanics.question.problem import Problem
from actionopt.plot._names import NO_UNITS, UnitNames, units_of
from actionopt.plot.data.arguments import check_arguments
from actionopt.plot.data.motion import Draw
from actionopt.plot.live.as_found import answer, still
from actionopt.plot.live.data import data
from actionopt.plot.live.drawing import drawing, is_upside_down
from actionopt.plot.live.film import STATIC
from actionopt.plot.live.words import words as spoken
from actionopt.scenes import Measure, Scene
from actionopt.solver.input.arguments import Guess
from actionopt.tools.document import document
from actionopt.tools.files import ready, write
from actionopt.tools.greek import letter
from actionopt.tools.texts import read
from actionopt.tools.words import current, language, say

SCRIPTS = ("action.js", "address.js", "sentences.js", "panel.js", "live.js")
MINUS_SIGN = "\N{MINUS SIGN}"


def page(
    question: Scene | Problem,
    file: str | Path,
    *,
    draw: Draw | None = None,
    guess: Guess | None = None,
    units: UnitNames | None = None,
    lang: str | None = None,
) -> None:
    """Write a page on which the path of a problem is bent, solved and relaxed by its reader.

    One file of HTML, below 300 kB, that computes by itself: the Lagrangian and its derivatives
    are in it as JavaScript. With `?embed` behind its address it is the figure alone, for frames.

    Parameters
    ----------
    question : Scene or Problem
    file : path
        Ends in .html or .htm.
    draw : callable, optional
        `draw(q, t)`, the shapes of the system, in place of a scene's.
    guess : Path, callable or array, optional
        In place of a scene's guess.
    units : UnitNames, optional
        Words for the labels; SI for a scene, none for a problem.
    lang : {"en", "de", "fr"}, optional
        Of the words; by default that of `plot.language`.

    Where the path closes, or its times or places were to be found, the page keeps the ends of the
    path that was found, and says so. What it cannot solve again, along an obstacle, through events,
    with a given integral or with accelerations, it shows as it was found.

    Raises
    ------
    ValueError
        For a law that a page cannot compute.
    SolveError
        If no path is found.
    OSError
        If the file cannot be written.
    """
    target = ready(file, ".html", ".htm")
    with language(current() if lang is None else lang):
        text = whole(question, draw=draw, guess=guess, units=units)
    write(target, text)


@check_arguments
def whole(
    question: Scene | Problem,
    *,
    draw: Draw | None = None,
    guess: Guess | None = None,
    units: UnitNames | None = None,
    above: str = "",
) -> str:
    """Return the page as text; `above` is HTML that leads elsewhere. Raises as `page` does."""
    title = heading_of(question)
    problem = question.problem if isinstance(question, Scene) else question
    measure = question.measure if isinstance(question, Scene) else None
    if isinstance(question, Scene):
        draw, guess = draw or question.draw, question.guess if guess is None else guess
        units = units_of(question) if units is None else units
    units = NO_UNITS if units is None else units
    solution, kept, bends = answer(problem, guess, units)
    shown = (
        figure(solution.problem, solution, units=units, draw=draw, measure=measure)
        if bends
        else still(solution, units, kept)
    )
    note = f'<p class="section-note">{escape(kept)}</p>\n' if kept and bends else ""
    what = say("{title}: bend the path, and see its action", title=title)
    made = say("Made by actionopt {version}.", version=escape(__version__))
    style, *scripts = (read(STATIC / name) for name in ("style.css", *SCRIPTS))
    code = "\n".join(f"<script>\n{text}</script>" for text in scripts)
    body = f"""<main>
{above}<header class="title"><h1>{escape(title)}</h1>
<p class="lead">{escape(_sentence(solution.problem, units, measure)) if bends else ""}</p></header>
{note}{shown}
</main>
<footer class="site"><p>{made}</p></footer>
{code}"""
    return document(title, f"<style>\n{style}</style>\n", body, what)


def heading_of(question: Scene | Problem) -> str:
    """Return the heading of a page."""
    title = say(question.title) if isinstance(question, Scene) else question.name.replace("_", " ")
    return title[:1].upper() + title[1:]


def figure(
    problem: Problem,
    solution: Solution,
    *,
    units: UnitNames = NO_UNITS,
    draw: Draw | None = None,
    caption: str = "",
    name: str = "",
    shown: bool = False,
    arrows: bool = False,
    measure: Measure | None = None,
    parts: Sequence[str] = (),
) -> str:
    """Return the live figure of a problem as HTML; it needs `SCRIPTS` and the style.

    `name` tells it from others on a page; `shown` is whether the motion is seen from the start,
    and with `arrows` the sum over paths is all that is. `measure` is what its S stands for, if that
    is no action. `parts` are the buttons (bend, wave, half, hunt) and panels (lagrangian, missing,
    picture, parameters) that are not folded away, and slopes, how S falls with each handle. Raises
    ValueError as `data` does.
    """
    found: dict[str, Any] = {"name": name or problem.name, **data(problem, solution, units)}
    found["words"] = spoken()
    if measure is not None:
        name = say(measure.name) if measure.name else ""
        unit = measure.unit.replace("^2", "\N{SUPERSCRIPT TWO}")
        found["measure"] = {"name": name, "unit": unit, "factor": measure.factor}
    if draw is not None:
        found |= {"picture": drawing(solution, draw), "down": is_upside_down(solution, draw)}
    text = json.dumps(found, separators=(",", ":")).replace("</", "<\\/")
    words = f"\n<figcaption>{caption}</figcaption>" if caption else ""
    looks = " data-show" * shown + " data-sum" * arrows
    looks += f' data-with="{" ".join(parts)}"' if parts else ""
    return f"""<figure class="live" data-live="{escape(found["name"])}"{looks}>
<script type="application/json">{text}</script>
<noscript><p>{say("Scripts are off: the path cannot be bent.")}</p></noscript>{words}
</figure>"""


def _sentence(problem: Problem, units: UnitNames, measure: Measure | None) -> str:
    """Return what is asked, in words."""

    def at(q: Sequence[float | None]) -> str:
        known = [
            f"{letter(name)} = {x:.4g} {units.coordinate(name)}".rstrip().replace("-", MINUS_SIGN)
            for name, x in zip(problem.system.coordinates, q, strict=True)
            if x is not None
        ]
        return ", ".join(known[:4]) + (say(" and more") if len(known) > 4 else "") or say(
            "anywhere"
        )

    if measure is not None:
        return say(
            "From {start} to {end}: of all the ways between, for which is S stationary?",
            start=at(problem.start.q),
            end=at(problem.end.q),
        )
    return say(
        "From {start} to {end} in {T}: of all the paths between, which is the motion?",
        start=at(problem.start.q),
        end=at(problem.end.q),
        T=f"{problem.duration:.4g} {units.time}".rstrip(),
    )
