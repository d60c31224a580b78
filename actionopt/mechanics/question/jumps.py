"""Where a Lagrangian jumps in time, and what a motion does there.

The Euler-Lagrange equations are d/dt (dL/dv) = dL/dq + Q + G' lam. Where L jumps at an instant,
because a force is switched on or a mass changes, the right-hand side is at most a step, so the
momentum dL/dv is continuous. The accelerations M a = dL/dq - ... do not know it: they miss the
rate of dL/dv at that instant, which is infinite. So the instant is found, the equations are
integrated up to it and from it, and the velocity between is the one that keeps the momentum.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.instants import INTERVALS, Instant, merge
from actionopt.mechanics.laws.switches import KINKS
from actionopt.mechanics.question.events import State
from actionopt.mechanics.system import System
from actionopt.tools.lobatto import lgl
from actionopt.tools.types import Array

RULE = lgl(6)  # sums what changes smoothly between two times; ad hoc, of order h^12
JUMP = 1e-9  # of the largest value: smaller jumps are ignored; ad hoc


def jumps(
    system: System, parameters: Mapping[str, ArrayLike] | None, times: Array, q: Array, v: Array
) -> list[Instant]:
    """Return the instants at which L, dL/dv or df/dt jump at fixed q and v, in order of time.

    Between every two of the increasing `times` (K,), where the motion is about q and v (n, K) or
    (n, K - 1), the change is compared with the integral of the rate, and what is left over is
    followed by bisection down to neighbouring numbers.
    """
    if not system.structure.depends_on_time or KINKS.isdisjoint(system.structure.operations):
        return []
    sym = system.symbols
    what = ca.vertcat(system.L, ca.gradient(system.L, sym.v), ca.jacobian(system.f, sym.t))
    function = Pointwise(
        ca.Function(
            "clock",
            [sym.q, sym.v, sym.t, sym.p],
            [ca.densify(what), ca.densify(ca.jacobian(what, sym.t))],
        )
    )
    packed = system.table.pack(system.table.values(parameters))
    a, b, state = times[:-1], times[1:], np.arange(times.size - 1)
    size, found = None, []
    while 0 < a.size < INTERVALS + times.size:
        half = (b - a)[:, None] / 2
        nodes = np.clip(a[:, None] + half * (1 + RULE.nodes), a[:, None], b[:, None])
        nodes[:, -1] = b
        columns = np.repeat(state, nodes.shape[1])
        values, rates = (
            each.reshape(*nodes.shape, -1)
            for each in function(q.T[columns], v.T[columns], nodes.reshape(-1, 1), packed)
        )
        change = values[:, -1] - values[:, 0]
        change = np.abs(change - half * np.einsum("ekr,k->er", rates, RULE.weights))
        if size is None:
            size = JUMP * np.max(np.abs(values), axis=(0, 1))
        jumped = np.any(change > size, axis=1)
        middle = a + (b - a) / 2
        whole = jumped & ((middle <= a) | (middle >= b))
        found += zip(a[whole].tolist(), b[whole].tolist(), strict=True)
        cut = jumped & ~whole
        a, b = np.concatenate([a[cut], middle[cut]]), np.concatenate([middle[cut], b[cut]])
        state = np.tile(state[cut], 2)
    return merge(found)


def across(
    system: System, parameters: Mapping[str, ArrayLike] | None, state: State, t: float
) -> State:
    """Return the state at the time t, on the other side of a jump: the momentum is the same.

    So is q, but for how far it goes between two neighbouring times, which late are far apart.

    Raises ValueError if no velocity there has that momentum.
    """
    p = system.momentum(state.q, state.v, state.t, parameters=parameters)
    v = system.velocity(state.q, p, t, state.v, parameters=parameters)
    return State(t, state.q + (t - state.t) * state.v, v)
