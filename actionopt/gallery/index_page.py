"""The index: a card for each scene, by the idea that it shows; to be searched, and told by tags."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from actionopt import scenes
from actionopt.gallery.course.lessons import LESSONS
from actionopt.gallery.page import escape, frame, typeset
from actionopt.scenes import Scene
from actionopt.tools.words import say

IDEAS: tuple[tuple[str, str, Callable[[Scene], bool]], ...] = (  # the first that holds is a scene's
    (
        "Ways, times, areas",
        "What else is stationary: the time of light and of sliding, lengths, areas.",
        lambda s: s.measure is not None,
    ),
    (
        "By way of events",
        "Reflections, bounces, surfaces: what is not given there is found.",
        lambda s: bool(s.problem.through),
    ),
    (
        "The energy is given, the time is found",
        "How long it takes is a part of the answer.",
        lambda s: s.problem.asked is not None,
    ),
    (
        "With friction",
        "A force beside the Lagrangian: the equations of Lagrange and d'Alembert.",
        lambda s: s.problem.system.structure.forced,
    ),
    (
        "Constraints push",
        "What keeps a body on its wire is a force, found with the motion.",
        lambda s: bool(s.problem.system.m),
    ),
    (
        "Driven from outside",
        "The Lagrangian depends on the time, and H need not be conserved.",
        lambda s: s.problem.system.structure.depends_on_time,
    ),
    (
        "Orbits, and what is conserved",
        "Several coordinates: cyclic ones, symmetries, coordinates that turn.",
        lambda s: s.problem.system.n > 1,
    ),
    (
        "One coordinate",
        "Where to begin: springs, pendulums, a bead on a hoop.",
        lambda s: True,
    ),
)


def idea(scene: Scene) -> str:
    """Return the title of the idea under which a scene stands."""
    return next(title for title, _, holds in IDEAS if holds(scene))


def index_page(
    pages: Mapping[str, Mapping[str, Any]], own: Mapping[str, Mapping[str, Any]] = {}
) -> str:
    """Return the page for scenes and pages of one's own, and what the manifest has on each."""
    cards: dict[str, list[str]] = {title: [] for title, *_ in reversed(IDEAS)}
    notes = {title: note for title, note, _ in IDEAS}
    found: Counter[str] = Counter()
    for name in sorted(pages):
        scene, about = scenes.get(name), pages[name]
        found.update(about["tags"])
        cards[idea(scene)].append(_card(name, say(scene.title), about, say(scene.words.question)))
    body = "\n".join(
        f'<section data-group><h2>{say(title)}</h2><p class="section-note">{say(notes[title])}</p>'
        f'<ul class="cards">{"".join(rows)}</ul></section>'
        for title, rows in cards.items()
        if rows
    )
    lead = say(
        "Where a system is at one time and where at another: of all the ways between the two, it "
        "takes one whose action is stationary. Each page asks a question, and has a motion, its "
        "Lagrangian, its film, and the numbers found next to what is known exactly."
    )
    story = say("Bend a path yourself, and see the action rise, or fall.")
    lessons = say("{count} lessons: predict, try, explain.", count=len(LESSONS))
    main = f"""<header class="title"><h1>{say("Stationary action, scene by scene")}</h1>
<p class="lead">{lead}</p>
<p class="feature"><strong><a href="course.html">{say("A course")}</a></strong>
<span>{lessons}</span></p>
<p class="feature"><strong><a href="least.html">{say("Is it really least?")}</a></strong>
<span>{story}</span></p></header>
{_finder(found)}{_own(own)}{body}"""
    about = say("Stationary action, scene by scene")
    return frame(say("Gallery"), main, root="", description=about, scripts=["find.js"])


def _finder(tags: Mapping[str, int]) -> str:
    """Return a field to search in, and a button for each tag that several pages have."""
    chips = "".join(
        f'<button type="button" aria-pressed="false" data-tag="{escape(tag)}">{escape(tag)} '
        f"<span>{count}</span></button>"
        for tag, count in sorted(tags.items())
        if count > 1
    )
    nothing = say("No scene has all of this.")
    return (
        f'<search class="finder" hidden><label>{say("Search")} <input type="search"></label>'
        f'<div class="chips">{chips}</div><p role="status" data-none="{nothing}"></p></search>'
    )


def _own(pages: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the entries of pages that are no scene's of the catalogue."""
    cards = "".join(_card(name, pages[name]["title"], pages[name]) for name in sorted(pages))
    title = say("Your own")
    return (
        f'<section data-group><h2>{title}</h2><ul class="cards">{cards}</ul></section>\n'
        if cards
        else ""
    )


def _card(name: str, title: str, about: Mapping[str, Any], question: str = "") -> str:
    """Return the entry of a page; one of a problem, which nothing draws, has no small picture."""
    words = "".join(f"<li>{escape(tag)}</li>" for tag in about["tags"])
    what = escape(say("The motion at a few equal times, {motion}.", motion=about["motion"]))
    drawn = f'<img src="{name}/thumbnail.svg" alt="{what}" loading="lazy">' * bool(about["motion"])
    return (
        f'<li class="card" data-words="{escape(f"{name} {title} {question}".lower())}">{drawn}'
        f'<h3><a href="{name}/index.html">{typeset(title[0].upper() + title[1:])}</a></h3>'
        f'<ul class="tags">{words}</ul></li>'
    )
