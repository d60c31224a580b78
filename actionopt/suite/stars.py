"""What is known of a test problem: the continuous path, and the discrete optimum near it.

They are not the same: the discrete optimum depends on the mesh, and tends to the path as the
mesh is refined. The path comes from the scene's closed form, or from a solve at the tightest
tolerance; the discrete optimum from Newton's method, started at the path on the same mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import casadi as ca
import numpy as np

from actionopt.analysis.solution import SolveError
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors, negative_eigenvalues, product
from actionopt.discrete.newton.newton import follow
from actionopt.scenes import Scene
from actionopt.solver.refinement.ipopt import find
from actionopt.solver.solve import solve
from actionopt.suite.families import sample
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

TIGHT = 1e-12  # tolerance of the solve, where there is no closed form
STATIONARY = 1e-12  # relative KKT residual of what is called a star
SHIFT = 1e-9  # of the normal matrix of the rows, whose gradients are of size one
# from the path, in the coordinates' sizes: what a mesh makes of it is no path; ad hoc
NO_PATH = 0.1
SAME_STAR = 1e-3  # paths nearer than this, in the coordinates' sizes, are the same


@immutable
class Continuous:
    """The path of the continuous problem.

    Attributes
    ----------
    path : callable
        q(t): (n, K) for K times.
    action : float
        Its action, in the user's units.
    how : str
        "closed form", "literature" or "high precision".
    digits : int
        Decimal digits to which `path` is known, relative to the coordinates' sizes.
    source : str
        Where it is from.
    """

    path: Callable[[Array], Array]
    action: float
    how: str
    digits: int
    source: str


@immutable
class Star:
    """A stationary point of the discrete problem, in the transcription's units.

    Attributes
    ----------
    z : (size,) array
        Unknowns and multipliers.
    index : int
        Negative eigenvalues of the Hessian reduced to the constraints' tangent space.
    digits : int
        Decimal digits to which the unknowns are known.
    """

    z: Array
    index: int
    digits: int


def continuous(scene: Scene, waypoints: tuple[tuple[float, ...], ...] = ()) -> Continuous:
    """Return the continuous path of a scene, from its closed form if it has one.

    Else the path near `waypoints` or the scene's own guess. Raises SolveError if that is not
    found.
    """
    if scene.exact is not None:
        assert scene.action is not None
        return Continuous(scene.exact, scene.action, "closed form", 14, scene.source)
    try:
        solution = solve(scene.problem, tol=TIGHT, guess=waypoints or scene.guess)
    except SolveError as error:
        # The floor of round-off may lie above so tight a tolerance; the path is good all the same.
        solution = error.solution
        if solution is None or not solution.error < 1e-8:
            raise
    digits = int(-np.log10(max(solution.error, 1e-15)))
    if scene.facts.action is not None:
        return Continuous(solution, scene.facts.action, "literature", digits, scene.source)
    return Continuous(solution, solution.action, "high precision", digits, scene.source)


def star(tr: Transcription, path: Callable[[Array], Array], *, polish: bool = True) -> Star:
    """Return the discrete optimum near a path.

    Without `polish` the path at the nodes is taken as it is: where the optimum is one of a
    family, nothing says where Newton's method would come to rest.

    Raises ValueError if there is none near the path: the mesh is too coarse for it.
    """
    system, nodes = tr.problem.system, tr.mesh.nodes
    Q = sample(path, nodes, system.n)
    z = tr.pack(Q, _multipliers(tr, Q))
    if not polish:
        return Star(z, _index(tr, z), 13)
    followed = follow(tr, z, linear=False, steps=20)
    z = followed.z
    if not (followed.converged or relative_residual(tr, z) <= STATIONARY):
        raise too_coarse(tr, "Newton's method leaves it")
    if not followed.travelled <= NO_PATH:
        raise too_coarse(tr, f"it is {followed.travelled:.2g} of the coordinates' sizes away")
    for _ in range(2):  # to the floor of round-off: what is called a star should shine
        again = follow(tr, z, linear=True, steps=1)
        if not relative_residual(tr, again.z) < relative_residual(tr, z):
            break
        z = again.z
    digits = int(np.clip(-np.log10(max(followed.noise, 1e-16)), 0, 15))
    return Star(z, _index(tr, z), digits)


def too_coarse(tr: Transcription, found: str) -> ValueError:
    """Return the error of a mesh whose optimum is not what the path is."""
    return ValueError(
        f"expected a discrete optimum near the path of {tr.problem.system.name}, found that "
        f"{found} on {tr.mesh.elements} elements of degree {max(tr.mesh.degrees)}; use more "
        "elements or a higher degree"
    )


def _index(tr: Transcription, z: Array) -> int:
    return negative_eigenvalues(tr.layout, tr.kkt(z)) - tr.layout.rows


def _multipliers(tr: Transcription, Q: Array) -> Array | None:
    """Return the multipliers (K, m) that balance the gradient of S at coordinates Q (K, n) best.

    None if there are no constraints.
    """
    if not tr.layout.rows:
        return None
    x = tr.pack(Q)[: tr.layout.unknowns]
    return tr.unpack(np.concatenate([x, least_multipliers(tr, x)]))[1]


def least_multipliers(tr: Transcription, x: Array) -> Array:
    """Return the mu (rows,) that make |grad S + J' mu| least, at any point x.

    With redundant rows, the shortest of them: the shift makes the normal matrix regular, and
    refinement removes its error where it matters.
    """
    layout = tr.layout
    mu = np.zeros(layout.rows)
    if not layout.rows:
        return mu
    J = ca.DM(layout.jacobian.sparsity, tr.jacobian(x))
    gradient = tr.gradient(x)
    normal = J @ J.T + SHIFT * ca.DM.eye(layout.rows)
    if not np.all(np.isfinite(gradient)) or not normal.is_regular():
        return mu
    solver = ca.Linsol("normal", "ldl", normal.sparsity())
    solver.sfact(normal)
    solver.nfact(normal)
    for _ in range(3):
        mu = mu - np.asarray(solver.solve(normal, J @ (gradient + J.T @ mu))).ravel()
    return mu


def relative_residual(tr: Transcription, z: Array) -> float:
    """Return max |r_i| over the largest sum of terms |K_ij z_j|: 1e-16 is round-off."""
    with np.errstate(all="ignore"):
        terms = product(tr.layout, np.abs(tr.kkt(z)), np.abs(z))
        size = float(np.max(terms, initial=np.finfo(float).tiny))
        return float(np.max(np.abs(tr.residual(z)), initial=0.0)) / size


def newton_step(tr: Transcription, x: Array) -> Array:
    """Return Newton's step from x for the conditions of first order, (unknowns,); NaN if none."""
    z = np.concatenate([x, least_multipliers(tr, x)])
    try:
        with np.errstate(all="ignore"):
            return -Factors(tr.layout, tr.kkt(z)).solve(tr.residual(z))[: x.size]
    except np.linalg.LinAlgError:
        return np.full(x.size, np.nan)


