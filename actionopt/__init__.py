"""Hamilton's principle as a boundary-value problem: a Lagrangian and two events in, a path out.

The question: `System`, `Event`, `Bounce`, `Periodic`, `Problem`; how to discretize: `Mesh`.
Answers: `solve`, `solve_all` (all paths), `trace` (families), `sweep` (grids); `load` from a file.
A `Solution` is a curve with its action, momenta, energies, forces, index, error and verdict.
What follows: `second_variation`, `conjugate_points`, `monodromy`, `variation`, `contact_loss`.
Mechanics: `noether`, `find_symmetries`, `integrate_pfaffian`; forward: `integrate`, `State`.
Rooms: `plot`, `scenes` (examples), `suite` (test problems), `gallery` (pages), `chapter`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from actionopt.mechanics.events import Bounce, Event, Periodic, State
from actionopt.mechanics.problem import Problem
from actionopt.mechanics.system import System

if TYPE_CHECKING:  # what is found by `__getattr__`
    from actionopt.analysis.compare import Comparison
    from actionopt.analysis.conjugate import ConjugatePoint, conjugate_points
    from actionopt.analysis.contact import Contact, contact_loss
    from actionopt.analysis.forward import IntegrationError, integrate
    from actionopt.analysis.index import Inertia
    from actionopt.analysis.modes import SecondVariation, second_variation
    from actionopt.analysis.monodromy import Monodromy, monodromy
    from actionopt.analysis.sensitivity import Sensitivity
    from actionopt.analysis.solution import Solution, SolveError
    from actionopt.analysis.status import Status
    from actionopt.analysis.store import load
    from actionopt.analysis.variation import Variation, variation
    from actionopt.discrete.mesh import Mesh
    from actionopt.discrete.path import Path
    from actionopt.families.all_paths import Paths, solve_all
    from actionopt.families.branch import Trace
    from actionopt.families.marks import Mark
    from actionopt.families.runs import Runs
    from actionopt.families.sweep import sweep
    from actionopt.families.trace import trace
    from actionopt.mechanics.obstacle import Arc
    from actionopt.mechanics.pfaffian import integrate_pfaffian
    from actionopt.mechanics.symmetry import Conserved, Symmetry, find_symmetries, noether
    from actionopt.solver.solve import solve

__all__ = [
    "Arc",
    "Bounce",
    "Comparison",
    "ConjugatePoint",
    "Conserved",
    "Contact",
    "Event",
    "Inertia",
    "IntegrationError",
    "Mark",
    "Mesh",
    "Monodromy",
    "Path",
    "Paths",
    "Periodic",
    "Problem",
    "Runs",
    "SecondVariation",
    "Sensitivity",
    "Solution",
    "SolveError",
    "State",
    "Status",
    "Symmetry",
    "System",
    "Trace",
    "Variation",
    "conjugate_points",
    "contact_loss",
    "find_symmetries",
    "integrate",
    "integrate_pfaffian",
    "load",
    "monodromy",
    "noether",
    "second_variation",
    "solve",
    "solve_all",
    "sweep",
    "trace",
    "variation",
]
__version__ = "0.1.0"

_ROOMS = ("chapter", "gallery", "plot", "scenes", "suite")  # that users enter


_LATER = {  # modules that are imported when one of their names is asked for
    "analysis.compare": "Comparison",
    "analysis.conjugate": "ConjugatePoint conjugate_points",
    "analysis.contact": "Contact contact_loss",
    "analysis.forward": "IntegrationError integrate",
    "analysis.index": "Inertia",
    "analysis.modes": "SecondVariation second_variation",
    "analysis.monodromy": "Monodromy monodromy",
    "analysis.sensitivity": "Sensitivity",
    "analysis.solution": "Solution SolveError",
    "analysis.status": "Status",
    "analysis.store": "load",
    "analysis.variation": "Variation variation",
    "discrete.mesh": "Mesh",
    "discrete.path": "Path",
    "families.all_paths": "Paths solve_all",
    "families.branch": "Trace",
    "families.marks": "Mark",
    "families.runs": "Runs",
    "families.sweep": "sweep",
    "families.trace": "trace",
    "mechanics.obstacle": "Arc",
    "mechanics.pfaffian": "integrate_pfaffian",
    "mechanics.symmetry": "Conserved Symmetry find_symmetries noether",
    "solver.solve": "solve",
}


def __getattr__(name: str) -> Any:
    """Return a room such as `scenes`, or what a module has, that is not imported yet."""
    if name in _ROOMS:
        return import_module(f"actionopt.{name}")
    for module, names in _LATER.items():
        if name in names.split():
            globals()[name] = found = getattr(import_module(f"actionopt.{module}"), name)
            return found
    raise AttributeError(f"module 'actionopt' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return the public names, and the rooms to enter from here."""
    return sorted([*__all__, *_ROOMS, "__version__"])
