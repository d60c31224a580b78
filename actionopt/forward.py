"""Forward integration of the equations of motion, with CVODES from SUNDIALS through CasADi.

This is the other way to the path: it knows nothing of the action, only of the Euler-Lagrange
equations, and so it can contradict a solution. The integrator works on s in [0, 1] with
t = t0 + s T and with every coordinate and velocity in units of its own size, so that one
tolerance means the same for atoms and for planets.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.path import Mesh, Path
from actionopt.problem import SURFACE_TOLERANCE, State
from actionopt.quadrature import Array
from actionopt.system import System

DEGREE = 12  # of the elements of the path
ROUNDS = 12  # of splitting elements before giving up
LOCAL = 1e-3  # CVODES bounds the error of one step; some hundred of them add up
FINEST = 1e-15  # below this local tolerance CVODES gains nothing
ROUGH = 1e-8  # local tolerance of the run that finds the sizes
CONDITION = 1e13  # of the equilibrated equations: accelerations beyond it are round-off


class IntegrationError(RuntimeError):
    """The forward integration could not be continued; the message says at what time."""


@dataclass(frozen=True, eq=False)
class Units:
    """What the integrator measures in: sizes of q and v, shape (n,), and of the equations.

    `rows` (n + m,) equilibrates the matrix of the index-1 equations, whose entries have as
    many units as there are pairs of coordinates.
    """

    q: Array
    v: Array
    rows: Array


def sizes(values: Array, least: float = 1e-14) -> Array:
    """Return the largest magnitude of each row of (n, K), shape (n,): always positive.

    A row that is zero up to round-off is given the size of the largest row, or 1.
    """
    size = np.max(np.abs(values), axis=1)
    largest = float(np.max(size))
    return np.where(size > least * largest, size, largest if largest > 0 else 1.0)


class Flow:
    """The equations of motion of a system at given parameters, ready for CVODES.

    Unconstrained they are M a = bias. With constraints the index-1 form is integrated,

        M a - G' lam = bias,      G a + gamma + 2 c (G v + f_t) + c^2 f = 0,

    in which Baumgarte's two terms, zero on every exact motion, make drift off the surface decay
    at the rate c.

    References
    ----------
    Baumgarte, Computer Methods in Applied Mechanics and Engineering 1 (1972) 1-16.
    """

    def __init__(self, system: System, parameters: Mapping[str, ArrayLike] | None = None) -> None:
        self.system = system
        self.parameters = system.table.values(parameters)
        self._packed = system.table.pack(self.parameters)[0]
        self._dae = _dae(system)

    def solver(self, s: Array, tolerance: float) -> ca.Function:
        """Return the integrator from s = 0 with output at the K increasing times `s` <= 1."""
        options = {
            "abstol": tolerance,
            "reltol": tolerance,
            "linear_multistep_method": "adams",
            "nonlinear_solver_iteration": "functional",
            "max_num_steps": 200_000,
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
        }
        return ca.integrator("forward", "cvodes", self._dae, 0.0, s, options)

    def run(
        self, solver: ca.Function, state: State, span: float, units: Units, rate: float = 10.0
    ) -> tuple[Array, Array]:
        """Integrate over the times t0 + s `span`; return q and v at the outputs, each (n, K).

        `rate` is c in units of 1 / span. Raises IntegrationError if CVODES gives up.
        """
        start = np.concatenate([state.q / units.q, state.v / units.v])
        values = np.concatenate(
            [self._packed, [state.t, span, rate / span], units.q, units.v, units.rows]
        )
        said = io.StringIO()
        try:
            with contextlib.redirect_stderr(said):
                out = solver(x0=start, p=values)["xf"].full()
        except RuntimeError as error:
            if "KeyboardInterrupt" in said.getvalue():
                raise KeyboardInterrupt from None
            raise IntegrationError(_where(solver, start, values, state.t, span)) from error
        n = self.system.n
        return out[:n] * units.q[:, None], out[n:] * units.v[:, None]
