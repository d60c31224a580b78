"""How much hangs on each constant? Every one is changed, up and down, and questions asked again.

    python -m benchmarks.constants [--again solver ...] [--questions 24]

A constant is a number that a module of the core names in capitals. It is divided and multiplied by
three (a whole number by two), and those questions are asked again that call a function in which it
stands: all scenes, without their guess, and the first cases of the families of stress. An answer
is changed if its status, its index or its action is another. Of a constant that changes nothing
either way its value is free within that factor, as far as these questions tell.

The page `docs/constants.md` is written by this command. What was measured before is kept for all
constants that still have their value; the others are measured, and all those of rooms `--again`.
"""

from __future__ import annotations

import argparse
import ast
import gc
import inspect
import json
import os
import pickle
import resource
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from math import isclose, isfinite
from pathlib import Path
from time import process_time
from types import CodeType, ModuleType
from typing import Any

import actionopt as ao
from actionopt import scenes
from actionopt.tools.files import write
from actionopt.tools.progress import steps
from benchmarks.results import DOCS, packed, stamp, table, text, unpacked
from benchmarks.stress.families import FAMILIES

PAGE, ROWS = DOCS / "constants.md", DOCS / "constants.json"
ROOMS = ("solver", "families", "analysis", "discrete", "mechanics")
FACTOR, WHOLE_FACTOR = 3.0, 2
TOLERANCE = 1e-9
SAME_ACTION = 1e-6  # relative: far above the error of a path, far below the next path's distance
EACH_FAMILY = 2  # cases
DEARER = 2.0  # times the processor time of the questions: noise is below, on a busy machine, too
LONGEST = 20  # seconds of the processor: a search that a changed number does not let end
SLOWEST = 2.0  # seconds of the processor: slower questions are left out, they are asked too often

Answer = tuple[Any, ...]
Place = tuple[str, int]  # a function's file and line


