"""Texts beside the modules: tables, scripts, styles. A wheel has them packed in one file.

Alike as they are, together they take three quarters of the room that they take one by one.
`hatch_build.py` packs them.
"""

import json
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
PACKED = PACKAGE / "data.xz"


def read(file: Path) -> str:
    """Return the text of a file of the package, from its place or as it was packed."""
    if PACKED.is_file():
        return unpack()[file.relative_to(PACKAGE).as_posix()]
    return file.read_text(encoding="utf-8")


@cache
def unpack() -> dict[str, str]:
    """Return the packed texts by their paths in the package."""
    import lzma  # which costs time, and is seldom needed

    return json.loads(lzma.decompress(PACKED.read_bytes()))
