"""From a problem to a solution: find a path on a coarse mesh, then follow it to the tolerance.

Finding and following are different work. *Finding* starts from the straight line, or from a
guess, and goes up the rungs of `LADDER`: a least path where there is one, else a stationary one.
*Following* is Newton's: each refinement round carries the path to a better mesh and polishes it
there, always the same path. Linear equations of motion need no finding: their discrete problem is
one linear system.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Literal, cast

import numpy as np

from actionopt.arguments import Guess, checked
from actionopt.continuation import release
from actionopt.descent import descend
from actionopt.newton import Followed, approach, follow, moved
from actionopt.path import Mesh, Path
from actionopt.preflight import check, project
from actionopt.problem import Problem
from actionopt.quadrature import Array
from actionopt.refine import DEGREES, Resolution, refined, resolution
from actionopt.solution import Solution
from actionopt.status import SolveError, Status
from actionopt.transcription import (
    Factors,
    Principle,
    Transcription,
    find,
    negative_eigenvalues,
)

# How a first path is sought from the straight line, each way on meshes of so many elements.
# Newton's method costs next to nothing, and knows at once whether it works; descent is robust and
# quick where the action is bounded below, and sees where it is not; Ipopt minimises under
# constraints, and where the descent is lost; continuation gets to a saddle slowly but surely;
# Ipopt's root finding needs no path to be near; a minimum down a long curved valley takes patience.
LADDER = (
    ("newton", (4,)),
    ("descent", (8, 16, 32, 64)),
    ("least", (8, 16, 32, 64)),
    ("continuation", (8, 16, 32)),
    ("stationary", (8, 16)),
    ("patient least", (8, 16, 32, 64)),
)
LEAST = ("descent", "least", "patient least")
FEW = 3  # coordinates up to which descending costs less than entering Ipopt
FINE = 3  # coordinates up to which a higher degree costs less than a second mesh
ALIKE = 4.0  # ratio of coordinates' sizes within which the units of action are kept
DENSE_MOTION = 400  # coordinates and constraints up to which the equations are solved as they are
SQUARE = 1500  # unknowns above which Ipopt takes too long over a square system
KEPT = 3000  # unknowns and rows up to which the factors are worth their memory
PATIENT = 30  # damped steps towards a path near a guess: whatever else there is costs more
NEAR_GUESS = (16, 32, 64)  # a guess has features that coarser meshes would miss
LINEAR = 4  # elements to begin with where nothing has to be sought
NEAR = 0.1  # a path that moves farther than this when refined, in its own size, is another one
COARSE_DEGREE = 6
ROUGHLY = 2e-2  # omitted coefficients below which a coarse path is worth refining
ROUNDS = 20
STALLED = 8  # rounds that bring nothing: a layer of 1e-6 is closed in on in six
SAFETY = 4.0  # between the measured error of the last round and the estimate for the next
ROUNDOFF = 2 * float(np.finfo(float).eps)  # of evaluating the polynomial, to begin with
SENSITIVE = 1e-10  # amplified round-off at which a path that does not settle is held to be that
ORDINARY = 100.0  # amplification of round-off on a mesh where nothing is sensitive, at most
UNDETERMINED = 1e-6  # amplified round-off above which the end points do not determine a path
MEASURABLE = 1e-12  # coefficients below this are too near to rounding to measure a gain
UNKNOWN_GAIN = 10.0  # assumed ratio of global to local error before any was measured


def solve(
    problem: Problem,
    *,
    tol: float = 1e-8,
    guess: Guess | None = None,
    principle: Literal["auto", "least", "stationary"] = "auto",
    mesh: Mesh | None = None,
    throw: bool = True,
) -> Solution:
    """Return the path between the events of `problem` that makes its action stationary.

    Parameters
    ----------
    problem : Problem
        The system and the two events.
    tol : float
        Bound on the maximum over time of |q_h(t) - q(t)|, each coordinate in units of the
        largest |q| it reaches; between 1e-14 and 0.1.
    guess : Path, Solution, callable or array, optional
        A curve near the path wanted: a callable of (K,) times returning (n, K), or waypoints
        (n, K) at equal times. With a guess the stationary path near it is returned; without
        one, a least path if there is one, else a stationary one.
    principle : {"auto", "least", "stationary"}
        What to ask of the action.
    mesh : Mesh, optional
        Solve on this mesh and do not refine.
    throw : bool
        Raise on failure; otherwise return the best attempt with its `status`.

    Raises
    ------
    ValueError
        For bad input, before any solver runs.
    SolveError
        If no path was found or the tolerance was not met; it carries the best attempt.
    KeyboardInterrupt
        If interrupted, also from within Ipopt.

    References
    ----------
    *Competitive Physics: Mechanics and Waves* (2018), sections 12.1-12.4; Marsden and West,
    *Discrete mechanics and variational integrators*, Acta Numerica 10 (2001), sections 1.2
    and 2.2.
    """
    started = perf_counter()
    start_curve = checked(problem, tol, guess, principle, mesh)
    run = _Run(problem, tol, principle, mesh, start_curve)
    if isinstance(guess, Solution):
        run.gain = guess.stats["gain"]  # a neighbour is as sensitive
        if guess.problem.system is problem.system:
            run.neighbour, run.units = guess, guess.discrete[0]
            run.checked = True
    status = run.go()
    solution = run.solution(status, perf_counter() - started)
    if throw and not solution.success:
        raise SolveError(run.message(status), solution)
    return solution


@dataclass(eq=False)
class _Run:
    """One solve under way: the current path, and what was done so far."""

    problem: Problem
    tol: float
    principle: str
    given: Mesh | None
    curve: Callable[[Mesh], Path] | None
    linear: bool = field(init=False)
    sizes: Array = field(init=False)
    tr: Transcription = field(init=False)
    z: Array = field(init=False)
    resolved: tuple[Array, Resolution] | None = None  # of the current z
    units: Transcription | None = None  # whose units of action and constraints serve again
    neighbour: Solution | None = None  # of the same system, whose path is the guess
    checked: bool = False
    diverged: bool = False
    may_be_least: bool = False
    spare: tuple[str, Path] | None = None  # a saddle found while a least path was sought
    rung: str = ""
    factors: Factors | None = None  # of the matrix at the last path followed
    gain: float = UNKNOWN_GAIN
    noise: float = 0.0
    error: float = np.inf
    iterations: Counter[str] = field(default_factory=Counter)
    evaluations: Counter[str] = field(default_factory=Counter)
    rounds: list[dict[str, Any]] = field(default_factory=list)
    time: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    # -- strategy ------------------------------------------------------------------------------

    def go(self) -> Status:
        system = self.problem.system
        clock = perf_counter()
        self.linear = system.structure.linear
        for name in ("first", "second"):
            system.pointwise(name)
        self.time["derive"] += perf_counter() - clock
        if self.linear:
            return self._certify(self._solve_linear())
        if self.curve is not None:
            return self._certify(self._near_guess())
        return self._certify(self._search())

    def _search(self) -> Status:
        """Find a path with no guess, by the rungs of `LADDER`, and settle it."""
        forced = self.problem.system.structure.forced
        self.may_be_least = self.principle != "stationary" and not forced
        status = Status.NOT_FOUND
        large = self.problem.system.n * COARSE_DEGREE * LADDER[1][1][0] > SQUARE
        # Continuation takes hundreds of factorizations: the last resort where each costs much.
        for rung, meshes in sorted(LADDER, key=lambda r: large and r[0] == "continuation"):
            if rung in LEAST and not (self.may_be_least and self._offers(rung)):
                continue
            if rung not in LEAST and self.spare is not None:
                continue  # it could only bring another saddle
            status = self._try(rung, meshes)
            if status is Status.UNBOUNDED:
                if self.principle == "least":
                    return status
                self.may_be_least = False
                status = self._settle_spare()
            elif self.spare is not None and self.principle == "auto" and large:
                # A least path is not worth many times the saddle in hand.
                status = self._settle_spare()
            if status not in (Status.NOT_FOUND, Status.UNRESOLVED):
                return status
        return self._settle_spare() if self.principle == "auto" else status

    def _settle_spare(self) -> Status:
        """Settle the saddle that was found while a least path was sought, if there is one."""
        if self.spare is None:
            return Status.NOT_FOUND
        (self.rung, path), self.spare = self.spare, None
        self.rounds.clear()
        self.gain, self.error = UNKNOWN_GAIN, np.inf
        self._place(path.mesh, path)
        return self._settle() if self._follow() else Status.NOT_FOUND

    def _try(self, rung: str, meshes: tuple[int, ...]) -> Status:
        """Seek a path on finer and finer meshes until one resolves it roughly, and settle it.

        A mesh too coarse for the motion has stationary points of its own that are no paths, or
        holds a path where it should not be: such a path does not settle under refinement. A
        least path on a mesh twice as fine starts from it, others from the straight line.
        """
        self.rung = rung
        self.rounds.clear()
        status, known = Status.NOT_FOUND, None
        for elements in meshes:
            self.sizes = self.problem.scales
            self.gain, self.error = UNKNOWN_GAIN, np.inf
            degree = self._fine_degree() if rung == "newton" else COARSE_DEGREE
            self._place(self._uniform(elements, degree), known)
            if not self._seek(rung):
                if self.least and self.diverged:
                    return Status.UNBOUNDED
                if rung in ("descent", "least"):
                    return Status.NOT_FOUND
                known = None
                continue
            if self.resolution().worst > ROUGHLY and elements != meshes[-1]:
                known = self.path() if self.least else None
                continue
            if not self.least and self.may_be_least and self._index() > 0:
                # There may be a least path yet; this one is kept in case there is not.
                self.spare = self.spare or (rung, self.path())
                return Status.NOT_FOUND
            status = self._settle()
            if status is not Status.UNRESOLVED:
                break
        return status

    @property
    def least(self) -> bool:
        return self.rung in LEAST

    def _offers(self, rung: str) -> bool:
        """Whether a way of minimising is open to the problem, and worth its time."""
        system = self.problem.system
        if rung == "descent":
            return system.m == 0 and system.n <= FEW
        # With a saddle in hand a long search on a large system is not worth it.
        return rung == "least" or self.spare is None or self.tr.layout.size <= SQUARE

    def _index(self) -> int:
        tr = self.tr
        return negative_eigenvalues(tr.layout, tr.kkt(self.z)) - tr.layout.rows

    def _seek(self, rung: str) -> bool:
        """Find a stationary path on the mesh at hand; False if that did not work."""
        if rung == "newton":
            return self._approach()
        if rung == "descent":
            return self._descend()
        if rung == "continuation":
            return self._release()
        return self._root() if rung == "stationary" else self._find(rung)

    def _near_guess(self) -> Status:
        """Follow the guess, or find the stationary path near it, or continue from it."""
        self.rung = "guess"
        assert self.curve is not None
        status = Status.NOT_FOUND
        for elements in NEAR_GUESS:
            coarse = self._uniform(elements, COARSE_DEGREE)
            curve, lam = self.curve(coarse), None
            mesh = self.given or (curve.mesh if elements == NEAR_GUESS[0] else None)
            if mesh is curve.mesh and self.neighbour is not None:
                curve, lam = self._moved_neighbour(curve)
            self.sizes = _sizes(curve.values.T, self.problem.scales)
            self._place(mesh or coarse, curve, lam)
            small = self.tr.layout.size <= SQUARE  # a guess is worth seconds, not minutes
            near = self._follow() or self._approach(PATIENT) or self._root()
            if near or (small and self._release()):
                status = self._settle()
                if status is not Status.UNRESOLVED:
                    break
        return status

    def _moved_neighbour(self, path: Path) -> tuple[Path, Array | None]:
        """Return the guess as it goes when its ends move to the problem's, and its multipliers.

        Only where nothing else than pinned ends differs.
        """
        assert self.neighbour is not None
        problem, old = self.problem, self.neighbour.problem
        tr, z = self.neighbour.discrete
        pins = (problem.start.pinned, problem.end.pinned) == (old.start.pinned, old.end.pinned)
        same = path.mesh is tr.mesh and np.array_equal(problem.packed, old.packed)
        if not (same and pins) or problem.advance is not None or old.advance is not None:
            return path, None
        ends = np.array([problem.start.q, problem.end.q], dtype=float)
        ends = np.where(np.isnan(ends), tr.ends[[0, -1]], ends)
        try:
            z = moved(tr, z, self.neighbour.factors, ends)
        except np.linalg.LinAlgError:
            return path, None
        if not np.all(np.isfinite(z)):
            return path, None
        Q, lam = tr.unpack(z)
        return Path(tr.mesh, Q.T), lam if tr.layout.rows else None

    def _uniform(self, elements: int, degree: int) -> Mesh:
        problem = self.problem
        return Mesh.uniform(problem.start.t, problem.end.t, elements, degree)

    def _fine_degree(self) -> int:
        """Return a degree with which a few elements of a smooth path may meet the tolerance.

        About one degree a digit. A second mesh costs more where the coordinates are few.
        """
        if self.problem.system.n > FINE:
            return COARSE_DEGREE
        wanted = max(COARSE_DEGREE, -np.log10(self.tol) + 3)
        return int(DEGREES[min(np.searchsorted(DEGREES, wanted), DEGREES.size - 1)])

    def _solve_linear(self) -> Status:
        self.rung = "linear"
        self.sizes = self.problem.scales
        mesh = self.given or self._uniform(LINEAR, self._fine_degree())
        if self.curve is not None and self.given is None:
            mesh = self.curve(mesh).mesh
        self._place(mesh, None)
        return self._settle() if self._follow() else Status.DEGENERATE

    def _settle(self) -> Status:
        """Carry the path from mesh to mesh until the tolerance is met or cannot be."""
        if self.given is not None:
            return self._settle_on(self.given)
        stalled = 0
        while len(self.rounds) <= ROUNDS:
            before = self.resolution()
            if self.error <= self.tol:
                return Status.SOLVED
            target = self.tol / (2 * SAFETY * self.gain)
            mesh = refined(before, target)
            if not self._carry(mesh, before):
                return self._lost()
            worst = self.resolution().worst
            resolved = worst < MEASURABLE or self.gain * worst < self.noise
            if resolved and SAFETY * self.noise > self.tol:
                return Status.DEGENERATE if self.noise > UNDETERMINED else Status.FLOOR
            stalled = stalled + 1 if self.resolution().worst > before.worst / 2 else 0
            if stalled == STALLED:
                return self._lost()
        return Status.SOLVED if self.error <= self.tol else self._lost()

    def _lost(self) -> Status:
        """Say why a path does not settle: it is not determined, or it was none."""
        undetermined = self.noise > SENSITIVE
        return Status.DEGENERATE if undetermined else Status.UNRESOLVED

    def _settle_on(self, mesh: Mesh) -> Status:
        """Solve on the user's mesh; two degrees more on each element tell the error."""
        if self.tr.mesh is not mesh and not self._carry(mesh, self.resolution()):
            return Status.UNRESOLVED
        tr, z = self.tr, self.z
        finer = Mesh(mesh.boundaries, np.minimum(np.array(mesh.degrees) + 2, 64))
        path = self.path()
        ok = self._carry(finer, self.resolution())
        change = np.max(np.abs(self.path()(finer.nodes) - path(finer.nodes)).T / self.sizes)
        self.tr, self.z = tr, z
        self.error = float(change) + SAFETY * self.noise if ok else np.inf
        return Status.ON_MESH

    def _certify(self, status: Status) -> Status:
        if self.principle == "least" and status.success and self._index() > 0:
            return Status.UNBOUNDED if self.linear else Status.NOT_LEAST
        return status

    # -- steps ---------------------------------------------------------------------------------

    def _place(self, mesh: Mesh, path: Path | None, lam: Array | None = None) -> None:
        """Transcribe on `mesh`, starting from `path` there, or from the straight line.

        Multipliers (K, m) that are not given are those that the motion along it would need.
        """
        clock = perf_counter()
        system = self.problem.system
        like = self.units if self.units is not None and self._alike(self.units.lengths) else None
        self.tr = self.units = Transcription(self.problem, mesh, self.sizes, like=like)
        self.evaluations.update(self.tr.counts)
        self.tr.counts = self.evaluations
        if path is None:
            Q = self.tr.straight()
        else:
            Q = path.values.T if path.mesh is mesh else path(mesh.nodes).T
        if system.m and lam is None:
            Q = project(self.tr, Q)
        if not self.checked:
            check(self.tr, Q)
            self.checked = True
        if system.m and lam is None and system.n + system.m <= DENSE_MOTION:
            lam = self._motion_multipliers(mesh, Q)
        self.z = self.tr.pack(Q, lam)
        self.time["assemble"] += perf_counter() - clock

    def _alike(self, lengths: Array) -> bool:
        """Whether units of these lengths serve for the present sizes as well."""
        ratio = self.sizes / lengths
        return bool(ratio.max() < ALIKE and ratio.min() > 1 / ALIKE)

    def _motion_multipliers(self, mesh: Mesh, Q: Array) -> Array | None:
        """Return the multipliers (K, m) of the index-1 equations of motion along Q (K, n)."""
        v = Path(mesh, Q.T).velocity(mesh.nodes)
        parameters = self.problem.parameters
        try:
            lam = self.problem.system.multipliers(Q.T, v, mesh.nodes, parameters=parameters).T
        except np.linalg.LinAlgError:
            return None
        return np.nan_to_num(lam, posinf=0.0, neginf=0.0)

    def _find(self, principle: str) -> bool:
        clock = perf_counter()
        attempt = find(self.tr, self.z, cast(Principle, principle))
        self.iterations["ipopt"] += attempt.iterations
        self.diverged = attempt.diverged
        self.time["solve"] += perf_counter() - clock
        if not attempt.converged:
            return False
        self.z = attempt.z
        self._record(perf_counter() - clock)
        return True

    def _root(self) -> bool:
        """Ask Ipopt for a root of the stationarity conditions, unless that takes too long."""
        if self.tr.layout.size > SQUARE:
            return False
        before, self.z = self.z, self._unheld()
        if self._find("stationary"):
            return True
        self.z = before
        return False

    def _release(self) -> bool:
        """Continue from the straight line by releasing the force that makes it a motion."""
        clock = perf_counter()
        released = release(self.tr, self.z)
        if released is not None:
            self.z = released[0]
            self.iterations["continuation"] += released[1]
        self.time["solve"] += perf_counter() - clock
        return released is not None and self._follow()

    def _descend(self) -> bool:
        """Minimise the action from the path at hand."""
        clock = perf_counter()
        result = descend(self.tr, self.z)
        self.iterations["descent"] += result.iterations
        self.diverged = result.runaway
        if result.found:
            self.z = result.z
        self.time["solve"] += perf_counter() - clock
        return result.found and self._follow()

    def _approach(self, steps: int = 12) -> bool:
        """Go to a path by damped Newton steps.

        Near a resonance the multipliers of the motion along the first path make the matrix
        nearly singular there; without any it is stiff, and the way may be open.
        """
        clock = perf_counter()
        near = approach(self.tr, self.z, steps)
        if near is None and self.tr.layout.rows:
            near = approach(self.tr, self._unheld(), steps)
        if near is not None:
            self.z = near[0]
            self.iterations["newton"] += near[1]
        self.time["solve"] += perf_counter() - clock
        return near is not None and self._follow()

    def _unheld(self) -> Array:
        """Return the path at hand without multipliers."""
        cut = self.tr.layout.unknowns
        return np.concatenate([self.z[:cut], np.zeros(self.z.size - cut)])

    def _follow(self, reach: float = np.inf) -> bool:
        """Polish the path where it is; False if it is not there, or farther than `reach`."""
        clock = perf_counter()
        result: Followed = follow(self.tr, self.z, linear=self.linear)
        self.iterations["newton"] += result.iterations
        self.time["solve"] += perf_counter() - clock
        arrived = result.converged and (self.linear or result.travelled < reach)
        if arrived:
            self.z, self.noise = result.z, result.noise
            self.factors = result.factors if self.tr.layout.size <= KEPT else None
            self.gain = max(self.gain, self._sensitivity())
            self.error = SAFETY * (self.gain * self.resolution().worst + self.noise + ROUNDOFF)
            self._record(perf_counter() - clock)
        return arrived

    def _carry(self, mesh: Mesh, before: Resolution) -> bool:
        """Take the path to another mesh and polish it there; False if it was lost."""
        old = self.path()
        lam = self._multipliers(mesh)
        Q = self.tr.coordinates(self.z)
        self.sizes = _sizes(Q, self.problem.scales)
        self._place(mesh, old, lam)
        carried = self.tr.coordinates(self.z)
        if not self._follow(reach=NEAR):
            if not self._recover():
                return False
            moved = np.max(np.abs(self.tr.coordinates(self.z) - carried) / self.sizes)
            if not self.least and moved > NEAR:
                return False
        change = np.max(np.abs(self.tr.coordinates(self.z) - carried) / self.sizes)
        if before.worst > MEASURABLE:
            self.gain = max(float(change) / before.worst, 1.0)
        elif self.gain == UNKNOWN_GAIN:
            self.gain = 1.0
        self.gain = max(self.gain, self._sensitivity())
        self.error = SAFETY * (self.gain * self.resolution().worst + self.noise + ROUNDOFF)
        self.rounds[-1]["estimate"] = self.error
        return True

    def _recover(self) -> bool:
        """Find the path again on a mesh where following it did not work."""
        if not self.least:
            return self._root() and self._follow()
        if self._offers("descent") and self._descend():
            return True
        return self._find("patient least") and self._follow()

    def _sensitivity(self) -> float:
        """Return how much amplified round-off says that other errors are amplified, at least."""
        return self.noise / (ORDINARY * ROUNDOFF)

    def _multipliers(self, mesh: Mesh) -> Array | None:
        """Return the multipliers carried to the nodes of `mesh`, (K, m)."""
        if not self.tr.layout.rows:
            return None
        lam = self.tr.unpack(self.z)[1]
        nodes = self.tr.mesh.nodes
        table = np.empty((mesh.nodes.size, lam.shape[1]))
        for i, row in enumerate(lam.T):
            known = np.isfinite(row)
            table[:, i] = np.interp(mesh.nodes, nodes[known], row[known])
        return table

    def _record(self, seconds: float) -> None:
        mesh = self.tr.mesh
        self.rounds.append(
            {
                "elements": mesh.elements,
                "degrees": [min(mesh.degrees), max(mesh.degrees)],
                "unknowns": self.tr.layout.size,
                "estimate": None,
                "time": seconds,
            }
        )

    # -- what there is now ------------------------------------------------------------------------

    def path(self) -> Path:
        return Path(self.tr.mesh, self.tr.coordinates(self.z).T)

    def resolution(self) -> Resolution:
        if self.resolved is None or self.resolved[0] is not self.z:
            found = resolution(self.tr.mesh, self.tr.coordinates(self.z), self.sizes)
            self.resolved = (self.z, found)
        return self.resolved[1]

    def message(self, status: Status) -> str:
        name = self.problem.system.name or "problem"
        figures = f"tol = {self.tol:g}, error estimate {self.error:.2g}"
        if status in (Status.FLOOR, Status.DEGENERATE):
            figures += f", condition about {self.noise / ROUNDOFF:.1g}"
        return f"{name}: {status.value} ({figures})"

    def solution(self, status: Status, seconds: float) -> Solution:
        problem, tr = self.problem, self.tr
        system = problem.system
        clock = perf_counter()
        path = self.path()
        action = tr.action(self.z[: tr.layout.unknowns]) * tr.action_unit
        self.time["verify"] += perf_counter() - clock
        self.time["total"] = seconds + perf_counter() - clock
        layout = tr.layout
        stats = {
            "rung": self.rung,
            "unknowns": layout.unknowns,
            "rows": layout.rows,
            "iterations": dict(self.iterations),
            "evaluations": dict(self.evaluations),
            "rounds": self.rounds,
            "gain": self.gain,
            "noise": self.noise,
            "condition": max(self.noise / ROUNDOFF, 1.0),
            "derived": system.derived,
            "time": dict(self.time),
        }
        lam = tr.unpack(self.z)[1].T
        solution = Solution(problem, path, action, lam, self.error, status, stats)
        solution.__dict__["discrete"] = (tr, self.z)  # at hand already: nothing to rebuild
        if self.factors is not None and self.factors.layout is layout:
            solution.__dict__["factors"] = self.factors
        return solution


def _sizes(Q: Array, fallback: Array) -> Array:
    """Return the largest |q| of each coordinate along a path, (n,), positive."""
    size = np.max(np.abs(Q), axis=0)
    largest = float(np.max(size))
    return np.where(size > 1e-12 * largest, size, largest) if largest > 0 else fallback
