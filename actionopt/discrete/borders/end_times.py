"""How the discrete action changes with the times of its events.

As an end time moves the mesh stretches, and every node keeps its fraction s = (t - t0) / T:

    dS/dt1 = (1/T) sum w (L - v.p) + sum w s dL/dt = -H(t1),

exactly, so that no difference is taken, and as accurate as the action is. With constraints L stands
for L + sum lam f.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.borders.stretch import by_joints
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.laws.instants import Instant
from actionopt.mechanics.question.events import State
from actionopt.mechanics.question.jumps import across
from actionopt.tools.types import Array


def by_times(at: DiscretePath) -> Array:
    """Return dS/dt at fixed coordinates at the nodes by the times of all events, (k + 2,)."""
    return by_joints(at).slopes(at.lam)


def jumps_of(at: DiscretePath) -> tuple[tuple[Instant, ...], Array]:
    """Return the instants between the ends at which L switches, and dS/dt of each, (K,).

    That is by how much H jumps there: q and p do not.
    """
    problem, path = at.problem, at.path
    start, end = problem.start.t, problem.end.t
    inner = tuple(i for i in problem.instants if start < i[0] and i[1] < end)
    if problem.laws:  # they take turns at the events
        times = [e.t for e in problem.through]
        inner = tuple(i for i in inner if not any(i[0] <= t <= i[1] for t in times))
    system, parameters, jumps = problem.system, problem.parameters, []
    for before, after in inner:
        beyond = State(after, path(after), path.velocity(after))
        here = across(system, parameters, beyond, before)
        H = [system.energy(x.q, x.v, x.t, parameters=parameters) for x in (here, beyond)]
        jumps.append(float(H[1] - H[0]))
    return inner, np.array(jumps)
