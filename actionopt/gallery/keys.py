"""What a page depends on: the package's sources, as one short text that changes with them."""

from __future__ import annotations

import re
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from importlib.resources import files

import actionopt
from actionopt import scenes

BESIDE = ("chapter", "suite", "cli", "__main__", "scenes")  # rooms no page depends on as a whole
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
    folder = files("actionopt.gallery") / "static"
    return {f.name: f.read_text(encoding="utf-8") for f in folder.iterdir() if f.is_file()}


@cache
def _common() -> bytes:
    """Return a digest of all that matters to every page: the package, and the libraries."""
    digest = sha256(actionopt.__version__.encode())
    for library in LIBRARIES:
        digest.update(f"{library} {version(library)}".encode())
    package = files("actionopt")
    for room in sorted(package.iterdir(), key=lambda f: f.name):
        if room.name.removesuffix(".py") in BESIDE:
            continue
        for file in [room] if room.is_file() else sorted(room.iterdir(), key=lambda f: f.name):
            if file.is_file() and file.name.endswith(".py"):
                digest.update(file.name.encode() + file.read_bytes())
    for file in ("__init__", "_elliptic", "_scene", "_shapes"):
        digest.update(_source(file))
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
    return (files("actionopt.scenes") / f"{scene}.py").read_bytes()
