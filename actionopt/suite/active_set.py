"""Members with inequalities: a path that an obstacle holds, f(q, t) >= 0 at every node.

Their discrete optimum is found by an active set: rows that press are equations, the others are left
out, and both change until no row pulls and none is violated. What is left are Karush, Kuhn and
Tucker's conditions, which certify it: J. Nocedal and S. J. Wright, *Numerical Optimization* (2nd
ed. 2006), section 12.3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from actionopt.analysis.solution import SolveError
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors, negative_eigenvalues
from actionopt.discrete.newton.newton import follow
from actionopt.mechanics.question.held import Held
from actionopt.mechanics.question.problem import Problem
from actionopt.scenes import Scene
from actionopt.solver.solve import solve
from actionopt.suite.stars import NO_PATH, SAME_STAR, Star, bent_line, least_multipliers, too_coarse
from actionopt.tools.types import Array, NDInt

# of the active set; ad hoc: rows at the ends of contact come and go one by one
SET_ROUNDS = 60
ON_ROW = 1e-9  # of a row's unit: what a path leaves of one that it touches
SAME_TO_FIVE = 1e-3  # of the coordinates' sizes: points that are known to five digits
MET = 1e-4  # the same of an answer whose multipliers are fitted: far above solvers' tolerances


class Pressed(Held):
    """A problem in which the rows are in force at some nodes, (K, m + r), of one mesh."""

    on: NDArray[np.bool_]

    def __init__(self, free: Problem, on: NDArray[np.bool_]) -> None:
        super().__init__(free, ())
        object.__setattr__(self, "on", on)

    def in_force(self, boundaries: Array, offsets: NDInt) -> NDArray[np.bool_]:
        """Return which rows those are."""
        return self.on


def star(tr: Transcription, z: Array, on: NDArray[np.bool_], reach: float = NO_PATH) -> Star:
    """Return the discrete optimum near z, (size,) of all rows, from the rows in force `on`.

    Raises ValueError if there is none within `reach`.
    """
    asked, cut = tr.problem, tr.layout.unknowns
    assert isinstance(asked, Held)
    first, seen = z[:cut], []
    _, lam = tr.unpack(z)
    while len(seen) < SET_ROUNDS and not any((on == other).all() for other in seen):
        seen.append(on)
        part = Transcription(Pressed(asked.free, on), tr.mesh, tr.lengths, like=tr)
        found = follow(part, part.pack(tr.coordinates(z), np.nan_to_num(lam)), steps=30)
        if not found.converged:
            raise too_coarse(tr, "Newton's method leaves it")
        again = follow(part, found.z, linear=True, steps=1)
        Q, lam = part.unpack(again.z)
        z = tr.pack(Q, np.nan_to_num(lam))
        new = _next_set(tr, on, z)
        if (new == on).all():
            break
        on = new
    else:
        raise too_coarse(tr, "its active set does not settle")
    away = float(np.max(np.abs(z[:cut] - first), initial=0.0))
    if not away <= reach:
        raise too_coarse(tr, f"it is {away:.2g} of the coordinates' sizes away")
    kkt = part.kkt(again.z)
    index = negative_eigenvalues(part.layout, kkt) - part.layout.rows
    return Star(z, index, int(np.clip(-np.log10(max(again.noise, 1e-16)), 0, 15)))


def from_path(tr: Transcription, path: Callable[[Array], Array]) -> Star:
    """Return the discrete optimum near a continuous path."""
    Q = np.asarray(path(tr.mesh.nodes), dtype=float).reshape(tr.problem.system.n, -1).T
    return star(tr, tr.pack(Q), touching(tr, tr.pack(Q), ON_ROW))


def others(
    tr: Transcription,
    scene: Scene,
    bends: tuple[tuple[float, ...], ...],
    points: Sequence[Array],
    known: Star,
) -> list[Star]:
    """Return other optima: near paths round other sides of the obstacle, and near `points`."""
    cut, stars = tr.layout.unknowns, [known]
    candidates = [nearest(tr, point, SAME_TO_FIVE) for point in points]
    for bend in bends:
        try:
            path = solve(scene.problem, tol=1e-10, guess=bent_line(tr, bend))
            candidates.append(from_path(tr, path))
        except (SolveError, ValueError):
            continue
    for found in candidates:
        if found and all(np.max(np.abs(found.z[:cut] - s.z[:cut])) > SAME_STAR for s in stars):
            stars.append(found)
    return stars[1:]


def nearest(tr: Transcription, x: Array, reach: float) -> Star | None:
    """Return the optimum within `reach` of x (unknowns,), if there is one."""
    z = np.concatenate([x, fit_multipliers(tr, x)])
    for least in (MET, MET / 10, MET / 100):  # rows that are nearly met may not be, together
        try:
            return star(tr, z, touching(tr, z, least), reach)
        except ValueError:
            continue
    return None


def touching(tr: Transcription, z: Array, least: float) -> NDArray[np.bool_]:
    """Return at which nodes rows are equations, or smaller than `least`, (K, m + r)."""
    asked, layout = tr.problem, tr.layout
    assert isinstance(asked, Held)
    on = np.zeros((layout.node_count, asked.system.m), dtype=bool)
    on[layout.row_node, layout.row_constraint] = tr.constraint(z[: layout.unknowns]) <= least
    on[:, : asked.free.system.m] = True
    return on


def fit_multipliers(tr: Transcription, x: Array) -> Array:
    """Return the multipliers (rows,) of the rows that x touches, fitted to the gradient."""
    asked, layout = tr.problem, tr.layout
    assert isinstance(asked, Held)
    on = touching(tr, tr.pack(tr.coordinates(x)), MET)
    part = Transcription(Pressed(asked.free, on), tr.mesh, tr.lengths, like=tr)
    _, lam = part.unpack(np.concatenate([x, least_multipliers(part, x)]))
    mu = np.nan_to_num(lam)[layout.row_node, layout.row_constraint] / tr.mu_unit
    return np.where(layout.row_constraint < asked.free.system.m, mu, np.minimum(mu, 0.0))


def step(tr: Transcription, x: Array) -> Array:
    """Return Newton's step from x, (unknowns,), with the rows that are in contact behind it.

    Those that x touches to begin with: then rows that pull leave, and those that the step violates
    come, until that settles, as in `star`. Rows that hardly press may come and go for ever, and
    make hardly any difference.
    """
    asked, seen = tr.problem, []
    assert isinstance(asked, Held)
    on = touching(tr, tr.pack(tr.coordinates(x)), MET)
    found = np.full(x.size, np.nan)
    while len(seen) < SET_ROUNDS and not any((on == other).all() for other in seen):
        seen.append(on)
        part = Transcription(Pressed(asked.free, on), tr.mesh, tr.lengths, like=tr)
        z = np.concatenate([x, least_multipliers(part, x)])
        try:
            with np.errstate(all="ignore"):
                whole = -Factors(part.layout, part.kkt(z)).solve(part.residual(z))
        except np.linalg.LinAlgError:
            break
        found, (_, lam) = whole[: x.size], part.unpack(z + whole)
        on = _next_set(tr, on, tr.pack(tr.coordinates(x + found), np.nan_to_num(lam)))
    return found


def _next_set(tr: Transcription, on: NDArray[np.bool_], z: Array) -> NDArray[np.bool_]:
    """Return the rows in force after those `on`: without those that pull, with those violated."""
    asked, layout, cut = tr.problem, tr.layout, tr.layout.unknowns
    assert isinstance(asked, Held)
    push, row = np.zeros(on.shape), np.ones(on.shape)
    push[layout.row_node, layout.row_constraint] = -z[cut:]
    row[layout.row_node, layout.row_constraint] = tr.constraint(z[:cut])
    new = np.where(on, push >= -ON_ROW, row < -ON_ROW)
    new[:, : asked.free.system.m] = True
    return new
