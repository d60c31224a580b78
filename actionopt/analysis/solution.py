"""The answer: a path, and everything that follows from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import field, fields, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from actionopt.analysis.status import Status
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.boundaries import split
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import TIME_SLACK, Path
from actionopt.discrete.meshes.resolution import resolution
from actionopt.discrete.newton.discrete_path import DiscretePath, Unknowns
from actionopt.mechanics.question.events import State
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.singular_ends import finite_derivatives
from actionopt.tools.cached import cached_property
from actionopt.tools.checks import numbers
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

if TYPE_CHECKING:
    from pathlib import Path as FilePath

    from actionopt.analysis.motion.compare import Comparison
    from actionopt.analysis.motion.parts import Part
    from actionopt.analysis.quadratic.index import Inertia
    from actionopt.analysis.quadratic.sensitivity import Sensitivity
    from actionopt.mechanics.question.held import Held
    from actionopt.mechanics.question.obstacle import Arc

# Of an element, from an end where L is infinite: where it is asked what grows. Ad hoc.
BESIDE_END = np.array([1e-2, 1e-4])
IN_CONTACT = ("acceleration", "multipliers", "constraint_force", "contact_force")

DRAWN_POINTS, DRAWN_COORDINATES = 201, 4  # points of a path in a notebook, and coordinates


@immutable
class Ends:
    """States and momenta at the two events, of a solution whose system is not at hand.

    Velocities at both ends of each leg, (k + 1, 2, n); its unknowns, where L contains
    accelerations.
    """

    states: tuple[State, State]
    momenta: tuple[Array, Array]
    leg_velocities: Array
    unknowns: Unknowns | None = None


@immutable
class Solution:
    """A stationary path between two events; call it with a time.

    Attributes
    ----------
    problem : Problem
        The question it answers.
    path : Path
        The curve q(t).
    action : float
        S along the path.
    lam : (m, K) array
        Multipliers of the discrete problem at the K nodes of the mesh, NaN at nodes without a
        constraint row (pinned ends); `multipliers(t)` is as accurate anywhere. Those of the rows
        of an obstacle, (r, K), stand behind, NaN where it does not touch.
    error : float
        Estimate of max over t of |q_h(t) - q(t)|, each coordinate in units of the largest |q|
        it reaches along the path; the units of `tol`.
    status : Status
        The verdict, a sentence.
    stats : dict
        What was built, how often each function was evaluated, each refinement round, and how
        the time divides.
    ends : Ends, optional
        What is not to be derived from the system, but was read from a file.
    known : DiscretePath, optional
        The path as it was found, else made when asked for (`discrete`).
    """

    problem: Problem
    path: Path
    action: float
    lam: Array
    error: float
    status: Status
    stats: dict[str, Any]
    ends: Ends | None = field(default=None, repr=False)
    known: DiscretePath | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        """Show the verdict and the numbers that matter, not the arrays."""
        return (
            f"Solution({self.problem.name}: {self.status.name}, S = {self.action:.8g}, "
            f"error {self.error:.1e}, elements {self.mesh.elements}, "
            f"unknowns {self.stats.get('unknowns', 'not counted')})"
        )

    def _repr_html_(self) -> str:
        """Show the numbers that matter and the path, as a notebook does."""
        from actionopt.tools.notebook import picture, table

        rows = [
            ("status", self.status.name),
            ("action S", f"{self.action:.10g}"),
            ("error of the path, relative", f"{self.error:.1e}"),
            ("mesh", f"{self.mesh.elements} elements, {self.mesh.nodes.size} nodes"),
        ]
        with suppress(ValueError, np.linalg.LinAlgError):  # forced, or too rough to be counted
            rows.insert(2, ("it is a", f"{self.kind}, Morse index {self.morse_index}"))
        t = np.linspace(self.mesh.boundaries[0], self.mesh.boundaries[-1], DRAWN_POINTS)
        curves = list(zip(self.problem.system.coordinates, self(t), strict=True))
        return table(self.problem.name, rows) + picture(t, curves[:DRAWN_COORDINATES])

    @cached_property
    def momenta(self) -> tuple[Array, Array]:
        """Momenta p0 = -dS/dq0 and p1 = +dS/dq1 at the events, each (n,): accurate to order 2d.

        Where L contains accelerations, Ostrogradsky's: those of q, then those of v, (order n,).
        With constraints, those of the motions that the constraints allow. NaN where they are
        infinite, at an end where L is. Hamilton and Jacobi's identities; Marsden and West (2001),
        section 1.3.
        """
        if self.ends is not None:
            return self.ends.momenta
        system, parameters = self.problem.system, self.problem.parameters
        if system.order > 1 and system.m:
            from actionopt.analysis.motion.ostrogradsky import momenta

            return _read_only(*momenta(self.between_times.discrete).values.T[[0, -1]])
        if system.order > 1 and (self._is_held_at(0) or self._is_held_at(1)):
            from actionopt.analysis.motion.ostrogradsky import momenta

            ends = self.free_parts[0], self.free_parts[-1]
            p0, p1 = (momenta(part.discrete).values.T for part in ends)
            return _read_only(p0[0].copy(), p1[-1].copy())
        if system.order > 1:
            return self._free_momenta
        if not (system.m or (system.r and (self._is_held_at(0) or self._is_held_at(1)))):
            if any(self.mesh.singular_ends):
                finite = [known[0] for known in self._finite_at_ends]
                pairs = zip(finite, self._free_momenta, strict=True)
                return _read_only(*(np.where(known, p, np.nan) for known, p in pairs))
            return self._free_momenta
        p0, p1 = (
            system.momentum(s.q, s.v, s.t, parameters=parameters) for s in (self.start, self.end)
        )
        return _read_only(p0, p1)

    @property
    def start(self) -> State:
        """State at the start event; its velocity comes from the momentum there.

        It is accurate to order 2d, where the polynomial's derivative is only of order d.
        """
        return self._states[0]

    @property
    def end(self) -> State:
        """State at the end event, as accurate as `start`."""
        return self._states[1]

    @cached_property
    def length(self) -> float:
        """The length of a geodesic (`System.geodesic`), sqrt(2 S (t1 - t0)); of all its legs.

        Where integrals are given it is the integral of the length: the rate may then change.
        Raises ValueError for any other system, and where the length is negative on the way.
        """
        problem, at = self.problem, self.discrete
        given = problem.kappa.size > 0
        if problem.through and not given:  # at given times each leg has a rate of its own
            return sum(leg.length for leg in self.parts)
        law = problem.plain or problem.system
        if law.F is None:
            raise ValueError(
                "expected a path of System.geodesic(length, coordinates), found one of a "
                "Lagrangian: it has an action, and no length"
            )
        place = at.tr.place(at.x)
        F = law.pointwise("length")(place.at, place.v, at.tr.times, problem.packed_of(law))[0]
        if not F.min() >= 0:
            raise ValueError(
                "expected a length that is not negative, found one that is along the path: the "
                "rates that F^2 keeps equal differ in sign; add what makes F positive"
            )
        if given:
            return float(np.sum(at.tr.weight * F))
        return float(np.sqrt(2 * self.action * problem.duration))

    @cached_property
    def surface_multipliers(self) -> tuple[Array, Array]:
        """The mu of S + mu.on at the start and the end, (s,) each; none where there is no surface.

        The momenta are p0 = mu on_q and p1 = -mu on_q, in the coordinates that are free there.
        """
        from actionopt.discrete.borders.surfaces import reactions

        at, surfaces = self.discrete, self.problem.surfaces
        mu = [np.zeros(0) if e is None else reactions(at, -k)[0] for k, e in enumerate(surfaces)]
        return _read_only(mu[0], mu[1])

    @property
    def success(self) -> bool:
        """Whether the path can be used as it is."""
        return self.status.success

    @cached_property
    def legs(self) -> tuple[Path, ...]:
        """The parts of the path between the events that it passes, k + 1 of them.

        Their velocities at their ends come from the momenta there, as those of `parts`.
        """
        pieces, known = self._pieces, self.problem
        whole = isinstance(known, Problem) and self._momenta_tell
        if not whole or self.contacts or known.instants:  # v jumps on the way
            return pieces
        found = []
        for piece, ends in zip(pieces, self._leg_velocities, strict=True):
            rates = piece.velocity(piece.mesh.nodes)
            rates[:, [0, -1]] = ends.T
            found.append(Path(piece.mesh, piece.values, rates))
        return tuple(found)

    @cached_property
    def _pieces(self) -> tuple[Path, ...]:
        """The polynomials of the legs."""
        return split(self.path, [e.t for e in self.problem.through])

    @property
    def _momenta_tell(self) -> bool:
        """Whether velocities at events are those of momenta, where these are finite."""
        tails = self.problem.has_tails or any(self.mesh.singular_ends)
        return self.path.velocities is None and not tails

    @cached_property
    def _leg_velocities(self) -> Array:
        """Velocities at both ends of each leg, as `parts` have them, (k + 1, 2, n)."""
        if self.ends is not None:
            return self.ends.leg_velocities
        inner = [v for one, other in pairwise(self.parts) for v in (one.end.v, other.start.v)]
        return np.array([self.start.v, *inner, self.end.v]).reshape(-1, 2, self.start.v.size)

    @cached_property
    def parts(self) -> tuple[Solution, ...]:
        """The legs as answers of their own, each between the two events as they were found."""
        if not self.problem.through:
            return (self.between_times,)
        from actionopt.analysis.motion.parts import legs

        return tuple(self._part(part) for part in legs(self.discrete, self._pieces, self.lam))

    @cached_property
    def free_parts(self) -> tuple[Solution, ...]:
        """The `parts` of a path with accelerations, cut where contact begins and ends as well.

        Along an arc of contact the obstacle is a constraint.
        """
        if not (self.problem.system.order > 1 and self.contacts):
            return self.parts
        from actionopt.analysis.motion.parts import cut_at_contacts

        return tuple(self._part(part) for part in cut_at_contacts(self.discrete, self.contacts))

    def _part(self, part: Part) -> Solution:
        """Return a part of the path as an answer of its own."""
        told = {f.name: getattr(part, f.name) for f in fields(part)}
        return replace(self, ends=None, **told)

    @cached_property
    def contact_impulses(self) -> Array:
        """The impulses of `contacts`, at the begin and the end of each: (contacts, 2).

        p(t+) - p(t-) = - impulse df/dq. A moment has one, which stands first. With accelerations in
        L both ends of an arc have one, and `contact_force` is the force between them.
        """
        from actionopt.analysis.obstacle_forces import impulses

        return impulses(self.discrete, self.contacts)

    @property
    def impulses(self) -> Array:
        """The jumps of the momentum at the events between the ends, after minus before: (k, n).

        With constraints, those of the motions that the constraints allow, as `momenta`.
        """
        return self.jumps[0]

    @property
    def energy_jumps(self) -> Array:
        """The jumps of the energy H there, after minus before: (k,)."""
        return self.jumps[1]

    @cached_property
    def jumps(self) -> tuple[Array, Array]:
        """`impulses` and `energy_jumps`: -dS/dq and dS/dt at events of given place."""
        from actionopt.discrete.borders.end_times import by_times

        system, at = self.problem.system, self.discrete
        if not self.problem.through:
            return _read_only(np.zeros((0, system.order * system.n)), np.zeros(0))
        if not (system.m or self.contacts):
            return _read_only(-at.tr.pulls(at.z)[1:-1], by_times(at)[1:-1])
        # The rows that an event of given place has not would push there, too: from both sides.
        p, H = [], []
        if system.order > 1 and self.contacts:
            from actionopt.analysis.motion.ostrogradsky import energy, momenta

            parts, times = self.free_parts, [e.t for e in self.problem.through]
            for before, after in pairwise(parts):
                if after.mesh.boundaries[0] in times:
                    p0, p1 = (momenta(x.discrete).values for x in (before, after))
                    H0, H1 = (energy(x.discrete).values for x in (before, after))
                    p.append(p1[:, 0] - p0[:, -1])
                    H.append(float(H1[0, 0] - H0[0, -1]))
            return _read_only(np.array(p), np.array(H))
        for before, after in pairwise(self.parts):
            p.append(after.momenta[0] - before.momenta[1])
            levels = [before.energy(before.end.t), after.energy(after.start.t)]
            H.append(float(levels[1] - levels[0]))
        return _read_only(np.array(p), np.array(H))

    @property
    def time_slopes(self) -> Array:
        """dS/dt by the times of all events at fixed coordinates, (k + 2,): H0, jumps of H, -H1."""
        from actionopt.discrete.borders.end_times import by_times

        if self.problem.system.order > 1 and (self.problem.system.m or self.contacts):
            # Their rows hold f in the mean over functions of an element's own time.
            H0, H1 = self.energy(self.discrete.mesh.boundaries[[0, -1]])
            return np.array([H0, *self.energy_jumps, -H1])
        times = by_times(self.discrete)
        times[1:-1] = self.energy_jumps
        return times

    @property
    def integral_multipliers(self) -> Array:
        """The multipliers kappa (c,) of S + kappa.(int g dt - value): dS/dvalue = -kappa."""
        return self.problem.kappa

    @property
    def duration(self) -> float:
        """Time between the events, given or found."""
        return self.problem.duration

    @property
    def abbreviated_action(self) -> float:
        """S + E T, which is the integral of p dq where L does not depend on the time.

        E is the energy of the problem where a time was to be found, else the mean of H.
        """
        energy = self.problem.energy
        if energy is not None:
            return self.action + energy * self.duration
        tr, x = self.discrete.tr, self.discrete.x
        place = tr.place(x)
        parameters = self.problem.packed
        first = self.problem.system.pointwise("first")
        p = first(place.at, place.v, tr.times, parameters)[1]
        return float(np.sum(tr.weight * place.v * p))

    @cached_property
    def between_times(self) -> Solution:
        """The same path as the answer to the question with what was found given: times, places."""
        problem = self.problem
        if problem.asked is None:
            return self
        given = Problem(problem.system, problem.start, problem.end, parameters=problem.parameters)
        return replace(self, problem=given, known=None)

    @property
    def mesh(self) -> Mesh:
        """The mesh of the path."""
        return self.path.mesh

    def __call__(self, t: ArrayLike) -> Array:
        """Return q(t): shape (n, K) for K times, (n,) for one time.

        Raises ValueError for a time that is not between the events; so do the methods below. Where
        an event lies at infinite time, the tail beyond the window is an exponential.
        """
        return self._beyond(t, 0) if self.problem.has_tails else self.path(t)

    def velocity(self, t: ArrayLike) -> Array:
        """Return v(t), shape (n, K) or (n,).

        At the events by the momenta there, as `start` and `end` have it; after an event that is
        passed, at its time.
        """
        if self.problem.has_tails:
            return self._beyond(t, 1)
        found = self.path.velocity(t)
        if self._momenta_tell:
            b = self.mesh.boundaries[[0, -1]]
            times = np.array([b[0], *(e.t for e in self.problem.through), b[1]])
            near = np.abs(np.ravel(t)[:, None] - times) <= TIME_SLACK * np.abs(b).max()
            at, which = np.nonzero(near)
            if at.size:
                rates = self._leg_velocities
                v = np.vstack([rates[:, 0], rates[-1:, 1]])
                found.reshape(v.shape[1], -1)[:, at] = v[which].T
        return found

    def _beyond(self, t: ArrayLike, derivatives: int) -> Array:
        """Return q or v at times of which some may be beyond a window, (n, *t.shape)."""
        times = numbers(t, "the times")
        flat, problem = times.ravel(), self.problem
        low, high = (
            t if event.side else away
            for t, event, away in zip(
                self.mesh.boundaries[[0, -1]],
                (problem.start, problem.end),
                (-np.inf, np.inf),
                strict=True,
            )
        )
        inside = np.clip(flat, low, high)
        found = self.path.velocity(inside) if derivatives else self.path(inside)
        for out, k in ((flat < low, 0), (flat > high, -1)):
            if out.any():
                known = problem.rests[k]
                assert known is not None
                edge = self.path.values[:, k] - known.q
                eta = known.beyond(edge, flat[out] - inside[out])
                found[:, out] = known.rates @ eta if derivatives else known.q[:, None] + eta
        return found.reshape(found.shape[0], *times.shape)

    def momentum(self, t: ArrayLike) -> Array:
        """Return p(t) = dL/dv, shape (n, K) or (n,).

        Where L contains accelerations, Ostrogradsky's momenta p_1 = dL/dv - dp_2/dt of q and
        p_2 = dL/da of v, (2 n, K), and so on; after an event that is passed, at its time.
        """
        if self.problem.system.order > 1:
            from actionopt.analysis.motion.ostrogradsky import momenta

            return self._along_legs(momenta, t)
        return self._pointwise("momentum", t)

    def energy(self, t: ArrayLike) -> Array:
        """Return the energy function H = v . dL/dv - L, shape (K,) or a 0-d array.

        Where L contains accelerations, H = p_1 . v + p_2 . a - L, with `momentum`.
        """
        if self.problem.system.order > 1:
            from actionopt.analysis.motion.ostrogradsky import energy

            return self._along_legs(energy, t)[0]
        return self._pointwise("energy", t)

    def derivatives(self, t: ArrayLike) -> Array:
        """Return the state from which a motion goes on, (2, n, *t.shape): q and v.

        Where L contains accelerations (4, n, *t.shape), q, v, a and j, and so on: those that its
        momenta tell, by these.
        """
        if self.problem.system.order == 1:
            return np.stack([self(t), self.velocity(t)])
        from actionopt.analysis.motion.ostrogradsky import CanonicalPath

        found = self._along_legs(lambda at: CanonicalPath(at, 0.0).derivatives, t)
        system = self.problem.system
        return found.reshape(2 * system.order, system.n, *found.shape[1:])

    def _along_legs(
        self, curve: Callable[[DiscretePath], Callable[[Array], Array]], t: ArrayLike
    ) -> Array:
        """Return a curve that is made for each leg between events, at times t, (..., *t.shape)."""
        times = numbers(t, "the times")
        flat, parts = times.ravel(), self.free_parts
        begins = np.array([part.mesh.boundaries[0] for part in parts[1:]])
        leg = np.searchsorted(begins, flat, side="right")
        used = np.unique(leg) if flat.size else np.zeros(1, dtype=int)
        each = [curve(parts[k].discrete)(flat[leg == k]) for k in used]
        found = np.empty((len(each[0]), flat.size))
        for k, values in zip(used, each, strict=True):
            found[:, leg == k] = values
        return found.reshape(len(found), *times.shape)

    def acceleration(self, t: ArrayLike) -> Array:
        """Return the accelerations of the equations of motion at q(t), v(t): (n, K) or (n,).

        Where L contains them, those of the polynomials.
        """
        if self.problem.system.order > 1:
            return self.path.acceleration(t)
        return self._pointwise("acceleration", t)

    def multipliers(self, t: ArrayLike) -> Array:
        """Return lambda(t) of L' = L + sum lambda f, shape (m, K) or (m,).

        From the index-1 form of the equations at q(t), v(t), and so as accurate as v; where L
        contains accelerations by those of the polynomials, and with fewer digits.
        """
        if self.problem.system.order > 1:
            from actionopt.analysis.motion.ostrogradsky import multipliers

            return self._along_legs(multipliers, t)
        return self._pointwise("multipliers", t)

    def constraint_force(self, t: ArrayLike) -> Array:
        """Return the generalized forces of constraint G' lambda, shape (n, K) or (n,)."""
        return self._pointwise("constraint_force", t)

    @cached_property
    def contacts(self) -> tuple[Arc, ...]:
        """The parts of the path in contact with the obstacle, in order of time.

        A moment only is an impulse, p(t+) - p(t-) = - its size df/dq; at a free end, the momentum.
        """
        if not self.problem.system.r:
            return ()
        from actionopt.mechanics.question.held import arcs_of

        rows = np.isfinite(self.lam[self.problem.system.m :])
        return arcs_of(rows, self.mesh.boundaries, self.mesh.offsets)

    @cached_property
    def _question(self) -> Held:
        """The question with the rows of the obstacle as constraints where there is contact."""
        from actionopt.mechanics.question.held import Held

        return Held(self.problem, self.contacts)

    def contact_force(self, t: ArrayLike) -> Array:
        """Return nu(t) >= 0 of S - int nu f dt, shape (r, K) or (r,): zero where nothing touches.

        The obstacle pushes with the generalized force nu df/dq, which balances -dS/dq: as on a
        string whose potential energy is S. (A body that goes this way in time would have to be
        pulled with the same force.) As accurate as `multipliers`.

        It jumps where contact begins and ends. At both times of an arc of `contacts` it is the
        limit from within the arc, and so are `acceleration`, `multipliers` and `constraint_force`;
        the impulse of a moment of contact is no part of it.

        Raises ValueError for a system without an obstacle.
        """
        if not self.problem.system.r:
            raise ValueError(
                "expected a system with an obstacle, found none; give it as System(..., "
                "obstacle=f), f(q, t) >= 0, or as a constraint, which has `multipliers`"
            )
        if self.problem.system.order > 1:
            from actionopt.analysis.obstacle_forces import density

            return density(self.discrete, self.contacts, numbers(t, "the times"))
        return self._pointwise("contact_force", t)

    @cached_property
    def inertia(self) -> Inertia:
        """Index and nullity of the second variation, counted when first asked for.

        For a path whose duration was to be found it is that of S + E T, the duration varying;
        `between_times` has the other.
        """
        from actionopt.analysis.quadratic.index import inertia, inertia_asked, inertia_through

        if self.problem.is_course and not self.problem.closes:
            return inertia_through(self.discrete, self.error)
        if self.problem.has_free_boundary:
            return inertia_asked(self.discrete, self.error)
        return inertia(self.discrete, self.error)

    @property
    def morse_index(self) -> int:
        """Number of independent variations that lower the action; 0 is a (weak) minimum."""
        return self.inertia.index

    @property
    def kind(self) -> str:
        """What the action is at the path: "minimum", "saddle" or "degenerate"."""
        return self.inertia.kind

    @cached_property
    def velocity_error(self) -> float:
        """Estimate of max over t of |v_h(t) - v(t)|, in units of each coordinate's largest |v|.

        A coordinate that hardly moves is measured by its size over the duration instead.

        The first Legendre coefficient left out, differentiated: P'_k(1) = k (k + 1) / 2.
        """
        sizes = np.max(np.abs(self.path.values), axis=1)
        speeds = np.max(np.abs(self.path.velocity(self.mesh.nodes)), axis=1)
        sizes = np.where(sizes > 0, sizes, 1.0)
        speeds = np.maximum(speeds, sizes / self.problem.duration)
        found = resolution(self.mesh, self.path.values.T, sizes)
        k = np.array(self.mesh.degrees) + 1
        rates = (found.omitted + self.error / 4) * k * (k + 1) / self.mesh.lengths
        return float(rates.max() * (sizes / speeds).max())

    @cached_property
    def multiplier_error(self) -> float:
        """Estimate of the error of `multipliers(t)`, in units of the largest |lambda|; 0 if none.

        Each of several rows counts by its force: |lambda_i| times the largest root of
        sum_j G_ij^2 / M_jj, in units that all rows share. A row that vanishes, by a symmetry say,
        is measured beside the others; where all of them do, they are measured beside the motion.

        Eight times the distance of the discrete problem's multipliers, themselves less accurate,
        from those of `multipliers` at the same nodes. Raises ValueError without constraints, or
        where these are not independent.
        """
        from actionopt.analysis.multiplier_error import multiplier_error

        velocities = self.velocity(self.mesh.nodes)
        return multiplier_error(self.discrete, self.path.values, velocities, self.lam)

    @cached_property
    def discrete(self) -> DiscretePath:
        """The path as unknowns on its mesh, with multipliers; in contact, its problem is `Held`."""
        known, problem = self.known, self.problem
        same = known is not None and known.path is self.path and known.problem.free is problem
        if known is not None and same and (self.contacts or not problem.system.r):
            return known
        held = self._question if self.contacts else problem
        if known is not None and problem.system.order > 1 and problem.system.r:
            # Derivatives, and multipliers of moments, are not read from values.
            tr, old = Transcription(held, self.mesh, known.tr.lengths, like=known.tr), known.tr
            return DiscretePath(tr, tr.unknowns_of(old.place(known.x).places))
        return DiscretePath.of(held, self.path, self.lam[: held.system.m].T)

    @property
    def neighbour(self) -> DiscretePath | None:
        """The path that was found, where `path` is what is expected near it; None elsewhere."""
        return None if self.known is None or self.known.path is self.path else self.known

    def __deepcopy__(self, memo: dict[int, Any]) -> Solution:
        """Return a copy with memory of its own; what follows from it is made when asked for."""
        copied = {f.name: deepcopy(getattr(self, f.name), memo) for f in fields(self)[:-1]}
        if self.known is not None and not self.problem.system.r:
            tr = self.known.tr.between(copied["problem"])
            copied["known"] = known = DiscretePath(tr, self.known.z)
            copied["path"] = known.path
        return Solution(**copied)

    def __reduce__(self) -> tuple:
        """Carry the numbers; what follows from them is made when asked for."""
        made = [getattr(self, f.name) for f in fields(self)[:-1]]
        known = self.known
        if known is None or (self.problem.system.r and self.problem.system.order == 1):
            return Solution, tuple(made)
        made[1] = None  # it is that of the unknowns
        return _restore, (made, self.mesh, known.unknowns)

    def compare(self) -> Comparison:
        """Return the comparison with the forward integration from `start`, made once."""
        return self._comparison

    def sensitivity(self) -> Sensitivity:
        """Return the derivatives of the action by the events and the parameters."""
        from actionopt.analysis.quadratic.sensitivity import sensitivity

        found = sensitivity(
            self.discrete, self.error, self.momenta, self.impulses, self.time_slopes
        )
        if any(self.mesh.singular_ends):
            return found.where(*(known[1] for known in self._finite_at_ends))
        return found

    def action_function(self) -> ca.Function:
        """Return the discrete action on the mesh of this path as a CasADi function.

        `f(Q, ...)` takes the coordinates Q (n, K) at `mesh.nodes`, as `path.values` has them, and a
        parameter each, by order or by name, the default of one number being that of the problem. It
        returns `S`, `gradient` (n, K), and `hessian` (n K, n K), sparse, node by node. The work of
        non-conservative forces is not in it, nor are constraints; at a path without these the
        gradient is minus and plus the momenta at the ends and vanishes at all nodes between, but
        where an event gives coordinates: there it is what p jumps by. Where integrals are given, S
        is that of L + kappa.g, whose path is stationary.

        Raises ValueError for closed paths, ends at infinity, several laws and accelerations.
        """
        from actionopt.analysis.action_function import action_function

        self.problem.system.check_order("the action as a function of nodes")
        return action_function(self.problem, self.discrete.tr)

    def opti(self) -> tuple[ca.Opti, ca.MX]:
        """Return a CasADi `Opti` that asks for the path of least action, and its variable Q (n, K).

        It holds the discrete action on the mesh of this path, what the events and the integrals
        give, constraints and obstacles at the nodes, and the path as the first guess; add to it
        what you like, choose a solver, and solve. Q are the coordinates at `mesh.nodes`.

        Raises ValueError as `action_function` does, for non-conservative forces, and for events
        whose time or place is to be found.
        """
        from actionopt.analysis.action_function import opti

        self.problem.system.check_order("the action as a function of nodes")
        return opti(self.problem, self.path, self.discrete.tr)

    def to_xarray(self, t: ArrayLike | None = None) -> Any:
        """Return the path at K times as an xarray.Dataset, its nodes if none are given.

        `q`, `v` and `p` over (coordinate, t), `energy` over t, the `multipliers` of constraints
        over (row, t), the `contact_force` of obstacles over (obstacle_row, t); parameters, action
        and verdict are attributes. Where L contains accelerations also `a` and `p_v`, the momentum
        of v, and so on.

        Raises ImportError if xarray is not installed, ValueError for times outside.
        """
        from actionopt.analysis.tables import dataset

        return dataset(self, t)

    def to_dataframe(self, t: ArrayLike | None = None) -> Any:
        """Return the path at K times as a pandas.DataFrame, its nodes if none are given.

        A row for each time, which is the index `t`; columns are called as the coordinates, `v_x`
        and `p_x` the velocity and the momentum of a coordinate x, and `energy`; where L contains
        accelerations also `a_x` and `p_v_x`, Ostrogradsky's momentum of v, and so on. The
        coordinates of one are read as a guess: `solve(problem, guess=frame)`.

        Raises ImportError if pandas is not installed, ValueError for times outside.
        """
        from actionopt.analysis.tables import frame

        return frame(self, t)

    def save(self, file: str | FilePath) -> None:
        """Write the numbers to an .npz file, whole or not at all; `actionopt.load` reads it."""
        from actionopt.analysis.saved import save

        save(
            file,
            self.problem,
            self.path,
            self._unknowns,
            {"status": self.status.name, "stats": self.stats},
            lam=self.lam,
            action=self.action,
            error=self.error,
            velocities=self._leg_velocities.reshape(-1, self.start.v.size),
            momenta=np.stack(self.momenta),
        )

    @property
    def _unknowns(self) -> Unknowns | None:
        """The unknowns that a file holds: where L contains accelerations."""
        if isinstance(self.problem, Problem):  # what was loaded from a file alone has no system
            return self.discrete.unknowns if self.problem.system.order > 1 else None
        return None if self.ends is None else self.ends.unknowns

    @cached_property
    def _comparison(self) -> Comparison:
        """The comparison of `compare`. Raises ValueError for a path in contact."""
        from actionopt.analysis.motion.compare import compare, join

        if self.problem.system.order > 1 and self.contacts:
            from actionopt.analysis.motion.ostrogradsky import compare_motion

            # What an obstacle holds in all coordinates moves as that does.
            parts = [x for x in self.free_parts if x.problem.system.r < x.problem.system.n]
            return join([compare_motion(x.discrete, x.error) for x in parts], 0.0)
        if self.problem.through:
            from actionopt.analysis.motion.parts import law_deviation

            size = np.abs(self.path.values).max(axis=1)
            missed = law_deviation(self.problem, self.parts, size)
            return join([part.compare() for part in self.parts], missed)
        if self.problem.system.r and self.contacts and self.problem.system.order == 1:
            raise ValueError(
                "expected a path that touches no obstacle, found contact from t = "
                f"{self.contacts[0].begin:.6g} on: forward integration does not know it; compare "
                "the free parts, each as a problem of its own without the obstacle"
            )
        if self.problem.system.order > 1:
            from actionopt.analysis.motion.ostrogradsky import compare_motion

            return compare_motion(self.between_times.discrete, self.error)
        return compare(self)

    @cached_property
    def _free_momenta(self) -> tuple[Array, Array]:
        return _read_only(*self.discrete.tr.momenta(self.discrete.z))

    @property
    def _finite_at_ends(self) -> list[tuple[Array, Array]]:
        """Whether momenta, and second derivatives of S, are finite at both ends, (n,) each."""
        found = []
        for k, b in enumerate((self.mesh.boundaries[:2], self.mesh.boundaries[:-3:-1])):
            t = b[0] + (b[1] - b[0]) * BESIDE_END
            known = np.full((2, self.problem.system.n), True)
            if self.mesh.singular_ends[k]:
                known[:] = finite_derivatives(self.problem, self(t).T, self.velocity(t).T, t)
            found.append((known[0], known[1]))
        return found

    @cached_property
    def _states(self) -> tuple[State, State]:
        return self.ends.states if self.ends is not None else (self._state(0), self._state(1))

    def _state(self, k: int) -> State:
        """Return the state at the start (k = 0) or the end (-1), its velocity by the momentum."""
        system, parameters = self.problem.system, self.problem.parameters
        t, q = float(self.mesh.boundaries[-k]), self.path.values[:, -k]
        v = self.path.velocity(t)
        if system.order > 1:
            places = self.discrete.tr.place(self.discrete.x).places
            return State(t, q, places[-k, q.size : 2 * q.size])
        if system.r and self._is_held_at(k):  # the momentum does not tell
            return State(t, q, v)
        # A failed attempt may have no such velocity: the polynomial's stands.
        with suppress(ValueError, np.linalg.LinAlgError):
            v = system.velocity(q, self._free_momenta[k], t, v, parameters=parameters)
        return State(t, q, v)

    def _is_held_at(self, k: int) -> bool:
        """Whether the path is in contact next to the start (k = 0) or the end (1)."""
        t = self.mesh.boundaries[-k]
        return any(not arc.point and t in (arc.begin, arc.end) for arc in self.contacts)

    def _pointwise(self, name: str, t: ArrayLike) -> Array:
        """Return what a method of the system says along the path, (..., *t.shape)."""
        times = numbers(t, "the times")
        system = self.problem.system
        if system.r and name in IN_CONTACT:
            method = getattr(self._question, name)
        else:
            method = getattr(system, name)
        parameters = self.problem.parameters
        if times.ndim <= 1:
            return method(self(times), self.velocity(times), times, parameters=parameters)
        flat = times.ravel()
        result = method(self(flat), self.velocity(flat), flat, parameters=parameters)
        return result.reshape(*result.shape[:-1], *times.shape)


