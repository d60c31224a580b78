"""Hamilton's principal function: how the action of a path changes with its ends and parameters.

    dS = p1.dq1 - p0.dq0 - H1 dt1 + H0 dt0 + int (dL/da) dt da

(Hamilton and Jacobi; the last term because S is stationary in all else). For a discrete path
these are exact derivatives of the discrete action (those by the times are in `end_times`), so that
no difference is taken, nothing is solved again, and the accuracy is that of the action.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from actionopt.analysis.jacobi import resolve
from actionopt.analysis.second_variation import Form, condense
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.end_times import by_times, explicit, jumps_of
from actionopt.discrete.surfaces import reactions, surface_at
from actionopt.mechanics.held import Held
from actionopt.mechanics.problem import Tail
from actionopt.mechanics.system import System
from actionopt.tools.blas import one_thread
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

# Of the Jacobi fields; derived: second derivatives converge twice as fast, to round-off.
SENSITIVITY_RESOLUTION = 1e-8


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """First and second derivatives of the action S(q0, t0, q1, t1; parameters).

    A coordinate that an event leaves free is determined by the others: derivatives by it are
    zero; where it lies on a surface it moves with that, at its `parameters`, too. With
    constraints, events may move only along the surface, and first derivatives are to be combined
    with motions that do.

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

    __repr__ = one_line

    @property
    def van_vleck(self) -> float:
        """Van Vleck's determinant of -d2S/dq0 dq1; with constraints it is zero."""
        return float(np.linalg.det(-self.q0q1))


@one_thread
def sensitivity(at: DiscretePath, error: float, momenta: tuple[Array, Array]) -> Sensitivity:
    """Return the derivatives of the action of a path by its ends and parameters.

    `error` is the path's, `momenta` those at its ends, (n,) each. Raises ValueError for a path in
    contact with an obstacle, and for non-conservative forces: S is then no function of the ends
    that the momenta would be derivatives of.

    References
    ----------
    Goldstein, *Classical Mechanics* (3rd ed. 2002), sections 8.6 and 10.1; J. H. Van Vleck,
    *Proc. Natl. Acad. Sci.* 14 (1928), p. 178.
    """
    if isinstance(at.problem, Held):
        raise ValueError(
            "expected a path that touches no obstacle, found one that does: its contact changes "
            "with the events, which these derivatives do not count; solve for neighbouring events "
            "and take differences, or see `momenta` for dS by the coordinates there"
        )
    form = resolve(at, error, SENSITIVITY_RESOLUTION)
    found = slopes(at, momenta)
    q0, q1 = found["q0"], found["q1"]
    problem = at.problem
    for row, on, event in zip(
        (q0, q1), problem.surfaces, (problem.start, problem.end), strict=True
    ):
        row[[i for i, x in enumerate((on or event).q) if x is None]] = 0.0
    parameters = _unpack(at.problem.system, found["parameters"])
    return Sensitivity(q0, q1, float(found["t0"]), float(found["t1"]), parameters, *_second(form))


def slopes(at: DiscretePath, momenta: tuple[Array, Array]) -> dict[str, Array]:
    """Return the first derivatives of S: by "q0", "q1" (n,), "t0", "t1" and "parameters" (p,).

    The last packed. Only where no force is non-conservative.
    """
    tr, problem, node_of = at.tr, at.problem, at.tr.layout.node_of
    system, q = problem.system, at.Q[node_of]
    t0, t1 = by_times(at)
    lam = at.lam[node_of]
    by_parameters = explicit(system)(q, tr.velocities(q), tr.times, problem.packed, lam)[1]
    packed = np.sum(tr.weight * by_parameters, axis=0)
    inner, jumps = jumps_of(at)
    if inner:  # moved by parameters
        assert system.clock is not None
        packed = packed + jumps @ system.clock.moving(inner, problem.packed)
    q0, q1 = -momenta[0], momenta[1].copy()
    for k, row in enumerate((q0, q1)):
        if problem.surfaces[k] is not None:  # S + mu.on is what is stationary
            mu, _ = reactions(at, -k)
            _, by_q, by_t, by_p = surface_at(at, -k)
            row += mu @ by_q
            t0, t1 = (t0, t1 + float(mu @ by_t)) if k else (t0 + float(mu @ by_t), t1)
            packed = packed + mu @ by_p
    if problem.has_tails:  # what is beyond the window's edges goes with the system
        known = next(x for x in problem.rests if x is not None)
        ends = np.array([[problem.start.t], [problem.end.t]])
        at_rest = np.broadcast_to(known.q, (len(tr.times), known.q.size))
        still, nowhere = np.zeros_like(at_rest), np.zeros((len(tr.times), 0))
        level = explicit(system)(at_rest, still, tr.times, problem.packed, nowhere)[1]
        packed = packed - np.sum(tr.weight * level, axis=0)
        L = system.pointwise("value")(at_rest[:2], still[:2], ends, problem.packed)[0][:, 0]
        t0 = 0.0 if isinstance(problem.start, Tail) else t0 + float(L[0])
        t1 = 0.0 if isinstance(problem.end, Tail) else t1 - float(L[1])
    return {
        "q0": q0, "q1": q1, "t0": np.array(t0), "t1": np.array(t1), "parameters": packed,
    }  # fmt: skip


def _second(form: Form) -> tuple[Array, Array, Array]:
    """Return the second derivatives by q0 twice, q0 and q1, q1 twice, each (n, n)."""
    hessian = condense(form).hessian
    problem, n = form.tr.problem, form.units.size
    maps, first = [], 0
    for k, count in enumerate(form.pinned):
        # Directions a of the pinned coordinates: dq = units * basis a, and none off a surface.
        asked = problem.surfaces[k]
        pinned = list((asked or (problem.start, problem.end)[k]).pinned)
        basis = (form.units[:, None] * form.basis[-k])[:, :count]
        directions = basis[pinned]
        if asked is not None:
            directions = np.concatenate([directions, surface_at(form.at, -k)[1] @ basis])
        to_directions = np.zeros((hessian.shape[0], n))
        inverse = np.linalg.pinv(directions)
        to_directions[first : first + count, pinned] = inverse[:, : len(pinned)]
        maps.append(to_directions)
        first += count
    start, end = maps
    return start.T @ hessian @ start, start.T @ hessian @ end, end.T @ hessian @ end


def _unpack(system: System, packed: Array) -> dict[str, Array]:
    """Return packed derivatives by name, each in its parameter's shape."""
    result, first = {}, 0
    for name, shape in system.table.shapes.items():
        size = int(np.prod(shape))
        result[name] = packed[first : first + size].reshape(shape)
        first += size
    return result
