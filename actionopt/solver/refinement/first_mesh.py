"""The first mesh for linear equations, from the rates at which their solutions turn and decay.

Along one coordinate M a = L_qq q + Q_v v: solutions turn at the rate sqrt(-L_qq / M) where that is
real, and decay from an end at the rate sqrt(L_qq / M) elsewhere, or by friction at |Q_v| / M. A
mesh on which turns are lost, or layers, would have to be refined from nothing.
"""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.meshes.resolution import DEGREES
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.question.scales import diagonal, ends_of
from actionopt.mechanics.system import System
from actionopt.tools.blas import check_definite
from actionopt.tools.types import Array

FIRST_TOL = 1e-3  # of paths that are followed on to an energy, a surface or an integral; ad hoc
LINEAR = 4  # elements to begin with where nothing has to be sought
# Measured over the scenes and 40 stress cases: degrees 4, 5, 8 and 10 take from 3 % fewer to 10 %
# more evaluations in the geometric mean, 1.1 to 2.6 times as many in the sum, and all but 5 lose an
# extreme case.
COARSE_DEGREE, COARSE_ELEMENTS = 6, 8
IPOPT_SIZE = 1500  # unknowns above which Ipopt, and what takes as long, is to do with less; ad hoc
# Radians, or e-foldings, on an element: by the formula in `plan_mesh` twelve digits at degree 13.
# Derived so far; that few elements of this degree are better than many of another is ad hoc.
PHASE_PER_ELEMENT = 2.5
# E-foldings from an end at which elements meet; elements lengthen as the layer decays, and beyond
# 35 it is below round-off (derived; the steps between are ad hoc).
LAYER_PHASES = PHASE_PER_ELEMENT * np.array([0, 1, 2, 3, 4, 6, 9, 14])
MOST_ELEMENTS = 64  # for turns; ad hoc: more are left to refinement, as near a singularity
# Radians on an element of degree six beyond which a motion is lost. Measured on pendulums of 30 to
# 100 links: they are found at 5.3, not at 6.2; derived: the coefficient left out is 1e-3 and 6e-3.
LOST_PHASE = 5.5
TAIL_MARGIN = 5.0  # between a coefficient and the tolerance it has to meet: `SAFETY`, and a little
STEADY_RATE = 1e-6  # rate over the whole time, in place of none: of that the first degree is enough
LINE_SAMPLES = 33  # of the straight line, where its inertias are compared; ad hoc
PACE_SAMPLES = 2**12  # of that line where its pace is found; ad hoc, a descent does the rest
LOG_FACTORIALS = np.array([math.lgamma(d) for d in DEGREES])  # of d - 1
THINNEST_ELEMENT = 1e3 * np.finfo(float).eps  # in parts of the time; ad hoc: its nodes are distinct


def plan_mesh(problem: Problem, tol: float, elements: int) -> Mesh:
    """Return a mesh that resolves to `tol` whatever solves equations that do not depend on time."""
    turns, folds = steady_rates(problem)
    parts, fastest = _boundaries(turns, folds, elements), PHASE_PER_ELEMENT
    if parts is None:
        parts, fastest = np.linspace(0.0, 1.0, elements + 1), max(turns, folds) / elements
    # The Legendre coefficient k of exp(x t) is about (x / 2)^k / k!; the last two tell the error.
    logarithms = (DEGREES - 1) * np.log(max(fastest, STEADY_RATE) / 4) - LOG_FACTORIALS
    good = logarithms < np.log(tol / TAIL_MARGIN)
    degree = DEGREES[np.argmax(good)] if good.any() else DEGREES[-1]
    since = problem.duration * parts
    return Mesh.over(problem.start.t, problem.end.t, since, int(degree))


def steady_rates(problem: Problem) -> tuple[float, float]:
    """Return the fastest turning, in radians, and decay, in e-foldings, over the whole time.

    Of what solves equations that do not depend on time.
    """
    system, n = problem.system, problem.system.n
    rest, now = np.zeros((1, n)), np.array([[problem.start.t]])
    state = rest, rest, now, problem.packed
    second = system.pointwise("second")(*state)
    forces = system.pointwise("force_jacobian")(*state) if system.structure.forced else None
    return _rates(system, second, forces, problem.duration)


