"""Paths of least action along an obstacle, f(q, t) >= 0: the path, and the times of contact.

Where a path touches the obstacle (`touching`) f = 0 is a constraint like any other, elements end
where contact begins and ends, and the path is followed from mesh to mesh as other paths are. The
times of contact are unknowns of an outer Newton's method: a path of least action meets the obstacle
tangentially,

    df/dt = f_q . v + f_t = 0    where contact begins and ends, on the free side of it,

v from the discrete momentum there, which is accurate to order 2d. (Of all joints the action is
least at these, so that the path depends on the times of contact to second order only.) At last the
conditions of Karush, Kuhn and Tucker are looked at between the nodes as well: a part where the
obstacle would have to pull is freed, one inside of it brought in contact, and all done again.

References
----------
A. E. Bryson and Y.-C. Ho, *Applied Optimal Control* (1975), section 3.11; J. Nocedal and
S. J. Wright, *Numerical Optimization* (2nd ed. 2006), section 12.3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from actionopt.analysis.second_variation import RANK
from actionopt.analysis.status import Status
from actionopt.discrete.discrete_path import DiscretePath
from actionopt.discrete.factors import Factors
from actionopt.discrete.mesh import Mesh
from actionopt.discrete.path import Path
from actionopt.mechanics.held import Held
from actionopt.mechanics.obstacle import Arc
from actionopt.mechanics.problem import Problem
from actionopt.mechanics.switches import is_smooth
from actionopt.solver.contact_times import slips, stretched, without
from actionopt.solver.iterate import Iterate
from actionopt.solver.refine import refine
from actionopt.solver.touching import (
    NO_ROOM,
    is_of_higher_order,
    lines,
    looked_at,
    narrow,
    other_sides,
    rows_along,
    runs,
    touch,
    touched,
    unseen,
)
from actionopt.solver.workspace import Workspace
from actionopt.tools.types import EPS, Array
from actionopt.tools.watch import OutOfTime

# Ad hoc, all of them, where nothing else is said.
SOUGHT, SOUGHT_DEGREE = 16, 4  # elements on which contact is sought first, and their degree
TRIES, MOST = 7, 200  # meshes on which it is sought, and elements of one
FLAT = 1e-3  # in units of the rows' typical gradients: a row has none
BARRIER = 1e-6  # in units of the motion: Ipopt's tolerance
HELD_ELEMENTS, HELD_DEGREE = 8, 6  # with which a path is followed first, once contact is known
JOINS = 25  # steps to the times of contact
TANGENTIAL = 1e-15  # of a typical rate of f: a rate that is zero
SHORTER, SHORTENED = 3, 0.05  # how often, and to what part, contact is made shorter
CHANGES = 8  # of what is in contact, before it is given up
# For derivatives by a time of contact: of the shortest part, but of the duration at least so much,
# far above its round-off, and of the part at most.
DIFFERENCE, LEAST_DIFFERENCE, MOST_DIFFERENCE = 1e-6, 1e-11, 1e-2
SHRINK = 0.2  # of its length, what one step leaves of a part at least
# Of the duration, in this range the tolerance: a shorter part between times of contact is none. Of
# the path's size, the greater one: what may be inside of the obstacle where such parts come and go.
VANISHING = 1e-10, 1e-5
SETTLED_TIME = 1e-13  # of the duration: a step of the times of contact that is the last
STALLED_TIME = 1e-6  # of the duration: steps that stop contracting below this are round-off
INSIDE = 10.0  # times the error of the path: what f may be below zero
PULLING = 1e-6  # of the largest contact force: what it may be below zero
KINKED = (
    "expected an obstacle that is smooth in the coordinates, found a kink or a corner (fmax, fmin, "
    "fabs), where its force has no direction: round it, such as by (x**4 + y**4)**(1/4) for the "
    "larger of abs(x) and abs(y); give fmin(f, g) as two rows"
)
NO_SLOPE = "the obstacle has no slope where it is met: give a function that has, such as a distance"
ORDER = (
    "expected an obstacle whose gradient is not zero on its surface, found a power of the distance "
    "from it: give a function that grows as the distance, such as f for f**3"
)
DEPENDENT = "rows in contact have gradients that depend on each other: give each surface once"
SMALL = (
    "round something small or sharp contact is short: below about a thousandth of the path it may "
    "not be found; give a guess that goes round it, or make it larger or rounder"
)
HOPELESS = (NO_ROOM, KINKED, ORDER, DEPENDENT)  # what finer meshes do not mend
FAMILY = (
    "where events and obstacle have a symmetry, such as a sphere between them, the least path may "
    "be one of a family: move an event a little"
)


class Changed(Exception):
    """Other parts of the path are in contact than was thought."""

    def __init__(self, arcs: tuple[Arc, ...]) -> None:
        super().__init__()
        self.arcs = arcs


@dataclass(eq=False)
class Along(Workspace):
    """What a search for a path along an obstacle works on: its problem is `Held`.

    Attributes
    ----------
    inside : float
        How far the path is inside of the obstacle where it is not held, in its own size.
    freed : bool
        Whether parts that do not press were freed already.
    """

    inside: float = 0.0
    freed: bool = False

    @property
    def held(self) -> Held:
        """The question with the parts in contact that are thought so."""
        assert isinstance(self.problem, Held)
        return self.problem

    @property
    def question(self) -> Problem:
        """What was asked."""
        return self.held.free

    # -- the path and its times of contact -------------------------------------------------------

    def stand(self, found: Iterate) -> None:
        """Go back to a path that Ipopt found."""
        self.problem, self.here = found.problem, found

    def hold(self, arcs: tuple[Arc, ...]) -> None:
        """Stand on a mesh whose elements end where these parts do, and hold them there."""
        old, free = self.here.bare(), self.question
        self.problem = held = self.held.holding(arcs)
        T = free.duration
        parts = [np.zeros(1)]
        for a, b in pairwise(np.union1d(held.fixed, held.joints) - free.start.t):
            count = max(int(np.ceil(HELD_ELEMENTS * (b - a) / T)), 1)
            parts.append(np.linspace(a, b, count + 1)[1:])
        mesh = Mesh.over(free.start.t, free.end.t, np.concatenate(parts), HELD_DEGREE)
        # What Ipopt's barrier leaves of a coordinate that is zero is no size of it.
        values = np.where(np.abs(old.Q) < BARRIER * free.lengths, 0.0, old.Q).T
        path = Path(old.mesh, values)
        self.transcribe(mesh, path, self._passed(old, path.on(mesh)), like=path)

    def as_given(self) -> bool:
        """Follow the path with the obstacle's own rows, which are zero where those sought are."""
        held, old = self.held, self.here
        if not held.sought:
            return True
        self.problem, self.units = Held(self.question, held.arcs), None
        self.transcribe(old.mesh, old.path, self._passed(old, old.path), like=old.path)
        return self.follow()

    def _passed(self, old: DiscretePath, path: Path) -> Array | None:
        """Return multipliers (K, m + r) that press as those of another form of the rows do."""
        lam, before, now = old.rows_on(path.mesh), old.tr.problem.system, self.held.system
        if lam is None or before is now:
            return lam
        state, parameters = (path.values, path.mesh.nodes), self.held.parameters
        G, normals = (x.constraint_jacobian(*state, parameters=parameters) for x in (before, now))
        slopes = np.linalg.norm(normals, axis=1)
        return lam * (np.linalg.norm(G, axis=1) / np.where(slopes > 0, slopes, 1.0)).T

    def follow(self, reach: float = np.inf) -> bool:
        """Polish the path, and the times at which contact begins and ends."""
        return super().follow(reach) and self._join() and self._at_rest()

    def _at_rest(self) -> bool:
        """Make zero of what is zero but for round-off, all of it: a path at rest on an obstacle."""
        here, lengths = self.here, self.question.lengths
        if here.Q.any() and (np.abs(here.Q) <= EPS * lengths).all():
            z = here.z.copy()
            z[: here.x.size] = here.tr.pack(np.zeros(here.Q.shape))[: here.x.size]
            scales = self.question.scales
            self.here = replace(here.moved(z), sizes=scales, lengths=lengths).estimated(
                here.gain, 0.0
            )
        return True

    def _change(self, first: Iterate, old: Iterate) -> float:
        """Return by how much the path changed: its nodes have moved with the mesh."""
        return float(np.max(np.abs(self.here.Q - old.path.on(self.here.mesh).values.T) / old.sizes))

    def _recover(self, least: bool) -> bool:
        return False

    def _join(self) -> bool:
        """Move the times of contact to where the path is tangential; False if that fails."""
        last, duration = np.inf, self.question.duration
        for _ in range(JOINS):
            times = self.held.joints
            if not times.size:
                return True
            with self.record.clock("solve"):
                step = self._step(times)
            size = float(np.abs(step).max()) / duration
            if not np.isfinite(size):
                return False
            if last < STALLED_TIME and size > last / 2:
                return True
            self._shift(times, self._within(times, step))
            if not super().follow():
                return False
            if size < SETTLED_TIME:
                return True
            last = size
        return False

    def _step(self, times: Array) -> Array:
        """Return Newton's step for the times of contact (J,); not finite if there is none."""
        here = self.here
        slip, residual = slips(here), here.tr.residual(here.z)
        speed = float(here.tr.row_units.max()) / self.question.duration
        if (
            np.abs(slip).max() <= TANGENTIAL * speed
        ):  # whatever the times are, where nothing presses
            return np.zeros(times.size)
        knots, duration = np.union1d(self.held.fixed, times), self.question.duration
        part = float(np.diff(knots).min())
        delta = min(max(DIFFERENCE * part, LEAST_DIFFERENCE * duration), MOST_DIFFERENCE * part)
        slopes = np.empty((slip.size, times.size))
        try:
            factors = Factors(here.tr.layout, here.tr.kkt(here.z), many=True)
            for j in range(times.size):
                tr = stretched(here.tr, times, np.where(np.arange(times.size) == j, delta, 0.0))
                there = DiscretePath(tr, here.z - factors.solve(tr.residual(here.z) - residual))
                slopes[:, j] = (slips(there) - slip) / delta
            return -np.linalg.lstsq(slopes, slip, rcond=None)[0]
        except np.linalg.LinAlgError:
            return np.full(times.size, np.nan)

    def _within(self, times: Array, step: Array) -> Array:
        """Return the step, shortened where a part shrinks too much; raise where one vanishes."""
        knots = np.union1d(self.held.fixed, times)
        moves = np.zeros(knots.size)
        moves[np.searchsorted(knots, times)] = step
        lengths, changes = np.diff(knots), np.diff(moves)
        shortest = float(np.clip(self.tol, *VANISHING)) * self.question.duration
        gone = (lengths < shortest) & (changes < 0)
        if gone.any():
            k = int(np.flatnonzero(gone)[0])
            raise Changed(without(self.held, knots[k], knots[k + 1]))
        limit = (SHRINK - 1) * lengths
        return step * min(1.0, float(np.min(limit / np.minimum(changes, limit))))

    def _shift(self, times: Array, step: Array) -> None:
        """Move the times of contact, and the mesh and the path with them."""
        here = self.here
        here.tr.forget()
        self.units = tr = stretched(here.tr, times, step)
        self.problem = tr.problem
        self._attach(tr)
        self.here = replace(here.moved(here.z), tr=tr)

    def why(self) -> str:
        """Return why a path may not be found by Newton's method."""
        system = self.held.system
        if not is_smooth(system.operations(self.question.system.outside)):
            return KINKED
        t = self.here.mesh.nodes
        on = self.held.active(t)
        if is_of_higher_order(self.here):
            return ORDER
        G = system.constraint_jacobian(self.here.Q.T, t, parameters=self.held.parameters)
        G = G * self.here.tr.lengths[:, None] / self.here.tr.row_units[:, None, None]
        for rows in (G[on[:, k], :, k] for k in np.flatnonzero(on.any(axis=0))):
            size = np.linalg.norm(rows, axis=1)
            if size.min() < FLAT:
                return NO_SLOPE
            if len(rows) > system.n or np.linalg.svd(rows.T / size, compute_uv=False)[-1] < RANK:
                return DEPENDENT
        return FAMILY

    # -- the conditions between the nodes --------------------------------------------------------

    def changed(self, allowed: float) -> tuple[Arc, ...] | None:
        """Return other parts to hold, if the path violates a condition somewhere; else None.

        A part that would have to be pulled is freed, one inside of the obstacle is held, if it is
        so by more than is `allowed`, in the path's own size; `inside` tells by how much.
        """
        here, held, m = self.here, self.held, self.question.system.m
        assert held.arcs is not None
        t = looked_at(here)
        q, f, on = here.path(t), rows_along(here, t), held.active(t)[m:]
        G = held.system.constraint_jacobian(q, t, parameters=held.parameters)[m:]
        push = np.zeros(f.shape)
        if on.any():
            push = held.contact_force(q, here.path.velocity(t), t, parameters=held.parameters)
        known = max(here.error if np.isfinite(here.error) else 0.0, here.resolution.worst)
        depth = np.where(on, 0.0, -f) / np.einsum("rnk,n->rk", np.abs(G), here.sizes)
        self.inside = float(depth.max(initial=0.0))
        inside = depth > max(INSIDE * known, allowed)
        unit = here.tr.action_unit / (here.problem.duration * here.tr.row_units[m:, None])
        pulled = on & (push < -PULLING * np.maximum(np.abs(push).max(initial=0.0), unit))
        found = [
            arc
            for arc in held.arcs
            if (arc.point and not self._pulls(arc))
            or not (arc.point or (inside | pulled)[arc.row].any())
        ]
        if len(found) == len(held.arcs) and not inside.any():
            return self._idle(t, push, PULLING * unit)
        middle = (t[:-1] + t[1:]) / 2
        for i in np.flatnonzero((inside | pulled).any(axis=1)).tolist():
            for k, l in runs((on[i] & ~pulled[i]) | inside[i]):
                begin = t[k] if on[i, k] or k == 0 else middle[k - 1]
                end = t[l] if on[i, l] or l == t.size - 1 else middle[l]
                if begin < end:
                    found.append(Arc(i, float(begin), float(end)))
        return tuple(found)

    def _idle(self, t: Array, push: Array, least: Array) -> tuple[Arc, ...] | None:
        """Return the parts without those that touch and hardly press, once; None if all press."""
        arcs = self.held.arcs or ()
        pressing = tuple(
            arc
            for arc in arcs
            if arc.point or np.any((push > least)[arc.row, (arc.begin <= t) & (t <= arc.end)])
        )
        if self.freed or len(pressing) == len(arcs):
            return None
        self.freed = True
        return pressing

    def _pulls(self, arc: Arc) -> bool:
        """Whether the impulse of a moment points inwards."""
        node = self.here.mesh.offsets[np.argmin(np.abs(self.here.mesh.boundaries - arc.begin))]
        return bool(self.here.rows[node, self.question.system.m + arc.row] > 0)


