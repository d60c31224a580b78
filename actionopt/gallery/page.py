"""What all pages share: the frame around a page, and how text and numbers are written in it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from actionopt import __version__

__all__ = ["Page", "escape", "frame", "number", "prose", "rounded", "table"]


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
    """

    files: dict[str, str]
    tags: tuple[str, ...] = ()
    motion: str = ""


def frame(
    title: str, main: str, *, root: str, description: str, scripts: Sequence[str] = ()
) -> str:
    """Return a whole page around the HTML `main`; `root` leads to the gallery's folder."""
    head = "".join(f'<script defer src="{root}{name}"></script>\n' for name in scripts)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta name="description" content="{escape(description)}">
<title>{escape(title)}</title>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="{root}style.css">
{head}</head>
<body>
<a class="skip" href="#main">Skip to the content</a>
<header class="site">
<nav aria-label="Gallery">
<a class="home" href="{root}index.html">actionopt <span>gallery</span></a>
<a href="{root}least.html">Is it really least?</a>
</nav>
</header>
<main id="main">
{main}
</main>
<footer class="site"><p>Made by actionopt {escape(__version__)}. Every number was computed
when this page was made.</p></footer>
</body>
</html>
"""


def number(value: float, digits: int = 6) -> str:
    """Return a number as HTML, powers of ten written out.

    >>> number(9.6481), number(-1.25e-10), number(3)
    ('9.6481', '&minus;1.25 &times; 10<sup>&minus;10</sup>', '3')
    """
    if not math.isfinite(value):
        return "none"
    mantissa, _, power = f"{value + 0.0:.{digits}g}".partition("e")
    text = mantissa.replace("-", "&minus;")
    if not power:
        return text
    exponent = str(int(power)).replace("-", "&minus;")
    return f"{text} &times; 10<sup>{exponent}</sup>"


def rounded(value: float, digits: int = 3) -> str:
    """Return a number as plain words, for alternative texts and labels.

    >>> rounded(9.6481), rounded(-2.5e-10)
    ('9.65', '-2.5e-10')
    """
    return f"{value + 0.0:.{digits}g}"


def prose(text: str) -> str:
    """Return docstring text as paragraphs, names in backticks as code."""
    paragraphs = (escape(" ".join(p.split()), quote=False) for p in text.split("\n\n"))
    code = r"<code>\1</code>"
    return "\n".join(f"<p>{re.sub(r'`([^`]+)`', code, p)}</p>" for p in paragraphs if p)


def table(
    caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], *, kind: str = ""
) -> str:
    """Return a table of HTML cells, the first of each row its heading; it scrolls if too wide."""
    top = "".join(f'<th scope="col">{cell}</th>' for cell in head)
    body = "\n".join(
        f'<tr><th scope="row">{first}</th>' + "".join(f"<td>{c}</td>" for c in cells) + "</tr>"
        for first, *cells in rows
    )
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}">'
        f'<table class="{kind}"><caption>{escape(caption)}</caption>'
        f"<thead><tr>{top}</tr></thead>\n<tbody>{body}</tbody></table></div>"
    )
