"""Find a path: from the straight line by the rungs of a ladder, or from a guess.

Without a guess a least path is sought where there may be one, else a stationary one; with one, the
stationary path near it. Linear equations of motion need no finding: their discrete problem is one
linear system.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.discrete.resolution import DEGREES, resolution
from actionopt.discrete.transcription import Transcription
from actionopt.solver.first_mesh import paced, planned
from actionopt.solver.iterate import LARGE, Walk, sizes
from actionopt.solver.refine import settle, settle_on
from actionopt.tools.types import Array

# How a first path is sought from the straight line, each way on meshes of so many elements.
# Newton's method costs next to nothing, and knows at once whether it works. It hardly ever fails
# where the action is convex at the straight line; elsewhere descent comes first, robust and quick
# where the action is bounded below, and sees where it is not; Ipopt minimises under constraints,
# and where the descent is lost; continuation gets to a saddle slowly but surely. Motions from both
# events that nearly meet half way are near a path however far that is from the line, and in less
# time than continuation takes on fine meshes; their numbers stand for the meshes. Ipopt's root
# finding needs no path to be near; a minimum down a long curved valley takes patience.
Ladder = tuple[tuple[str, tuple[int, ...]], ...]
LADDER: Ladder = (
    ("convex newton", (4,)),
    ("descent", (8, 16, 32, 64)),
    ("newton", (4,)),
    ("least", (8, 16, 32, 64)),
    ("continuation", (8,)),
    ("meeting", (256, 768)),
    ("fine continuation", (16, 32)),
    ("stationary", (8, 16)),
    ("patient least", (8, 16, 32, 64)),
)
SHORT = 4  # rungs that are tried from a bent line
BEND = 0.4  # of the motion's sizes
TRAPPED = (Status.NOT_FOUND, Status.UNRESOLVED, Status.DEGENERATE)
LEAST = ("descent", "least", "patient least")
FIRST = ("convex newton", *LEAST)  # what is tried only as long as there may be a least path
MEETING = 8  # coordinates up to which a few hundred motions are many
TRIED = 32  # pairs of motions; and so many elements as that many paths of
MANY = 1500  # unknowns have
LENGTHY = 48  # elements of a motion that takes long to compute
FINE = 3  # coordinates up to which a higher degree costs less than a second mesh
PATIENT = 30  # damped steps towards a path near a guess: whatever else there is costs more
NEAR_GUESS = (16, 32, 64)  # a guess has features that coarser meshes would miss
LINEAR = 4  # elements to begin with where nothing has to be sought
COARSE_DEGREE = 6
SHOWN = 1e-3  # omitted coefficients of a guess below which a mesh shows all of it
ROUGHLY = 2e-2  # omitted coefficients below which a coarse path is worth refining


@dataclass(eq=False)
class Search:
    """What is sought: a path to `tol` that obeys `principle`, on the mesh `given` if there is one.

    `rung` says which way it was found in the end.
    """

    walk: Walk
    tol: float
    principle: str
    given: Mesh | None
    rung: str = ""
    bent: bool = False  # whether a path is sought from a bent line
    may_be_least: bool = False
    ladder: Ladder = LADDER
    spare: tuple[str, Path, Array] | None = None  # a saddle, found while a least path was sought

    @property
    def least(self) -> bool:
        """Whether the path at hand was found by minimising."""
        return self.rung in LEAST

    # -- without a guess -----------------------------------------------------------------------

    def from_nothing(self) -> Status:
        """Find a path with no guess, by the rungs of `LADDER`, and settle it.

        A straight line may be a trap: through the centre of a force or of a circle, symmetry keeps
        every way on it. Then a bent one is tried.
        """
        status = self._climb(self.ladder)
        if status in TRAPPED:
            again = self._bend(self.ladder[:SHORT])
            return again if again.success else status
        return status

    def _bend(self, ladder: Ladder) -> Status:
        """Try the rungs from a bent line."""
        if self.bent or self.walk.problem.system.n == 1 or self._large:
            return Status.NOT_FOUND
        before = {**vars(self.walk), "rounds": list(self.walk.rounds)}
        around = Search(self.walk, self.tol, self.principle, self.given, bent=True)
        status = around._climb(ladder)
        if status.success:
            self.rung = around.rung
        else:  # the attempt from the straight line is the one to show
            lost = self.walk.lost
            vars(self.walk).update(before)
            self.walk.lost = lost or self.walk.lost
        return status

    @property
    def _large(self) -> bool:
        """Whether even the coarsest mesh has many unknowns."""
        return self.walk.problem.system.n * COARSE_DEGREE * LADDER[1][1][0] > LARGE

    def _climb(self, ladder: Ladder) -> Status:
        """Try the rungs in turn until one leads to a path that settles."""
        forced = self.walk.problem.system.structure.forced
        self.may_be_least = self.principle != "stationary" and not forced
        status = Status.NOT_FOUND
        large = self._large
        # Continuation takes hundreds of factorizations: the last resort where each costs much.
        for rung, meshes in sorted(ladder, key=lambda r: large and "continuation" in r[0]):
            if (rung in FIRST and not self.may_be_least) or not self._offers(rung):
                continue
            if rung not in FIRST and self.spare is not None:
                continue  # it could only bring another saddle
            status = self._try(rung, meshes)
            if rung == "descent" and status is Status.UNRESOLVED:
                around = self._bend(self.ladder[:2])  # before what costs more
                status = around if around.success else status
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
        (self.rung, path, z), self.spare = self.spare, None
        if self.walk.z is z:
            return self._settle()
        self.walk.rounds.clear()
        self.walk.restart()
        self.walk.place(path.mesh, path)
        return self._settle() if self.walk.follow() else Status.NOT_FOUND

    def _try(self, rung: str, meshes: tuple[int, ...]) -> Status:
        """Seek a path on finer and finer meshes until one resolves it roughly, and settle it.

        A mesh too coarse for the motion has stationary points of its own that are no paths, or
        holds a path where it should not be: such a path does not settle under refinement. A
        least path on a mesh twice as fine starts from it, others from the straight line.
        """
        self._begin(rung)
        if rung == "meeting":
            return self._meet(meshes)
        self.walk.rounds.clear()
        status, known = Status.NOT_FOUND, None
        for elements in meshes:
            self.walk.begin()
            self.walk.restart()
            degree = self._fine_degree() if "newton" in rung else COARSE_DEGREE
            mesh = self._uniform(elements, degree)
            self.walk.place(mesh, known or (self._bent(mesh) if self.bent else None))
            if not self._seek(rung):
                if self.least and self.walk.diverged:
                    return Status.UNBOUNDED
                if rung in ("descent", "least"):
                    return Status.NOT_FOUND
                known = None
                continue
            finer = elements != meshes[-1] or rung == "continuation"
            if self.walk.rough() > ROUGHLY and finer:
                known = self.walk.path() if self.least else None
                continue
            if not self.least and self.may_be_least and self.walk.index() > 0:
                # There may be a least path yet; this one is kept in case there is not.
                self.spare = self.spare or (rung, self.walk.path(), self.walk.z)
                return Status.NOT_FOUND
            status = self._settle()
            if status is not Status.UNRESOLVED:
                break
        return status

    def _meet(self, counts: tuple[int, ...]) -> Status:
        """Seek a path near motions that nearly meet half way, more and more of them."""
        walk, problem = self.walk, self.walk.problem
        from actionopt.solver.meeting import meetings

        for seed, count in enumerate(counts):
            left, elements = TRIED * MANY, LENGTHY + 1
            for guess in meetings(problem, count, TRIED, seed, walk.watch):
                walk.rounds.clear()
                walk.restart()
                walk.begin(guess)
                walk.place(guess.mesh, guess)
                elements = min(elements, guess.mesh.elements)
                left -= max(walk.tr.layout.size, MANY)
                if walk.approach(PATIENT):
                    saddle = self.may_be_least and walk.index() > 0
                    status = self._settle()
                    if status.success or status is Status.FLOOR:
                        if not saddle:
                            return status
                        self.spare = ("meeting", walk.path(), walk.z)
                        return Status.NOT_FOUND
                if left < 0:
                    break
            if elements > LENGTHY:
                break  # more of these would take too long
        return Status.NOT_FOUND

    @property
    def _meets(self) -> bool:
        """Whether motions from both events can be expected to meet half way."""
        problem, n = self.walk.problem, self.walk.problem.system.n
        whole = len(problem.start.pinned) == n == len(problem.end.pinned)
        return whole and n <= MEETING and problem.system.m == 0 and not self.bent

    def _offers(self, rung: str) -> bool:
        """Whether a way is open to the problem, and worth its time."""
        if rung in ("convex newton", "descent"):
            return self.walk.can_descend
        if rung == "meeting":
            return self._meets
        # With a saddle in hand a long search on a large system is not worth it.
        small = self.spare is None or self.spare[0] == "meeting" or not self.walk.large
        return rung != "patient least" or small

    def _seek(self, rung: str) -> bool:
        """Find a stationary path on the mesh at hand; False if that did not work."""
        if rung in ("convex newton", "newton"):
            return self.walk.approach(convex=rung != "newton")
        if rung == "descent":
            return self.walk.descend()
        if "continuation" in rung:
            return self.walk.release()
        if rung == "stationary":
            return self.walk.root()
        return self.walk.find("least" if rung == "least" else "patient least")

    # -- from a guess --------------------------------------------------------------------------

    def from_neighbour(self, neighbour: Solution) -> Status:
        """Follow a path of the system as its ends move to these, where nothing else differs."""
        problem, old = self.walk.problem, neighbour.problem
        tr, z = neighbour.discrete.tr, neighbour.discrete.z
        same = (
            (old.start.t, old.end.t) == (problem.start.t, problem.end.t)
            and (old.start.pinned, old.end.pinned) == (problem.start.pinned, problem.end.pinned)
            and old.advance is None is problem.advance
            and self.given in (None, tr.mesh)
        )
        self._begin("linear" if self.walk.linear else "guess")
        if not same or not self.walk.join(tr, z):
            return Status.NOT_FOUND
        near = self.walk.follow() or self.walk.approach(PATIENT)
        return self._settle() if near else Status.NOT_FOUND

    def from_guess(self, curve_of: Callable[[Mesh], Path]) -> Status:
        """Follow the guess, or find the stationary path near it, or continue from it."""
        self._begin("guess")
        status = Status.NOT_FOUND
        for elements in self._fine_enough(curve_of):
            coarse = self._uniform(elements, COARSE_DEGREE)
            curve = curve_of(coarse)
            own = curve.mesh is not coarse and elements == NEAR_GUESS[0]
            mesh = self.given or (curve.mesh if own else coarse)
            self.walk.begin(curve)
            self.walk.place(mesh, curve)
            near = self.walk.follow() or self.walk.approach(PATIENT) or self.walk.root()
            # A guess is worth seconds, not minutes.
            if near or (not self.walk.large and self.walk.release()):
                status = self._settle()
                if status is not Status.UNRESOLVED:
                    break
        return status

    def _fine_enough(self, curve_of: Callable[[Mesh], Path]) -> tuple[int, ...]:
        """Return the numbers of elements to try: those that resolve the guess, if any does.

        A motion of many turns is lost on a mesh that misses them; a kink is resolved by none.
        """
        for k, elements in enumerate(NEAR_GUESS):
            mesh = self._uniform(elements, COARSE_DEGREE)
            curve = curve_of(mesh)
            size = sizes(curve.values.T, self.walk.problem.scales)
            if curve.mesh is not mesh or resolution(mesh, curve.values.T, size).worst < SHOWN:
                return NEAR_GUESS[k:]
        return NEAR_GUESS

    # -- linear equations ------------------------------------------------------------------------

    def solve_linear(self, curve_of: Callable[[Mesh], Path] | None) -> Status:
        """Solve linear equations; of a guess only the mesh is of use."""
        self._begin("linear")
        self.walk.begin()
        mesh, free = self.given, self.given is None and curve_of is None
        steady = self.walk.problem.system.structure.steady
        if free and steady:
            mesh = planned(self.walk.problem, self.tol, LINEAR)
        elif mesh is None:
            mesh = self._uniform(LINEAR, self._fine_degree())
            mesh = curve_of(mesh).mesh if curve_of is not None else mesh
        self.walk.place(mesh, None)
        if free and not steady:
            mesh = paced(self.walk.tr, self.walk.z)
            if mesh is not None:
                self.walk.place(mesh, None)
        return self._settle() if self.walk.follow() else Status.DEGENERATE

    def _begin(self, rung: str) -> None:
        self.rung = rung
        if self.walk.watch is not None:
            self.walk.watch.how = rung

    # -- both ------------------------------------------------------------------------------------

    def _uniform(self, elements: int, degree: int) -> Mesh:
        problem = self.walk.problem
        return Mesh.uniform(problem.start.t, problem.end.t, elements, degree)

    def _bent(self, mesh: Mesh) -> Path:
        """Return a line between the events that is bent to one side in every coordinate."""
        problem = self.walk.problem
        Q = Transcription(problem, mesh, problem.lengths).straight()
        s = mesh.nodes_since / mesh.duration
        side = problem.lengths * np.cos(np.arange(1.0, 1.0 + problem.system.n))  # no symmetry's own
        return Path(mesh, (Q + BEND * np.sin(np.pi * s)[:, None] * side).T)

    def _fine_degree(self) -> int:
        """Return a degree with which a few elements of a smooth path may meet the tolerance.

        About one degree a digit. A second mesh costs more where the coordinates are few.
        """
        if self.walk.problem.system.n > FINE:
            return COARSE_DEGREE
        wanted = max(COARSE_DEGREE, -np.log10(self.tol) + 3)
        return int(DEGREES[min(np.searchsorted(DEGREES, wanted), DEGREES.size - 1)])

    def _settle(self) -> Status:
        if self.given is not None:
            return settle_on(self.walk, self.given, least=self.least)
        return settle(self.walk, self.tol, least=self.least)
