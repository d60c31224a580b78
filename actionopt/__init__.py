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

from actionopt.mechanics.question.events import Bounce, Event, Periodic, State
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System

if TYPE_CHECKING:  # what is found by `__getattr__`
    from actionopt.analysis.contact import Contact, contact_loss
    from actionopt.analysis.motion.compare import Comparison
    from actionopt.analysis.motion.forward import IntegrationError, integrate
    from actionopt.analysis.quadratic.index import Inertia
    from actionopt.analysis.quadratic.sensitivity import Sensitivity
    from actionopt.analysis.solution import Solution, SolveError
    from actionopt.analysis.spectra.conjugate import ConjugatePoint, conjugate_points
    from actionopt.analysis.spectra.modes import SecondVariation, second_variation
    from actionopt.analysis.spectra.monodromy import Monodromy, monodromy
    from actionopt.analysis.spectra.variation import Variation, variation
    from actionopt.analysis.status import Status
    from actionopt.analysis.store import load
    from actionopt.discrete.meshes.mesh import Mesh
    from actionopt.discrete.meshes.path import Path
    from actionopt.families.searches.all_paths import Paths, solve_all
    from actionopt.families.sweeps.runs import Runs
    from actionopt.families.sweeps.sweep import sweep
    from actionopt.families.traces.branch import Trace
    from actionopt.families.traces.marks import Mark
    from actionopt.families.traces.trace import trace
    from actionopt.mechanics.conservation.symmetry import (
        Conserved,
        Symmetry,
        find_symmetries,
        noether,
    )
    from actionopt.mechanics.pfaffian import integrate_pfaffian
    from actionopt.mechanics.question.obstacle import Arc
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
    "analysis.motion.compare": "Comparison",
    "analysis.spectra.conjugate": "ConjugatePoint conjugate_points",
    "analysis.contact": "Contact contact_loss",
    "analysis.motion.forward": "IntegrationError integrate",
    "analysis.quadratic.index": "Inertia",
    "analysis.spectra.modes": "SecondVariation second_variation",
    "analysis.spectra.monodromy": "Monodromy monodromy",
    "analysis.quadratic.sensitivity": "Sensitivity",
    "analysis.solution": "Solution SolveError",
    "analysis.status": "Status",
    "analysis.store": "load",
    "analysis.spectra.variation": "Variation variation",
    "discrete.meshes.mesh": "Mesh",
    "discrete.meshes.path": "Path",
    "families.searches.all_paths": "Paths solve_all",
    "families.traces.branch": "Trace",
    "families.traces.marks": "Mark",
    "families.sweeps.runs": "Runs",
    "families.sweeps.sweep": "sweep",
    "families.traces.trace": "trace",
    "mechanics.question.obstacle": "Arc",
    "mechanics.pfaffian": "integrate_pfaffian",
    "mechanics.conservation.symmetry": "Conserved Symmetry find_symmetries noether",
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
