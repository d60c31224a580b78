"""What an obstacle pushes with along a path in contact: impulses, and forces between them."""

from __future__ import annotations

import numpy as np

from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.mechanics.question.obstacle import Arc
from actionopt.tools.types import Array


def impulses(at: DiscretePath, contacts: tuple[Arc, ...]) -> Array:
    """Return the impulses at the begin and the end of each arc, (contacts, 2)."""
    found, tr, mesh = np.zeros((len(contacts), 2)), at.tr, at.mesh
    if not len(found):
        return found
    m = at.problem.free.system.m
    weight = np.bincount(tr.layout.node_of, tr.weight[:, 0], tr.layout.node_count)
    for k, arc in enumerate(contacts):
        for i, t in enumerate((arc.begin, arc.end)[: 1 if arc.point else 2]):
            node = mesh.offsets[np.argmin(np.abs(mesh.boundaries - t))]
            if tr.order > 1:
                found[k, i] = -tr.row_multipliers(at.z)[node, arc.row]
            elif arc.point:
                found[k, i] = -at.rows[node, m + arc.row] * weight[node]
    return found + 0.0


def density(at: DiscretePath, contacts: tuple[Arc, ...], times: Array) -> Array:
    """Return the force of each row at times (...) of a path with accelerations, (r, ...)."""
    found = np.zeros((at.problem.free.system.r, times.size))
    if not contacts:
        return found.reshape(-1, *times.shape)
    tr, mesh, flat = at.tr, at.mesh, times.ravel()
    middle = (mesh.boundaries[:-1] + mesh.boundaries[1:]) / 2
    nu = -tr.contact_density(tr.row_multipliers(at.z))
    for arc in contacts:
        inside = np.flatnonzero((arc.begin < middle) & (middle < arc.end))
        if not inside.size:
            continue
        a, b = inside[0], inside[-1] + 1
        own = np.isin(tr.layout.element_of, inside)
        node = tr.layout.node_of[own] - mesh.offsets[a]
        values = np.bincount(node, nu[own, arc.row]) / np.bincount(node)
        here = (arc.begin <= flat) & (flat <= arc.end)
        found[arc.row, here] = Path(mesh.part(a, b), values[None])(flat[here])[0]
    return found.reshape(-1, *times.shape) + 0.0
