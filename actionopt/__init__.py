"""Hamilton's principle as a boundary-value problem: a Lagrangian and two events in, a path out."""

from actionopt.compare import Comparison
from actionopt.forward import IntegrationError, integrate
from actionopt.path import Mesh, Path
from actionopt.problem import Event, Periodic, Problem, State
from actionopt.solution import Solution
from actionopt.solve import solve
from actionopt.status import SolveError, Status
from actionopt.store import load
from actionopt.system import System

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
    "integrate",
    "load",
    "solve",
]
__version__ = "0.1.0"
