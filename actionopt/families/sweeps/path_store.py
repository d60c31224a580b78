"""Paths of many members, packed in a few arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cached_property

import numpy as np

from actionopt.discrete.meshes.mesh import Mesh, with_singular_ends
from actionopt.discrete.meshes.path import Path
from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array, NDInt


@immutable
class PackedPaths:
    """Paths of k members."""

    members: NDInt  # (k,): their numbers in a grid
    times: Array  # (k, 2)
    elements: NDInt  # (k,): how many each has
    # since, degrees, values: one member after the other: `Mesh.since`, degrees, and coordinates row
    # by row.
    since: Array
    degrees: NDInt
    values: Array
    passed: Array  # (k, events): when each passes the events between its ends

    def __repr__(self) -> str:
        return f"PackedPaths({self.members.size} paths)"

    @classmethod
    def of(cls, members: NDInt, paths: Sequence[Path]) -> PackedPaths:
        """Pack paths, one of each member."""

        def row(parts: list[Array], kind: type) -> Array:
            return np.concatenate([np.zeros(0, kind), *parts])

        # Elements with singular ends become others, whose polynomials are as near as the paths.
        events = len(paths[0].passed) if paths else 0
        passed = np.array([path.passed for path in paths], dtype=float).reshape(len(paths), events)
        meshes = [with_singular_ends(path.mesh, (0, 0)) for path in paths]
        pairs = zip(paths, meshes, strict=True)
        paths = [path if path.mesh is mesh else path.on(mesh) for path, mesh in pairs]
        return cls(
            np.asarray(members, dtype=int),
            np.array([mesh.boundaries[[0, -1]] for mesh in meshes]).reshape(-1, 2),
            np.array([mesh.elements for mesh in meshes], dtype=int),
            row([mesh.since for mesh in meshes], float),
            row([np.array(mesh.degrees) for mesh in meshes], int),
            row([path.values.ravel() for path in paths], float),
            passed,
        )

    def pack(self, name: str) -> dict[str, Array]:
        """Return the arrays by names that begin with `name`."""
        return {f"{name}_{f.name}": getattr(self, f.name) for f in fields(self)}

    @classmethod
    def unpack(cls, arrays: Mapping[str, Array], name: str) -> PackedPaths:
        """Return what was packed under a name."""
        return cls(*(arrays[f"{name}_{f.name}"] for f in fields(cls)))

    @cached_property
    def _first(self) -> tuple[NDInt, NDInt]:
        """Where the degrees and the nodes of each member begin, and where the last one ends."""
        elements = np.concatenate([[0], np.cumsum(self.elements)])
        through = np.concatenate([[0], np.cumsum(self.degrees)])
        return elements, through[elements] + np.arange(elements.size)

    def path(self, member: int) -> Path | None:
        """Return the path of a member, or None if it is not here."""
        found = np.flatnonzero(self.members == member)
        if not found.size:
            return None
        k = found[0]
        elements, nodes = self._first
        a, b = elements[k : k + 2]
        since = self.since[a + k : b + k + 1]
        t0, t1 = self.times[k].tolist()
        mesh = Mesh.over(t0, t1, since, self.degrees[a:b])
        n = self.values.size // nodes[-1]
        values = self.values[n * nodes[k] : n * nodes[k + 1]].reshape(n, -1)
        return Path(mesh, values, passed=tuple(self.passed[k].tolist()))


def find(kept: Sequence[PackedPaths], member: int) -> Path | None:
    """Return the path of a member, the latest of several, or None."""
    return next((p for x in reversed(kept) if (p := x.path(member)) is not None), None)
