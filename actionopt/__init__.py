"""Hamilton's principle as a boundary-value problem: a Lagrangian and two events in, a path out."""

from importlib import import_module
from typing import Any

from actionopt.analysis.compare import Comparison
from actionopt.analysis.conjugate import conjugate_points
from actionopt.analysis.contact import contact_loss
from actionopt.analysis.forward import IntegrationError, integrate
from actionopt.analysis.modes import second_variation
from actionopt.analysis.monodromy import monodromy
from actionopt.analysis.solution import Solution, SolveError
from actionopt.analysis.status import Status
from actionopt.analysis.store import load
from actionopt.analysis.variation import variation
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.families.all_paths import solve_all
from actionopt.families.runs import Runs
from actionopt.families.sweep import sweep
from actionopt.families.trace import trace
from actionopt.mechanics.events import Event, Periodic, State
from actionopt.mechanics.pfaffian import integrate_pfaffian
from actionopt.mechanics.problem import Problem
from actionopt.mechanics.symmetry import find_symmetries, noether
from actionopt.mechanics.system import System
from actionopt.solver.solve import solve

__all__ = [
    "Comparison",
    "Event",
    "IntegrationError",
    "Mesh",
    "Path",
    "Periodic",
    "Problem",
    "Runs",
    "Solution",
    "SolveError",
    "State",
    "Status",
    "System",
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


def __getattr__(name: str) -> Any:
    """Return a room such as `scenes` or `plot` that is not imported yet."""
    if name not in _ROOMS:
        raise AttributeError(f"module 'actionopt' has no attribute {name!r}")
    return import_module(f"actionopt.{name}")


def __dir__() -> list[str]:
    """Return the public names, and the rooms to enter from here."""
    return sorted([*__all__, *_ROOMS, "__version__"])
