"""The index: a card for each scene, in the order of the chapter's sections."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from actionopt import scenes
from actionopt.gallery.page import escape, frame

SECTIONS = {
    "12.2": "Calculus of variations",
    "12.3": "Equations of motion",
    "12.3.1": "Coordinates",
    "12.3.2": "Total time derivatives",
    "12.4": "Constraints",
    "12.5": "Conserved quantities",
    "": "Beyond the chapter",
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


def index_page(tags: Mapping[str, Sequence[str]]) -> str:
    """Return the page for scenes and what is worth knowing of each."""
    cards: dict[str, list[str]] = {number: [] for number in SECTIONS}
    for name in sorted(tags):
        scene = scenes.get(name)
        cards[section(scene.source)].append(_card(name, scene.title, tags[name]))
    body = "\n".join(
        f'<section><h2><span class="no">{number}</span> {title}</h2>'
        f'<ul class="cards">{"".join(cards[number])}</ul></section>'
        for number, title in SECTIONS.items()
        if cards[number]
    )
    main = f"""<header class="title"><h1>Stationary action, scene by scene</h1>
<p class="lead">A Lagrangian and two events in, the path between them out.</p></header>
{body}"""
    return frame("actionopt gallery", main, root="", description="Stationary action in pictures")


def _card(name: str, title: str, tags: Sequence[str]) -> str:
    words = "".join(f"<li>{escape(tag)}</li>" for tag in tags)
    return (
        f'<li class="card"><img src="{name}/thumbnail.svg" alt="" loading="lazy">'
        f'<h3><a href="{name}/index.html">{escape(title)}</a></h3>'
        f'<ul class="tags">{words}</ul></li>'
    )
