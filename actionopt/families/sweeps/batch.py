"""Many problems of one system, solved together: they differ in parameters, end points or times.

Members are solved in waves. Each begins where those that are solved lead to expect its path, and a
wave goes no farther from them than that works: first outwards from one member, then in between.
Members that do not contract wait for nearer neighbours, and are solved alone in the end: near the
nearest one, then from nothing. So is every member of which there is any doubt: `stacked_newton`
says what it measures. Searches from nothing that fail have a budget, and members that lie behind
one without a path come last. Few members are solved one after the other.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.quadratic.index import inertia
from actionopt.analysis.quadratic.indices import indices
from actionopt.analysis.solution import Solution
from actionopt.analysis.status import Status
from actionopt.discrete.between_nodes.crossing import find_imbalance
from actionopt.discrete.between_nodes.energy_balance import DRIFT_SAFETY
from actionopt.discrete.between_nodes.unsampled import may_have_unsampled
from actionopt.discrete.meshes.mesh import MAX_DEGREE, Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.stacks import PROGRAMS, Stack, StackShape, compile_function
from actionopt.families.continuation import (
    AS_EXPECTED,
    LEAP,
    OFF_BRANCH,
    OFF_SLOPES,
    continue_path,
    disagree,
)
from actionopt.families.sweeps.budget import Budget, Exhausted
from actionopt.families.sweeps.common_mesh import denser, even, transfer_matrix
from actionopt.families.sweeps.members import Members, checked_columns, member, refusal
from actionopt.families.sweeps.scheduling import NEIGHBOURS, Front, squares, weights
from actionopt.families.vary import lead_to, position_in_parameters, slope, slope_along
from actionopt.mechanics.laws.pulses import centres
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.refinement.iterate import (
    LATE_TIME,
    ROUNDED,
    SAFETY,
    UNKNOWN_GAIN,
    Iterate,
    amplification,
    coordinate_scales,
    estimate,
    sizes,
)
from actionopt.solver.refinement.stacked_newton import FollowedStack, follow
from actionopt.solver.refinement.workspace import MEASURABLE
from actionopt.solver.solve import Guess, refuse_rest, solve, solve_near
from actionopt.tools.blas import one_thread
from actionopt.tools.interrupts import ordinary_errors
from actionopt.tools.types import Array, NDInt

PREDICTED = 256  # at a time; ad hoc, a size of memory
SAME_MEMBER = 1e-7  # distance, of the ranges, at which members are one
BLOCK = 1024  # members among which neighbours are sought; ad hoc: distances of all to all
# Ad hoc, where nothing else is said.
MESH_MARGIN = 0.1  # of `tol`, the coefficients that a mesh may leave out to begin with
OTHERS_GAIN = 2.0  # times that of one member, of errors whose shapes differ
MORE_DEGREES = 4  # that tell what a mesh has left out
MESH_LEVELS = 4  # meshes that a member is tried on, each finer
INDEX_MESHES = 4  # on which indices are counted together
MEMBERS_BEFORE = 6  # members before one that is solved alone, by which its path is expected
# Amplified round-off, as it is and against a mesh's first member, from where on `solve` is to count
# whether a member is one of a family. Measured: of 400 families in all directions 2.4e-7 and more.
# On a mesh of many elements round-off moves its first member farther, of which `solve` found that
# it is none of a family: then those that it moves a little farther are none either; ad hoc.
SENSITIVE, SENSITIVE_GROWTH, SENSITIVE_ALIKE = 1e-8, 1e3, 2.0
REBASED = 0.25  # of a wave, on a finer mesh: the next ones begin there


@one_thread
def solve_run(
    problem: Problem,
    columns: Mapping[Any, ArrayLike],
    tol: float = 1e-8,
    *,
    index: bool = False,
    guess: Guess | None = None,
    first: int = 0,
    given: Mapping[int, Solution] | None = None,
    limited: bool = True,
) -> Members:
    """Return the paths of members of a family, each found from its neighbours.

    Parameters
    ----------
    problem : Problem
        What all members have in common.
    columns : mapping of name to (k,) values
        What differs, in the order of neighbours: names of parameters (of one number), "t0", "t1",
        ("start", coordinate) and ("end", coordinate).
    tol : float
        As for `solve`.
    index : bool
        Whether to count Morse indices.
    guess : Path, Solution, callable or array, optional
        Near which the member is sought from which all others are reached.
    first : int
        Which that is.
    given : mapping of int to Solution, optional
        Members that are solved already, from which others are reached: not solved again.
    limited : bool
        Whether searches that find nothing have a budget; else every member is searched for.

    Raises
    ------
    ValueError
        If a name is not one of these, values are not k finite numbers, or times do not
        increase.
    """
    run = _Members(problem, columns, tol, index, limited)
    run.go(guess, first, given or {})
    return run.members()


@dataclass(eq=False)
class _MeshLevel:
    """A mesh for members; how far errors, and round-off in the matrix, move a path there.

    Its number among the meshes, and finer ones on which indices are counted, itself first.
    """

    shape: StackShape
    gain: float
    probed: float
    number: int
    finer: list[StackShape]


class _Members:
    """The members as they are found."""

    def __init__(
        self,
        problem: Problem,
        columns: Mapping[Any, ArrayLike],
        tol: float,
        index: bool,
        limited: bool,
    ) -> None:
        self.problem, self.tol, self.counting = problem, tol, index
        self.columns = checked_columns(problem, columns)
        k, n = next(iter(self.columns.values())).size, problem.system.n
        self.times = np.tile([problem.start.t, problem.end.t], (k, 1))
        self.packed = np.tile(problem.packed, (k, 1))
        given = [[np.nan if x is None else x for x in e.q] for e in (problem.start, problem.end)]
        self.ends = np.tile(np.array(given), (k, 1, 1))
        for name, values in self.columns.items():
            if isinstance(name, tuple):
                i = problem.system.coordinates.index(name[1])
                self.ends[:, int(name[0] == "end"), i] = values
            elif name in ("t0", "t1"):
                self.times[:, int(name == "t1")] = values
            else:
                self.packed[:, position_in_parameters(problem.system, name)] = values
        if not (self.times[:, 1] > self.times[:, 0]).all():
            i = int(np.argmin(self.times[:, 1] - self.times[:, 0]))
            raise ValueError(
                "expected end events after start events, found t0 = {:g} and t1 = {:g} for member "
                "{}".format(*self.times[i], i)
            )
        table = np.array(list(self.columns.values())).T
        span = np.ptp(table, axis=0)
        self.at = (table - table.min(axis=0)) / np.where(span > 0, span, 1.0)  # (k, columns)
        self.status = [Status.NOT_FOUND] * k
        self.action, self.error, self.moved = np.full((3, k), np.nan)
        self.error[:] = np.inf
        self.slopes = np.full((k, len(self.columns)), np.nan)
        self.index, self.neighbour, self.mesh, self.sheet = np.full((4, k), -1)
        self.iterations = np.zeros(k, dtype=int)
        self.momenta = np.full((k, 2, n), np.nan)
        self.alone, self.decided, self.known, self.doubtful = np.zeros((4, k), dtype=bool)
        self.unsought, self.departed, self.turned = np.zeros((3, k), dtype=bool)
        self.values: list[Array] = [np.zeros((n, 0))] * k
        self.meshes: list[Mesh] = []
        self.messages: dict[int, str] = {}
        self.errors: dict[int, str] = {}
        self.budget = Budget(limited, n)
        self.levels: list[_MeshLevel] = []
        self.base = 0
        self.seeds = np.zeros((k, 0, n))  # of known members, on the mesh of the level `base`
        self.before = np.zeros((0, 0)), np.zeros(0)  # where members before one were, their weights

    def members(self) -> Members:
        """Return them all."""
        return Members(
            tuple(self.status), self.action, self.error, self.index, self.momenta, self.times,
            self.iterations, self.alone, self.neighbour, self.moved, self.slopes,
            self.sheet, tuple(self.meshes), self.mesh, tuple(self.values), self.messages,
            self.errors, self.unsought,
        )  # fmt: skip

    # -- the order -----------------------------------------------------------------------------

    def go(self, guess: Guess | None, first: int, given: Mapping[int, Solution]) -> None:
        """Solve all members, block by block, from the first one on and then before it.

        Or from the first of those that are `given`.
        """
        count, solution = len(self.status), None
        for i in given or sorted(range(count), key=lambda i: abs(i - first)):
            solution, first = given.get(i) or self._solve(i, guess), i
            if solution is not None and solution.success:
                break
        else:
            return
        for i, known in given.items():
            self._hold(i, known)
        if not (
            _can_be_stacked(self.problem, self.times, self.packed) and self._begin(first, solution)
        ):
            for way in (range(first + 1, count), range(first - 1, -1, -1)):
                near = {first: solution}  # the last ones that were found
                for i in way:
                    found = given.get(i)
                    if not self.decided[i]:
                        (*_, j), (*_, last) = near, near.values()
                        found = self._solve(i, self._expect(i, near), j, last)
                    if found is not None and found.success:
                        *_, last = near.values()
                        alike = _have_one_shape(found.mesh, last.mesh)
                        alike &= not self.departed[i]
                        kept = list(near.items())[1 - MEMBERS_BEFORE :] if alike else []
                        near = dict([*kept, (i, found)])
            return
        for i in given:
            if i != first:
                self._know(i, given[i].path)
                self.sheet[i] = self.sheet.max() + 1
        home = first // BLOCK
        blocks = [np.arange(k, min(k + BLOCK, count)) for k in range(0, count, BLOCK)]
        for block in (*blocks[home:], *blocks[:home][::-1]):
            self._block(block)
            if self.known[block].any():  # farther ones are neighbours no more
                near = np.concatenate([block, blocks[home]])
                self.known[np.setdiff1d(np.arange(count), near)] = False

    def _block(self, block: NDInt) -> None:
        """Solve some members, in waves from those that are known."""
        front, known = Front(self.at[block]), np.flatnonzero(self.known)
        front.learn(known, self.at[known], ~self.decided[block])
        lost: deque[int] = deque()  # for whom a search from nothing found no path
        while True:
            left = ~self.decided[block]
            chosen = front.wave(left & ~self.doubtful[block], self.known[block])
            if chosen.size:
                try:
                    self._solve_together(block[chosen], front.nearest[chosen])
                except ordinary_errors():  # for one of them: each is solved alone
                    self.doubtful[block[chosen]] = True
                new = block[chosen][self.known[block[chosen]]]
                front.note_solved(chosen.size, new.size, float(self.moved[block[chosen]].max()))
            else:
                i, allowed = front.next_alone(left, self.budget.allows), self.budget.allows
                again = i is None and allowed and bool(lost)
                i = lost.popleft() if again else i
                if i is None:
                    self.unsought[block[left]] = self.decided[block] = True
                    break
                new = block[i : i + 1]
                self._leave(int(block[i]), int(front.nearest[i]), again)
                if not self.known[block[i]]:
                    if allowed and not again:
                        lost.append(i)
                    if self.status[block[i]] is not Status.DEGENERATE:  # there are on both sides
                        front.note_lost(self.at[new])
                    continue
                front.again()
            front.learn(new, self.at[new], ~self.decided[block])

    # -- one by one ------------------------------------------------------------------------------

    def _solve(
        self,
        i: int,
        guess: Guess | None,
        neighbour: int = -1,
        near: Solution | None = None,
        again: bool = False,
    ) -> Solution | None:
        """Solve a member alone; None if it is refused, or if that fails unexpectedly.

        Near a guess, as it goes on from a `neighbour`, which has a path `near`; then from nothing
        as `solve` does; `again`, as `solve` does from the guess.
        """
        self.alone[i] = self.decided[i] = True
        self.neighbour[i] = neighbour
        try:
            problem = member(self.problem, self.columns, i)
            if isinstance(guess, Path):
                guess = lead_to(guess, problem)
            elif isinstance(guess, Solution):
                guess = replace(guess, path=lead_to(guess.path, problem))
            found = None
            if again:
                found = self._search(i, problem, guess)
            elif guess is not None:
                found = refuse_rest(solve_near(problem, guess, self.tol))
                if neighbour >= 0 and (found.success or not self.turned[neighbour]):
                    found = self._continue(i, (neighbour, near), guess, found)
                if found.success:
                    steps = sum(found.stats["iterations"].values())
                    self.budget.well += steps * found.mesh.elements
            if found is None or not (found.success or again):
                near, found = found, self._search(i, problem, None)
                if near is not None and (found is None or found.status is Status.NOT_FOUND):
                    found = near  # which may tell more
            if found is None:
                return None
            slopes = slope_along(found, self.columns)
            if self.counting and found.success:
                with suppress(ValueError):  # there is none
                    self.index[i] = found.morse_index
        except ordinary_errors() as error:
            text, refused = refusal(error)
            (self.messages if refused else self.errors)[i] = text
            return None
        self.status[i], self.action[i], self.error[i] = found.status, found.action, found.error
        self.unsought[i] &= not found.success
        self.iterations[i] += sum(found.stats["iterations"].values())
        self.momenta[i], self.slopes[i] = found.momenta, slopes
        self._hold(i, found)
        return found

    def _continue(
        self, i: int, near: tuple[int, Solution | None], guess: Guess, found: Solution
    ) -> Solution:
        """Return the path of a member that goes on from one `near`, or what was found."""
        j, before = near
        expected = guess.path if isinstance(guess, Solution) else guess
        assert isinstance(expected, Path)
        start, end = ({name: float(x[k]) for name, x in self.columns.items()} for k in (j, i))
        if before is None:
            problem = member(self.problem, self.columns, j)
            before = solve_near(problem, self._path(j), self.tol)
        found, goes_on, turned = continue_path(before, (start, end), found, expected, self.tol)
        self.departed[i], self.turned[j] = not goes_on, self.turned[j] or turned
        return found

    def _expect(self, i: int, near: Mapping[int, Solution]) -> Solution:
        """Return the last of the members `near` with the path that all lead to expect of another.

        Their meshes are of one shape.
        """
        *_, last = near.values()
        apart = self.at[list(near)] - self.at[i]
        radius = np.sqrt((apart**2).sum(axis=1).max())
        x = apart / (radius if radius > SAME_MEMBER else 1.0)
        if not (x.shape == self.before[0].shape and np.abs(x - self.before[0]).max() < SAME_MEMBER):
            self.before = x, weights(x[None])[0]
        share = self.before[1]
        values = np.tensordot(share, [other.path.values for other in near.values()], 1)
        lam = np.tensordot(share, [other.lam for other in near.values()], 1)
        return replace(last, path=Path(last.mesh, values), lam=lam)

    def _hold(self, i: int, found: Solution) -> None:
        """Keep the path of a member."""
        self.decided[i], self.mesh[i], self.values[i] = True, len(self.meshes), found.path.values
        self.meshes.append(found.mesh.moved(0.0, 1.0))

    def _search(self, i: int, problem: Problem, guess: Guess | None) -> Solution | None:
        """Search as `solve` does, from nothing if the budget is spent; None where that ended it."""
        guess, before = guess if self.budget.allows else None, self.budget.vain
        if solved := sum(status.success for status in self.status):
            left, j = int((~self.decided).sum()), self.neighbour[i]
            self.budget.begin(left, solved, turned=j >= 0 and bool(self.turned[j]))
        try:
            found = solve(
                problem, tol=self.tol, guess=guess, throw=False, progress=self.budget.count
            )
        except Exhausted:
            self.unsought[i] = True
            return None
        found = refuse_rest(found)
        if found.success:
            self.budget.note_found(before)
        return found

    def _leave(self, i: int, neighbour: int, again: bool) -> None:
        """Leave a member to `solve`, from a neighbour."""
        expected = self._predict(np.array([i]), np.array([neighbour]))[0]
        found = self._solve(i, self._path(neighbour), neighbour, again=again)
        if found is not None and found.success:
            self._know(i, found.path)
            size = np.abs(self.seeds[i]).max(axis=0)
            apart = np.abs(self.seeds[i] - expected).max(axis=0) / np.where(size > 0, size, 1.0)
            self.moved[i] = apart.max()
            apart = self.departed[i]
            self.sheet[i] = self.sheet.max() + 1 if apart else self.sheet[neighbour]

    def _path(self, i: int) -> Path:
        """Return the path of a member."""
        return Path(self.meshes[self.mesh[i]].moved(*self.times[i].tolist()), self.values[i])

    def _know(self, i: int, path: Path) -> None:
        """Keep the path of a member as a guess for its neighbours."""
        mesh = self.levels[self.base].shape.mesh.moved(*self.times[i].tolist())
        self.seeds[i], self.known[i] = path.on(mesh).values.T, True

    # -- meshes ----------------------------------------------------------------------------------

    def _begin(self, i: int, solution: Solution) -> bool:
        """Make the first mesh from a solution; False if that cannot be followed with others."""
        ends, tr = (self.problem.start, self.problem.end), solution.discrete.tr
        start, end = (tuple(set(range(tr.lengths.size)) - set(e.pinned)) for e in ends)
        size = sizes(solution.path.values.T, self.problem.scales)
        mesh = self._mesh(solution.path, size)
        closed = self.problem.advance is not None
        free, units = ((), ()) if closed else (start, end), (tr.lengths, tr.action_unit)
        shape = StackShape(self.problem.system, mesh, free, *units, closed=closed)
        # One by one members of a map are led to other kinds of path, and closed ones are lost.
        members = math.inf if closed or len(self.columns) > 1 else len(self.status)
        if not (shape.pays(members) and self._add_level(i, solution.path, shape)):
            return False
        self.seeds = np.zeros((len(self.status), mesh.offsets[-1] + 1, shape.n))
        self._know(i, solution.path)
        self.sheet[i] = 0
        return True

    def _mesh(self, path: Path, size: Array) -> Mesh:
        """Return a mesh of one degree for members like a path, in units of `size`.

        It may leave out a part of what the tolerance allows. A path that closes has two elements.
        """
        mesh = even(path, size, MESH_MARGIN * self.tol / (2 * SAFETY))
        few = self.problem.advance is not None and mesh.elements == 1
        return Mesh([0.0, 0.5, 1.0], mesh.degrees[0]) if few else mesh

    def _add_level(self, i: int, path: Path, shape: StackShape) -> bool:
        """Add a mesh that resolves the path of a member; False if it cannot be followed there.

        On one of more nodes the path tells how far errors are amplified.
        """
        mesh, found = shape.mesh, []
        finer = mesh.cut(mesh.since, mesh.degrees[0] + MORE_DEGREES)
        for there in (shape, shape.on(finer)):
            Q = path.on(there.mesh.moved(*self.times[i].tolist())).values.T[None]
            found.append(self._follow(there, np.array([i]), Q, measured=there is shape))
            if not found[-1].converged[0]:
                return False
        at, better = found
        size = sizes(path.values.T, self.problem.scales)
        exact = Path(finer, better.Q[0].T)(mesh.nodes).T
        change = float((np.abs(exact - at.Q[0]) / size).max())
        left = float(at.omitted[0])
        gain = max(change / left, 1.0) * OTHERS_GAIN if left > MEASURABLE else UNKNOWN_GAIN
        self.levels.append(_MeshLevel(shape, gain, float(at.probed[0]), len(self.meshes), [shape]))
        self.meshes.append(mesh)
        return True

    def _to(self, level: int, Q: Array, source: int) -> Array:
        """Return coordinates (C, K, n) on the mesh of one level on that of another."""
        return transfer_matrix(*(self.levels[k].shape.mesh for k in (source, level))) @ Q

    def _rebase(self, level: int) -> None:
        """Move the known paths to the mesh of another level, on which members begin from now on."""
        here, shape = np.flatnonzero(self.known), self.levels[level].shape
        seeds = np.zeros((len(self.status), shape.mesh.offsets[-1] + 1, shape.n))
        seeds[here] = self._to(level, self.seeds[here], self.base)
        self.seeds, self.base = seeds, level

    # -- together --------------------------------------------------------------------------------

    def _follow(
        self, shape: StackShape, which: NDInt, Q: Array, *, measured: bool = True
    ) -> FollowedStack:
        given = self.times[which], self.packed[which], Q, self.tol
        return follow(shape, *given, measured=measured)

    def _solve_together(self, which: NDInt, nearest: NDInt) -> None:
        """Follow paths to some members from their `nearest` solved ones, all at once.

        Those whose error is too large go on to finer meshes; those that are solved are known from
        then on, and the others are tried again when they have a nearer neighbour.
        """
        self.neighbour[which], count = nearest, which.size
        expected = self._predict(which, nearest)
        found = self._follow(self.levels[self.base].shape, which, expected)
        found.converged &= found.moved <= LEAP
        self.iterations[which] += found.iterations
        elements = self.levels[self.base].shape.mesh.elements
        self.budget.well += int(found.iterations[found.converged].sum()) * elements
        self.moved[which] = np.where(found.converged, found.moved, np.nan)
        self.seeds[which] = found.Q
        finer = self._judge(self.base, which, found)
        arrived, level = which[found.converged], self.base
        wanted = finer.size
        which, Q, omitted = which[finer], found.Q[finer], found.omitted[finer]
        while which.size and level < self.base + MESH_LEVELS:
            if level + 1 == len(self.levels) and not self._finer(level, which, Q, omitted):
                break
            first = self._to(level + 1, Q, level)
            level += 1
            found = self._follow(self.levels[level].shape, which, first)
            self.iterations[which] += found.iterations
            finer = self._judge(level, which, found)
            which, Q, omitted = which[finer], found.Q[finer], found.omitted[finer]
        arrived = arrived[self.decided[arrived]]
        self.known[arrived] = True
        self.sheet[arrived] = self.sheet[self.neighbour[arrived]]
        if wanted > REBASED * count and level > self.base:
            self._rebase(level)

    def _finer(self, level: int, which: NDInt, Q: Array, omitted: Array) -> bool:
        """Add a finer mesh, for the worst of some members; False if there is none."""
        worst = int(np.argmax(omitted))
        i, shape = which[worst : worst + 1], self.levels[level].shape
        mesh, degree = shape.mesh, shape.mesh.degrees[0]
        there = shape.on(mesh.cut(mesh.since, min(2 * degree, MAX_DEGREE)))
        first = transfer_matrix(mesh, there.mesh) @ Q[worst : worst + 1]
        found = self._follow(there, i, first, measured=False)
        if not found.converged[0]:
            return False
        mesh = there.mesh.moved(*self.times[i[0]].tolist())
        path = Path(mesh, found.Q[0].T)
        mesh = self._mesh(path, sizes(found.Q[0], self.problem.scales))
        return self._add_level(int(i[0]), path, shape.on(mesh))

    def _judge(self, level: int, which: NDInt, found: FollowedStack) -> NDInt:
        """Keep what is solved; return which of those that arrived want a finer mesh, (F,)."""
        at = self.levels[level]
        # Errors are amplified as round-off in the matrix is.
        gain = at.gain * np.fmax(found.probed / at.probed, 1.0)
        gain = np.maximum(gain, amplification(found.noise))
        error = estimate(gain, found.omitted, found.noise)
        within = error <= self.tol
        error = np.maximum(error, SAFETY * found.missed)
        error = np.fmax(error, DRIFT_SAFETY * found.drift)
        several = found.Q.shape[2] > 1
        sensitive = max(min(SENSITIVE, SENSITIVE_GROWTH * at.probed), SENSITIVE_ALIKE * at.probed)
        one_of_many = found.probed > sensitive if several else found.noise > ROUNDED
        sound = found.converged & np.isfinite(found.omitted) & ~one_of_many
        good = sound & (error <= self.tol)
        asked = good & (np.isnan(found.drift) | self._may_have_unsampled(at, which, found.Q))
        for k in np.flatnonzero(asked).tolist():
            good[k], error[k] = self._balances(at, int(which[k]), found.Q[k], float(error[k]))
        self.doubtful[which] = found.converged & ~good & ~(sound & ~within)
        i = which[good]
        self.action[i], self.error[i] = found.action[good], error[good]
        self.momenta[i], self.decided[i], self.mesh[i] = found.momenta[good], True, at.number
        for j, row in zip(i.tolist(), found.Q[good], strict=True):
            self.status[j], self.values[j] = Status.SOLVED, row.T
        if i.size:
            self.slopes[i] = self._slopes(at.shape, i, found.Q[good])
        if self.counting:
            self._count(at, i, found.Q[good])
        far = i[self.moved[i] > AS_EXPECTED]
        for j in far[self._departs(far)].tolist():
            self._drop(j)
        return np.flatnonzero(sound & ~within)

    def _departs(self, which: NDInt) -> NDInt:
        """Return which members are of another kind than their neighbours, as far as that shows."""
        near = self.neighbour[which]
        step = np.stack([x[which] - x[near] for x in self.columns.values()], axis=1)
        before, after = ((self.slopes[k] * step).sum(axis=1) for k in (near, which))
        known = self.action[which] - self.action[near], before, after
        off, far_off = (disagree(*known, part) for part in (OFF_SLOPES, OFF_BRANCH))
        asked = np.union1d(which[off], near[off])
        self._index_alone(asked[self.index[asked] < 0])
        return far_off | off & (self.index[which] != self.index[near])

    def _drop(self, i: int) -> None:
        """Forget the path of a member, which is to be found from a nearer one."""
        self.status[i], self.decided[i] = Status.NOT_FOUND, False
        self.action[i], self.error[i], self.momenta[i], self.slopes[i] = (
            np.nan,
            np.inf,
            *[np.nan] * 2,
        )
        self.index[i] = self.mesh[i] = -1

    def _may_have_unsampled(self, at: _MeshLevel, which: NDInt, Q: Array) -> Array:
        """Return on the paths of which members L may have steps between samples, (C,)."""
        system, start = self.problem.system, self.times[which, 0]
        mesh, duration = at.shape.mesh, self.times[which, 1] - start
        since = np.multiply.outer(mesh.nodes_since / mesh.duration, duration)
        q = Q.transpose(2, 1, 0)
        return may_have_unsampled(
            system, system.step_arguments, q, since, duration, start, self.packed[which]
        )

    def _balances(self, at: _MeshLevel, i: int, Q: Array, error: float) -> tuple[bool, float]:
        """Return whether energy balances along a member's path, and its error, as `solve` does."""
        path = Path(at.shape.mesh.moved(*self.times[i].tolist()), Q.T)
        on_mesh = DiscretePath.of(member(self.problem, self.columns, i), path)
        scales = coordinate_scales(on_mesh.problem, on_mesh.Q)
        here = Iterate(on_mesh.tr, on_mesh.z, *scales)
        off, error = find_imbalance(here, error, self.tol, lambda: here.impulse_gain(many=False)[0])
        return off is None and error <= self.tol, error

    def _slopes(self, shape: StackShape, which: NDInt, Q: Array) -> Array:
        """Return the derivatives of the actions of members by what differs, (C, columns)."""
        p0, p1 = self.momenta[which].swapaxes(0, 1)
        known = {"q0": -p0, "q1": p1}
        if any(isinstance(name, str) for name in self.columns):
            parts = []
            for here in shape.parts(which.size):
                i = which[here]
                parts.append(
                    Stack(shape, self.times[i], self.packed[i]).slopes(shape.local(Q[here]))
                )
            known |= {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        return np.stack([slope(self.problem, known, name) for name in self.columns], axis=1)

    def _count(self, at: _MeshLevel, which: NDInt, Q: Array) -> None:
        """Count the indices of members, on finer meshes where neighbours of their paths need it."""
        mesh = at.shape.mesh
        for k in range(INDEX_MESHES):
            if not which.size:
                return
            if k == len(at.finer):
                at.finer.append(at.shape.on(denser(at.finer[-1].mesh)))
            there = Q if k == 0 else transfer_matrix(mesh, at.finer[k].mesh) @ Q
            found = indices(at.finer[k], self.times[which], self.packed[which], there, self.tol)
            self.index[which] = found
            which, Q = which[found < 0], Q[found < 0]
        self._index_alone(which)

    def _index_alone(self, which: NDInt) -> None:
        """Count the indices of members one by one."""
        for i in which.tolist():
            alone = DiscretePath.of(member(self.problem, self.columns, i), self._path(i))
            with suppress(ValueError):  # there is none
                self.index[i] = inertia(alone, float(self.error[i])).index

    def _predict(self, which: NDInt, nearest: NDInt) -> Array:
        """Return where known members lead to expect others, (C, K, n), by interpolation.

        Only members on the sheet of the nearest are asked.
        """
        known = np.flatnonzero(self.known)
        columns = self.at.shape[1]
        most = NEIGHBOURS[min(columns, len(NEIGHBOURS) - 1)]
        Q = np.empty((which.size, *self.seeds.shape[1:]))
        for first in range(0, which.size, PREDICTED):
            some = which[first : first + PREDICTED]
            apart = squares(self.at[some], self.at[known])
            if known.size > most:
                chosen = np.argpartition(apart, most - 1, axis=1)[:, :most]
                chosen.sort(axis=1)
            else:
                chosen = np.tile(np.arange(known.size), (some.size, 1))
            rows = np.arange(some.size)[:, None]
            mine = nearest[first : first + PREDICTED, None]
            other = self.sheet[known[chosen]] != self.sheet[mine]
            if other.any():  # the nearest once more: all of them weigh as one
                chosen = np.where(other, np.searchsorted(known, mine), chosen)
            radius = np.sqrt(apart[rows, chosen].max(axis=1))
            radius = np.where(radius > SAME_MEMBER, radius, 1.0)[:, None, None]
            x = (self.at[known[chosen]] - self.at[some][:, None]) / radius
            values = self.seeds[known[chosen]].reshape(*chosen.shape, -1)
            found = weights(x)[:, None] @ values
            Q[first : first + PREDICTED] = found.reshape(-1, *Q.shape[1:])
        miss = self.ends[which] - Q[:, [0, -1]]
        miss = np.where(np.isfinite(miss), miss, 0.0)
        s = self.levels[self.base].shape.mesh.nodes[:, None]
        Q += (1 - s) * miss[:, :1] + s * miss[:, 1:]
        pinned = np.isfinite(self.ends[which])
        Q[:, [0, -1]] = np.where(pinned, self.ends[which], Q[:, [0, -1]])
        if self.problem.advance is not None:
            Q[:, -1] = Q[:, 0] + self.problem.advance
        return Q


def _has_clock_alone(problem: Problem) -> bool:
    """Whether a path that closes has a clock, and nothing else tells where it begins."""
    kept = problem.order == tuple(range(problem.system.n))
    return kept and not problem.may_be_shifted and not problem.start.pinned


def _have_one_shape(a: Mesh, b: Mesh) -> bool:
    """Whether two meshes are one, but for their times."""
    same = a.degrees == b.degrees
    return same and bool((a.since / a.duration == b.since / b.duration).all())


def _can_be_stacked(problem: Problem, times: Array, packed: Array) -> bool:
    """Whether members of these times and parameters are plain enough to be solved together."""
    system = problem.system
    structure = system.structure
    far = np.abs(times).max(axis=1) > LATE_TIME * (times[:, 1] - times[:, 0])
    plain = (
        system.m == system.r == 0
        and not structure.forced
        and (problem.advance is None or _has_clock_alone(problem))
        and not (problem.leads_to_rest or problem.on_surface)
    )
    late = structure.depends_on_time and bool(far.any())
    if not plain or late or problem.boundaries or system.switches or system.clock:
        return False
    if system.pulses is not None:  # elements end there, of each member where its own are
        laws = np.unique(np.hstack([times, packed]), axis=0)
        if any(centres(system.pulses, t0, t1, np.array([p])) for t0, t1, *p in laws.tolist()):
            return False
    try:
        for name in PROGRAMS:
            compile_function(system, name)
    except ValueError:  # an instruction that there is no function of numpy's for
        return False
    return True
