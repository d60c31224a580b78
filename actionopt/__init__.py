"""Hamilton's principle as a boundary-value problem: a Lagrangian and two events in, a path out."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from actionopt.path import Mesh, Path
from actionopt.problem import Event, Periodic, Problem, State
from actionopt.solution import Solution
from actionopt.solve import solve
from actionopt.status import SolveError, Status
from actionopt.system import System
from actionopt.trace import trace

if TYPE_CHECKING:
    from actionopt.all_paths import solve_all
    from actionopt.compare import Comparison
    from actionopt.conjugate import conjugate_points
    from actionopt.contact import contact_loss
    from actionopt.forward import IntegrationError, integrate
    from actionopt.index import second_variation
    from actionopt.pfaffian import integrate_pfaffian
    from actionopt.store import load
    from actionopt.symmetry import find_symmetries, noether
    from actionopt.varied import variation

__all__ = [
    "Comparison",
    "Event",
    "IntegrationError",
    "Mesh",
    "Path",
    "Periodic",
    "Problem",
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
    "noether",
    "second_variation",
    "solve",
    "solve_all",
    "trace",
    "variation",
]
__version__ = "0.1.0"

# What a solve does not need is imported when it is asked for. (A name that is a room's as well,
# such as `trace`, cannot wait: the room would take its place.)
_ON_DEMAND = {
    "Comparison": "compare",
    "IntegrationError": "forward",
    "conjugate_points": "conjugate",
    "contact_loss": "contact",
    "find_symmetries": "symmetry",
    "integrate": "forward",
    "integrate_pfaffian": "pfaffian",
    "load": "store",
    "noether": "symmetry",
    "second_variation": "index",
    "solve_all": "all_paths",
    "variation": "varied",
}
_ROOMS = ("chapter", "gallery", "plot", "scenes", "suite")


def __getattr__(name: str) -> Any:
    """Return a public name, or a room such as `scenes` or `plot`, that is not imported yet."""
    if name in _ON_DEMAND:
        found = getattr(import_module(f"actionopt.{_ON_DEMAND[name]}"), name)
        globals()[name] = found
        return found
    from importlib.util import find_spec

    room = f"actionopt.{name}"
    if name.startswith("_") or find_spec(room) is None:
        raise AttributeError(f"module 'actionopt' has no attribute {name!r}")
    return import_module(room)


def __dir__() -> list[str]:
    """Return the public names, and the rooms to enter from here."""
    return sorted([*__all__, *_ROOMS, "__version__"])
