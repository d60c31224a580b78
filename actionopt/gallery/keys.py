"""What a page depends on: the package's sources, as one short text that changes with them."""

from __future__ import annotations

import re
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import actionopt
from actionopt import scenes

PACKAGE = Path(actionopt.__file__).parent
BESIDE = ("chapter", "suite", "cli", "__main__")  # rooms no page depends on
LIBRARIES = ("casadi", "matplotlib", "numpy")
IMPORT = re.compile(r"^from actionopt\.scenes(?: import |\.)(?!_)(\w+)", re.MULTILINE)


def key(name: str) -> str:
    """Return the key of a scene's page, or of one that is about all scenes."""
    digest = sha256(_common())
    for scene in sorted(_needed(name) if name in scenes.SCENES else scenes.SCENES):
        digest.update(_source(scene))
    return digest.hexdigest()


def static() -> dict[str, str]:
    """Return the files that all pages share: name and text."""
    folder = PACKAGE / "gallery" / "static"
    return {file.name: file.read_text(encoding="utf-8") for file in sorted(folder.iterdir())}


@cache
def _common() -> bytes:
    """Return a digest of all that matters to every page: the package, and the libraries."""
    digest = sha256(actionopt.__version__.encode())
    for library in LIBRARIES:
        digest.update(f"{library} {version(library)}".encode())
    for file in sorted(PACKAGE.rglob("*")):
        room = file.relative_to(PACKAGE).parts[0].removesuffix(".py")
        beside = room in BESIDE or (room == "scenes" and file.stem in scenes.SCENES)
        if file.suffix in (".py", ".html") and not beside:
            digest.update(str(file.relative_to(PACKAGE)).encode() + file.read_bytes())
    return digest.digest()


def _needed(name: str) -> set[str]:
    """Return the scenes whose files a scene's file imports, itself among them."""
    found, ahead = set(), {name}
    while ahead:
        scene = ahead.pop()
        found.add(scene)
        ahead |= set(IMPORT.findall(_source(scene).decode())) - found
    return found & set(scenes.SCENES)


def _source(scene: str) -> bytes:
    return (PACKAGE / "scenes" / f"{scene}.py").read_bytes()
