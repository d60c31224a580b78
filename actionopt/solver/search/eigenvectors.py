"""First paths along which integrals have given values: eigenvectors of the second variation.

Near a straight path that is nearly stationary, those with given integrals are to first order
eigenvectors x of S'' x = -kappa G'' x, where G'' is the second variation of the integrals: the
states of an oscillator, the modes of a rod that buckles. Where S and G are quadratic they are the
paths themselves.
"""

from __future__ import annotations

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.integrals import integrals
from actionopt.discrete.matrices.factors import full
from actionopt.discrete.meshes.mesh import Mesh, with_singular_ends
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.refinement.first_mesh import FIRST_TOL
from actionopt.tools.immutable import immutable
from actionopt.tools.types import EPS, RANK, Array, NDInt

# Ad hoc. Of the full matrices; and shifts, each so many times the last, until one is definite.
MOST_UNKNOWNS = 600
MOST_SHIFTS, SHIFTED = 24, 4.0
OWN_SIGN = 0.1  # of the largest entry: the first that is larger is positive


@immutable
class Eigenvectors:
    """The lowest eigenvectors, `rows` (count, unknowns), about a path at `origin` (unknowns,).

    They are the answers where S and one integral are quadratic, and the other integrals as asked.
    """

    tr: Transcription
    origin: Array
    rows: Array
    are_answers: bool


def eigenvectors(
    problem: Problem, straight: Path, mesh: Mesh, lengths: Array, count: int
) -> Eigenvectors | None:
    """Return the `count` lowest eigenvectors of a problem whose events have times.

    On a mesh whose elements are halved until their polynomials show them. None where they never do,
    the second variation of the integrals is not definite, or there are constraints or forces.
    """
    if problem.system.m or problem.system.structure.forced:
        return None
    mesh = with_singular_ends(mesh, problem.singular_ends)
    while True:
        found = _on_mesh(problem, straight, mesh, lengths, count)
        if found is None:
            return None
        rough = _rough_elements(found)
        if not rough.size:
            return found
        nodes = mesh.offsets[-1] + rough.size * max(mesh.degrees)
        if nodes * problem.system.n > MOST_UNKNOWNS:
            return None
        parts = np.ones(mesh.elements, dtype=int)
        parts[rough] = 2
        mesh = mesh.divide(parts, np.full(mesh.elements, max(mesh.degrees)))


def _on_mesh(
    problem: Problem, straight: Path, mesh: Mesh, lengths: Array, count: int
) -> Eigenvectors | None:
    asked = np.array(problem.integral)
    tr = Transcription(problem, mesh, lengths)
    origin = tr.pack(straight(tr.mesh.nodes).T)
    times = [event.t for event in problem.joints_found]
    with_all = problem.original.loose.found_at(times, kappa=np.ones(asked.size))
    both = tr, Transcription(with_all, mesh, lengths, like=tr)
    if origin.size != tr.layout.unknowns:
        return None
    S, G = (full(at.layout, at.kkt(origin)) for at in both)
    G = G - S
    reached, slopes = integrals(DiscretePath(tr, origin))
    if not all(np.isfinite(x).all() for x in (S, G, slopes)):
        return None
    held = np.abs(slopes).max(axis=1) > 0  # to first order: no eigenvector changes them
    basis = np.linalg.qr(slopes[held].T, mode="complete")[0][:, np.count_nonzero(held) :]
    S, G = (basis.T @ matrix @ basis for matrix in (S, G))
    G *= np.sign(np.trace(G))
    least, *_, largest = np.linalg.eigvalsh(G)
    if not least > -RANK * largest:
        return None
    half = _inverse_root(S, G)
    if half is None:
        return None
    vectors = np.linalg.eigh(half @ G @ half.T)[1][:, ::-1]
    rows = (basis @ (half.T @ vectors[:, :count])).T
    first = np.argmax(np.abs(rows) > OWN_SIGN * np.abs(rows).max(axis=1, keepdims=True), axis=1)
    rows /= np.sign(np.take_along_axis(rows, first[:, None], axis=1))
    rows /= np.abs(rows).max(axis=1, keepdims=True)
    at_rest = np.abs(tr.gradient(origin)).max() <= EPS
    as_asked = (reached == asked)[held].all() and np.count_nonzero(~held) == 1
    linear = with_all.system.structure.linear
    return Eigenvectors(tr, origin, rows, bool(linear and at_rest and as_asked))


def _inverse_root(S: Array, G: Array) -> Array | None:
    """Return the inverse of R, where R R' is S + s G for a number s that makes it definite."""
    shift = RANK * abs(np.trace(S)) / np.trace(G)
    for _ in range(MOST_SHIFTS):
        try:
            return np.linalg.inv(np.linalg.cholesky(S + shift * G))
        except np.linalg.LinAlgError:
            shift *= SHIFTED
    return None


def _rough_elements(found: Eigenvectors) -> NDInt:
    """Return the elements in which the polynomials of eigenvectors do not decay."""
    tr = found.tr
    rough = np.zeros(tr.mesh.elements, dtype=bool)
    straight = tr.coordinates(found.origin)
    for row in found.rows:
        shape = tr.coordinates(found.origin + row) - straight
        for g in tr.mesh.groups:
            last = np.abs(g.rule.to_legendre[-2:] @ shape[g.nodes]).max(axis=(1, 2))
            rough[g.elements] |= last > FIRST_TOL * np.abs(shape).max()
    return np.flatnonzero(rough)
