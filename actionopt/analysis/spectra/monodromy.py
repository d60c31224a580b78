"""How neighbours of a path are carried from its start to its end: the monodromy matrix.

The second variation on one element, its inner nodes eliminated, is the Hessian of the principal
function S(a, b) of the coordinates at its ends, with p_a = -dS/da and p_b = dS/db; solved for
(b, p_b) it is a symplectic matrix, and the product of those of all elements carries (q, p) along
the path. For a closed path the eigenvalues of that matrix are the Floquet multipliers. They come in
pairs z, 1 / z: both are found from z + 1 / z, an eigenvalue of M + M^-1, where M^-1 = -J M' J.
"""

from __future__ import annotations

import numpy as np

from actionopt.analysis.quadratic.jacobi import resolve
from actionopt.analysis.quadratic.second_variation import Form
from actionopt.analysis.quadratic.sensitivity import second_through
from actionopt.analysis.solution import Solution, question
from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.borders.borders import moves_of, times_of
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.course import check_whole
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.tools.blas import one_thread
from actionopt.tools.types import Array

# What the mesh leaves out of Jacobi fields; derived: second derivatives converge twice as fast.
MONODROMY_RESOLUTION = 1e-8
ON_CIRCLE = 1e-5  # how far from the circle a multiplier may be that is on it; ad hoc


class Monodromy(np.ndarray):
    """The matrix (2n, 2n) that carries (dq, dp) from the start of a path to its end: an array.

    Attributes
    ----------
    trivial : int
        How many pairs of eigenvalues are 1 because the path may be moved: along itself, where
        there is no clock, and as a whole by each symmetry of L. Such an eigenvalue is double, and
        so known to the root of what the matrix is.
    eigenvalues : (2n,) array, complex
        Of a closed path the Floquet multipliers, in pairs z, 1 / z.
    stable : bool
        Whether all but the trivial ones are on the unit circle.
    stability : str
        That in a sentence, with how many are not.
    """

    trivial: int = 0

    def __array_finalize__(self, other: object) -> None:
        """Keep what is known of the matrix this one is taken from."""
        self.trivial = getattr(other, "trivial", 0)

    def __repr__(self) -> str:
        """Show the size and the stability; `print` shows the entries."""
        if self.ndim != 2 or self.shape[0] != self.shape[1] or not np.isfinite(self).all():
            return super().__repr__()  # of a part, say
        return f"Monodromy({self.shape[0]} x {self.shape[1]}, {self.stability})"

    @property
    def eigenvalues(self) -> Array:
        """Eigenvalues in pairs z, 1 / z, the largest first."""
        M = np.asarray(self)
        n = len(M) // 2
        J = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
        # In units in which q and p are of one size: no eigenvalue depends on them.
        unit = _balance(M)
        M = M * unit / unit[:, None]
        values = list(np.linalg.eigvals(M - J @ M.T @ J))
        pairs = []
        for _ in range(n):  # each is double
            one = values.pop(int(np.argmax(np.abs(values))))
            other = values.pop(int(np.argmin(np.abs(np.array(values) - one))))
            half = complex(one + other) / 4
            root = np.sqrt(half**2 - 1)
            large = half + root if abs(half + root) >= abs(half - root) else half - root
            pairs += [large, 1 / large]
        return np.array(pairs)

    @property
    def stable(self) -> bool:
        """Whether no neighbour leaves the path exponentially."""
        return self._leaving == 0

    @property
    def _leaving(self) -> int:
        pairs = self.eigenvalues.reshape(-1, 2)[:, 0]
        apart = pairs[np.argsort(np.abs(pairs - 1))][self.trivial :]
        return int(np.sum(np.abs(apart) > 1 + ON_CIRCLE))

    @property
    def stability(self) -> str:
        """Whether neighbours stay near, in a sentence."""
        largest = np.abs(self.eigenvalues).max()
        if not self._leaving:
            return "linearly stable: all multipliers are on the unit circle"
        count = self._leaving
        return (
            f"unstable: {count} multiplier{'s' if count > 1 else ''} outside the unit circle, the "
            f"largest of modulus {largest:.6g}"
        )


