"""A test problem: functions in the user's units, all counted, and what is known of its answer.

    minimise f(x) subject to c(x) = 0,      grad f(x) + J(x)' lam = 0 at a stationary point

x are the free coordinates at the nodes, node by node, in the units the scene is written in or those
of the family (unlike the transcription, which scales them): units of atoms or planets, or of both
at once, are a difficulty that a solver should meet. f is the discrete action and
c_k = w_k f(q_k, t_k) the constraints, weighted with the quadrature, so that lam are the
multipliers lambda(t_k) of the continuous problem.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from actionopt.discrete.mesh import Mesh
from actionopt.discrete.transcription import Transcription
from actionopt.suite.families import Family, sample
from actionopt.suite.stars import (
    Continuous,
    Star,
    continuous,
    least_multipliers,
    others,
    relative_residual,
    star,
    stationary_near,
)
from actionopt.tools.types import Array, NDInt

SEED = 20  # of the perturbed starting points
PERTURBATION, NEAR = 0.1, 1e-3  # in units of the coordinates' sizes
WAYPOINTS = 3  # of the coarse starting point, between the ends


class TestProblem:
    """One member of a family: a smooth nonlinear program with known answers.

    Functions of x (n,): `objective`, `gradient`, `constraints`, and the nonzeros `jacobian` and
    `hessian`, flat, in the order of `jacobian_structure` and `hessian_structure`. To begin with:
    `start(name)`, name one of `start_names`. Known: `x_star`, `lam_star`, `f_star`, `index_star`,
    `kind`. To judge by: `distance(x)`, `residual(x, lam)`. Scipy's sparse arrays (of the whole
    Hessian) and arguments for scipy, Ipopt and CUTEst are made by `actionopt.suite.interfaces`.

    Parameters
    ----------
    family : Family
    elements, degree : int, optional
        The mesh: `elements` equal elements of one degree; the family's own by default.
    parameters : mapping, optional
        Parameters of the scene.

    Attributes
    ----------
    counts : Counter
        Evaluations by name: f, grad, c, jac, hess, hprod.
    """

    __test__ = False  # the name begins like a test's

    def __init__(
        self,
        family: Family,
        elements: int | None = None,
        degree: int | None = None,
        parameters: Mapping[str, Any] | None = None,
    ) -> None:
        self.family = family
        self.parameters = dict(parameters or {})
        self.scene = family.build(**self.parameters)
        asked = self.scene.problem
        elements = family.elements if elements is None else elements
        degree = family.degree if degree is None else degree
        if not isinstance(elements, (int, np.integer)) or elements < 1:
            raise ValueError(f"expected a whole number of elements, at least 1, found {elements!r}")
        mesh = Mesh.uniform(asked.start.t, asked.end.t, int(elements), degree)
        self.transcription = Transcription(asked, mesh, asked.scales)
        self.counts: Counter[str] = Counter()

    def __repr__(self) -> str:
        """Show the name, the class and the size."""
        return f"TestProblem({self.name}, {self.classification})"

    # -- what it is --------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The family's name."""
        return self.family.name

    @property
    def tags(self) -> tuple[str, ...]:
        """What is special about the family."""
        return self.family.tags

    @property
    def mesh(self) -> Mesh:
        """The mesh."""
        return self.transcription.mesh

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return self.transcription.layout.unknowns

    @property
    def m(self) -> int:
        """Number of constraint rows."""
        return self.transcription.layout.rows

    @property
    def nnz_jacobian(self) -> int:
        """Structural nonzeros of the Jacobian."""
        return self.transcription.layout.jacobian.nnz if self.m else 0

    @property
    def nnz_hessian(self) -> int:
        """Structural nonzeros of the upper triangle of the Hessian of the Lagrangian."""
        return self.transcription.layout.hessian.nnz

    @property
    def classification(self) -> str:
        """The class in the manner of CUTEst, as "QUR2-MN-31-0".

        Objective Quadratic or Other; constraints Unconstrained, Linear or Other; Regular, with
        second derivatives; a Model; No internal variables; n and m.
        """
        structure = self.scene.problem.system.structure
        quadratic = (
            structure.constant_mass and structure.constant_coupling and structure.constant_stiffness
        )
        kind = "U" if not self.m else "L" if structure.affine_constraint else "O"
        return f"{'Q' if quadratic else 'O'}{kind}R2-MN-{self.n}-{self.m}"

    @property
    def convex(self) -> bool:
        """Whether f is convex where c = 0 is: quadratic, with linear constraints and index 0."""
        return (
            self.classification[0] == "Q"
            and self.classification[1] != "O"
            and (self.index_star == 0)
        )

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of x, each (n,): there are none."""
        return np.full(self.n, -np.inf), np.full(self.n, np.inf)

    @property
    def constraint_bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of c, each (m,): zero."""
        return np.zeros(self.m), np.zeros(self.m)

    # -- functions ---------------------------------------------------------------------------

    @cached_property
    def stretch(self) -> Array:
        """How many of the family's units make one of the scene's, for each unknown, (n,)."""
        half = self.family.decades / 2
        return np.logspace(-half, half, self.n)

    @cached_property
    def unit(self) -> Array:
        """Size of each unknown, (n,), as far as the events tell."""
        return self.transcription.x_unit * self.stretch

    def objective(self, x: Array) -> float:
        """Return f(x), the discrete action."""
        self.counts["f"] += 1
        return self.transcription.action(self._scaled(x)) * self.transcription.action_unit

    def gradient(self, x: Array) -> Array:
        """Return grad f(x), (n,)."""
        self.counts["grad"] += 1
        return self.transcription.gradient(self._scaled(x)) * (
            self.transcription.action_unit / self.unit
        )

    def constraints(self, x: Array) -> Array:
        """Return c(x), (m,)."""
        self.counts["c"] += 1
        if not self.m:
            return np.zeros(0)
        return self.transcription.constraint(self._scaled(x)) * self.transcription.row_unit

    @property
    def jacobian_structure(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of the nonzeros of the Jacobian, by columns."""
        if not self.m:
            return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
        J = self.transcription.layout.jacobian
        return J.row, J.col

    def jacobian(self, x: Array) -> Array:
        """Return the nonzeros of dc/dx, flat, in the order of `jacobian_structure`."""
        self.counts["jac"] += 1
        if not self.m:
            return np.zeros(0)
        rows, cols = self.jacobian_structure
        values = self.transcription.jacobian(self._scaled(x))
        return values * self.transcription.row_unit[rows] / self.unit[cols]

    @property
    def hessian_structure(self) -> tuple[NDInt, NDInt]:
        """Rows and columns of the nonzeros of the Hessian's upper triangle, by columns."""
        H = self.transcription.layout.hessian
        return H.row, H.col

    def hessian(self, x: Array, lam: Array | None = None, factor: float = 1.0) -> Array:
        """Return the nonzeros, flat, of the upper triangle of factor * f'' + sum lam c''."""
        self.counts["hess"] += 1
        return self._hessian(x, lam, factor)

    def hessian_product(
        self, x: Array, lam: Array | None, direction: Array, factor: float = 1.0
    ) -> Array:
        """Return the Hessian of the Lagrangian times a direction, (n,)."""
        self.counts["hprod"] += 1
        rows, cols = self.hessian_structure
        values = self._hessian(x, lam, factor)
        product = np.bincount(rows, values * direction[cols], self.n)
        off = rows != cols
        return product + np.bincount(cols[off], values[off] * direction[rows[off]], self.n)

    def _hessian(self, x: Array, lam: Array | None, factor: float) -> Array:
        tr = self.transcription
        rows, cols = self.hessian_structure
        mu = np.zeros(self.m) if lam is None else np.asarray(lam) / tr.mu_unit
        scaled = self._scaled(x)
        # The transcription's Hessian is f'' + sum mu c'': affine in mu.
        values = tr.hessian(np.concatenate([scaled, mu]))
        if factor != 1.0:
            bare = tr.hessian(np.concatenate([scaled, np.zeros(self.m)])) if mu.any() else values
            values = values - (1.0 - factor) * bare
        return values * (tr.action_unit / (self.unit[rows] * self.unit[cols]))

    def _scaled(self, x: Array) -> Array:
        return np.asarray(x, dtype=float) / self.unit

    # -- starting points ---------------------------------------------------------------------

    @property
    def default_start(self) -> str:
        """The scene's own guess where it has one, else the straight line."""
        return "guess" if self.scene.guess is not None else "straight"

    @property
    def start_names(self) -> tuple[str, ...]:
        """Names of the starting points."""
        guess = () if self.scene.guess is None else ("guess",)
        return (*guess, "straight", "perturbed", "coarse", "near")

    def start(self, name: str | None = None) -> Array:
        """Return a starting point x0, (n,).

        "straight": the straight line between the events; "perturbed": the default one with
        noise of a tenth of the coordinates' sizes; "coarse": the path's broken line through a
        few of its points; "near": the optimum, with noise of a thousandth; "guess": the
        scene's own. Raises ValueError for another name.
        """
        name = name or self.default_start
        if name not in self.start_names:
            raise ValueError(
                f"expected a starting point among {', '.join(self.start_names)}, found {name!r}"
            )
        tr, scene = self.transcription, self.scene
        nodes, n = self.mesh.nodes, scene.problem.system.n
        noise = np.random.default_rng(SEED).uniform(-1, 1, self.n)
        if name == "near":
            return self.x_star + NEAR * noise * self.unit
        if name == "perturbed":
            return self.start() + PERTURBATION * noise * self.unit
        if name == "straight":
            Q = tr.straight()
        elif name == "guess":
            assert scene.guess is not None
            Q = sample(scene.guess, nodes, n)
        else:
            few = np.linspace(nodes[0], nodes[-1], WAYPOINTS + 2)
            corners = sample(self.continuous.path, few, n)
            Q = np.stack([np.interp(nodes, few, column) for column in corners.T], axis=1)
        return Q.ravel()[tr.layout.free] * self.stretch

    # -- what is known -----------------------------------------------------------------------

    @cached_property
    def continuous(self) -> Continuous:
        """The path of the continuous problem: what the discrete optimum tends to."""
        scene = self.family.plain(**self.parameters) if self._redundant else self.scene
        return continuous(scene, self.family.waypoints)

    @property
    def _redundant(self) -> bool:
        return "redundant constraints" in self.tags

    @property
    def _plain(self) -> Transcription:
        """The discrete problem with each constraint stated once: its KKT matrix is regular."""
        if not self._redundant:
            return self.transcription
        asked = self.family.plain(**self.parameters).problem
        return Transcription(asked, self.mesh, asked.scales)

    @cached_property
    def star(self) -> Star:
        """The discrete optimum near the path, in units of the transcription.

        Raises ValueError if the mesh is too coarse to have one.
        """
        return star(self._plain, self.continuous.path, polish=not self.scene.facts.flat)

    @property
    def x_star(self) -> Array:
        """The discrete optimum, (n,)."""
        return self.star.z[: self.n] * self.unit

    @property
    def lam_star(self) -> Array:
        """Its multipliers, (m,); with redundant constraints those that leave the copies alone."""
        plain = self._plain
        _, lam = plain.unpack(self.star.z)
        layout = self.transcription.layout
        lam = np.pad(lam, ((0, 0), (0, self.scene.problem.system.m - lam.shape[1])))
        return lam[layout.row_node, layout.row_constraint]

    @cached_property
    def f_star(self) -> float:
        """The discrete optimum's action."""
        tr = self.transcription
        return tr.action(self.star.z[: self.n]) * tr.action_unit

    @property
    def index_star(self) -> int | None:
        """Number of directions that lower f there along c = 0; None where it is degenerate."""
        return None if self.scene.facts.flat else self.star.index

    @property
    def kind(self) -> str:
        """What the optimum is: "minimum", "saddle" or "degenerate"."""
        if self.index_star is None:
            return "degenerate"
        return "saddle" if self.index_star else "minimum"

    @cached_property
    def others(self) -> tuple[Array, ...]:
        """Other stationary points x that are known, each (n,); the linear ones have none."""
        if self.scene.problem.system.structure.linear:
            return ()
        known = others(self._plain, self.scene, self.family.bends, self.star)
        return tuple(other.z[: self.n] * self.unit for other in known)

    @cached_property
    def flat(self) -> Array:
        """Directions along which the optimum is undetermined, orthonormal in `unit`: (n, k)."""
        if not self.scene.facts.flat:
            return np.zeros((self.n, 0))
        Q = sample(self.scene.facts.flat, self.mesh.nodes, self.scene.problem.system.n)
        direction = Q.ravel()[self.transcription.layout.free] / self.transcription.x_unit
        return (direction / np.linalg.norm(direction))[:, None]

    @property
    def known_by(self) -> dict[str, str]:
        """How each answer is known, in words."""
        path, star = self.continuous, self.star
        digits = f"high precision, {star.digits} digits: Newton's method from the path"
        exact = f"{path.how}, {path.digits} digits: {path.source}"
        counted = "inertia of the KKT matrix" if self.index_star is not None else "degenerate"
        return {
            "x_star": digits if not self.flat.size else exact,
            "f_star": digits if not self.flat.size else exact,
            "lam_star": digits if self.m else "no constraints",
            "index_star": counted,
            "continuous": exact,
        }

    # -- judging -----------------------------------------------------------------------------

    def distance(self, x: Array, star: Array | None = None) -> float:
        """Return max |x - x_star| in units of the coordinates, flat directions left out."""
        away = (np.asarray(x) - (self.x_star if star is None else star)) / self.unit
        away = away - self.flat @ (self.flat.T @ away)
        return float(np.max(np.abs(away), initial=0.0))

    def is_near_stationary(self, x: Array, reach: float) -> bool:
        """Whether a stationary point of the discrete problem lies within `reach`, in `unit`."""
        return stationary_near(self._plain, self._scaled(x), reach)

    def residual(self, x: Array, lam: Array | None = None) -> float:
        """Return the relative KKT residual: 1e-16 is round-off. Multipliers are fitted if None.

        The fit is in the least-squares sense, so that a solver that returns none is judged alike.
        """
        tr = self.transcription
        scaled = self._scaled(x)
        mu = least_multipliers(tr, scaled) if lam is None else np.asarray(lam) / tr.mu_unit
        return relative_residual(tr, np.concatenate([scaled, mu]))
