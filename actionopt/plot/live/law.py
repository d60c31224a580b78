"""The law of a system as JavaScript, with its derivatives, its parameters left as arguments."""

from __future__ import annotations

from typing import Any

import casadi as ca

from actionopt.mechanics.system import System
from actionopt.plot.live.javascript import body


def law(system: System) -> dict[str, Any]:
    """Return a law for JSON: `n`, `m`, whether it is `forced`, and two functions.

    `first` takes q, v, t, p and returns L, L_q, L_v, Q, f, all dense. `second` takes also the
    multipliers lam and returns the nonzeros of the upper triangle of d2L/d(q, v)2, of
    dQ/d(q, v), of G = df/dq, and of the upper triangle of lam . d2f/dq2. Each has its `body`, the
    numbers of entries of its results, `sizes`, its working memory, `work`; and `second` the rows
    and columns of the nonzeros, `places`. Raises ValueError as `javascript.body` does.
    """
    s, d = system.symbols, system.derivatives
    arguments, z = [s.q, s.v, s.t, s.p], ca.vertcat(s.q, s.v)
    lam = ca.SX.sym("lam", system.m)
    first = [system.L, d.Lq, d.Lv, system.Q, system.f]
    second = [
        ca.triu(ca.hessian(system.L, z)[0]),
        ca.jacobian(system.Q, z),
        d.G,
        ca.triu(ca.hessian(ca.dot(lam, system.f), s.q)[0]),
    ]
    return {
        "n": system.n,
        "m": system.m,
        "forced": system.structure.forced,
        "first": _plain(ca.Function("first", arguments, ca.cse([ca.densify(x) for x in first]))),
        "second": _plain(ca.Function("second", [*arguments, lam], ca.cse(second))),
    }


def _plain(function: ca.Function) -> dict[str, Any]:
    patterns = [function.sparsity_out(i) for i in range(function.n_out())]
    return {
        "body": body(function),
        "work": function.sz_w(),
        "sizes": [pattern.nnz() for pattern in patterns],
        "places": [[pattern.row(), pattern.get_col()] for pattern in patterns],
    }