@one_thread
def monodromy(solution: Solution) -> Monodromy:
    """Return the matrix (2n, 2n) that carries (dq, dp) along a path from its start to its end.

    Its eigenvalues are the Floquet multipliers of a path that closes. Where that is in another
    order (`Periodic(T, relabel=...)`) the matrix is that of the part, P^-1 dx(T)/dx(0) with the
    order P: its k-th power is that of the whole path, where P^k = 1.

    Raises
    ------
    ValueError
        For a system under constraints, whose (q, p) are not independent, with non-conservative
        forces or accelerations; for a path through a singularity, between infinite times, or one
        that touches an obstacle.

    References
    ----------
    Meyer, Hall and Offin, *Introduction to Hamiltonian Dynamical Systems* (2009), chapters 2 and 8.
    """
    problem = question(solution)
    system = problem.system
    if system.m:
        raise ValueError(
            "expected a system without constraints, found one that has some: its coordinates "
            "and momenta are not independent; choose independent coordinates"
        )
    if system.r and solution.contacts:
        raise ValueError(
            "expected a path that touches no obstacle, found one that does: its neighbours are "
            "carried along it by other forces; give the free parts, each as a problem of its own"
        )
    if problem.has_tails:
        raise ValueError(
            "expected a path between finite times, found one that is at rest at an infinite one: "
            "its neighbours leave that exponentially, and no matrix carries them all the way; "
            "solve a part of it, between two of its times"
        )
    if problem.through and system.order > 1:
        raise ValueError(
            "expected a path without events between its ends, or a Lagrangian without "
            "accelerations, found both: how its neighbours pass the events is not known here"
        )
    if problem.through:
        return _through(solution)
    check_whole(problem, "a matrix that carries (q, p) of neighbours")
    start = Event(problem.start.t, None)
    end = Event(problem.end.t, None) if problem.advance is None else problem.end.at(problem.end.t)
    free = Problem(system, start, end, parameters=problem.parameters)
    at = DiscretePath.of(free, solution.path, lengths=solution.discrete.tr.lengths)
    found = transport_matrix(resolve(at, solution.error, MONODROMY_RESOLUTION)).view(Monodromy)
    if problem.closes:
        discrete = solution.discrete
        asked = problem.original
        moves = moves_of(asked)
        bordered, _ = Bordered.around(asked, solution.path, None, discrete.tr.lengths, moves)
        found.trivial = bordered.phases
    return found


def _through(solution: Solution) -> Monodromy:
    """Return the matrix along a path that is reflected, refracted or kicked on its way.

    From the second derivatives of the principal function S(q0, q1), in which places and times of
    the events follow the ends.
    """
    problem, n = solution.problem, solution.problem.system.n
    asked = problem.original
    times = times_of(problem)
    q0, q1 = solution.path.values[:, 0], solution.path.values[:, -1]
    ends = Event(times[0], q0), Event(times[-1], q1)
    opened = asked.replace(start=ends[0], end=ends[1], energy=None)
    Q = np.array([solution(t) for t in times])
    at = DiscretePath.of(
        opened.found_at(times, Q), solution.path, lengths=solution.discrete.tr.lengths
    )
    a, b, c = second_through(at)
    if not np.isfinite(b).all() or np.linalg.matrix_rank(b) < n:
        if any(event.pinned for event in asked.through):
            raise ValueError(
                "expected events between the ends that leave the path to its motion, found "
                "coordinates that one gives: neighbours are led through them, not carried past; "
                "see solution.parts"
            )
        raise ValueError(
            "expected ends of a path through events that are not conjugate, found that they are: "
            "begin a closed path elsewhere along itself"
        )
    M = _carry(a, b, c)
    order = list(problem.order) or list(range(n))
    rows = np.argsort(order)
    M = M[np.r_[rows, n + rows]].view(Monodromy)
    M.trivial = int(problem.may_be_shifted)
    return M


def transport_matrix(form: Form) -> Array:
    """Return the product of the elements' symplectic matrices, in the user's units.

    Where a path closes in another order of the coordinates, so does the matrix: once round is a
    power of it.
    """
    r = form.freedom
    M = np.eye(2 * r)
    for E in form.elements:
        ends = np.r_[:r, len(E) - r : len(E)]
        inner = np.arange(r, len(E) - r)
        S = E[np.ix_(ends, ends)]
        if inner.size:
            S = S - E[np.ix_(ends, inner)] @ np.linalg.solve(
                E[np.ix_(inner, inner)], E[np.ix_(inner, ends)]
            )
        a, b, c = S[:r, :r], (S[:r, r:] + S[r:, :r].T) / 2, S[r:, r:]
        M = _carry(a, b, c) @ M
    # dq = units basis a, and p . dq is the same in both.
    unit = np.concatenate([form.units, 1 / form.units])
    frames = []
    for Z in (form.basis[0], form.basis[0 if form.closed else -1]):
        zero = np.zeros_like(Z)
        frames.append(np.block([[Z, zero], [zero, Z]]))
    return unit[:, None] * (frames[1] @ M @ frames[0].T) / unit


def _carry(a: Array, b: Array, c: Array) -> Array:
    """Return what carries (dq, dp) from start to end, of S_00 = a, S_01 = b and S_11 = c, (n, n).

    By p0 = -S_0 and p1 = S_1.
    """
    inverse = np.linalg.inv(b)
    return np.block([[-inverse @ a, -inverse], [b.T - c @ inverse @ a, -c @ inverse]])


def _balance(M: Array) -> Array:
    """Return units (2n,) of (q, p), each pair inverse, in which M's blocks are of one size."""
    n = len(M) // 2
    upper, lower = np.abs(M[:n, n:]).max(), np.abs(M[n:, :n]).max()
    ratio = np.sqrt(np.sqrt(upper / lower)) if upper > 0 and lower > 0 else 1.0
    return np.concatenate([np.full(n, ratio), np.full(n, 1 / ratio)])
