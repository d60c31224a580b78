"""Hamilton's principle as a boundary-value problem: a Lagrangian and two events in, a path out."""

from actionopt.all_paths import solve_all
from actionopt.compare import Comparison
from actionopt.conjugate import conjugate_points
from actionopt.contact import contact_loss
from actionopt.forward import IntegrationError, integrate
from actionopt.index import second_variation
from actionopt.path import Mesh, Path
from actionopt.pfaffian import integrate_pfaffian
from actionopt.problem import Event, Periodic, Problem, State
from actionopt.solution import Solution
from actionopt.solve import solve
from actionopt.status import SolveError, Status
from actionopt.store import load
from actionopt.symmetry import find_symmetries, noether
from actionopt.system import System
from actionopt.trace import trace
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
