"""What was measured, in JSON files of one short line a row, so that two measurements compare."""

from __future__ import annotations

import datetime
import json
import os
import platform
import sys
from collections.abc import Container, Iterable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import actionopt
from actionopt.tools.files import rounded, write

COLUMNS = ("start", "setting", "kind", "time", "error", "status")
DOCS = Path(__file__).parents[1] / "docs"
LONGEST = 90  # characters of what a peer said


def text(data: Any, depth: int, indent: str = "") -> str:
    """Return JSON in which what is nested deeper than `depth` stands on one line.

    >>> print(text({"rows": [[1, 2], [3, 4]]}, 2))
    {
     "rows": [
      [1, 2],
      [3, 4]
     ]
    }
    """
    if not depth or not isinstance(data, (dict, list)) or not data:
        return json.dumps(data, ensure_ascii=False)
    inner = indent + " "
    if isinstance(data, dict):
        lines = [f"{json.dumps(k)}: {text(v, depth - 1, inner)}" for k, v in data.items()]
    else:
        lines = [text(v, depth - 1, inner) for v in data]
    first, last = "{}" if isinstance(data, dict) else "[]"
    return first + "\n" + ",\n".join(inner + line for line in lines) + f"\n{indent}{last}"


def packed(rows: Sequence[dict], columns: Iterable[str] = ()) -> dict[str, Any]:
    """Return rows as lists under common columns, rounded; null where a row has no entry."""
    columns = tuple(columns) or tuple(dict.fromkeys(k for row in rows for k in row))
    return {"columns": columns, "rows": [[rounded(r.get(k)) for k in columns] for r in rows]}


def unpacked(table: dict[str, Any]) -> list[dict]:
    """Return the rows, each with the entries that it has."""
    rows = [zip(table["columns"], row, strict=True) for row in table["rows"]]
    return [{k: v for k, v in row if v is not None} for row in rows]


def table(
    head: Sequence[str], rows: Iterable[Sequence[str]], right: Container[int] = ()
) -> list[str]:
    """Return the lines of a table in Markdown; the columns `right` are set to the right."""
    marks = ["---:" if k in right else "---" for k in range(len(head))]
    lines = ["| " + " | ".join(head) + " |", "|" + "|".join(marks) + "|"]
    return lines + ["| " + " | ".join(c.replace("|", "/") for c in row) + " |" for row in rows]


def version(package: str) -> str:
    """Return the version of a package, or of Python."""
    if package == "python":
        return platform.python_version()
    return actionopt.__version__ if package == "actionopt" else metadata.version(package)


def versions(*packages: str) -> str:
    """Return the versions of what was used."""
    return ", ".join(f"{name} {version(name)}" for name in packages)


def stamp(*packages: str) -> str:
    """Return when and with what something is measured."""
    return f"{datetime.date.today().isoformat()}; {versions(*packages)}."


def made_by(command: str, *packages: str) -> str:
    """Return the line of a page that says how it is made."""
    return f"Made by `python -m benchmarks.{command}`, {stamp(*packages)}"


def brief(said: str) -> str:
    """Return the beginning of a sentence that fits into a table."""
    said = said.replace("|", "/").replace("\n", " ")
    return said if len(said) <= LONGEST else said[: LONGEST - 3] + "..."


class Results:
    """Rows by problem and peer.

    `rows[case][peer]` is a list of dicts: start ("line" or "bent"), setting, kind ("cold" or
    "again"), time (s), error, status ("" for success).
    """

    def __init__(self, file: Path, data: dict) -> None:
        self.file, self.about = file, {k: data.get(k, {}) for k in ("machine", "versions")}
        columns = data.get("columns", COLUMNS)
        self.rows: dict[str, dict[str, list[dict]]] = {
            case: {p: unpacked({"columns": columns, "rows": r}) for p, r in by_peer.items()}
            for case, by_peer in data.get("rows", {}).items()
        }
        self._partial: dict[tuple[str, str], list[dict]] = {}

    @classmethod
    def open(cls, name: Path, fresh: bool = False) -> Results:
        """Read the results of that name, or start new ones."""
        file = name.with_suffix(".json")
        return cls(file, json.loads(file.read_text()) if file.exists() and not fresh else {})

    def has(self, case: str, peer: str) -> bool:
        """Whether a problem was measured with a peer."""
        return peer in self.rows.get(case, {})

    def add(self, case: str, peer: str, rows: list[dict]) -> None:
        """Keep rows; they count as measured once saved."""
        self._partial.setdefault((case, peer), []).extend(rows)

    def save(self) -> None:
        """Write the file."""
        for (case, peer), rows in self._partial.items():
            self.rows.setdefault(case, {})[peer] = rows
        self._partial.clear()
        rows = {
            case: {peer: packed(r, COLUMNS)["rows"] for peer, r in by_peer.items()}
            for case, by_peer in self.rows.items()
        }
        write(self.file, text({**self.about, "columns": COLUMNS, "rows": rows}, 4) + "\n")

    def describe(self, versions: dict[str, str]) -> None:
        """Record machine, date and the versions of packages."""
        self.about["versions"].update(versions)
        self.about["machine"] = {
            "processor": _processor(),
            "cores": os.cpu_count(),
            "threads used": 1,
            "system": platform.system(),
            "python": platform.python_version(),
            "date": datetime.date.today().isoformat(),
        }


def _processor() -> str:
    if sys.platform == "linux":
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":")[1].strip()
    return platform.processor() or platform.machine()
