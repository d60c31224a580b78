"""What all pages share: the frame around a page, and how text and numbers are written in it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from actionopt import __version__
from actionopt.tools.document import document
from actionopt.tools.greek import GREEK
from actionopt.tools.words import say

__all__ = [
    "Page",
    "escape",
    "frame",
    "prose",
    "table",
    "typeset",
]

SITE = (("course.html", "Course"), ("least.html", "Is it really least?"))
_GREEK = "|".join(name for name in GREEK if name.isalpha())
WRITTEN = (  # how docstrings write mathematics, escaped, and how books do, in this order
    (rf"\b({_GREEK})(?=\d?\b)", lambda name: GREEK[name[1]]),
    (r"\bw(?=[0t]?\b)", GREEK["omega"]),
    (r"(?<!\w)(\w)(\d?)''", "\\1\u0308\\2"),
    (r"(?<!\w)(\w)(\d?)'(?!\w)", "\\1\u0307\\2"),
    (r"(?<![\w.])([^\W\d]\u0307?)(\d)\b", r"\1<sub>\2</sub>"),
    (r"\^(\w)", r"<sup>\1</sup>"),
    (  # the index of a momentum
        r"(?<!\w)([pv])_([^\W\d]+)\b",
        lambda name: f"{name[1]}<sub>{GREEK.get(name[2], name[2])}</sub>",
    ),
    (r"\bhbar\b", "\u0127"),
    (r"\bsqrt\(", "\u221a("),
    (r"(?<=\w)'(?=\w)", "\N{RIGHT SINGLE QUOTATION MARK}"),
    (r"-&gt;", "\u2192"),
    (r"&lt;=", "\u2264"),
    (r"(?<![\w.])-(?=[\w(\u221a])|(?<= )-(?= )", "\u2212"),
)


@dataclass(frozen=True)
class Page:
    """A page made, not yet written.

    Attributes
    ----------
    files : mapping from str to str
        Path below the gallery's folder and text of each file.
    tags : tuple of str
        Words for the index.
    motion : str
        What is seen in the small picture there.
    title : str
        Its entry in the index.
    """

    files: dict[str, str]
    tags: tuple[str, ...] = ()
    motion: str = ""
    title: str = ""


def frame(
    title: str, main: str, *, root: str, description: str, scripts: Sequence[str] = ()
) -> str:
    """Return a whole page around the HTML `main`; `root` leads to the gallery's folder."""
    head = "".join(f'<script defer src="{root}{name}"></script>\n' for name in scripts)
    links = "".join(f'<a href="{root}{href}">{say(text)}</a>\n' for href, text in SITE)
    made = say(
        "Made by actionopt {version}. Every number was computed when this page was made.",
        version=escape(__version__),
    )
    head = f"""<link rel="stylesheet" href="{root}style.css">
<link rel="stylesheet" href="{root}gallery.css">
{head}"""
    body = f"""<a class="skip" href="#main">{say("Skip to the content")}</a>
<header class="site">
<nav aria-label="{say("Gallery")}">
<a class="home" href="{root}index.html">actionopt <span>{say("gallery")}</span></a>
{links}</nav>
</header>
<main id="main">
{main}
</main>
<footer class="site"><p>{made}</p></footer>"""
    return document(f"{title} - actionopt", head, body, description)


def prose(text: str) -> str:
    """Return docstring text as paragraphs, written as `typeset` does."""
    return "\n".join(f"<p>{typeset(' '.join(p.split()))}</p>" for p in text.split("\n\n") if p)


def typeset(text: str) -> str:
    """Return a line of a docstring as HTML: mathematics as in books, names in backticks as code.

    >>> typeset("p_phi, hbar of rod_pendulum")
    'p<sub>φ</sub>, ħ of rod_pendulum'
    >>> typeset("`w`: theta1'^2 <= m/s^2")
    '<code>w</code>: θ̇<sub>1</sub><sup>2</sup> ≤ m/s<sup>2</sup>'
    """
    plain, *rest = escape(text, quote=False).split("`")
    parts = [_mathematics(plain)]
    for code, plain in zip(rest[::2], rest[1::2], strict=True):
        parts += [f"<code>{code}</code>", _mathematics(plain)]
    return "".join(parts)


def _mathematics(text: str) -> str:
    for pattern, replacement in WRITTEN:
        text = re.sub(pattern, replacement, text)
    return text


def _spoken(cell: str) -> str:
    """Return a heading with its name in words where it is a formula alone."""
    alone = re.fullmatch(r'<math[^>]*alttext="([^"]*)".*</math>', cell, re.DOTALL)
    if alone is None:
        return cell
    return f'<span class="spoken">{alone[1]}</span><span aria-hidden="true">{cell}</span>'


def table(
    caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], *, kind: str = ""
) -> str:
    """Return a table of HTML cells, the first of each row its heading; on a phone a card a row."""
    first, *others = head
    top = f"<td>{first}</td>" + "".join(f'<th scope="col">{cell}</th>' for cell in others)
    body = "\n".join(
        f'<tr><th scope="row">{_spoken(first)}</th>'
        + "".join(f'<td data-of="{name}">{c}</td>' for name, c in zip(head[1:], cells, strict=True))
        + "</tr>"
        for first, *cells in rows
    )
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}">'
        f'<table class="{kind}"><caption>{escape(caption)}</caption>'
        f"<thead><tr>{top}</tr></thead>\n<tbody>{body}</tbody></table></div>"
    )
