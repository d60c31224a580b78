"""Who may import whom: the rooms of `docs/rooms.py`, arrows to the left and nowhere else."""

import ast
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).parent.parent
SPEC = importlib.util.spec_from_file_location("rooms", TOP / "docs" / "rooms.py")
assert SPEC is not None and SPEC.loader is not None
rooms = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(rooms)

# Library: its only room. PIL comes with matplotlib. scipy is no dependency: the suite compares
# its solvers where it is there.
THIRD_PARTY = {"casadi": None, "numpy": None, "matplotlib": "plot", "PIL": "plot", "scipy": "suite"}
SOLVERS = ("actionopt.solver.ipopt", "actionopt.suite")  # the suite compares all there are
MODULES = list(rooms.FILES)
ARROWS = rooms.arrows()


@pytest.mark.parametrize("module", MODULES)
def test_arrows_point_to_the_left(module):
    room = rooms.room(module)
    assert room in rooms.ROOMS, f"give {room!r} a place in ROOMS"
    for target in ARROWS[module]:
        other = rooms.room(target)
        right = rooms.ROOMS.index(other) > rooms.ROOMS.index(room)
        assert not right, f"{module} must not import {target}"


def test_the_package_and_its_short_twin_know_nothing_of_each_other():
    assert not ARROWS["actionopt.simple"]
    assert not any("actionopt.simple" in found for found in ARROWS.values())


@pytest.mark.parametrize("module", MODULES)
def test_libraries_stay_in_their_rooms(module):
    for imported in rooms.imports(rooms.FILES[module]):
        library = imported.split(".")[0]
        if library == "actionopt" or library in sys.stdlib_module_names:
            continue
        assert library in THIRD_PARTY, f"{module} imports {library}, which is no dependency"
        assert THIRD_PARTY[library] in (None, rooms.room(module)), f"{module} imports {library}"


@pytest.mark.parametrize("module", [m for m in MODULES if not m.startswith(SOLVERS)])
def test_one_module_knows_the_interface_of_ipopt(module):
    for node in ast.walk(ast.parse(rooms.FILES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute):
            assert node.attr not in ("nlpsol", "qpsol")
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            assert not node.value.startswith(("ipopt.", "nlpsol"))


def test_the_map_is_the_one_in_contributing():
    page = (TOP / "CONTRIBUTING.md").read_text(encoding="utf-8")
    printed = page.split(rooms.BEGIN)[1].split(rooms.END)[0]
    assert printed.strip() == rooms.drawn().strip(), "run: python docs/rooms.py --write"


def test_importing_the_package_imports_nothing_optional():
    command = [sys.executable, "-X", "importtime", "-c", "import actionopt"]
    report = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    imported = {line.rsplit("|", 1)[-1].strip().split(".")[0] for line in report.splitlines()}
    assert "casadi" in imported
    assert not imported & {"matplotlib", "scipy", "mpmath", "heyoka"}
