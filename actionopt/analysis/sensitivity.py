"""Hamilton's principal function: how the action of a path changes with its ends and parameters.

    dS = p1.dq1 - p0.dq0 - H1 dt1 + H0 dt0 + int (dL/da) dt da

(Hamilton and Jacobi; the last term because S is stationary in all else). For a discrete path
these are exact derivatives of the discrete action: as t1 moves the mesh stretches,

    dS/dt1 = (1/T) sum w (L - v.p) + sum w s dL/dt,    s = (t - t0) / T,

so that no difference is taken, nothing is solved again, and the accuracy is that of the action.
With constraints L stands for L + sum lam f.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from actionopt.analysis.jacobi import resolved
from actionopt.analysis.second_variation import Form, condense
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.mechanics.compiled import Pointwise
from actionopt.mechanics.jumps import across
from actionopt.mechanics.problem import State, Tail
from actionopt.mechanics.system import System
from actionopt.tools.blas import one_thread
from actionopt.tools.types import Array

# Of the Jacobi fields; derived: second derivatives converge twice as fast, to round-off.
SENSITIVITY_RESOLUTION = 1e-8


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """First and second derivatives of the action S(q0, t0, q1, t1; parameters).

    A coordinate that an event leaves free is determined by the others: derivatives by it are
    zero. With constraints, events may move only along the surface, and first derivatives are
    to be combined with motions that do.

    Attributes
    ----------
    q0, q1 : (n,) arrays
        dS/dq0 = -p0 and dS/dq1 = p1.
    t0, t1 : float
        dS/dt0 = H0 and dS/dt1 = -H1, at fixed coordinates.
    parameters : dict
        dS/da by name, in the parameter's shape, at fixed events.
    q0q0, q0q1, q1q1 : (n, n) arrays
        Second derivatives by the ends; minus `q0q1` is Van Vleck's matrix. With constraints
        they are reduced to the tangent planes at the events: along a curve q(s) on the surface
        add dS/dq . q''. Infinite or huge where the ends are conjugate.
    """

    q0: Array
    q1: Array
    t0: float
    t1: float
    parameters: dict[str, Array]
    q0q0: Array
    q0q1: Array
    q1q1: Array

    @property
    def van_vleck(self) -> float:
        """Van Vleck's determinant of -d2S/dq0 dq1; with constraints it is zero."""
        return float(np.linalg.det(-self.q0q1))


