"""The equations of a path once more, with another quadrature.

A path is sampled where its nodes are. Forces that vary faster than it does (a narrow pulse, a kink
where a node happens to be, a total time derivative that should cancel) may be missed there, and
nothing in the path tells. Summed over other points its equations then no longer hold.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from actionopt.quadrature import Array

if TYPE_CHECKING:
    from actionopt.transcription.action import Transcription


def missed(tr: Transcription, x: Array) -> Array:
    """Return what another quadrature finds left of dS/dx, less what `tr` does, in its units."""
    total = np.concatenate([part.ravel() for part in _gradients(tr, x, other=True)])
    whole = np.bincount(tr.layout.scatter, total, tr.layout.node_count * tr.problem.system.n)
    return tr.free_part(whole) - tr.gradient(x)


def uneven(tr: Transcription, x: Array) -> Array:
    """Return how much each element has part in that, (N,)."""
    unit = tr.lengths / tr.action_unit
    shares = np.empty(tr.mesh.elements)
    both = _gradients(tr, x, other=True), _gradients(tr, x, other=False)
    for g, there, here in zip(tr.layout.groups, *both, strict=True):
        shares[g.elements] = np.abs((there - here) * unit).max(axis=(1, 2))
    return shares


def _gradients(tr: Transcription, x: Array, *, other: bool) -> list[Array]:
    """Return dS/dq (virtual work included) of the elements of each degree, (E, d + 1, n).

    Summed over the points of the `other` quadrature of each degree, or over the nodes.
    """
    system, p = tr.problem.system, tr.problem.packed
    Q, n = tr.place(x)[0], tr.problem.system.n
    q, v, t = [], [], []
    rules = [g.rule.other if other else g.rule.same for g in tr.layout.groups]
    for g, rule, half in zip(tr.layout.groups, rules, tr.halves, strict=True):
        local = Q[g.nodes]
        q.append((rule.values @ local).reshape(-1, n))
        v.append((rule.slopes @ (local - local[:, :1]) / half).reshape(-1, n))
        middle = tr.mesh.boundaries[g.elements, None] + half[:, 0]
        t.append((middle + half[:, 0] * rule.nodes).reshape(-1, 1))
    at = [parts[0] if len(parts) == 1 else np.concatenate(parts) for parts in (q, v, t)]
    force, momentum, _ = system.pointwise("first")(*at, p)
    if system.structure.forced:
        force = force + system.pointwise("force")(*at, p)[0]
    found, first = [], 0
    for g, rule, half in zip(tr.layout.groups, rules, tr.halves, strict=True):
        shape = g.elements.size, rule.nodes.size, n
        part = slice(first, first + shape[0] * shape[1])
        first = part.stop
        local = momentum[part].reshape(shape)
        constant = local[:, 0]  # its work is done at the element's ends alone
        work = rule.weighted_slopes @ (local - local[:, :1])
        work += half * (rule.weighted_values @ force[part].reshape(shape))
        work[:, 0] -= constant
        work[:, -1] += constant
        found.append(work)
    return found
