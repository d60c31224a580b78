"""A page of the suite: its style, its tables and its figures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from actionopt.tools.document import document
from actionopt.tools.files import write as write_file

PAGE_STYLE = """
:root { color-scheme: light }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto }
div { overflow-x: auto }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums }
pre { overflow-x: auto }
th, td { padding: 0.2rem 0.7rem; border-bottom: 1px solid #ddd; text-align: right }
th:first-child, td:first-child { text-align: left }
img { max-width: 100% }
.right { color: #007a5a } .wrong { color: #b84a00; font-weight: bold }
"""


def write(file: Path, title: str, body: str) -> Path:
    """Write a page whose heading is its title; return the file."""
    heading = f"<h1>{escape(title)}</h1>\n"
    write_file(file, document(title, f"<style>{PAGE_STYLE}</style>\n", heading + body))
    return file


def figure(ax: Any, folder: Path, name: str, title: str) -> str:
    """Save the figure of matplotlib's axes beside a page; return its place in HTML."""
    from actionopt.plot import profiles  # matplotlib only where something is drawn

    profiles.save(ax, folder / f"{name}.svg")
    return f'<p><img src="{name}.svg" alt="{escape(title)}"></p>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in HTML."""
    lines = ["<div><table>", f"<tr>{''.join(f'<th>{escape(cell)}</th>' for cell in head)}</tr>"]
    for row in rows:
        lines.append(f"<tr>{''.join(map(_cell, row))}</tr>")
    return "\n".join([*lines, "</table></div>"])


def _cell(text: str) -> str:
    kind = f' class="{text}"' if text in ("right", "wrong") else ""
    return f"<td{kind}>{escape(text)}</td>"