def question(solution: Solution) -> Problem:
    """Return the problem of a solution. Raises ValueError for anything else."""
    if not isinstance(solution, Solution):
        hint = "; solve it first" if isinstance(solution, Problem) else ""
        if isinstance(solution, Sequence):
            hint = "; give one of them"
        raise ValueError(f"expected a Solution, as `solve` returns it, found {solution!r}{hint}")
    return solution.problem


class SolveError(RuntimeError):
    """A solve that did not succeed.

    Attributes
    ----------
    solution : Solution
        The best path so far, with its `status`.
    """

    def __init__(self, message: str, solution: Solution) -> None:
        super().__init__(message)
        self.solution = solution

    def __reduce__(self) -> tuple:
        """Carry the attempt, too."""
        return SolveError, (str(self), self.solution)


def _restore(made: list[Any], mesh: Mesh, unknowns: Unknowns) -> Solution:
    """Return a solution whose path is known as unknowns."""
    problem, lam = made[0], made[3]
    if problem.system.r:
        from actionopt.mechanics.question.held import Held, arcs_of

        arcs = arcs_of(np.isfinite(lam[problem.system.m :]), mesh.boundaries, mesh.offsets)
        problem = Held(problem, arcs)
    known = DiscretePath.restore(problem, mesh, unknowns)
    made[1] = known.path
    return Solution(*made, known=known)


def _read_only(p0: Array, p1: Array) -> tuple[Array, Array]:
    """Return the arrays, read-only: they are kept."""
    for p in (p0, p1):
        p.setflags(write=False)
    return p0, p1