@one_thread
def sensitivity(at: DiscretePath, error: float, momenta: tuple[Array, Array]) -> Sensitivity:
    """Return the derivatives of the action of a path by its ends and parameters.

    `error` is the path's, `momenta` those at its ends, (n,) each. Raises ValueError for
    non-conservative forces: S is then no function of the ends that the momenta would be
    derivatives of.

    References
    ----------
    Goldstein, *Classical Mechanics* (3rd ed. 2002), sections 8.6 and 10.1; J. H. Van Vleck,
    *Proc. Natl. Acad. Sci.* 14 (1928), p. 178.
    """
    form = resolved(at, error, SENSITIVITY_RESOLUTION)
    tr, problem, node_of = at.tr, at.problem, at.tr.layout.node_of
    system, q = problem.system, at.Q[node_of]
    v = tr.velocities(q)
    _, p, L = (x.copy() for x in system.pointwise("first")(q, v, tr.times, problem.packed))
    explicit = system.made("explicit", lambda: _explicit(system))
    by_time, by_parameters = explicit(q, v, tr.times, problem.packed, at.lam[node_of])
    s = (tr.times - problem.start.t) / problem.duration
    stretch = float(np.sum(tr.weight * (L - np.sum(v * p, axis=1, keepdims=True))))
    stretch /= problem.duration
    t1 = stretch + float(np.sum(tr.weight * s * by_time))
    t0 = -stretch + float(np.sum(tr.weight * (1 - s) * by_time))
    packed = np.sum(tr.weight * by_parameters, axis=0)
    inner = tuple(i for i in problem.instants if problem.start.t < i[0] and i[1] < problem.end.t)
    if inner:  # at rest while the times about them are stretched, and moved by parameters
        jumps = np.array([_jump(at, before, after) for before, after in inner])
        s = (np.array(inner)[:, 1] - problem.start.t) / problem.duration
        t1, t0 = t1 - float(s @ jumps), t0 - float((1 - s) @ jumps)
        assert system.clock is not None
        packed = packed + jumps @ system.clock.moving(inner, problem.packed)
    q0, q1 = -momenta[0], momenta[1].copy()
    for row, event in ((q0, problem.start), (q1, problem.end)):
        row[[i for i, x in enumerate(event.q) if x is None]] = 0.0
    if problem.has_tails:  # what is beyond the window's edges goes with the system
        known = next(x for x in problem.rests if x is not None)
        ends = np.array([[problem.start.t], [problem.end.t]])
        at_rest = np.broadcast_to(known.q, (len(tr.times), known.q.size))
        still, nowhere = np.zeros_like(at_rest), np.zeros((len(tr.times), 0))
        level = explicit(at_rest, still, tr.times, problem.packed, nowhere)[1]
        packed = packed - np.sum(tr.weight * level, axis=0)
        L = system.pointwise("value")(at_rest[:2], still[:2], ends, problem.packed)[0][:, 0]
        t0 = 0.0 if isinstance(problem.start, Tail) else t0 + float(L[0])
        t1 = 0.0 if isinstance(problem.end, Tail) else t1 - float(L[1])
    return Sensitivity(q0, q1, t0, t1, _unpack(system, packed), *_second(form))


def _jump(at: DiscretePath, before: float, after: float) -> float:
    """Return dS/dt of an instant, which is by how much H jumps there: q and p do not."""
    system, parameters, path = at.problem.system, at.problem.parameters, at.path
    beyond = State(after, path(after), path.velocity(after))
    here = across(system, parameters, beyond, before)
    H = [system.energy(x.q, x.v, x.t, parameters=parameters) for x in (here, beyond)]
    return float(H[1] - H[0])


def _second(form: Form) -> tuple[Array, Array, Array]:
    """Return the second derivatives by q0 twice, q0 and q1, q1 twice, each (n, n)."""
    hessian = condense(form).hessian
    problem, n = form.tr.problem, form.units.size
    maps, first = [], 0
    for k, event, count in (
        (0, problem.start, form.pinned[0]),
        (-1, problem.end, form.pinned[1]),
    ):
        # Directions a of the pinned coordinates: dq = units * basis a.
        pinned = list(event.pinned)
        directions = (form.units[:, None] * form.basis[k])[pinned, :count]
        to_directions = np.zeros((hessian.shape[0], n))
        to_directions[first : first + count, pinned] = np.linalg.pinv(directions)
        maps.append(to_directions)
        first += count
    start, end = maps
    return start.T @ hessian @ start, start.T @ hessian @ end, end.T @ hessian @ end


def _explicit(system: System) -> Pointwise:
    """Return the partial derivatives of L + sum lam f by the time and the packed parameters."""
    s = system.symbols
    lam = ca.SX.sym("lam", system.m)
    L = system.L + (ca.dot(lam, system.f) if system.m else 0)
    by_time = ca.densify(ca.jacobian(L, s.t))
    by_parameters = ca.densify(ca.jacobian(L, s.p).T)
    function = ca.Function("explicit", [s.q, s.v, s.t, s.p, lam], [by_time, by_parameters])
    return Pointwise(function)


def _unpack(system: System, packed: Array) -> dict[str, Array]:
    """Return packed derivatives by name, each in its parameter's shape."""
    result, first = {}, 0
    for name, shape in system.table.shapes.items():
        size = int(np.prod(shape))
        result[name] = packed[first : first + size].reshape(shape)
        first += size
    return result
