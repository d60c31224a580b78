"""The index: a card for each scene, in the order of the chapter's sections."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from actionopt import scenes
from actionopt.gallery.page import escape, frame, typeset
from actionopt.tools.words import say

SECTIONS = {
    "12.2": (
        "Calculus of variations",
        "Of all paths between two events, the motion is one whose action does not change to "
        "first order.",
    ),
    "12.3": (
        "Equations of motion",
        "What a Lagrangian gives for particles in potentials, and how drag is added.",
    ),
    "12.3.1": (
        "Coordinates",
        "Any coordinates will do, moving ones too: the path does not depend on them.",
    ),
    "12.3.2": (
        "Total time derivatives",
        "They change the action by a number, and the motion not at all.",
    ),
    "12.4": (
        "Constraints",
        "Built into the coordinates, or kept by a multiplier that is their force.",
    ),
    "12.5": (
        "Conserved quantities",
        "Cyclic coordinates, symmetries, and an energy function that need not be the energy.",
    ),
    "": ("Beyond the chapter", "What it leaves out, some of it without a closed form."),
}
CHAPTER = re.compile(r"Competitive Physics[^;]*?sections? (\d+\.\d+(?:\.\d+)?)")


def section(source: str) -> str:
    """Return the chapter's section that a source cites first, or nothing.

    >>> section("Competitive Physics: Mechanics and Waves (2018), section 12.5.4, p. 646")
    '12.5'
    """
    found = CHAPTER.search(source)
    if found is None:
        return ""
    return max((s for s in SECTIONS if found[1].startswith(s)), key=len)


def _with_number(number: str) -> str:
    return f'<span class="no">{number}</span> ' if number else ""


def index_page(
    pages: Mapping[str, Mapping[str, Any]], own: Mapping[str, Mapping[str, Any]] = {}
) -> str:
    """Return the page for scenes and pages of one's own, and what the manifest has on each."""
    cards: dict[str, list[str]] = {number: [] for number in SECTIONS}
    for name in sorted(pages):
        scene = scenes.get(name)
        cards[section(scene.source)].append(_card(name, say(scene.title), pages[name]))
    body = "\n".join(
        f"<section><h2>{_with_number(number)}{say(title)}</h2>"
        f'<p class="section-note">{say(note)}</p>'
        f'<ul class="cards">{"".join(cards[number])}</ul></section>'
        for number, (title, note) in SECTIONS.items()
        if cards[number]
    )
    lead = say(
        "Where a system is at one time and where at another: of all the ways between the two, it "
        "takes one whose action is stationary. Each page asks a question, and has a motion, its "
        "Lagrangian, its film, and the numbers found next to what is known exactly."
    )
    story = say("Bend a path yourself, and see the action rise, or fall.")
    lessons = say("Nine lessons: predict, try, explain.")
    main = f"""<header class="title"><h1>{say("Stationary action, scene by scene")}</h1>
<p class="lead">{lead}</p>
<p class="feature"><strong><a href="course.html">{say("A course")}</a></strong>
<span>{lessons}</span></p>
<p class="feature"><strong><a href="least.html">{say("Is it really least?")}</a></strong>
<span>{story}</span></p></header>
{_own(own)}{body}
<p class="source">{say("The sections are those of")} <cite lang="en">Competitive Physics:
Mechanics and Waves</cite> (2018), 12.</p>"""
    return frame(
        say("Gallery"), main, root="", description=say("Stationary action, scene by scene")
    )


def _own(pages: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the entries of pages that are no scene's of the catalogue."""
    cards = "".join(_card(name, pages[name]["title"], pages[name]) for name in sorted(pages))
    title = say("Your own")
    return f'<section><h2>{title}</h2><ul class="cards">{cards}</ul></section>\n' if cards else ""


def _card(name: str, title: str, about: Mapping[str, Any]) -> str:
    """Return the entry of a page; one of a problem, which nothing draws, has no small picture."""
    words = "".join(f"<li>{escape(tag)}</li>" for tag in about["tags"])
    what = escape(say("The motion at a few equal times, {motion}.", motion=about["motion"]))
    drawn = f'<img src="{name}/thumbnail.svg" alt="{what}" loading="lazy">' * bool(about["motion"])
    return (
        f'<li class="card">{drawn}'
        f'<h3><a href="{name}/index.html">{typeset(title[0].upper() + title[1:])}</a></h3>'
        f'<ul class="tags">{words}</ul></li>'
    )
