"""Direct collocation as a CasADi user writes it, after the example in CasADi's own manual.

Euler-Lagrange equations from the Lagrangian by `jacobian`, states (q, v) and, with constraints,
multipliers as algebraic states of the equations reduced to index 1; Gauss-Legendre points from
`collocation_points`, one symbolic expression for the whole horizon, Ipopt with no objective.
"""

from __future__ import annotations

import inspect

import casadi as ca
import numpy as np

from benchmarks.peers._peer import IPOPT, Answer, Peer, succeeded, waypoints
from benchmarks.problems import Case, Ends

# Elements and degree; the manual's example has degree 3.
MESHES = (*((N, 3) for N in (10, 20, 40)), *((N, 6) for N in (5, 10, 20, 40, 80, 160)))


def equations(case: Case) -> ca.Function:
    """Return the implicit equations of motion as a function (q, v, a, lam, t) -> residual."""
    n = case.n
    q, v, a, t = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("a", n), ca.SX.sym("t")
    L, f = lagrangian(case, q, v, t)
    lam = ca.SX.sym("lam", f.numel())
    p = ca.gradient(L, v)
    G = ca.jacobian(f, q)
    rate = ca.jtimes(p, q, v) + ca.jtimes(p, v, a) + ca.jacobian(p, t)
    motion = rate - ca.gradient(L, q) - G.T @ lam
    second = ca.jtimes(G @ v, q, v) + G @ a
    return ca.Function("motion", [q, v, a, lam, t], [ca.vertcat(motion, second)])


def lagrangian(case: Case, q, v, t):
    """Return L and the constraints as expressions in columns q and v."""
    q, v = ca.array(q).reshape(case.n), ca.array(v).reshape(case.n)
    L = ca.SX(case.lagrangian(q, v, t, **_wanted(case.lagrangian, case)))
    if case.constraint is None:
        return L, ca.SX(0, 1)
    rows = case.constraint(q, t, **_wanted(case.constraint, case))
    rows = rows if isinstance(rows, list) else [rows]
    return L, ca.vertcat(*[ca.vec(ca.SX(row)) for row in rows])


def _wanted(function, case: Case) -> dict:
    names = inspect.signature(function).parameters
    return {name: value for name, value in case.parameters.items() if name in names}


def accelerations(case: Case) -> ca.Function:
    """Return the explicit equations of motion as a function (q, v, t) -> a."""
    motion = equations(case)
    q, v, a, lam, t = (ca.SX.sym(motion.name_in(i), motion.size1_in(i)) for i in range(5))
    unknown = ca.vertcat(a, lam)
    residual = motion(q, v, a, lam, t)
    at_rest = ca.substitute(residual, unknown, ca.DM.zeros(unknown.shape))
    solved = ca.solve(ca.jacobian(residual, unknown), -at_rest)
    return ca.Function("acceleration", [q, v, t], [solved[: case.n]])


class Collocation:
    """The nonlinear program of one problem on one mesh, its end points parameters."""

    def __init__(self, case: Case, mesh: tuple[int, int]) -> None:
        elements, degree = mesh
        n, h = case.n, case.duration / elements
        tau = [0.0, *ca.collocation_points(degree, "legendre")]
        C, D, _ = ca.collocation_coeff(tau[1:])
        motion = equations(case)
        m = motion.size1_in(3)
        start, end = ca.MX.sym("start", n), ca.MX.sym("end", n)
        X, Z, rows, times = [], [], [], []
        x = ca.MX.sym("x0", 2 * n)
        X.append(x)
        times.append(0.0)
        rows.append(x[:n] - start)
        for k in range(elements):
            stage = [ca.MX.sym(f"x{k}_{j}", 2 * n) for j in range(degree)]
            every = ca.horzcat(x, *stage)
            slopes = every @ C / h
            for j in range(degree):
                t = (k + tau[j + 1]) * h
                lam = ca.MX.sym(f"lam{k}_{j}", m)
                q, v = stage[j][:n], stage[j][n:]
                rows.append(slopes[:n, j] - v)
                rows.append(motion(q, v, slopes[n:, j], lam, t))
                X.append(stage[j])
                Z.append(lam)
                times.append(t)
            x = ca.MX.sym(f"x{k + 1}", 2 * n)
            rows.append(every @ D - x)
            X.append(x)
            times.append((k + 1) * h)
        rows.append(x[:n] - end)
        w = ca.veccat(*X, *Z)
        nlp = {"x": w, "f": 0, "g": ca.veccat(*rows), "p": ca.vertcat(start, end)}
        self.solver = ca.nlpsol("collocation", "ipopt", nlp, IPOPT)
        self.n, self.elements, self.h, self.tau = n, elements, h, np.array([*tau, 1.0])
        self.times, self.multipliers = np.array(times), m * len(Z)

    def solve(self, case: Case, ends: Ends, w) -> Answer:
        """Solve from the vector w."""
        answer = self.solver(x0=w, lbg=0, ubg=0, p=np.concatenate([ends.start, ends.end]))
        succeeded(self.solver.stats()["return_status"])
        w = answer["x"].full().ravel()
        states = w[: self.times.size * 2 * self.n].reshape(-1, 2 * self.n)
        return Answer(lambda t: self.interpolate(states[:, : self.n].T, t), (self, w))

    def interpolate(self, q: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Evaluate the polynomial of each element through its start and collocation points."""
        k = np.clip((t / self.h).astype(int), 0, self.elements - 1)
        s = t / self.h - k
        nodes = self.tau[:-1]
        weights = np.ones((t.size, nodes.size))
        for j, node in enumerate(nodes):
            for other in np.delete(nodes, j):
                weights[:, j] *= (s - other) / (node - other)
        index = k[:, None] * nodes.size + np.arange(nodes.size)
        return np.einsum("nkj,kj->nk", q[:, index], weights)


def cold(case: Case, ends: Ends, start: str, mesh) -> Answer:
    """Build the program and solve it from the first guess."""
    program = Collocation(case, mesh)
    q, v = waypoints(case, ends, start, program.times)
    w = np.concatenate([np.vstack([q, v]).T.ravel(), np.zeros(program.multipliers)])
    return program.solve(case, ends, w)


def again(answer: Answer, case: Case, ends: Ends, mesh) -> Answer:
    """Solve the same program from the last solution."""
    program, w = answer.state
    return program.solve(case, ends, w)


PEER = Peer(("casadi",), MESHES, cold, again)
