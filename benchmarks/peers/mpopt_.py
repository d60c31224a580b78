"""mpopt: pseudospectral collocation in segments.

It fixes the whole state at the start, so the unknown first velocity enters as its parameters:
q' = w + a, w' = acceleration(q, w + a), w(0) = 0.
"""

from __future__ import annotations

import numpy as np
from mpopt import mp  # type: ignore[import-not-found]

from benchmarks.peers._peer import IPOPT, Answer, Peer, Unable, piecewise, succeeded
from benchmarks.peers.casadi_collocation import accelerations
from benchmarks.problems import Case, Ends

MESHES = ((1, 10), (1, 20), (4, 10), (16, 10))


def _solve(case: Case, ends: Ends, mesh, last) -> Answer:
    n, (segments, degree) = case.n, mesh
    acceleration = accelerations(case)

    def dynamics(x, u, t, a):
        v = x[n:] + a
        rate = acceleration(x[:n], v, t)
        return [*(v[k] for k in range(n)), *(rate[k] for k in range(n))]

    ocp = mp.OCP(n_states=2 * n, n_controls=1, n_params=n)
    ocp.dynamics[0] = dynamics
    ocp.terminal_constraints[0] = lambda xf, tf, x0, t0, a: [
        xf[k] - float(ends.end[k]) for k in range(n)
    ]
    ocp.x00[0] = [*ends.start, *np.zeros(n)]
    ocp.xf0[0] = [*ends.end, *np.zeros(n)]
    ocp.a0[0] = (ends.end - ends.start) / case.duration
    ocp.lbu[0] = ocp.ubu[0] = 0.0
    ocp.lbtf[0] = ocp.ubtf[0] = ocp.tf0[0] = case.duration
    ocp.validate()
    mpo = mp.mpopt(ocp, segments, [degree] * segments)
    mpo._MUTE_ = True
    solution = mpo.solve(last, nlp_solver_options=IPOPT)
    succeeded(mpo.nlp_solver.stats()["return_status"])
    x, _, t, *_ = mpo.init_trajectories(0)(solution["x"], mpo._nlp_sw_params)
    nodes, q = t.full().ravel(), x.full()[:, :n].T
    return Answer(lambda times: piecewise(nodes, q, degree, times), {"x": solution["x"]})


def cold(case: Case, ends: Ends, start: str, mesh) -> Answer:
    """Build and solve; it makes its own straight line."""
    if start != "line":
        raise Unable("starts from a straight line of its own")
    return _solve(case, ends, mesh, None)


def again(answer: Answer, case: Case, ends: Ends, mesh) -> Answer:
    """Build anew, as end points are part of the program, and start from the last solution."""
    return _solve(case, ends, mesh, answer.state)


PEER = Peer(("mpopt",), MESHES, cold, again)
