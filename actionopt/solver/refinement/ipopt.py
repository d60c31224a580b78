"""What Ipopt sees of the discrete action; no other module knows its conventions.

Two problems are put to it. *Least*: minimise S subject to the constraint rows, and
to the values of integrals that are given. *Stationary*: find a root of the KKT residual, a square
system with zero objective. Both read their functions from
the transcription that is bound to them, so the solver of a layout is built once, by each thread
that needs it. (MUMPS, which serves one thread at a time, is guarded by Ipopt itself.)

Only the direction to a path is asked of Ipopt: Newton's method on the same KKT system ends the
work, so its tolerance is loose.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import kkt_nonzeros
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.solver.refinement.first_mesh import IPOPT_SIZE
from actionopt.tools.immutable import immutable
from actionopt.tools.interrupts import raised_later
from actionopt.tools.types import Array

if TYPE_CHECKING:
    from actionopt.discrete.borders.bordered import Bordered

Principle = Literal["least", "patient least", "stationary"]

IPOPT_TOLERANCE = 1e-6  # in the scaled residual; ad hoc, Newton's method takes over far above this
DIVERGING_ITERATES = 1e4  # coordinates this many times their own size: minimising has run away
# Ad hoc: a saddle is reached in tens of iterations or not at all; a minimum may lie in a long
# valley. Above so many unknowns half of that has to do.
IPOPT_ITERATIONS = {"least": 40, "patient least": 300, "stationary": 60}
FIRST_BARRIER = 1e-4  # in the unit of the action, where a path is near; ad hoc
OPTIONS: dict[str, Any] = {
    "print_time": 0,
    "calc_lam_p": False,
    "no_nlp_grad": True,
    "show_eval_warnings": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": IPOPT_TOLERANCE,
    "ipopt.nlp_scaling_method": "none",  # the transcription is scaled already
    "ipopt.mumps_permuting_scaling": 0,  # MUMPS can stall for seconds on square systems with it
    "ipopt.diverging_iterates_tol": DIVERGING_ITERATES,
}


ABSENT = "this CasADi is without Ipopt"  # such as one that was built for a browser


@cache
def is_there() -> bool:
    """Whether this CasADi has Ipopt."""
    return ca.has_nlpsol("ipopt")


@immutable
class Attempt:
    """The outcome of one call of Ipopt: the last iterate z, its word, and the iterations."""

    z: Array
    status: str
    iterations: int

    @property
    def converged(self) -> bool:
        """Whether Ipopt says it converged; the residual decides, not this."""
        return self.status in ("Solve_Succeeded", "Solved_To_Acceptable_Level")

    @property
    def diverged(self) -> bool:
        """Whether the action ran away to minus infinity."""
        return self.status == "Diverging_Iterates" or bool(
            np.max(np.abs(self.z)) > DIVERGING_ITERATES
        )


class _Function(ca.Callback):
    """A numpy function in CasADi's clothes; it reads and writes CasADi's memory directly."""

    def __init__(
        self,
        name: str,
        inputs: Sequence[tuple[str, ca.Sparsity]],
        outputs: Sequence[tuple[str, ca.Sparsity]],
        evaluate: Callable[..., Sequence[Any]],
        raised: list[BaseException],
    ) -> None:
        ca.Callback.__init__(self)
        self.inputs, self.outputs, self.evaluate = inputs, outputs, evaluate
        self.raised = raised
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self.inputs)

    def get_n_out(self) -> int:
        return len(self.outputs)

    def get_name_in(self, i: int) -> str:
        return self.inputs[i][0]

    def get_name_out(self, i: int) -> str:
        return self.outputs[i][0]

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return self.inputs[i][1]

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return self.outputs[i][1]

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, arg, res) -> int:
        if self.raised:
            return 1
        try:
            values = self.evaluate(*[None if a is None else np.frombuffer(a) for a in arg])
            for memory, value in zip(res, values, strict=True):
                if memory is not None and len(memory):
                    np.frombuffer(memory)[:] = value
        except BaseException as error:
            # No exception can cross Ipopt: it is raised again when the solver has returned,
            # soon, as every evaluation fails from here on.
            self.raised.append(error)
        return 1 if self.raised else 0


class _Given:
    """A discrete action and integrals along its path that are given: rows behind its own.

    The multiplier of such a row is the unknown of its border, whose action has it in the
    Lagrangian; that without is the one at zero.
    """

    def __init__(self, bordered: Bordered) -> None:
        self.bordered, self.layout = bordered, bordered.first.layout
        self.added = bordered.layout.border
        self.without = bordered.at(np.zeros(bordered.layout.size))

    def action(self, x: Array) -> float:
        return self.without.action(x)

    def gradient(self, x: Array) -> Array:
        return self.without.gradient(x)

    def constraint(self, x: Array) -> Array:
        from actionopt.discrete.borders.borders import Gradient

        at, none = DiscretePath(self.without, x), Gradient(np.zeros(0), np.zeros(0))
        own = [b.residual(at, np.zeros(b.size), none) for b in self.bordered.borders]
        rows = self.without.constraint(x) if self.layout.rows else np.zeros(0)
        return np.concatenate([rows, *own])

    def jacobian(self, x: Array) -> Array:
        from actionopt.discrete.borders.borders import Bend

        at, none = DiscretePath(self.without, x), Bend(np.zeros(0))
        own = [b.derivative(at, np.zeros(b.size), none).rows for b in self.bordered.borders]
        dense = np.concatenate(own)[:, : self.layout.unknowns].ravel(order="F")
        sparse = self.without.jacobian(x) if self.layout.rows else np.zeros(0)
        return np.concatenate([sparse, dense])[self._pattern[1]]

    def hessian(self, z: Array) -> Array:
        return self.bordered.at(z).hessian(z[: self.layout.size])

    @property
    def sparsity(self) -> ca.Sparsity:
        """The sparsity of the Jacobian."""
        return self._pattern[0]

    @cached_property
    def _pattern(self) -> tuple[ca.Sparsity, NDArray[np.intp]]:
        """The pattern of the sparse rows above the dense ones, and where its nonzeros are there."""
        size = self.layout.unknowns
        sparse = self.layout.jacobian.sparsity if self.layout.rows else ca.Sparsity(0, size)
        dense, first = ca.Sparsity.dense(self.added, size), sparse.nnz()
        parts = [ca.DM(x, np.arange(x.nnz())) for x in (sparse, dense)]
        whole = ca.vertcat(parts[0], parts[1] + first)
        return whole.sparsity(), np.array(whole.nonzeros(), dtype=np.intp)


class _Solver:
    """Ipopt for one layout, one principle, and a number of dense rows behind its own."""

    def __init__(self, principle: Principle, bound: Transcription | _Given) -> None:
        self.bound: Any = bound  # a `_Given` has what a least path needs
        layout, dense = bound.layout, ca.Sparsity.dense
        if principle == "stationary":
            size = rows = layout.size
            J, H = layout.kkt.sparsity, ca.Sparsity(size, size)
            functions = (self._root, lambda *_: (0.0, 0.0), self._root_rows, lambda *_: (0.0,))
        else:
            size, rows, H = layout.unknowns, layout.rows, layout.hessian.sparsity
            J = layout.jacobian.sparsity if rows else ca.Sparsity(0, size)
            if isinstance(bound, _Given):
                rows, J = rows + bound.added, bound.sparsity
            functions = (self._least, self._least_gradient, self._least_rows, self._least_hessian)
        self.rows = rows
        x, p = ("x", dense(size)), ("p", ca.Sparsity(0, 0))
        lam = [("lam_f", dense(1)), ("lam_g", dense(rows))]
        f, g, grad = ("f", dense(1)), ("g", dense(rows)), ("grad_f_x", dense(size))
        shapes = (
            ("nlp", [x, p], [f, g]),
            ("nlp_grad_f", [x, p], [f, grad]),
            ("nlp_jac_g", [x, p], [g, ("jac_g_x", J)]),
            ("nlp_hess_l", [x, p, *lam], [("triu_hess_gamma_x_x", H)]),
        )
        self.raised: list[BaseException] = []  # shared by the functions
        pairs = zip(shapes, functions, strict=True)
        self.functions = [_Function(*shape, known, self.raised) for shape, known in pairs]
        options: dict[str, Any] = {
            **OPTIONS,
            "ipopt.max_iter": IPOPT_ITERATIONS[principle] // (1 if size <= IPOPT_SIZE else 2),
            "grad_f": self.functions[1],
            "jac_g": self.functions[2],
            "hess_lag": self.functions[3],
        }
        self.solver = ca.nlpsol("nlp", "ipopt", self.functions[0], options)

    def _rows(self, x: Array) -> Array:
        return self.bound.constraint(x) if self.rows else np.zeros(0)

    def _least(self, x, p):
        return self.bound.action(x), self._rows(x)

    def _least_gradient(self, x, p):
        return self.bound.action(x), self.bound.gradient(x)

    def _least_rows(self, x, p):
        return self._rows(x), self.bound.jacobian(x) if self.rows else np.zeros(0)

    def _least_hessian(self, x, p, lam_f, lam_g):
        # S and the rows enter with their own factors: H is linear in (lam_f, lam_g).
        factor = 1.0 if lam_f is None else float(lam_f[0])
        mu = np.zeros(0) if lam_g is None else lam_g
        if factor == 1.0:
            return (self.bound.hessian(np.concatenate([x, mu])),)
        bare = self.bound.hessian(np.concatenate([x, np.zeros_like(mu)]))
        if not mu.size:
            return (factor * bare,)
        return ((factor - 1) * bare + self.bound.hessian(np.concatenate([x, mu])),)

    def _root(self, x, p):
        return 0.0, self.bound.residual(x)

    def _root_rows(self, x, p):
        return self.bound.residual(x), kkt_nonzeros(self.bound.layout, self.bound.kkt(x))


def find(
    equations: Transcription | Bordered,
    z: Array,
    principle: Principle,
    outside: NDArray[np.bool_] | None = None,
) -> Attempt:
    """Ask Ipopt for a path near z by the `principle`.

    Rows that are `outside` (rows,) are inequalities, f >= 0; there a path is least, and there are
    integrals that are given beside it, if anything.
    Whatever the transcription or a signal handler raises meanwhile is raised again, as it is.
    Nothing is found where there is no Ipopt.
    """
    if not is_there():
        return Attempt(z, ABSENT, 0)
    given = equations if isinstance(equations, Transcription) else _Given(equations)
    kind = f"{principle} {given.added}" if isinstance(given, _Given) else principle
    solvers = given.layout.solvers
    if kind not in solvers:
        solvers[kind] = _Solver(principle, given)
    mine = solvers[kind]
    mine.bound = given
    cut = given.layout.unknowns
    bound = 0.0 if mine.functions[0].outputs[1][1].numel() else np.zeros(0)
    with np.errstate(all="ignore"), raised_later(mine.raised, stop=False):
        above: Any = bound
        if outside is not None:
            above = np.zeros(mine.rows)
            above[: outside.size][outside] = np.inf
        answer = mine.solver(x0=z[:cut] if principle != "stationary" else z, lbg=bound, ubg=above)
        stats = mine.solver.stats()
        found = answer["x"].full().ravel()
        if principle != "stationary":
            found = np.concatenate([found, answer["lam_g"].full().ravel()])
    return Attempt(found, stats["return_status"], int(stats["iter_count"]))


def minimize(
    x: ca.MX, S: ca.MX, rows: ca.MX, x0: Array, above: Array
) -> tuple[Attempt, Array, Array]:
    """Minimise S(x) from near x0, rows being between zero and `above`, all expressions of x.

    Return the attempt, whose z is x, the rows' multipliers, and the rows. Nothing is found where
    there is no Ipopt.
    """
    if not is_there():
        return Attempt(x0, ABSENT, 0), 0 * above, 0 * above
    options = {key: value for key, value in OPTIONS.items() if key != "no_nlp_grad"}
    options |= {"ipopt.max_iter": IPOPT_ITERATIONS["patient least"]}
    # Else the barrier carries the path off, to where a coarse mesh sees nothing.
    options |= {"ipopt.mu_init": FIRST_BARRIER}
    solver = ca.nlpsol("least", "ipopt", {"x": x, "f": S, "g": rows}, options)
    with raised_later([], stop=False):
        answer = solver(x0=x0, lbg=0.0, ubg=above)
    stats, (z, mu, g) = solver.stats(), (answer[k].full().ravel() for k in ("x", "lam_g", "g"))
    return Attempt(z, stats["return_status"], int(stats["iter_count"])), mu, g
