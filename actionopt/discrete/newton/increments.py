"""Newton's matrix of a path with accelerations, where short elements are stiffer than digits allow.

An element of length h holds its ends together by 1 / h^(2 r - 1), times the inertia, and leaves a
polynomial of degree r - 1 alone. In a matrix by the values at both ends it does so by cancellation,
whose round-off acts like a spring to which the element is clamped: from h = 1e-5 of the duration on
it may hold the path more than all else does. By the values at the start and what the end differs
from the polynomial through them, the increments, nothing cancels. Each node is eliminated from the
last one back, its increment given the node before: Riccati's recursion (A. E. Bryson and Y.-C. Ho,
*Applied Optimal Control* (1975), section 5.3), in which stiff increments are large pivots.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.action import assemble_blocks
from actionopt.discrete.action.equations import Equations
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.factors import Factors
from actionopt.discrete.matrices.layout import BorderedLayout
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, Array

# Round-off of the stiffest element over the stiffness of a whole, above which it counts; ad hoc.
STIFF = 1e-3
PROBE_STEP = 1e-5  # in the coordinates' units: small, and far above their round-off; ad hoc


def is_stiff(equations: Equations, z: Array) -> bool:
    """Return whether the round-off of short elements holds the path noticeably."""
    order = equations.layout.system.order
    if order == 1:
        return False
    mesh = equations.at(z).mesh
    return EPS * (mesh.duration / mesh.lengths.min()) ** (2 * order - 1) > STIFF


def factorize(
    equations: Equations, z: Array, *, many: bool = False, nonzeros: Array | None = None
) -> Factors:
    """Return factors of the matrix at z, or of the `nonzeros` given; `many` as `Factors` has it.

    Raises numpy.linalg.LinAlgError as that.
    """
    if nonzeros is None:
        nonzeros = equations.kkt(z)
    if is_stiff(equations, z) and not (equations.layout.rows or equations.layout.closed):
        return Increments(equations, z, nonzeros)
    return Factors(equations.layout, nonzeros, many=many)


def is_reliable(equations: Equations, factors: Factors, z: Array, residual: Array) -> bool:
    """Return whether solutions are right to a half, where the matrix itself may not be.

    By a difference of residuals, which short elements do not round: from that at z.
    """
    smooth = factors.solve(factors.layout.probe)
    smooth = smooth * (PROBE_STEP / np.linalg.norm(smooth))
    back = factors.solve(equations.residual(z + smooth) - residual)
    return bool(np.linalg.norm(back - smooth) < PROBE_STEP / 2)


@immutable
class _Step:
    """An element: how it leads from the node x before it to the next one, A x + e.

    Where the next node is free u are its increments e: H u + G x = right; where it is pinned e is
    what A x asks for. And K by the node before.
    """

    inverse: Array  # of H
    by_node: Array  # G
    back: Array  # what u does to the equations of the node before
    onward: Array  # F A, of the free places F
    pinned: Array  # (1 - F) A
    free: Array


class Increments(Factors):
    """Factors of the matrix of a path without constraints that does not close, as above.

    The `nonzeros` are those of `equations.kkt(z)`, less `shift` times the kinetic part. A border is
    eliminated first, by as many solutions.
    """

    def __init__(self, equations: Equations, z: Array, nonzeros: Array, shift: float = 0.0) -> None:
        super().__init__(equations.layout, nonzeros)
        if not isinstance(self.layout, BorderedLayout):
            self._of_path = _Recursion(equations.at(z), z, nonzeros, shift)
            return
        K, B, self._rows, corner = self.layout.split(nonzeros)
        self._of_path = _Recursion(equations.at(z), z[: len(B)], K, shift)
        self._columns = np.stack([self._of_path.solve(column) for column in B.T], axis=1)
        self._corner = corner - self._rows @ self._columns

    def solve(self, right: Array, enough: float = 0.0) -> Array:
        """Return the solution for one right-hand side, (size,)."""
        if not isinstance(self.layout, BorderedLayout):
            return self._of_path.solve(right)
        x = self._of_path.solve(right[: len(self._columns)])
        beside = np.linalg.solve(self._corner, right[len(x) :] - self._rows @ x)
        return np.concatenate([x - self._columns @ beside, beside])

    def solve_both(self, one: Array, other: Array) -> tuple[Array, Array]:
        """Return the solutions for two right-hand sides."""
        return self.solve(one), self.solve(other)

    def negative(self) -> int:
        """Return the number of negative eigenvalues of a symmetric matrix (its inertia)."""
        pivots = self._of_path.pivots
        if isinstance(self.layout, BorderedLayout):
            pivots = [*pivots, (self._corner + self._corner.T) / 2]
        return sum(int((np.linalg.eigvalsh(M) < 0).sum()) for M in pivots if M.size)


class _Recursion:
    """The factors of the path's own matrix; its `pivots` are symmetric where that is."""

    def __init__(self, tr: Transcription, z: Array, nonzeros: Array, shift: float) -> None:
        self.layout = layout = tr.layout
        r, n = tr.order, tr.problem.system.n
        f, N = layout.width, tr.mesh.elements
        self._groups = layout.groups
        at = np.arange(f)
        S, A, self._inner = np.empty((N, 2 * f, 2 * f)), np.empty((N, f, f)), []
        for k, M in enumerate(assemble_blocks.by_increments(tr, z, shift)):
            g, shape = layout.groups[k], layout.shapes[k]
            ends, inside = np.r_[at, M.shape[1] - f + at], np.arange(f, M.shape[1] - f)
            inverse = np.linalg.inv(M[:, inside[:, None], inside])
            by_ends, back = M[:, inside[:, None], ends], M[:, ends[:, None], inside]
            S[g.elements] = M[:, ends[:, None], ends] - back @ inverse @ by_ends
            self._inner.append((M[:, inside[:, None], inside], inverse, by_ends, back))
            scale = tr.halves[k].reshape(-1, 1) ** np.arange(r)
            scale = (scale[:, :, None] * tr.place_units.reshape(r, n)).reshape(-1, f)
            carried = np.kron(shape.taylor[1], np.eye(n))
            A[g.elements] = carried * scale[:, None] / scale[:, :, None]
        at_nodes = layout.blocks.split(nonzeros)[1]
        number = np.zeros(layout.node_count * f, dtype=bool)
        number[layout.free] = True
        free = number.reshape(-1, f)[layout.offsets]
        self._steps: list[_Step] = []
        self.pivots: list[Array] = []
        P = at_nodes[N]
        for k in range(N - 1, -1, -1):
            F, ss, se, es, ee = free[k + 1], S[k, :f, :f], S[k, :f, f:], S[k, f:, :f], S[k, f:, f:]
            onward, pinned = A[k] * F[:, None], A[k] * ~F[:, None]
            H = (ee + P)[F][:, F]
            G = (es - ee @ pinned + P @ onward)[F]
            back = (se - pinned.T @ ee + onward.T @ P)[:, F]
            inverse = np.linalg.inv(H)
            P = ss - se @ pinned - pinned.T @ (es - ee @ pinned) + onward.T @ P @ onward
            P = at_nodes[k] + P - back @ inverse @ G
            self.pivots.append(H)
            self._steps.append(_Step(inverse, G, back, onward, pinned, F))
        self._first, self._pivot = free[0], P[free[0]][:, free[0]]
        self.pivots += [self._pivot, *(M for M, *_ in self._inner)]

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side, (size,)."""
        layout, f, n = self.layout, self.layout.width, self.layout.system.n
        whole = np.zeros(layout.node_count * f)
        whole[layout.free] = right
        at_nodes = whole.reshape(-1, f)[layout.offsets]
        N = len(self._steps)
        pulled, inside = np.zeros((N, 2 * f)), []
        for g, (_, inverse, _, back) in zip(self._groups, self._inner, strict=True):
            r = f // n
            b = whole.reshape(-1, f)[g.nodes[:, r:-r], :n].reshape(len(g.nodes), -1, 1)
            inside.append(inverse @ b)
            pulled[g.elements] = -(back @ inside[-1])[:, :, 0]
        moved, load = [], at_nodes[N]
        for step, k in zip(self._steps, range(N - 1, -1, -1), strict=True):
            start, end = pulled[k, :f], pulled[k, f:]
            u = step.inverse @ (load + end)[step.free]
            moved.append(u)
            load = at_nodes[k] + start + step.onward.T @ load - step.pinned.T @ end - step.back @ u
        x = np.zeros((N + 1, f))
        x[0, self._first] = np.linalg.solve(self._pivot, load[self._first])
        both = np.zeros((N, 2 * f))
        for k, (step, u) in enumerate(zip(self._steps[::-1], moved[::-1], strict=True)):
            e = -step.pinned @ x[k]
            e[step.free] = u - step.inverse @ (step.by_node @ x[k])
            both[k, :f], both[k, f:] = x[k], e
            x[k + 1] = np.where(step.free, step.onward @ x[k] + e, 0.0)
        found = whole.reshape(-1, f)
        for g, (_, inverse, by_ends, _), own in zip(self._groups, self._inner, inside, strict=True):
            own = own - inverse @ (by_ends @ both[g.elements][:, :, None])
            r = f // n
            found[g.nodes[:, r:-r], :n] = own.reshape(len(g.nodes), -1, n)
        found[layout.offsets] = x
        return found.ravel()[layout.free]
