"""The HTML around a page, of one file or of many."""

from __future__ import annotations

import re
from html import escape

from actionopt.tools.words import current, together

HTML_PARTS = re.compile(r"<(script|style|pre|code)\b.*?</\1>|<[^>]*>|[^<]+", re.DOTALL)


def document(title: str, head: str, body: str, description: str = "") -> str:
    """Return a whole page in the current language; `head` and `body` are HTML."""
    about = f'<meta name="description" content="{escape(description)}">\n' if description else ""
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
{HTML_PARTS.sub(lambda m: m[0] if m[0][0] == "<" else together(m[0]), body)}
</body>
</html>
"""
