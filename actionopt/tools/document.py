"""The HTML around a page, of one file or of many."""

from __future__ import annotations

import re
from html import escape

from actionopt.tools.words import current, numerals, together

HTML_PARTS = re.compile(
    r"<(script|style|pre|code)\b.*?</\1>|<(\w+)[^>]*\blang=.*?</\2>|<[^>]*>|[^<]+", re.DOTALL
)
READ = re.compile(r'(?<=\balt=")[^"]*|(?<=\baria-label=")[^"]*')  # attributes that are read


def document(title: str, head: str, body: str, description: str = "") -> str:
    """Return a whole page in the current language; `head` and `body` are HTML."""
    about = (
        f'<meta name="description" content="{escape(numerals(description))}">\n'
        if description
        else ""
    )
    return f"""<!DOCTYPE html>
<html lang="{current()}">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
{about}<title>{escape(title)}</title>
<link rel="icon" href="data:,">
{head}</head>
<body>
{HTML_PARTS.sub(_localize, body)}
</body>
</html>
"""


def _localize(part: re.Match[str]) -> str:
    """Return a part of a page with the numbers of its language; code has those of programs."""
    if part[0][0] != "<":
        return numerals(together(part[0]))
    if part[1] or part[2]:
        return part[0]
    return READ.sub(lambda words: numerals(words[0]), part[0])