def along(ws: Along, tol: float, curve_of: Callable[[Mesh], Path] | None) -> tuple[Along, Status]:
    """Find the path along the obstacle that is least near a guess or, without one, near lines.

    Return the search that has it, and the verdict.

    That is the straight one and, against symmetries that would hold the path there, curved ones to
    either side, and then the other side of each part that touches; of what Ipopt finds from them,
    the least action first. Where that is lost another is kept, and contact sought more finely.
    """
    kept: tuple[Along, Status] | None = None
    last = ws, Status.NOT_FOUND
    try:
        for found, status, least in _sought(ws, tol, curve_of):
            last = found, status
            if status is Status.NOT_FOUND or status is Status.UNRESOLVED:
                continue
            if kept is None or found.here.action < kept[0].here.action:
                kept = last
            if least:
                break
    except OutOfTime:
        if kept is None:
            raise
    return kept or last


def _sought(
    ws: Along, tol: float, curve_of: Callable[[Mesh], Path] | None
) -> Iterator[tuple[Along, Status, bool]]:
    """Yield what is found on finer and finer meshes: see `_least`."""
    problem = ws.question
    since = np.linspace(0.0, problem.duration, SOUGHT + 1)
    for k in range(TRIES):
        mesh = Mesh.over(problem.start.t, problem.end.t, since, SOUGHT_DEGREE)
        guesses = lines(problem, mesh) if curve_of is None else [curve_of(mesh)]
        # The straight line may be a trap, in which Ipopt goes about for long.
        principle = "patient least" if k or len(guesses) == 1 else "least"
        first: list[Iterate] = []
        for guess in guesses:
            ws.restart()
            if touch(ws, mesh, guess, principle):
                first.append(ws.here)
            elif ws.unbounded and guess is None:
                yield ws, Status.UNBOUNDED, True
        windows: list[Array] = []
        if first:
            if curve_of is None:
                first = _both_sides(ws, mesh, first)
            first.sort(key=lambda found: found.action)
            windows = unseen(first[0])
            if not windows:
                windows = narrow(first[0])
                yield _least(ws, tol, first)
            ws.stand(first[0])
        since = np.unique(np.concatenate([since, *(windows or [(since[:-1] + since[1:]) / 2])]))
        if since.size > MOST or ws.hint in HOPELESS:
            return


