"""What the files of the scenes say in words: statement, sketch, formulas."""

from __future__ import annotations

import importlib
import inspect
import re
from dataclasses import dataclass

from actionopt.tools.formula import Formula, formula


@dataclass(frozen=True)
class Texts:
    """The words of a scene's file.

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
    source : str
        The source of these functions.
    """

    statement: str
    sketch: str
    remarks: str
    usage: str
    formulas: tuple[Formula, ...]
    source: str


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
    return Texts(parts[0], sketch, remarks, usage, formulas, source)
