"""Paths of least action along an obstacle, f(q, t) >= 0: the path, and the times of contact.

Where a path touches the obstacle (`first_contacts`) f = 0 is a constraint like any other, elements
end where contact begins and ends, and the path is followed from mesh to mesh as other paths are.
The times of contact are unknowns of the same Newton's method: a path of least action meets the
obstacle tangentially,

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

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.borders.borders import moves_of, times_of
from actionopt.discrete.borders.contact_times import (
    TangencyMatrix,
    merge_contacts,
    with_contact_times,
)
from actionopt.discrete.meshes.boundaries import with_boundaries
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.newton.newton import CHORDS, CONTRACTION
from actionopt.mechanics.laws.switches import is_smooth
from actionopt.mechanics.question.held import Held, contacts_of
from actionopt.mechanics.question.obstacle import Arc
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.contact.first_contacts import (
    cut_part,
    is_of_higher_order,
    normal_turns,
    runs,
    sample_rows,
)
from actionopt.solver.ends.window import set_phase
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE, COARSE_ELEMENTS, elements_of
from actionopt.solver.refinement.ipopt import IPOPT_TOLERANCE
from actionopt.solver.refinement.iterate import Iterate, UnfixedPath
from actionopt.solver.refinement.signals import HALVINGS
from actionopt.solver.refinement.workspace import PATIENT, Workspace
from actionopt.tools.immutable import change
from actionopt.tools.types import EPS, RANK, Array

# Ad hoc, all of them, where nothing else is said.
FLAT = 1e-3  # in units of the rows' typical gradients: a row has none
FLATTEST = 1e-6  # of its gradient on the straight line: a row that still has a unit of its own
RUNAWAY_STEP = 10.0  # in units of the motion: a longer step leads nowhere
SHRINK = 0.2  # of its length, what one step leaves of a part at least
# A part between times of contact is none if it is shorter, in the duration, than the tolerance,
# kept in this range. Where such parts come and go a path may be inside of the obstacle by the end
# of the range, in its size.
VANISHING = 1e-10, 1e-5
# Steps of path and times of contact that need not be taken, in their sizes and the duration: a
# thousandth of the tolerance, kept in this range. The path depends on the times to second order.
# Newton's own step below the tolerance, and below a share of all parts (ad hoc), is the last: in
# 150 questions the next was a tenth of it at most.
SETTLED_SHARE, SETTLED_STEPS, SHORT_STEP = 1e-3, (1e-13, 1e-9), 1e-4
# A finer tolerance, and the degree with which the first elements, which are short, may meet it.
# Measured round balls: less leaves out 3e-9, and another mesh takes a third of the time. Beams with
# accelerations lost their contacts with it.
FINE_TOL, FINE_DEGREE = 1e-8, 8
# Ratio of Newton's own steps, twice, from where on their sum tells what comes: times of contact on
# flat sides, where the slip grows as a high power k of the time, step by 1 - 1 / k of the last; ad
# hoc.
FLAT_RATE = 0.8
RATE_DOUBT = 10.0  # times the ratio of two steps, that of the next: measured up to 8
# Steps of the times of contact are round-off if two, shorter than this part of the duration, do not
# contract. One may correct what the last step left of the path: taken for round-off it lost 14 of
# 72 walls of 1:100.
STALLED_TIME = 1e-6
# Part of what weighs a row where contact begins or ends, below which the whole multiplier stands
# there at first. Strings round walls of 1:100 and thinner are lost without it; ad hoc.
SHORT_CONTACT = 0.05
INSIDE = 10.0  # times the error of the path: what f may be below zero
PULLING = 1e-6  # of the largest contact force: what it may be below zero
KINKED = (
    "expected an obstacle that is smooth in the coordinates, found a kink or a corner (fmax, "
    "fabs), where its force has no direction: round it, such as by (x**4 + y**4)**(1/4) for the "
    "larger of abs(x) and abs(y), or (f + g + sqrt((f - g)**2 + w**2))/2 for that of f and g, w a "
    "tenth of its size; a path that touches corners alone is one through them, without the "
    "obstacle: ao.Problem(..., through=[ao.Event(None, corner), ...])"
)
NO_SLOPE = "the obstacle has no slope where it is met: give a function that has, such as a distance"
ORDER = (
    "expected an obstacle whose gradient is not zero on its surface, found a power of the distance "
    "from it: give a function that grows as the distance, such as f for f**3"
)
DEPENDENT = "rows in contact have gradients that depend on each other: give each surface once"
FAMILY = (
    "where events and obstacle have a symmetry, such as a sphere between them, the least path may "
    "be one of a family: move an event a little"
)


class ContactChange(Exception):
    """Other parts of the path are in contact than was thought."""

    def __init__(self, arcs: tuple[Arc, ...]) -> None:
        super().__init__()
        self.arcs = arcs


@dataclass(eq=False)
class Along(Workspace[Iterate]):
    """The workspace of a search for a path along an obstacle: its problem is `Held`."""

    freed: bool = False  # whether parts that do not press were freed already
    flat: bool = False  # whether a row has hardly a slope where it is held
    # radians or e-foldings over the whole duration, of what is not in contact: infinite where that
    # is not known
    phases: float = np.inf
    # Whether the obstacle is one convex body that stays where it is, with paths that are straight
    # lines elsewhere: where these meet it tangentially they are outside, and it presses.
    convex: bool = False
    _looked_at: tuple[Iterate, tuple[Array, ...]] | None = None

    @property
    def contact_problem(self) -> Held:
        """The question with the parts in contact that are thought so."""
        return contacts_of(self.problem)

    @property
    def question(self) -> Problem:
        """The question; at the duration at hand, where that is to be found."""
        return contacts_of(self.problem).free

    def _stand_at(self, there: Iterate) -> None:
        self.iterate, self.problem = there, there.problem  # its duration may be another

    def answer(self) -> tuple[Problem, DiscretePath]:
        """Return the question with the times and ends that were found, and the path."""
        question, here = self.question, self.here
        if not isinstance(here, UnfixedPath):
            return super().answer()
        if question.on_surface or question.has_open_events:
            times, kappa = times_of(here.problem), question.kappa
            places = here.Q[here.tr.joints]
            question = question.original.found_at(times, places, kappa if kappa.size else None)
        held = Held(question, self.contact_problem.arcs)
        return question, DiscretePath.of(held, here.path, here.rows)

    # -- the path and its times of contact -------------------------------------------------------

    def _at(self, mesh: Mesh, path: Path | None, lam: Array | None, like: Path | None) -> Iterate:
        """Return the iterate on a mesh, each row in units of the least slope it has in contact.

        At the edge of a thin obstacle slopes are less, by orders, than on the straight line.
        """
        here, held = super()._at(mesh, path, lam, like), self.contact_problem
        old, layout = here.tr, here.tr.layout
        if held.arcs and layout.rows and held.system.order == 1:
            jacobian = held.system.pointwise("constraint_jacobian")
            G = np.abs(jacobian.full(0, old.normals(here.x)) * old.lengths)
            slopes, units = G.max(axis=2).ravel(), np.zeros(held.system.m) + np.inf
            slopes[~(slopes < np.inf)] = np.inf
            np.minimum.at(units, layout.row_constraint, slopes[layout.row_select])
            units = np.where(np.isfinite(units), units, old.row_units)
            least = FLATTEST * old.row_units
            self.flat = bool((units < least).any())
            tr = self.units = old.with_row_units(np.maximum(units, least))
            self._attach(tr)
            z = here.z.copy()
            z[here.x.size :] *= old.mu_unit / tr.mu_unit
            here = change(here, tr=tr, z=z)
        if held.has_free_boundary:
            bordered, y = Bordered.beside(held.original, here, moves_of(held.original))
            known = here.sizes, here.lengths, here.gain
            here = UnfixedPath(here.tr, y, *known, bordered=bordered)
        return here

    def with_boundaries(self, mesh: Mesh) -> Mesh:
        """Return the mesh with boundaries where laws switch, and where contact begins and ends."""
        mesh, times = super().with_boundaries(mesh), self.contact_problem.contact_times.tolist()
        if set(times) <= set(mesh.boundaries.tolist()):
            return mesh
        return with_boundaries(mesh, tuple([(t, t) for t in times]))

    def take_up(self, found: Iterate) -> None:
        """Take up a path that Ipopt found, with the contacts it had there."""
        self.problem, self.here = found.problem, found

    def first_degree(self, touches: bool) -> int:
        """Return the degree of first elements of a path that touches the obstacle, or does not."""
        fine = touches and self.tol < FINE_TOL and self.question.system.order == 1
        return FINE_DEGREE if fine else COARSE_DEGREE

    def free_elements(self, touches: bool) -> float:
        """Return on how many elements, over the whole duration, what is not in contact begins."""
        return min(COARSE_ELEMENTS, elements_of(self.first_degree(touches), self.phases, self.tol))

    def hold(
        self, arcs: tuple[Arc, ...], curve: Path | None = None, *, resolved: bool = False
    ) -> None:
        """Stand on a mesh whose elements end where these parts do, and hold them there.

        The path is the one at hand or a `curve`, along which multipliers are those of a motion. Its
        own mesh stays where it is `resolved`.
        """
        free = self.question
        self.problem = held = self.contact_problem.holding(arcs)
        old, path = None, curve
        if path is None:
            old = self.here.bare()
            # What Ipopt's barrier leaves of a coordinate that is zero is no size of it.
            values = np.where(np.abs(old.Q) < IPOPT_TOLERANCE * free.lengths, 0.0, old.Q).T
            path = Path(old.mesh, values)
        apart = set_phase(free, path, arcs)
        if apart is not free:  # not at a time at which contact may begin
            self.problem = held = Held(apart, arcs, sought=held.sought)
        if resolved:
            mesh = self.with_boundaries(path.mesh)
        else:
            since, count = [np.zeros(1)], self.free_elements(bool(arcs))
            for a, b in pairwise(held.divisions - free.start.t):
                turns = normal_turns(held, path, a, b)
                since.append(cut_part(a, b, free.duration, count, *turns))
            mesh = Mesh.over(
                free.start.t, free.end.t, np.concatenate(since), self.first_degree(bool(arcs))
            )
        there = path if mesh is path.mesh else path.on(mesh)
        lam = self._convert_multipliers(old, there) if old else self._contact_multipliers(there)
        self.transcribe(mesh, there, lam, like=path)

    def as_given(self) -> bool:
        """Follow the path with the obstacle's own rows, which are zero where those sought are.

        False if it is lost: then it stays where it was.
        """
        held, old = self.contact_problem, self.here
        if not held.sought:
            return True
        self.problem, self.units = Held(self.question, held.arcs), None
        self.transcribe(old.mesh, old.path, self._convert_multipliers(old, old.path), like=old.path)
        there = replace(self.here, noise=old.noise, error=old.error)
        if self.follow():
            return True
        self.here = there
        return False

    def _convert_multipliers(self, old: DiscretePath, path: Path) -> Array | None:
        """Return multipliers (K, m + r) that press as those of another form of the rows do."""
        lam, before, now = (
            old.rows_on(path.mesh),
            old.tr.problem.system,
            self.contact_problem.system,
        )
        if lam is None or before is now:
            return lam
        state, parameters = (path.values, path.mesh.nodes), self.contact_problem.parameters
        G = before.constraint_jacobian(*state, parameters=old.tr.problem.parameters)
        normals = now.constraint_jacobian(*state, parameters=parameters)
        slopes = np.linalg.norm(normals, axis=1)
        return lam * (np.linalg.norm(G, axis=1) / np.where(slopes > 0, slopes, 1.0)).T

    def _contact_multipliers(self, path: Path) -> Array:
        """Return the multipliers (K, m + r) of a motion along a path, held where contact is."""
        t, held = path.mesh.nodes, self.contact_problem
        lam = np.zeros((held.system.m, t.size))
        with suppress(np.linalg.LinAlgError):
            lam = held.row_multipliers(path.values.T, path.node_velocities().T, t)
        if held.system.order == 1 and not held.sought:
            # Where contact begins or ends the row weighs what is beside it, too, and does not push.
            b, degrees = path.mesh.boundaries, np.array(path.mesh.degrees)
            on = held.active((b[:-1] + b[1:]) / 2)
            weight = path.mesh.lengths / (degrees * (degrees + 1))
            share = (on[:, :-1] * weight[:-1] + on[:, 1:] * weight[1:]) / (weight[:-1] + weight[1:])
            lam[:, path.mesh.offsets[1:-1]] *= np.where(share < SHORT_CONTACT, 1.0, share)
        return np.where(np.isfinite(lam), lam, 0.0).T

    def follow(self, reach: float = np.inf, *, joined: bool = False) -> bool:
        """Polish the path, and the times at which contact begins and ends.

        Where `ease` has just `joined` both, the path alone.
        """
        return (joined or self._join()) and super().follow(reach, kept=True) and self._at_rest()

    def _at_rest(self) -> bool:
        """Set a path that is zero but for round-off, at rest on an obstacle, to zero."""
        here, lengths = self.here, self.question.lengths
        if here.Q.any() and (np.abs(here.Q) <= EPS * lengths).all():
            z = here.z.copy()
            z[: here.x.size] = here.tr.pack(np.zeros(here.Q.shape))[: here.x.size]
            scales = self.question.scales
            self.here = replace(here.moved(z), sizes=scales, lengths=lengths).with_error(
                here.gain, 0.0
            )
        return True

    def _change(self, first: Iterate, old: Iterate) -> float:
        """Return by how much the path changed: its nodes have moved with the mesh."""
        here, longer = self.here, 0.0
        mesh = old.mesh.moved(*here.mesh.boundaries[[0, -1]])
        if isinstance(here, UnfixedPath):
            was, now = times_of(old.problem), times_of(here.problem)
            longer = here.bordered.reach * float(np.abs(np.diff(now) / np.diff(was) - 1).max())
            if was.size > 2:  # its legs are stretched between their events
                since = np.interp(old.mesh.since, was - was[0], now - now[0])
                mesh = mesh.cut(since, mesh.degrees)
        path = Path(mesh, old.Q.T).on(here.mesh)
        return float(np.max(np.abs(here.Q - path.values.T) / old.sizes)) + longer

    def _recover(self, least: bool) -> bool:
        return False

    def ease(self) -> bool:
        """Take away, part by part, the force under which the path at hand would be one."""
        force: Array | float = 0.0
        done, part = 0.0, 1.0
        while done < 1.0:
            problem, here, units = self.problem, self.here, self.units
            if part == 0.5 and done == 0.0:
                force = here.equations.residual(here.z)
            with suppress(ContactChange):
                if self._join((1.0 - done - part) * force):
                    done += part
                    part = min(2 * part, 1.0 - done)
                    continue
            self.problem, self.here, self.units = problem, here, units
            part /= 2
            if part < 2.0**-HALVINGS:
                return False
        return True

    def _join(self, force: Array | float = 0.0) -> bool:
        """Move path and times of contact to where it is tangential; False if that fails."""
        settled = min(max(SETTLED_SHARE * self.tol, SETTLED_STEPS[0]), SETTLED_STEPS[1])
        matrix, last, stalled, contraction, since = None, np.inf, False, 1.0, 0.0
        rate, part = 0.0, 1.0
        for _ in range(PATIENT):
            if not self.contact_problem.contact_times.size:
                return True
            here, simplified = self.here, matrix is not None
            with self.record.clock("solve"), np.errstate(all="ignore"):
                try:
                    if matrix is None:
                        matrix, since = TangencyMatrix(here.equations, here.z, force), 0.0
                    step, move = matrix.step(here.equations, here.z, force)
                except np.linalg.LinAlgError:
                    return False
            size = float(np.abs(step).max()) / self.question.duration
            size = max(size, here.equations.relative_step(move))
            if simplified and not size < CONTRACTION * last:
                matrix = None  # Newton's own step may do
                continue
            if not size < RUNAWAY_STEP:
                return False
            before, stalled = stalled, last < STALLED_TIME and size > last / 2
            if not (size < settled or (before and stalled)):
                whole = part == 1.0 and not simplified
                rate, before_it = size / last if whole else 0.0, rate
                left = 1 / (1 - rate) if min(rate, before_it) > FLAT_RATE and rate < 1.0 else 0.0
                part, slight = self._within(step, left)
                self._shift(part * step)
                self.here = self.here.moved(here.z + part * move)
                since += size
                contraction = min(size / last, 1.0) if last < np.inf else contraction
                # Simplified steps are taken where few are left: they go astray where steps contract
                # slowly. Of the first, which tells no ratio, Newton's next is about the square.
                ratio = contraction if last < np.inf else size
                last_own = slight and size < self.tol and not simplified
                if not (RATE_DOUBT * size * contraction < settled or last_own):
                    if part < 1.0 or size * ratio**CHORDS > settled:
                        matrix = None
                    last = size
                    continue
            self.here = self.here.with_values(factors=matrix.factors, since=since)
            return True
        return False

    def _within(self, step: Array, left: float) -> tuple[float, bool]:
        """Return the share of a step that shortens no part too much; raise where one vanishes.

        So does one that steps as this one, `left` of them, all but close. And whether the step is
        slight beside all parts.
        """
        held = self.contact_problem
        knots, moves = held.divisions, np.zeros(held.divisions.size)
        moves[knots.searchsorted(held.contact_times)] = step
        lengths, changes = knots[1:] - knots[:-1], moves[1:] - moves[:-1]
        shortest = min(max(self.tol, VANISHING[0]), VANISHING[1]) * held.duration
        gone = (lengths < shortest) | (lengths + left * changes < SHRINK * lengths)
        gone &= changes < 0
        if gone.any():
            k = int(gone.argmax())
            moments = self.question.system.order > 1
            raise ContactChange(merge_contacts(held, knots[k], knots[k + 1], moments=moments))
        limit = (SHRINK - 1) * lengths
        slight = bool(np.abs(step).max() < SHORT_STEP * lengths.min())
        return min(1.0, float((limit / np.minimum(changes, limit)).min())), slight

    def _shift(self, step: Array) -> None:
        """Move the times of contact, and the mesh and the path with them."""
        here = self.here
        here.tr.forget()
        self.units = tr = with_contact_times(here.tr, step)
        self._attach(tr)
        here = change(here.moved(here.z), tr=tr)
        if isinstance(here, UnfixedPath):
            here = change(here, bordered=here.bordered.around_another(tr))
        self.here = here

    def why(self) -> str:
        """Return why a path may not be found by Newton's method."""
        if not is_smooth(self.contact_problem.system.operations(self.question.system.outside)):
            return KINKED
        if is_of_higher_order(self.here):
            return ORDER
        told, t = Held(self.question, self.contact_problem.arcs, sought=True), self.here.mesh.nodes
        on, n = told.active(t), told.system.n
        G = told.system.constraint_jacobian(self.here.Q.T, t, parameters=told.parameters)
        G = G * told.measures[:, None]
        for rows in (G[on[:, k], :, k] for k in np.flatnonzero(on.any(axis=0))):
            size = np.linalg.norm(rows, axis=1)
            if size.min() < FLAT:
                return NO_SLOPE
            if len(rows) > n or np.linalg.svd(rows.T / size, compute_uv=False)[-1] < RANK:
                return DEPENDENT
        return FAMILY

    # -- the conditions between the nodes --------------------------------------------------------

    def next_contacts(self, allowed: float) -> tuple[Arc, ...] | None:
        """Return other parts to hold, if the path violates a condition somewhere; else None.

        A part that would have to be pulled is freed, one inside of the obstacle is held, if it is
        so by more than is `allowed`, in the path's own size; `inside` tells by how much.
        """
        here, held = self.here, self.contact_problem
        assert held.arcs is not None
        if self.convex and held.contact_times.size == 2 and self._presses():
            self.inside = 0.0
            return None
        t, on, depth, push, unit = self._conditions()
        known = max(here.error if np.isfinite(here.error) else 0.0, here.resolution.worst)
        self.inside = float(depth.max(initial=0.0))
        inside = depth > max(INSIDE * known, allowed)
        pulled = on & is_pulled(push, unit)
        for node in here.tr.joints:  # an event's impulse is in the multipliers at its node
            at, rows = t == here.mesh.nodes[node], here.rows[node, self.question.system.m :]
            pulled[:, at] |= on[:, at] & is_pulled(-rows[:, None], unit)
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

    def _conditions(self) -> tuple[Array, ...]:
        """Return the `contact_conditions` of the path at hand, kept for the same path."""
        here, known = self.here, self._looked_at
        if known is None or known[0].z is not here.z or known[0].tr is not here.tr:
            known = self._looked_at = here.bare(), contact_conditions(here, here.sizes)
        return known[1]

    def _idle(self, t: Array, push: Array, least: Array) -> tuple[Arc, ...] | None:
        """Return the parts without those that touch and hardly press, once; None if all press."""
        arcs = self.contact_problem.arcs or ()
        pressing = tuple(
            arc
            for arc in arcs
            if arc.point or np.any((push > least)[arc.row, (arc.begin <= t) & (t <= arc.end)])
        )
        if self.freed or len(pressing) == len(arcs):
            return None
        self.freed = True
        return pressing

    def _presses(self) -> bool:
        """Whether a row presses at a node by more than round-off."""
        here, layout = self.here, self.here.tr.layout
        push = -here.z[layout.unknowns : layout.size] * here.tr.mu_unit
        units = here.tr.row_units[layout.row_constraint]
        least = PULLING * here.tr.action_unit / self.contact_problem.duration
        return bool((push * units > least).any())

    def _pulls(self, arc: Arc) -> bool:
        """Whether the impulse of a moment points inwards."""
        node = self.here.mesh.offsets[np.argmin(np.abs(self.here.mesh.boundaries - arc.begin))]
        return bool(self.here.rows[node, self.question.system.m + arc.row] > 0)