def straight_line(problem: Problem, mesh: Mesh) -> Path:
    """Return the straight line between events, at one velocity; a free end keeps the other's."""
    start, end = (x[:, None] for x in ends_of(problem))
    return Path(mesh, start + mesh.nodes_since / mesh.duration * (end - start))


def is_free(problem: Problem) -> bool:
    """Whether nothing pulls a body of constant inertia: its least path is a line, at one velocity.

    Between events that give all coordinates.
    """
    system = problem.system
    structure, second, now = system.structure, system.pointwise("second"), problem.start.t
    joins = all(len(event.pinned) == system.n for event in (problem.start, problem.end))
    if not (joins and structure.steady_forces) or structure.forced or any(problem.singular_ends):
        return False
    if second.sparsity(0)[0].size or second.sparsity(1)[0].size:
        return False
    state = *np.zeros((2, 1, system.n)), np.array([[now]]), problem.packed
    mass = second.full(2, second(*state)[2], symmetric=True)
    with suppress(np.linalg.LinAlgError):
        check_definite(mass)
        return not system.pointwise("first")(*state)[0].any()
    return False


def elements_of(degree: int, phases: float, tol: float) -> float:
    """Return how many elements of a degree resolve so many radians or e-foldings to `tol`.

    By the formula in `plan_mesh`.
    """
    logarithm = math.log(tol / TAIL_MARGIN) + math.lgamma(degree)
    return phases / (4 * math.exp(logarithm / (degree - 1)))


def plan_layers(tr: Transcription, z: Array) -> Mesh | None:
    """Return a mesh that shows turns and layers which that of `tr` does not, if there are any."""
    problem, mesh, x = tr.problem, tr.mesh, z[: tr.layout.unknowns]
    forces = tr.forces(x) if problem.system.structure.forced else None
    rates = _rates(problem.system, tr.second(x), forces, problem.duration)
    parts = _boundaries(*rates, mesh.elements)
    return None if parts is None else mesh.cut(mesh.duration * parts, max(mesh.degrees))