def others(
    tr: Transcription,
    scene: Scene,
    bends: tuple[tuple[float, ...], ...],
    points: Iterable[Array],
    known: Star,
) -> list[Star]:
    """Return other stationary points of the discrete problem; not all there are.

    Some are other paths, found from bent straight lines; one is what minimising leads to from
    the scene's guess and from the straight line, which on a coarse mesh may be no path; the last
    are near `points`, each (unknowns,), which solvers came to.
    """
    cut, stars = tr.layout.unknowns, [known]

    def keep(other: Star | None) -> None:
        if other is not None and all(
            np.max(np.abs(other.z[:cut] - s.z[:cut])) > SAME_STAR for s in stars
        ):
            stars.append(other)

    for bend in bends:
        try:
            keep(star(tr, solve(scene.problem, tol=1e-10, guess=bent_line(tr, bend))))
        except (SolveError, ValueError):
            continue
    for curve in (scene.guess, bent_line(tr, (0.0,) * scene.problem.system.n)):
        if curve is None:
            continue
        Q = sample(curve, tr.mesh.nodes, scene.problem.system.n)
        attempt = find(tr, tr.pack(Q), "patient least")
        if attempt.converged:
            keep(_polish(tr, attempt.z))
    for x in points:
        keep(nearest(tr, x, SAME_STAR))
    return stars[1:]


def nearest(tr: Transcription, x: Array, reach: float) -> Star | None:
    """Return the stationary point within `reach` of x, in scaled units, if Newton finds one."""
    found = _polish(tr, np.concatenate([x, least_multipliers(tr, x)]))
    if found is None or not np.max(np.abs(found.z[: x.size] - x), initial=0.0) <= reach:
        return None
    return found


def _polish(tr: Transcription, z: Array) -> Star | None:
    followed = follow(tr, z)
    if not followed.converged or not relative_residual(tr, followed.z) <= STATIONARY:
        return None
    return Star(followed.z, _index(tr, followed.z), 12)


def bent_line(tr: Transcription, bend: tuple[float, ...]) -> Callable[[Array], Array]:
    """Return the straight line with half a sine wave added."""
    t0, T = tr.problem.start.t, tr.problem.duration
    line = tr.straight()
    start, end = line[0], line[-1]

    def curve(t: Array) -> Array:
        s = (np.asarray(t) - t0) / T
        return start[:, None] + np.outer(end - start, s) + np.outer(bend, np.sin(np.pi * s))

    return curve
