"""Terms of the discrete action that depend on one node alone.

Where an end lies at infinity, the action beyond the window is a quadratic form in where the path is
at its edge (`mechanics.question.rest`). And where both do, and L does not contain t, the path may
be shifted in time at will: half the square of a function of one node, which vanishes at one of
these paths, chooses it, and adds nothing there.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.question.problem import Problem
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array


@immutable
class Term:
    """linear.eta + eta.matrix eta / 2, eta = q - center at a node between elements.

    `boundary` is the node's number among those, `phase` whether it chooses the origin of time, and
    `action` what it is of the action where the derivative, linear + matrix eta, is no gradient.
    """

    node: int
    boundary: int
    center: Array
    linear: Array
    matrix: Array
    phase: bool = False
    action: tuple[Array, Array] | None = None

    def value(self, q: Array) -> float:
        """Return the term for coordinates q (n,)."""
        eta = q - self.center
        linear, matrix = self.action or (self.linear, self.matrix)
        return float(linear @ eta + eta @ matrix @ eta / 2)

    def gradient(self, q: Array) -> Array:
        """Return its derivative by the coordinates, (n,)."""
        return self.linear + self.matrix @ (q - self.center)


def terms(problem: Problem, mesh: Mesh) -> tuple[Term, ...]:
    """Return the terms of a problem; none but for ends at infinity.

    Raises ValueError if no node between elements lies where the phase is set.
    """
    found = []
    last = mesh.elements
    for k, rest in zip((0, last), problem.rests, strict=True):
        if rest is not None:
            node = int(mesh.offsets[k])
            sign = -float(rest.side)
            pull = sign * rest.p, sign * rest.slope
            found.append(Term(node, k, rest.q, *pull, action=rest.action))
    phase = problem.start.phase
    if phase is not None:
        k = int(np.argmin(np.abs(mesh.boundaries - phase.t)))
        normal = np.array(phase.normal)
        center = np.array(phase.center)
        matrix = phase.weight * np.outer(normal, normal)
        found.append(
            Term(int(mesh.offsets[k]), k, center, np.zeros(normal.size), matrix, phase=True)
        )
    return tuple(found)


def rest_action(problem: Problem, times: Array, weight: Array) -> float:
    """Return the action of rest, which is taken away: sum of weight L at times (K, 1)."""
    known = [x for x in problem.rests if x is not None]
    if not known:
        return 0.0
    q = np.broadcast_to(known[0].q, (len(times), known[0].q.size))
    L = problem.system.pointwise("value")(q, np.zeros_like(q), times, problem.packed)[0][:, 0]
    return float(weight[:, 0] @ L)