def fewest_elements(problem: Problem) -> int:
    """Return the elements, a power of two, below which small motions without constraints are lost.

    A coarser mesh has stationary points of its own. The fastest rate of many coordinates is bounded
    by the row sums of M^-1 L_qq, here at rest half way between the events.
    """
    system, n = problem.system, problem.system.n
    middle = (ends_of(problem) / 2).sum(axis=0, keepdims=True)
    second, now = system.pointwise("second"), np.array([[problem.start.t]])
    A, _, C = second(middle, np.zeros((1, n)), now, problem.packed)
    (row, col), (at, other) = second.sparsity(0), second.sparsity(2)
    with np.errstate(all="ignore"):
        if (at == other).all():
            sizes, off = np.abs(A[0]), row != col
            sums = np.bincount(row, sizes, n) + np.bincount(col, sizes * off, n)
            squares = sums[at] / C[0]
        else:
            stiffness, mass = (second.full(k, x, symmetric=True)[0] for k, x in ((0, A), (2, C)))
            try:
                squares = np.abs(np.linalg.solve(mass, stiffness)).sum(axis=1)
            except np.linalg.LinAlgError:
                return 0
        fastest = math.sqrt(squares[np.isfinite(squares)].max(initial=0.0))
    phases = fastest * problem.duration / LOST_PHASE
    return 2 ** math.ceil(math.log2(min(max(phases, 1.0), MOST_ELEMENTS // 2)))


def uneven_elements(problem: Problem) -> float:
    """Return the elements on each of which the inertia along the straight line varies little.

    That is by e-foldings as many as a polynomial tells well; zero where the inertia is constant.
    """
    system = problem.system
    if system.structure.constant_mass or system.order > 1 or problem.has_tails:
        return 0.0
    s = np.linspace(0.0, 1.0, LINE_SAMPLES)[:, None]
    first, last = ends_of(problem)
    v = np.tile((last - first) / problem.duration, (s.size, 1))
    t = problem.start.t + s * problem.duration
    with np.errstate(all="ignore"):
        C = system.pointwise("second")((1 - s) * first + s * last, v, t, problem.packed)[2]
        logarithms = np.log(diagonal(system, 2, C) @ problem.lengths**2)
    logarithms = logarithms[np.isfinite(logarithms)]
    return float(np.ptp(logarithms)) / PHASE_PER_ELEMENT if logarithms.size else 0.0


def paced_line(problem: Problem, elements: int) -> Path | None:
    """Return the straight line at the pace that keeps v.L_vv v, on elements of equal parts of it.

    None where that is not positive and finite everywhere on it.
    """
    first, last = ends_of(problem)
    s = (np.arange(PACE_SAMPLES)[:, None] + 0.5) / PACE_SAMPLES
    step = (last - first) / problem.duration
    with np.errstate(all="ignore"):
        second, t = problem.system.pointwise("second"), problem.start.t + s * problem.duration
        C = second(first + s * (last - first), np.tile(step, (s.size, 1)), t, problem.packed)[2]
        slow = np.sqrt(step @ second.full(2, C, symmetric=True) @ step)
    if not (np.isfinite(slow).all() and slow.min() > 0):
        return None
    since = np.concatenate([[0.0], np.cumsum(slow)]) * (problem.duration / slow.sum())
    since[-1] = problem.duration
    edges = since[:: PACE_SAMPLES // elements]
    mesh = Mesh.over(problem.start.t, problem.end.t, edges, COARSE_DEGREE)
    parts = np.interp(mesh.nodes_since, since, np.linspace(0.0, 1.0, since.size))
    return Path(mesh, (first + parts[:, None] * (last - first)).T)


def _boundaries(turns: float, folds: float, elements: int) -> Array | None:
    """Return boundaries (N + 1,) for so many radians and e-foldings, None if `elements` do.

    They are parts of the duration, from 0 to 1: uniform but for the ends, where the elements
    lengthen with their distance from a layer.
    """
    if max(turns, folds) <= PHASE_PER_ELEMENT * elements:
        return None
    middle = int(np.clip(np.ceil(turns / PHASE_PER_ELEMENT), elements, MOST_ELEMENTS))
    layer = np.zeros(1)
    if folds > PHASE_PER_ELEMENT * elements:
        layer = LAYER_PHASES[0.4 * folds > LAYER_PHASES] / folds  # something is left between
    last = layer[-1]
    parts = np.concatenate(
        [layer[:-1], np.linspace(last, 1.0 - last, middle + 1), 1.0 - layer[-2::-1]]
    )
    parts[-1] = 1.0
    # A layer as thin as that is left to refinement.
    return None if np.diff(parts).min() < THINNEST_ELEMENT else parts


def _rates(
    system: System, second: list[Array], forces: list[Array] | None, duration: float
) -> tuple[float, float]:
    """Return the fastest turning, in radians, and decay, in e-foldings, over the whole time."""

    def own(name: str, output: int, values: Array) -> Array:
        return np.einsum("kii->ki", system.pointwise(name).full(output, values))

    stiffness, mass = (own("second", k, second[k]) for k in (0, 2))
    friction = np.zeros(1)
    if forces is not None:
        stiffness = stiffness + own("force_jacobian", 0, forces[0])
        friction = own("force_jacobian", 1, forces[1])
    with np.errstate(all="ignore"):
        squares, decay = stiffness / mass * duration**2, np.abs(friction / mass) * duration
    squares, decay = squares[np.isfinite(squares)], decay[np.isfinite(decay)]
    slow, fast = squares.min(initial=0.0), squares.max(initial=0.0)
    return float(np.sqrt(-slow)), float(max(np.sqrt(fast), decay.max(initial=0.0)))
