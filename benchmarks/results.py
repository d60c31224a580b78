"""What was measured, in one JSON file that is written whole or not at all."""

from __future__ import annotations

import datetime
import json
import os
import platform
import sys
from pathlib import Path


class Results:
    """Rows by problem and peer.

    `rows[case][peer]` is a list of dicts: setting, start ("line" or "bent"), kind ("cold" or
    "again"), time and times (s), error, status ("" for success), memory (bytes).
    """

    def __init__(self, file: Path, data: dict) -> None:
        self.file, self.data = file, data
        self.rows: dict[str, dict[str, list[dict]]] = data["rows"]
        self._partial: dict[tuple[str, str], list[dict]] = {}

    @classmethod
    def open(cls, name: Path, fresh: bool = False) -> Results:
        """Read the results of that name, or start new ones."""
        file = name.with_suffix(".json")
        if file.exists() and not fresh:
            return cls(file, json.loads(file.read_text()))
        return cls(file, {"machine": {}, "versions": {}, "rows": {}})

    def has(self, case: str, peer: str) -> bool:
        """Whether a problem was measured with a peer."""
        return peer in self.rows.get(case, {})

    def add(self, case: str, peer: str, rows: list[dict]) -> None:
        """Keep rows; they count as measured once saved."""
        self._partial.setdefault((case, peer), []).extend(rows)

    def save(self) -> None:
        """Write the file through a temporary one."""
        for (case, peer), rows in self._partial.items():
            self.rows.setdefault(case, {})[peer] = rows
        self._partial.clear()
        self.file.parent.mkdir(parents=True, exist_ok=True)
        new = self.file.with_suffix(".part")
        new.write_text(json.dumps(self.data, indent=1))
        os.replace(new, self.file)

    def describe(self, versions: dict[str, str]) -> None:
        """Record machine, date and the versions of packages."""
        self.data["versions"].update(versions)
        self.data["machine"] = {
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