def _both_sides(ws: Along, mesh: Mesh, first: list[Iterate]) -> list[Iterate]:
    """Return first paths, and those on the other side of each part of the least that touches."""
    compared: list[Iterate] = []
    while _another(least := min(first, key=lambda found: found.action), compared):
        compared.append(least)
        for guess in other_sides(least):
            ws.restart()
            if touch(ws, mesh, guess, "least"):
                first.append(ws.here)
    return first


def _least(ws: Along, tol: float, first: list[Iterate]) -> tuple[Along, Status, bool]:
    """Refine first paths, in order of their action.

    Return the search that has the least, the verdict, and whether none of less action was lost.

    What nodes alone hold outside costs less than what all of it does, about: one whose action there
    is above that of a path that was refined is not the least.
    """
    best: Along | None = None
    status = Status.NOT_FOUND
    tried: list[Iterate] = []
    least = True
    for found in first:
        if best and not (found.action < best.here.action and _another(found, tried)):
            continue
        tried.append(found)
        ws.restart()
        ws.stand(found)
        try:
            last = _refined(ws, tol)
        except OutOfTime:
            if best is None:
                raise
            break
        if last.success or last in (Status.FLOOR, Status.DEGENERATE):
            if best is None or ws.here.action < best.here.action:
                best, status = copy(ws), last
        elif best is None:
            status, least = last, False
    return best or ws, status, least


