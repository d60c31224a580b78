"""What the file of a scene says in words: statement, formulas, units, the program that solves it.

A scene of one's own has no such file: its formulas are those of its law.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from actionopt.gallery import units
from actionopt.mechanics.laws.written import lagrangian
from actionopt.scenes import Scene, parameters
from actionopt.tools.formula import Formula, formula

CATALOGUE = """\
import actionopt as ao
from actionopt import scenes

scene = scenes.get("{name}")
"""
OWN = """\
import actionopt as ao

# `scene` is the one that this page is about
"""


@dataclass(frozen=True)
class Texts:
    """The words on a scene, and what is written of its law.

    Attributes
    ----------
    statement : str
        What it is, the docstring's first sentence.
    sketch : str
        The drawing in it.
    remarks : str
        The rest of it.
    usage : str
        What the scene's function says of its parameters.
    formulas : tuple of Formula
        Of the functions that define the system: Lagrangian, and constraint, force, obstacle and
        integral if it has them.
    program : str
        How a program begins that has it as `scene`.
    source : str
        The source of these functions; nothing where it is not known.
    units : mapping from str to str
        Of its parameters, where they are known.
    """

    formulas: tuple[Formula, ...]
    program: str
    statement: str = ""
    sketch: str = ""
    remarks: str = ""
    usage: str = ""
    source: str = ""
    units: Mapping[str, str] = field(default_factory=dict)


def texts(name: str) -> Texts:
    """Return the words in the file of the scene `name`."""
    module = importlib.import_module(f"actionopt.scenes.{name}")
    parts = inspect.getdoc(module).split("\n\n")  # type: ignore[union-attr]
    sketches = [k for k, part in enumerate(parts) if part.startswith("    ")]
    first, last = sketches[0], sketches[-1]
    remarks = "\n\n".join(parts[1:first] + parts[last + 1 :])
    sketch = inspect.cleandoc("\n" + "\n\n".join(parts[first : last + 1]))
    usage = re.sub(r"\s*Raises\s+\w+Error.*", "", inspect.getdoc(module.scene) or "", flags=re.S)
    defined = (
        getattr(module, what, None)
        for what in ("lagrangian", "length", "constraint", "force", "obstacle", "integral")
    )
    functions = [f for f in defined if f is not None]
    formulas = tuple(formula(inspect.getdoc(f) or "") for f in functions)
    source = "\n\n".join(map(inspect.getsource, functions)).rstrip()
    known = {key: units.unit(name, key) for key in parameters(name)}
    program = CATALOGUE.format(name=name)
    return Texts(formulas, program, parts[0], sketch, remarks, usage, source, known)


def texts_of_own(scene: Scene) -> Texts:
    """Return the Lagrangian of a scene of one's own, if it can be written."""
    problem = scene.problem
    law = problem.plain or (*problem.laws, problem.system)[0]
    with suppress(ValueError):
        return Texts((formula(lagrangian(law, law.table)),), OWN)
    return Texts((), OWN)
