"""rockit: an optimal control problem without controls, by its direct collocation.

End points are parameters, so that the same transcription solves again.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import rockit  # type: ignore[import-not-found]

from benchmarks.peers._peer import IPOPT, Answer, Failed, Peer, waypoints
from benchmarks.peers.casadi_collocation import accelerations
from benchmarks.problems import Case, Ends

MESHES = (*((N, 4) for N in (5, 20, 80)), *((N, 8) for N in (10, 20, 40)))


def _curve(grid, row) -> ca.Function:
    return ca.interpolant("guess", "linear", [list(grid)], list(row))


def _guess(ocp, states, grid, tables) -> None:
    """Set the first guess: functions of time, as tables fail with CasADi 3.8."""
    for x, table in zip(states, tables, strict=True):
        ocp.set_initial(x, ca.vertcat(*[_curve(grid, row)(ocp.t) for row in table]))


def _solve(ocp, case: Case, ends: Ends) -> Answer:
    q, _, start, end = ocp.of_benchmark
    ocp.set_value(start, ends.start)
    ocp.set_value(end, ends.end)
    try:
        solution = ocp.solve()
    except RuntimeError as error:
        raise Failed(str(error).splitlines()[-1]) from error
    sampler = solution.sampler(q)
    return Answer(lambda t: np.asarray(sampler(t)).reshape(t.size, case.n).T, (ocp, solution))


def cold(case: Case, ends: Ends, start: str, mesh) -> Answer:
    """Write the problem down, transcribe it and solve it."""
    n, (N, degree) = case.n, mesh
    ocp = rockit.Ocp(T=case.duration)
    q, v = ocp.state(n), ocp.state(n)
    first, last = ocp.parameter(n), ocp.parameter(n)
    ocp.set_der(q, v)
    motion = accelerations(case)
    # It takes its own time only where the equations depend on it.
    ocp.set_der(v, motion(q, v, ocp.t if motion.jac_sparsity(0, 2).nnz() else 0.0))
    ocp.subject_to(ocp.at_t0(q) == first)
    ocp.subject_to(ocp.at_tf(q) == last)
    ocp.solver("ipopt", IPOPT)
    ocp.method(rockit.DirectCollocation(N=N, degree=degree, scheme="legendre"))
    grid = np.linspace(0.0, case.duration, 17)
    _guess(ocp, (q, v), grid, waypoints(case, ends, start, grid))
    ocp.of_benchmark = (q, v, first, last)
    return _solve(ocp, case, ends)


def again(answer: Answer, case: Case, ends: Ends, mesh) -> Answer:
    """Solve the same transcription from the last solution."""
    ocp, last = answer.state
    states = ocp.of_benchmark[:2]
    grid = last.sample(states[0], grid="control")[0]
    values = [np.reshape(last.sample(x, grid="control")[1], (-1, case.n)).T for x in states]
    _guess(ocp, states, grid, values)
    return _solve(ocp, case, ends)


PEER = Peer(("rockit-meco",), MESHES, cold, again)