def _another(found: Iterate, tried: list[Iterate]) -> bool:
    """Whether a path is none of these, on one mesh."""
    apart = [np.abs(found.Q - other.Q) / found.tr.lengths for other in tried]
    return all(difference.max() > FLAT for difference in apart)


def _refined(ws: Along, tol: float) -> Status:
    """Hold what is in contact and refine the path, until all conditions are satisfied.

    Round a small peg a path may turn at one node: contact is far shorter than nodes tell. Then it
    is made so, about the middle, as it grows to its size more easily than it shrinks.
    """
    first, arcs, allowed, ws.freed = ws.here, touched(ws.here), tol / 4, False
    shorter, coarse = 0, 2 * float(np.diff(first.mesh.nodes).max())
    for k in range(CHANGES):
        if k == CHANGES - 1:  # what comes and goes is shorter than times can be told apart
            allowed = max(tol, VANISHING[1])
        ws.hold(arcs)
        try:
            if not ws.follow():
                ws.hint = ws.why()
                if shorter == SHORTER or not any(arc.end - arc.begin < coarse for arc in arcs):
                    if shorter == SHORTER and ws.hint == FAMILY:
                        ws.hint = SMALL
                    return Status.NOT_FOUND
                shorter += 1
                ws.stand(first)
                arcs = tuple(_shortened(arc, coarse) for arc in arcs)
                continue
            ws.hint = ""
            other = ws.changed(allowed)
            if other is None:
                if not ws.as_given():
                    ws.hint = ws.why()
                    return Status.NOT_FOUND
                status = refine(ws, tol, least=True)
                other = ws.changed(allowed) if status.success else None
                if other is None:
                    return _judged(ws, tol, status)
            arcs = other
        except Changed as change:
            arcs = change.arcs
        except np.linalg.LinAlgError:
            ws.hint = DEPENDENT
            return Status.NOT_FOUND
    if ws.inside > allowed:
        ws.hint = SMALL
        return Status.NOT_FOUND
    return Status.UNRESOLVED


def _shortened(arc: Arc, coarse: float) -> Arc:
    """Return the same or, if it is not longer than `coarse`, a shorter one about its middle."""
    middle, half = (arc.begin + arc.end) / 2, SHORTENED * (arc.end - arc.begin) / 2
    long = arc.end - arc.begin >= coarse
    return arc if arc.point or long else Arc(arc.row, middle - half, middle + half)


def _judged(ws: Along, tol: float, status: Status) -> Status:
    """Return the verdict on a path that may be inside of the obstacle by a part of the tolerance.

    Where it is held at last it moves by as much.
    """
    depth = 2 * ws.inside
    if status.success and ws.here.error + depth > tol:
        status = refine(ws, max(tol - depth, tol / 2), least=True)
    error = ws.here.error + depth
    ws.here = replace(ws.here, error=error)
    return Status.FLOOR if status.success and error > tol else status