def contact_conditions(at: DiscretePath, sizes: Array) -> tuple[Array, ...]:
    """Return times (K,), and what Karush, Kuhn and Tucker's conditions ask between the nodes.

    Which rows are in contact, (r, K); how deep the path is inside of the others, in its sizes (n,);
    what those in contact push with, and the unit of that, (r, 1).
    """
    held = contacts_of(at.problem)
    t, q, v, f = sample_rows(held, at.path)
    m = held.free.system.m
    on = held.active(t)[m:]
    push, depth = np.zeros(f.shape), np.zeros(f.shape)
    touched, inside = on.any(axis=0), ((f < 0) & ~on).any(axis=0)
    if touched.any():
        push[:, touched] = 0.0 - held.row_multipliers(q[touched], v[touched], t[touched])[m:]
    if inside.any():
        jacobian = held.system.pointwise("constraint_jacobian")
        G = jacobian.full(0, jacobian(q[inside], t[inside, None], held.packed)[0])[:, m:]
        off = np.where(on, 0.0, -f)[:, inside]
        depth[:, inside] = off / (np.abs(G) @ sizes).T
    unit = at.tr.action_unit / (held.duration * at.tr.row_units[m:, None])
    return t, on, depth, push, unit


def is_pulled(push: Array, unit: Array) -> Array:
    """Return where an obstacle would have to pull, (r, K), by more than round-off."""
    return push < -PULLING * np.maximum(np.abs(push).max(initial=0.0), unit)
