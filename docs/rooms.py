"""Print the map of the package, drawn from its folders: what each room is and whom it imports.

    python docs/rooms.py            print it
    python docs/rooms.py --write    put it into CONTRIBUTING.md, between its two markers

A room is a folder of `actionopt`, or one of the files beside them. Imports point to the left in
`ROOMS`, and nowhere else; what is imported for annotations only, or on demand, is an import.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
PACKAGE = TOP / "actionopt"
# Left to right. The package itself (`__init__`: the public names) stands where it may be imported.
ROOMS = (
    *("tools", "mechanics", "scenes", "discrete", "analysis", "solver", "families"),
    *("__init__", "plot", "chapter", "suite", "gallery", "simple", "cli", "__main__"),
)
# Rooms within these, left to right too; "" are the modules that stand in the room itself.
INNER = {
    "mechanics": ("laws", "", "question", "conservation"),
    "discrete": ("meshes", "matrices", "action", "newton", "between_nodes", "borders", ""),
    "analysis": ("quadratic", "motion", "", "spectra"),
    "solver": ("input", "refinement", "ends", "search", "contact", "kinds", ""),
    "families": ("", "traces", "searches", "sweeps"),
}
BEGIN, END = "<!-- made by docs/rooms.py -->", "<!-- to here -->"


def dotted(file: Path) -> str:
    """Return the module's name."""
    parts = [PACKAGE.name, *file.relative_to(PACKAGE).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room(module: str) -> str:
    """Return the room a module of the package is in."""
    return (module.split(".") + ["__init__"])[1]


def inner(module: str) -> str:
    """Return the room within its room that a module is in, or "" where it is in none."""
    _, *parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in INNER.get(parts[0], ()) else ""


FILES = {dotted(file): file for file in sorted(PACKAGE.rglob("*.py"))}


@cache
def parsed(file: Path) -> ast.Module:
    """Return what a file says, as a tree."""
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def imports(file: Path) -> frozenset[str]:
    """Return the modules that a file imports, anywhere in it."""
    return frozenset(_imports(file))


@cache
def statements(file: Path) -> list[ast.AST]:
    """Return the statements of a file, without the expressions they are made of."""
    return list(_statements(parsed(file)))


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.stmt, ast.excepthandler, ast.match_case)):
            yield child
            yield from _statements(child)


def _imports(file: Path) -> Iterator[str]:
    for node in statements(file):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file.name}: write imports from the top, actionopt.x"
            assert node.module is not None
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in FILES else node.module


def arrows() -> dict[str, set[str]]:
    """Return which modules of the package each of them imports."""
    return {m: {x for x in imports(f) if x in FILES} for m, f in FILES.items()}


def sentence(file: Path) -> str:
    """Return the first line of a module's docstring."""
    text = ast.get_docstring(parsed(file)) or ""
    return text.split("\n\n")[0].replace("\n", " ").rstrip(".")


def drawn() -> str:
    """Return the map, as Markdown."""
    found = arrows()
    lines = ["| room | what it is | imports |", "|---|---|---|"]
    files = []
    for name in ROOMS:
        folder, single = PACKAGE / name, PACKAGE / f"{name}.py"
        inside = {m for m in found if room(m) == name}
        others = {room(x) for m in inside for x in found[m]} - {name}
        what = sentence(folder / "__init__.py" if folder.is_dir() else single)
        shown = f"`{name}/`" if folder.is_dir() else f"`{name}.py`"
        told = ", ".join(sorted(others, key=ROOMS.index)).replace("__init__", "actionopt")
        lines.append(f"| {shown} | {what} | {told} |")
        if name in ROOMS[: ROOMS.index("__init__")] and name != "scenes":
            for within in INNER.get(name, ("",)):
                files += _listed(name, within, sorted(m for m in inside if inner(m) == within))
    return "\n".join([*lines, *files]) + "\n"


def _listed(name: str, within: str, modules: list[str]) -> list[str]:
    """Return the lines about the modules of a room, or of one within it."""
    top = f"actionopt.{name}" + (f".{within}" if within else "")
    said = f": {sentence(FILES[top])}" if within else ""
    lines = [f"- `{m.split('.')[-1]}`: {sentence(FILES[m])}" for m in modules if m != top]
    return [f"\n`{top[10:].replace('.', '/')}/`{said}\n", *lines] if lines else []


if __name__ == "__main__":
    text = drawn()
    if "--write" in sys.argv:
        page = TOP / "CONTRIBUTING.md"
        before, rest = page.read_text(encoding="utf-8").split(BEGIN)
        after = rest.split(END)[1]
        page.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{after}", encoding="utf-8")
    else:
        print(text)