@dataclass(frozen=True)
class Constant:
    """A number of the core: its module, its name and the functions in which it stands."""

    module: ModuleType
    name: str
    readers: frozenset[Place]

    def __str__(self) -> str:
        return self.name

    @property
    def place(self) -> dict[str, str]:
        """The room and the module where it stands."""
        _, room, *_, module = self.module.__name__.split(".")
        return {"room": room, "module": module}

    @property
    def value(self) -> float:
        """As it is."""
        return getattr(self.module, self.name)

    def changed(self, up: bool) -> float:
        """Return the value to try."""
        if isinstance(self.value, int):
            return self.value * WHOLE_FACTOR if up else max(self.value // WHOLE_FACTOR, 1)
        return self.value * FACTOR if up else self.value / FACTOR

    @contextmanager
    def set(self, value: float) -> Iterator[None]:
        """Give it another value wherever it was imported to: one name has one value."""
        was, name = self.value, self.name
        homes = [m for m in _modules() if m.__dict__.get(name) is was]
        for module in homes:
            setattr(module, name, value)
        yield
        for module in homes:
            setattr(module, name, was)


def constants(rooms: tuple[str, ...]) -> list[Constant]:
    """Return the constants of rooms that are numbers, in the order of their files."""
    modules, readers = [], _readers()
    for room in rooms:
        folder = Path(str(ao.__file__)).parent / room
        for file in sorted(folder.rglob("*.py")):
            place = file.relative_to(folder.parent).with_suffix("").parts
            modules.append(import_module(".".join(("actionopt", *place))))
    return [
        Constant(module, name, frozenset(readers.get(name, ())))
        for module in modules
        for name in _numbers(module)
    ]


def questions() -> dict[str, Callable[[], Answer]]:
    """Return what is asked, by name; each call asks once."""
    asked: dict[str, Callable[[], Answer]] = {
        name: partial(_solve, scenes.get(name).problem) for name in scenes.SCENES
    }
    for family, module in FAMILIES.items():
        for case in module.cases(True)[:EACH_FAMILY]:
            if case.build is not None:
                question = case.build()
                asked[f"{family}: {case.name}"] = partial(_solve, question.problem, question.guess)
            elif case.measure is not None:
                asked[f"{family}: {case.name}"] = partial(_measure, case.measure)
    return asked


def study(asked_of: list[Constant], most: int) -> list[dict[str, Any]]:
    """Return a row for each constant: what changed, of how many questions, at what price."""
    asked = questions()
    reached: dict[str, set[Place]] = {}
    for name in steps(list(asked)):
        if _in_child(asked[name])[1] < SLOWEST:
            with _calls(reached.setdefault(name, set())):
                asked[name]()  # here, so that what is derived once is not derived in each child
    before = {name: _in_child(asked[name]) for name in reached}
    rows = []
    for constant in steps(asked_of):
        names = [name for name in reached if reached[name] & constant.readers]
        names = names[:: max(len(names) // most, 1)][:most]
        row = {
            **constant.place,
            "name": constant.name,
            "value": constant.value,
            "questions": len(names),
        }
        for way, up in (("less", False), ("more", True)):
            value = constant.changed(up)
            if not names or value == constant.value:
                continue
            with constant.set(value):
                after = {name: _in_child(asked[name]) for name in names}
            row[way] = [n for n in names if not _alike(before[n][0], after[n][0])]
            spent = sum(before[n][1] for n in names)
            row[f"price of {way}"] = sum(after[n][1] for n in names) / spent
        rows.append(row)
    return rows


def as_they_are(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows of constants whose values are still those measured, where they now stand."""
    now = {c.name: c for c in constants(ROOMS)}
    found = []
    for row in rows:
        constant = now.get(row["name"])
        if constant is not None and isclose(constant.value, row["value"], rel_tol=1e-3):
            found.append({**row, **constant.place})
    return found


def page(known: dict[str, Any]) -> str:
    """Return the page of what was kept."""
    rows = unpacked(known)
    asked = [r for r in rows if r["questions"]]
    flat = [r for r in asked if not _matters(r)]
    lines = [
        "# How much hangs on each constant",
        "",
        f"Made by `python -m benchmarks.constants`, {known['about']}",
        "",
        *inspect.cleandoc(__doc__ or "").split("\n\n")[2].splitlines(),
        "",
        f"Of {len(rows)} constants {len(asked)} stand in functions that these questions call;",
        f"{len(flat)} of them may be three times as large or as small (whole numbers: twice) and",
        f"no answer changes, nor the processor time by more than a factor of {DEARER:g}.",
        "",
        "## Those on which something hangs",
        "",
        *table(
            ["constant", "in", "value", "asked", "less: changed", "more: changed", "price"],
            [_line(r) for r in asked if _matters(r)],
            range(2, 4),
        ),
        "",
        "## Those that no question reaches",
        "",
        ", ".join(f"`{r['module']}.{r['name']}`" for r in rows if not r["questions"]) + ".",
        "",
        "## Those whose value is free within the factor",
        "",
        ", ".join(f"`{r['module']}.{r['name']}` ({r['questions']})" for r in flat) + ".",
    ]
    if known.get("newer"):
        lines += ["", "## Those that are newer, or have another value, than what was measured", ""]
        lines.append(", ".join(f"`{name}`" for name in known["newer"]) + ".")
    return "\n".join(lines)


def _line(row: dict[str, Any]) -> list[str]:
    """Return the cells of a row."""
    price = " / ".join(f"{row.get(f'price of {way}', 1.0):.2g}" for way in ("less", "more"))
    changed = [", ".join(row.get(way) or ()) or "-" for way in ("less", "more")]
    where = f"{row['room']}/{row['module']}"
    return [f"`{row['name']}`", where, f"{row['value']:g}", str(row["questions"]), *changed, price]


def _matters(row: dict[str, Any]) -> bool:
    """Whether an answer changes, or the price."""
    return any(row.get(way) or row.get(f"price of {way}", 1.0) > DEARER for way in ("less", "more"))


def _solve(problem: ao.Problem, guess: Any = None) -> Answer:
    """Return the answer to a question: status, action, index."""
    try:
        solution = ao.solve(problem, guess=guess, tol=TOLERANCE, throw=False)
        index = int(solution.morse_index) if solution.success else None
    except ValueError as error:
        return (type(error).__name__, 0.0, None)
    return (solution.status.name, float(solution.action), index)


def _measure(measure: Callable[[], list[dict]]) -> Answer:
    """Return the answers of a case that measures itself."""
    return tuple((row.get("status"), 0.0, row.get("success")) for row in measure())


def _alike(one: Answer, other: Answer) -> bool:
    """Whether two answers are the same."""
    if one and isinstance(one[0], tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    if len(one) != len(other) or (one[0], *one[2:]) != (other[0], *other[2:]):
        return False
    a, b = one[1], other[1]
    return not (isfinite(a) and isfinite(b)) or abs(a - b) <= SAME_ACTION * max(1.0, abs(a), abs(b))


def _in_child(ask: Callable[[], Answer]) -> tuple[Answer, float]:
    """Return the answer and its processor time, of a child: nothing that it keeps stays."""
    read, out = os.pipe()
    gc.collect()
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST))
        clock = process_time()
        try:
            answer = ask()
        except BaseException as error:  # an answer too: that of a value that breaks something
            answer = (type(error).__name__, 0.0, None)
        with os.fdopen(out, "wb") as pipe:
            pickle.dump((answer, process_time() - clock), pipe)
        os._exit(0)
    os.close(out)
    with os.fdopen(read, "rb") as pipe:
        told = pipe.read()
    os.waitpid(child, 0)
    return pickle.loads(told) if told else (("ended", 0.0, None), 0.0)


@contextmanager
def _calls(places: set[Place]) -> Iterator[None]:
    """Collect the functions that are called."""

    def note(frame, event, _):
        if event == "call":
            places.add((frame.f_code.co_filename, frame.f_code.co_firstlineno))

    sys.setprofile(note)
    yield
    sys.setprofile(None)


def _modules() -> list[ModuleType]:
    """Return the modules of the package that are imported."""
    return [m for name, m in sys.modules.items() if name.startswith("actionopt") and m]


def _numbers(module: ModuleType) -> list[str]:
    """Return the names in capitals to which a module assigns a number."""
    names = []
    for node in ast.parse(inspect.getsource(module)).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        names += [t.id for t in targets if isinstance(t, ast.Name) and t.id.isupper()]
    return [n for n in names if type(getattr(module, n)) in (int, float)]


def _readers() -> dict[str, set[Place]]:
    """Return the functions of the package in which a name stands, by name."""
    found: dict[str, set[Place]] = {}
    for file in Path(str(ao.__file__)).parent.rglob("*.py"):
        todo = [compile(file.read_text(), str(file), "exec")]
        while todo:
            code = todo.pop()
            todo += [c for c in code.co_consts if isinstance(c, CodeType)]
            for name in code.co_names:
                if name.isupper():
                    found.setdefault(name, set()).add((str(file), code.co_firstlineno))
    return found


def main(arguments: list[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.constants", description=__doc__)
    parser.add_argument("--again", nargs="+", choices=ROOMS, default=(), help="all of these rooms")
    parser.add_argument("--questions", type=int, default=24, help="most that are asked of each")
    parser.add_argument("--report-only", action="store_true", help="measure nothing")
    options = parser.parse_args(arguments)
    known = json.loads(ROWS.read_text()) if ROWS.exists() else {"columns": (), "rows": []}
    rows = [r for r in as_they_are(unpacked(known)) if r["room"] not in options.again]
    about, measured = known.get("about"), {r["name"] for r in rows}
    new = [] if options.report_only else [c for c in constants(ROOMS) if c.name not in measured]
    if new:
        rows, about = rows + study(new, options.questions), stamp("actionopt", "casadi", "numpy")
    rows.sort(key=lambda r: (ROOMS.index(r["room"]), r["module"]))
    measured = {r["name"] for r in rows}
    newer = [f"{c.place['module']}.{c.name}" for c in constants(ROOMS) if c.name not in measured]
    write(ROWS, text({"about": about, "newer": newer, **packed(rows)}, 2) + "\n")
    write(PAGE, page(json.loads(ROWS.read_text())) + "\n")


if __name__ == "__main__":
    main()
