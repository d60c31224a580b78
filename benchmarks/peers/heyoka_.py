"""Shooting with heyoka: a compiled Taylor integrator of the variational equations.

As its documentation has it: `var_ode_sys` adds the derivatives in the first velocities,
`taylor_adaptive` compiles the lot, and a continuous output is the path.
"""

from __future__ import annotations

from typing import Any

import heyoka as hy  # type: ignore[import-not-found]
import numpy as np

from benchmarks.arithmetic import elementwise
from benchmarks.peers._peer import TOLERANCES, Answer, Peer, first_velocity, meeting, tangent
from benchmarks.problems import Case, Ends

ROUNDOFF = 1e-14
COMPACT = 8  # coordinates from which compact mode compiles faster, as the documentation advises
ARITHMETIC = elementwise(hy)
hy.llvm_state.set_diskcache_enabled(False)  # cold means that it compiles


def compiled(case: Case, tol: float):
    """Return the integrator of the equations with their variations in v(0)."""
    n = case.n
    names = [f"q{k}" for k in range(n)] + [f"v{k}" for k in range(n)]
    symbols = np.array(hy.make_vars(*names), dtype=object)
    a = case.acceleration(symbols[:n], symbols[n:], hy.time, ARITHMETIC)
    right = [*symbols[n:], *(x if isinstance(x, hy.expression) else hy.expression(x) for x in a)]
    system = list(zip(symbols, right, strict=True))
    varied = hy.var_ode_sys(system, list(symbols[n:]), order=1)
    return hy.taylor_adaptive(
        varied, np.zeros(2 * n), tol=max(tol, 1e-16), compact_mode=n >= COMPACT
    )


def _fly(ta, case: Case, ends: Ends, v, output: bool = False):
    """Integrate from (start, v); return the miss, its slope in v and the continuous output."""
    n = case.n
    ta.time = 0.0
    ta.state[:] = 0.0
    ta.state[: 2 * n] = np.concatenate([ends.start, v])
    ta.state[2 * n :].reshape(2 * n, n)[n:] = np.eye(n)
    outcome, _, _, _, curve, _ = ta.propagate_until(case.duration, c_output=output)
    if outcome != hy.taylor_outcome.time_limit or not np.all(np.isfinite(ta.state)):
        return np.inf, None, None, None
    miss = ta.state[:n] - ends.end
    size = np.max(np.abs(miss)) / np.max(np.abs([ends.start, ends.end]))
    return size, miss, ta.state[2 * n :].reshape(2 * n, n)[:n].copy(), curve


def _shoot(ta, case: Case, ends: Ends, v, tol: float) -> Answer:
    Z = tangent(case, ends)

    def fly(v):
        size, miss, slope, _ = _fly(ta, case, ends, v)
        return size, miss, None if slope is None else slope @ Z

    v = meeting(fly, v, Z, tol, ROUNDOFF)
    curve: Any = _fly(ta, case, ends, v, output=True)[3]
    return Answer(lambda t: curve(t)[:, : case.n].T, (ta, v))


def cold(case: Case, ends: Ends, start: str, tol: float) -> Answer:
    """Compile, from empty caches, and shoot with the guess's own first velocity."""
    hy.llvm_state.clear_memcache()
    return _shoot(compiled(case, tol), case, ends, first_velocity(case, ends, start), tol)


def again(answer: Answer, case: Case, ends: Ends, tol: float) -> Answer:
    """Shoot with the compiled integrator from the last first velocity."""
    ta, v = answer.state
    return _shoot(ta, case, ends, v, tol)


PEER = Peer(("heyoka",), TOLERANCES, cold, again)
