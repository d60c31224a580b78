"""Who may import whom: arrows go from a higher rank to a lower one, and nowhere else."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import actionopt

PACKAGE = Path(actionopt.__file__).parent

# One row a rank, lowest first. A room is a module or a folder; each must be named here once.
RANKS = (
    ("checks", "interrupts"),
    ("progress", "quadrature", "status", "symbolic", "watch", "writing"),
    ("identity", "path", "pointwise", "tracing"),
    ("instants", "switches"),
    ("laws",),
    ("system",),
    ("invariance", "pfaffian", "problem"),
    ("contact", "crossing", "flow", "jumps", "scenes", "symmetry", "transcription"),
    ("newton",),
    (
        "branch",
        "continuation",
        "deflation",
        "descent",
        "preflight",
        "quadratic_form",
        "refine",
    ),
    ("fan", "jacobi", "rates"),
    ("conjugate", "index", "meeting", "sensitivity", "varied"),
    ("solution",),
    ("arguments", "relaxation", "walk"),
    ("settle",),
    ("search",),
    ("solve", "trial"),
    ("forward", "store", "trace"),
    ("compare",),
    ("exploration", "sweep"),
    ("all_paths",),
    ("__init__",),  # the public names
    ("chapter", "plot"),
    ("gallery", "suite"),
    ("cli",),
    ("__main__",),
)
RANK = {room: rank for rank, rooms in enumerate(RANKS) for room in rooms}

# A solution offers what is made from it, on demand: the only arrows that point the other way.
ON_DEMAND = {("solution", "compare"), ("solution", "store")}

# Library: its only room. PIL comes with matplotlib. scipy is no dependency: the suite compares
# its solvers where it is there.
THIRD_PARTY = {"casadi": None, "numpy": None, "matplotlib": "plot", "PIL": "plot", "scipy": "suite"}
SOLVERS = ("transcription", "suite")  # the suite puts its problems to every solver there is

MODULES = sorted(PACKAGE.rglob("*.py"))


def room_of(file: Path) -> str:
    return file.relative_to(PACKAGE).with_suffix("").parts[0]


def imports(file: Path) -> Iterator[tuple[str, bool]]:
    """Yield (dotted module, whether at module level) for every import that runs."""
    tree = ast.parse(file.read_text(encoding="utf-8"))

    def walk(node: ast.AST, top: bool) -> Iterator[tuple[str, bool]]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
                continue  # for annotations only; never runs
            if isinstance(child, ast.Import):
                yield from ((alias.name, top) for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                assert child.level == 0, f"{file.name}: write imports from the top, actionopt.x"
                if child.module == "actionopt":
                    for alias in child.names:
                        is_room = alias.name in RANK
                        yield (f"actionopt.{alias.name}" if is_room else "actionopt"), top
                elif child.module in folders():
                    for alias in child.names:
                        inner = f"{child.module}.{alias.name}"
                        yield (inner if inner in names() else child.module), top
                else:
                    yield str(child.module), top
            inside = isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
            yield from walk(child, top and not inside)

    yield from walk(tree, True)


def dotted(file: Path) -> str:
    parts = ["actionopt", *file.relative_to(PACKAGE).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 2 else parts)


def names() -> set[str]:
    return {dotted(file) for file in MODULES}


def folders() -> set[str]:
    return {dotted(f) for f in MODULES if f.name == "__init__.py" and f.parent != PACKAGE}


def target_room(module: str) -> str:
    return module.split(".")[1] if "." in module else "__init__"


@pytest.mark.parametrize("file", MODULES, ids=dotted)
def test_arrows_point_down(file):
    room = room_of(file)
    assert room in RANK, f"give {room!r} a place in RANKS"
    for module, top in imports(file):
        if module.split(".")[0] != "actionopt":
            continue
        target = target_room(module)
        if target == room or (not top and (room, target) in ON_DEMAND):
            continue
        assert RANK[target] < RANK[room], f"{dotted(file)} must not import {module}"


@pytest.mark.parametrize("file", MODULES, ids=dotted)
def test_libraries_stay_in_their_rooms(file):
    for module, _ in imports(file):
        library = module.split(".")[0]
        if library == "actionopt" or library in sys.stdlib_module_names:
            continue
        assert library in THIRD_PARTY, f"{dotted(file)} imports {library}, which is no dependency"
        assert THIRD_PARTY[library] in (None, room_of(file)), f"{dotted(file)} imports {library}"


@pytest.mark.parametrize("file", [f for f in MODULES if room_of(f) not in SOLVERS], ids=dotted)
def test_only_the_transcription_knows_the_interface_of_ipopt(file):
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute):
            assert node.attr not in ("nlpsol", "qpsol")
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            assert not node.value.startswith(("ipopt.", "nlpsol"))


def test_no_module_needs_itself():
    graph = {
        dotted(file): {m for m, top in imports(file) if top and m in names()} for file in MODULES
    }
    TopologicalSorter(graph).prepare()  # raises CycleError


def test_importing_the_package_imports_nothing_optional():
    command = [sys.executable, "-X", "importtime", "-c", "import actionopt"]
    report = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    imported = {line.rsplit("|", 1)[-1].strip().split(".")[0] for line in report.splitlines()}
    assert "casadi" in imported
    assert not imported & {"matplotlib", "scipy", "mpmath", "heyoka"}
