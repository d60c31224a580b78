"""A trial path under the hand: bend it, and see its action and how far it is from stationary.

A trial is held at a few knots, equal times apart. Moving one bends the path along a natural cubic
spline, which leaves it where it is at the other knots; taken hold of elsewhere, the path bends as
a whole. How far it is from stationary is the steepest slope of the action,

    max dS[eta]  over  (1 / T) int |eta / size|^2 dt = 1,

an action, to be compared with S itself: a variation of one hundredth of the path's size changes S
by one hundredth of the slope at most. It is T times the root mean square of size times the
missing force

    F = d/dt L_v - L_q,

the force that would have to act besides for the trial to be a motion. Where a non-conservative
force Q acts, F is d/dt L_v - L_q - Q: no slope then, for S is not stationary on the motion, but
the distance from the equations of Lagrange and d'Alembert all the same.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from actionopt.analysis.quadratic.second_variation import second_derivatives, tangent
from actionopt.discrete.action.projection import project
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.problem import Periodic, Problem
from actionopt.solver.input.arguments import Guess, curve
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array

KNOT_SPANS = 8  # between the knots
SPAN_ELEMENTS, SPAN_DEGREE = 4, 10  # of each span
ON_SURFACE = 1e-9  # |f| of a trial, relative to its change by the coordinates' own size


@immutable
class Trial:
    """A trial path between the events of a problem.

    Attributes
    ----------
    tr : Transcription
        The discrete action on the mesh of the trial; `tr.lengths` are the coordinates' sizes.
    Q : (K, n) array
        Coordinates at the nodes.
    """

    tr: Transcription
    Q: Array

    __repr__ = one_line

    @property
    def path(self) -> Path:
        """The curve."""
        return Path(self.tr.mesh, self.Q.T)

    @property
    def action(self) -> float:
        """S along the trial; NaN or infinite where L is not finite on it."""
        return self._first[0]

    @cached_property
    def slope(self) -> float:
        """The distance from stationary, as above; a free end varies by its own size as well."""
        tr, g = self.tr, self._gradient * self.tr.lengths
        if tr.problem.system.m:
            Z = tangent(tr.problem, self.Q, tr.mesh.nodes[:, None], tr.lengths)
            g = np.einsum("kir,ki->kr", Z, g)
        mass = weights(tr) / tr.problem.duration
        mass[[0, -1]] += [
            len(e.pinned) < tr.problem.system.n for e in (tr.problem.start, tr.problem.end)
        ]
        return float(np.sqrt(np.sum(g**2 / mass[:, None])))

    @cached_property
    def missing(self) -> Array:
        """The missing force F at the nodes, (n, K), NaN at the ends.

        With constraints it is d2L/dv2 times an acceleration that they allow: what they provide
        themselves is not missing.
        """
        tr, problem = self.tr, self.tr.problem
        force = -self._gradient / weights(tr)[:, None]
        if problem.system.m:
            t = tr.mesh.nodes[:, None]
            Z = tr.lengths[:, None] * tangent(problem, self.Q, t, tr.lengths)
            v = self.path.velocity(tr.mesh.nodes).T
            MZ = second_derivatives(problem, self.Q, v, t)[2] @ Z
            ZT = np.swapaxes(Z, 1, 2)
            force = (MZ @ np.linalg.solve(ZT @ MZ, ZT @ force[..., None]))[..., 0]
        force[[0, -1]] = np.nan
        return force.T

    @cached_property
    def _first(self) -> tuple[float, Array]:
        with np.errstate(all="ignore"):
            return self.tr.action_and_gradient(self.Q)

    @cached_property
    def _gradient(self) -> Array:
        """The gradient of S, (K, n), zero where the events pin the path."""
        g, free = np.zeros(self.Q.size), self.tr.layout.free
        g[free] = self._first[1][free]
        return g.reshape(self.Q.shape)


def straight(problem: Problem, guess: Guess | None = None) -> Trial:
    """Return the first trial: the guess, or the straight line, moved onto the constraint surface.

    Raises ValueError for a path that closes, never ends or lies on a surface at an end, or a guess
    that does not fit.
    """
    if problem.is_infinite:
        raise ValueError(
            "expected events at finite times, found one at infinite time; solve it, and ask the "
            "solution's own problem, which has a window of time"
        )
    if problem.on_surface:
        raise ValueError(
            "expected events that pin the ends or leave them free, found one on a surface; solve "
            "it, and ask the solution's own problem, which has the place that was found"
        )
    if isinstance(problem.end, Periodic):
        raise ValueError(
            "expected events that pin the ends or leave them free, found a path that closes: its "
            "end follows its start; give the end event of one turn"
        )
    mesh = Mesh.uniform(problem.start.t, problem.end.t, SPAN_ELEMENTS * KNOT_SPANS, SPAN_DEGREE)
    tr = Transcription(problem, mesh, problem.lengths)
    return trial_at(
        tr, tr.straight() if guess is None else curve(problem, guess)(mesh)(mesh.nodes).T
    )


def knots(trial: Trial) -> Array:
    """Return which nodes are the knots, both ends included, (SPANS + 1,)."""
    return trial.tr.mesh.offsets[::SPAN_ELEMENTS]


def free(trial: Trial, node: int, coordinate: int) -> bool:
    """Whether a coordinate can be moved at a node: no event pins it there."""
    return bool(trial.tr.layout.number[node, coordinate] >= 0)


def move_node(trial: Trial, node: int, to: dict[int, float]) -> Trial:
    """Return the trial bent so that at `node` the coordinates `to` have the values given.

    At a knot by a spline, else by a parabola that vanishes at both ends. Coordinates that an
    event pins there stay. With constraints the path is moved back onto their surface. Raises
    ValueError where none is near.
    """
    shift = np.zeros(trial.tr.problem.system.n)
    for i, value in to.items():
        shift[i] = value - trial.Q[node, i] if free(trial, node, i) else 0.0
    own = np.flatnonzero(knots(trial) == node)
    bend = _cardinal(int(own[0])) if own.size else _parabola(node)
    return trial_at(trial.tr, trial.Q + bend[:, None] * shift)


def trial_at(tr: Transcription, Q: Array) -> Trial:
    """Return the trial at Q (K, n), its ends where the events pin, on the constraint surface."""
    Q = np.array(Q)
    for k, event in ((0, tr.problem.start), (-1, tr.problem.end)):
        for i in event.pinned:
            Q[k, i] = event.q[i]
    if tr.problem.system.m:
        Q = project(tr, Q)
        nodes, p = tr.mesh.nodes[:, None], tr.problem.packed
        f = tr.problem.system.pointwise("constraint")(Q, nodes, p)[0]
        if not np.max(np.abs(f) / tr.row_units) <= ON_SURFACE:
            raise ValueError(
                "expected a path on the constraint surface near this one, found none: move less"
            )
    return Trial(tr, Q)


def weights(tr: Transcription) -> Array:
    """Return the quadrature weights of the nodes, (K,), times.

    A path that closes has its last node in its first.
    """
    found = np.bincount(tr.layout.node_of, tr.weight[:, 0], tr.layout.node_count)
    if tr.layout.closed:
        found[0] += found[-1]
    return found


def _cardinal(knot: int) -> Array:
    """Return the natural cubic spline that is 1 at `knot` and 0 at the others, at the nodes (K,).

    Its second derivatives M at the knots solve M_(j-1) + 4 M_j + M_(j+1) = 6 (second difference).
    """
    y = np.zeros(KNOT_SPANS + 1)
    y[knot] = 1.0
    M = np.zeros(KNOT_SPANS + 1)
    inner = 4 * np.eye(KNOT_SPANS - 1) + np.eye(KNOT_SPANS - 1, k=1) + np.eye(KNOT_SPANS - 1, k=-1)
    M[1:-1] = np.linalg.solve(inner, 6 * np.diff(y, 2))
    u = KNOT_SPANS * _fractions()
    j = np.minimum(u.astype(int), KNOT_SPANS - 1)
    b = u - j
    a = 1 - b
    return a * y[j] + b * y[j + 1] + ((a**3 - a) * M[j] + (b**3 - b) * M[j + 1]) / 6


def _parabola(node: int) -> Array:
    """Return the parabola that is 1 at `node` and 0 at both ends, at the nodes (K,)."""
    u = _fractions()
    return u * (1 - u) / (u[node] * (1 - u[node]))


def _fractions() -> Array:
    """Return the nodes of every trial as fractions of the duration, (K,)."""
    return Mesh.uniform(0.0, 1.0, SPAN_ELEMENTS * KNOT_SPANS, SPAN_DEGREE).nodes
