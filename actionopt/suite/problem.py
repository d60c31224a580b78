"""A test problem: functions in the user's units, all counted, and what is known of its answer."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.question.held import Held
from actionopt.suite import active_set, known
from actionopt.suite.action import ActionProgram
from actionopt.suite.families import STEADY, Family, sample
from actionopt.suite.limits import EQUAL, UNLIMITED, Bounds
from actionopt.suite.member import Member, Stationary
from actionopt.suite.stars import (
    Continuous,
    Star,
    continuous,
    nearest,
    newton_step,
    others,
    star,
    too_coarse,
)
from actionopt.tools.checks import by_name
from actionopt.tools.types import Array

SEED = 20  # of the perturbed starting points
PERTURBATION, PERTURBED_NEAR = 0.1, 1e-3  # in units of the coordinates' sizes
WAYPOINTS = 3  # of the coarse starting point, between the ends
FALLING = ("kepler_polar", "kepler_spherical")  # scenes: 1/r of an r that a solver takes below 0
MOST_DECADES = 100


class TestProblem(ActionProgram, Member):
    """One member of a family: a smooth nonlinear program with known answers.

    The functions are those of `Program`. To begin with: `start(name)`, name one of `start_names`.
    Known: `x_star`, `lam_star`, `f_star`, `index_star`, `kind`, `others`. To judge by:
    `distance(x)`, `residual(x, lam)`. Scipy's sparse arrays (of the whole Hessian) and arguments
    for scipy, Ipopt and CUTEst are made by `actionopt.suite.interfaces`.

    Parameters
    ----------
    family : Family
    elements, degree : int, optional
        The mesh: `elements` equal elements of one degree; the family's own by default.
    decades : float, optional
        Powers of ten over which the units of the unknowns range; the family's own by default.
    parameters : mapping, optional
        Parameters of the scene.
    """

    __test__ = False  # the name begins like a test's

    def __init__(
        self,
        family: Family,
        elements: int | None = None,
        degree: int | None = None,
        decades: float | None = None,
        parameters: Mapping[str, Any] | None = None,
    ) -> None:
        if not isinstance(family, Family):
            raise ValueError(
                f"expected a family, such as suite.FAMILIES['pendulum'], found {family!r}"
            )
        self.family = family
        self.parameters = dict(by_name(parameters, "parameters"))
        self.scene = family.build(**self.parameters)
        asked = self.scene.problem
        elements = family.elements if elements is None else elements
        degree = family.degree if degree is None else degree
        decades = family.decades if decades is None else decades
        if not isinstance(elements, (int, np.integer)) or elements < 1:
            raise ValueError(f"expected a whole number of elements, at least 1, found {elements!r}")
        if not (isinstance(decades, (int, float)) and 0 <= decades <= MOST_DECADES):
            raise ValueError(
                f"expected decades between 0 and {MOST_DECADES}, found {decades!r}; products of "
                "two units are to be numbers still"
            )
        mesh = Mesh.uniform(asked.start.t, asked.end.t, int(elements), degree)
        limits, r = family.limits, asked.system.r
        if r and limits is UNLIMITED:
            limits = Bounds(constraints=[EQUAL] * asked.system.m + [(0.0, np.inf)] * r)
        rows = r and not limits.coordinates  # else they are bounds
        tr = Transcription(Held(asked) if rows else asked, mesh, asked.scales)
        super().__init__(tr, float(decades), limits)
        if not self.n:
            raise ValueError(
                f"expected a mesh with nodes between the ends, found {elements} element of degree "
                f"{degree}, which leaves no unknowns; use more elements or a higher degree"
            )

    def __repr__(self) -> str:
        """Show the name, the class and the size."""
        return f"TestProblem({self.name}, {self.classification})"

    # -- what it is --------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The family's name."""
        return self.family.name

    @property
    def origin(self) -> dict[str, Any]:
        """Decades of the units, and where the scene is from."""
        return {"decades": self.decades, "source": self.scene.source}

    @property
    def resolution(self) -> dict[str, int]:
        """Elements and degree of the mesh."""
        return {"elements": self.mesh.elements, "degree": max(self.mesh.degrees)}

    @property
    def tags(self) -> tuple[str, ...]:
        """What is special about the family."""
        return self.family.tags

    @property
    def convex(self) -> bool:
        """Whether f is convex where c = 0 is: quadratic, with linear constraints and index 0."""
        return self._is_quadratic and self.index_star == 0

    @property
    def _is_quadratic(self) -> bool:
        """Whether f is quadratic, and so are no constraints."""
        return self.classification[0] == "Q" and self.classification[1] in "UBL"

    @property
    def unbounded(self) -> bool:
        """Whether f falls without bound along c = 0.

        Of quadratics with linear constraints: where their index is not zero. And where a solver
        that steps over a singularity, which paths cannot, finds the other side of it.
        """
        return bool(self._is_quadratic and self.index_star) or self.family.scene in FALLING

    # -- starting points ---------------------------------------------------------------------

    @property
    def default_start(self) -> str:
        """The family's own; else the scene's guess where it has one, else the straight line."""
        return self.family.start or self._base

    @property
    def _base(self) -> str:
        return "guess" if self.scene.guess is not None else "straight"

    @property
    def start_names(self) -> tuple[str, ...]:
        """Names of the starting points."""
        if STEADY in self.tags:
            return ("perturbed", "near")
        guess = () if self.scene.guess is None else ("guess",)
        return (*guess, "straight", "perturbed", "coarse", "near")

    def start(self, name: str | None = None) -> Array:
        """Return a starting point x0, (n,).

        "straight": the straight line between the events; "perturbed": that, or the scene's own
        guess, with noise of a tenth of the coordinates' sizes; "coarse": the path's broken line
        through a few of its points; "near": the optimum, with noise of a thousandth; "guess": the
        scene's own. Raises ValueError for another name, and for one that would be the answer.
        """
        name = name or self.default_start
        if name not in self.start_names:
            raise ValueError(
                f"expected a starting point among {', '.join(self.start_names)}, found {name!r}"
            )
        return self._start(name)

    def _start(self, name: str) -> Array:
        tr, scene = self.transcription, self.scene
        nodes, n = self.mesh.nodes, scene.problem.system.n
        noise = np.random.default_rng(SEED).uniform(-1, 1, self.n)
        if name == "near":
            return self.x_star + PERTURBED_NEAR * noise * self.unit
        if name == "perturbed":
            return self._start(self._base) + PERTURBATION * noise * self.unit
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
        scene = self.family.plain(**self.parameters) if self._stated_again else self.scene
        return continuous(scene, self.family.waypoints)

    @property
    def _redundant(self) -> bool:
        return "redundant constraints" in self.tags

    @property
    def _stated_again(self) -> bool:
        return self._redundant or bool(self.family.once)

    @property
    def _has_obstacle(self) -> bool:
        """Whether rows are inequalities of an obstacle."""
        return self.scene.problem.system.r > 0

    @property
    def _plain(self) -> Transcription:
        """The discrete problem with each constraint stated once: its KKT matrix is regular."""
        if not self._stated_again and not (self._has_obstacle and self.limits.coordinates):
            return self.transcription
        asked = self.family.plain(**self.parameters).problem
        return Transcription(Held(asked) if self._has_obstacle else asked, self.mesh, asked.scales)

    @property
    def path(self) -> Array:
        """That path at the nodes, (n,)."""
        return self.at_nodes(self.continuous.path)

    def at_nodes(self, curve: Any) -> Array:
        """Return a path, or `curve(t)` (n, K), at the nodes: (n,)."""
        Q = sample(curve, self.mesh.nodes, self.scene.problem.system.n)
        return Q.ravel()[self.transcription.layout.free] * self.stretch

    @cached_property
    def star(self) -> Star:
        """The discrete optimum near the path, in units of the transcription.

        Raises ValueError if the mesh is too coarse to have one, or to tell its index.
        """
        found, like = self._nearest_the_path, self._finer
        if like is not None and found.index != like._nearest_the_path.index:
            finer = like.mesh
            raise too_coarse(
                self._plain,
                f"its index, {found.index}, is {like._nearest_the_path.index} on {finer.elements} "
                f"of degree {max(finer.degrees)}, and not that",
            )
        return found

    @cached_property
    def _nearest_the_path(self) -> Star:
        if self._has_obstacle:
            return active_set.from_path(self._plain, self.continuous.path)
        return star(self._plain, self.continuous.path, polish=not self.scene.facts.flat)

    @property
    def _finer(self) -> TestProblem | None:
        """The same on a mesh that tells its index; None where this one does.

        The family's own mesh does, for the family's own parameters, and so do those finer.
        """
        own, mesh = self.family, self.mesh
        if self.scene.facts.flat:
            return None
        if self.parameters:
            return TestProblem(own, 2 * mesh.elements, max(mesh.degrees), 0, self.parameters)
        fine = mesh.elements >= own.elements and max(mesh.degrees) >= own.degree
        return None if fine else TestProblem(own, decades=0)

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
        lam = np.pad(lam, ((0, 0), (0, max(layout.system.m - lam.shape[1], 0))))
        return lam[layout.row_node, layout.row_constraint]

    @cached_property
    def f_star(self) -> float:
        """The discrete optimum's action."""
        tr = self.transcription
        return tr.action(self.star.z[: self.n]) * tr.action_unit

    @property
    def f_unit(self) -> float:
        """Size of f, as far as the events tell."""
        return abs(self.transcription.action_unit)

    @property
    def index_star(self) -> int | None:
        """Number of directions that lower f there along c = 0; None where it is degenerate."""
        return None if self.scene.facts.flat else self.star.index

    @cached_property
    def others(self) -> tuple[Stationary, ...]:
        """Other stationary points that are known; a linear problem has none."""
        points = () if self.parameters else known.points(self.name, self)
        if self._has_obstacle:
            found = active_set.others(self._plain, self.scene, self.family.bends, points, self.star)
            return tuple(map(self._stationary, found))
        if self.scene.problem.system.structure.linear:
            return ()
        found = others(self._plain, self.scene, self.family.bends, points, self.star)
        return tuple(map(self._stationary, found))

    def _stationary(self, star: Star) -> Stationary:
        tr, scaled = self.transcription, star.z[: self.n]
        return Stationary(scaled * self.unit, tr.action(scaled) * tr.action_unit, star.index)

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
            "f_lowest": self._search_method,
            "continuous": exact,
        }

    @property
    def _search_method(self) -> str:
        if self.unbounded:
            return "none: f is unbounded below"
        if self._is_quadratic:
            return "the only minimum: f is convex"
        starts, count = known.starts(self.name, self), 1 + len(self.others)
        searched = f"{starts} random starts of Ipopt" if starts else "no random starts"
        if every := known.paths(self.name, self):
            searched = f"{searched}, and the {every} paths that solve_all finds"
        return f"the least of {count} stationary points, from bent lines, solvers and {searched}"

    # -- judging -----------------------------------------------------------------------------

    def nearest(self, x: Array, reach: float) -> Stationary | None:
        """Return the stationary point within `reach` of x, in `unit`, that Newton's method finds.

        None if there is none.
        """
        near = active_set.nearest if self._has_obstacle else nearest
        found = near(self._plain, self._scale(x), reach)
        return None if found is None else self._stationary(found)

    def violation(self, x: Array) -> float:
        """Return how far x or c is outside its bounds, in the coordinates' sizes."""
        tr, outside = self.transcription, [np.zeros(1)]
        if self.m:
            c, (lower, upper) = tr.constraint(self._scale(x)), self.constraint_bounds
            outside += [lower / tr.row_unit - c, c - upper / tr.row_unit]
        if self.limits.coordinates:
            lower, upper = self.bounds
            outside += [(lower - x) / self.unit, (x - upper) / self.unit]
        return float(np.max(np.concatenate(outside)))

    def residual(self, x: Array) -> float:
        """Return how far Newton's method would step from x, in units of the coordinates.

        The step for the conditions of first order, with multipliers that fit the gradient best and
        the rows that are in contact then; flat directions are left out. Near a stationary point it
        is the distance. Infinite where there is no step.
        """
        scaled = self._scale(x)
        step = (active_set.step if self._has_obstacle else newton_step)(self._plain, scaled)
        step = step - self.flat @ (self.flat.T @ step)
        return float(np.nan_to_num(np.max(np.abs(step), initial=0.0), nan=np.inf))
