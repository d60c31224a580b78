"""Piecewise polynomials of scipy's, made of values at the nodes of a mesh, and read as such."""

from __future__ import annotations

from math import comb
from typing import Any

import numpy as np

from actionopt.discrete.meshes.mesh import Mesh
from actionopt.tools.types import Array

MEETING = 1e-8  # of the largest value: pieces that are further apart do not meet; ad hoc


def make_ppoly(mesh: Mesh, legendre: list[Array]) -> Any:
    """Return a PPoly of n coordinates, given by each element's Legendre coefficients (n, d + 1).

    Raises ImportError if scipy is not installed.
    """
    try:
        from scipy.interpolate import PPoly
    except ImportError as error:
        raise ImportError(
            "expected scipy to be installed, found none; install it by pip"
        ) from error

    order = max(mesh.degrees)
    c = np.zeros((len(legendre[0]), order + 1, mesh.elements))
    for e, coefficients in enumerate(legendre):
        d = coefficients.shape[1] - 1
        rising = coefficients @ _shifted_legendre(d) / mesh.lengths[e] ** np.arange(d + 1)
        c[:, order - d :, e] = rising[:, ::-1]
    return PPoly(c, mesh.boundaries, axis=1)


def _shifted_legendre(degree: int) -> Array:
    """Return the coefficients of s^j, columns, in P_k(2 s - 1), rows: (d + 1, d + 1)."""
    return np.array(
        [
            [(-1.0) ** (k + j) * comb(k, j) * comb(k + j, j) for j in range(degree + 1)]
            for k in range(degree + 1)
        ]
    )


def is_piecewise(curve: Any) -> bool:
    """Whether it is one of scipy's splines, told by what it has."""
    return callable(curve) and hasattr(curve, "c") and hasattr(curve, "axis")


def read_pieces(pieces: Any) -> tuple[Mesh, Array]:
    """Return the mesh of piecewise polynomials and their values (n, K) at its nodes.

    Raises ValueError for anything else, and where pieces do not meet.
    """
    if not is_piecewise(pieces):
        raise ValueError(
            "expected piecewise polynomials of scipy, such as a PPoly, a CubicSpline, a BSpline or "
            f"solve_bvp(...).sol, found {pieces!r}; Path.interpolate makes a path of a callable"
        )
    knots = pieces.t[pieces.k : len(pieces.t) - pieces.k] if hasattr(pieces, "t") else pieces.x
    degree = max(pieces.k if hasattr(pieces, "t") else len(pieces.c) - 1, 1)
    mesh = Mesh(np.unique(knots), degree)
    values = _rows(pieces, mesh.nodes)
    for g in mesh.groups:
        x = g.rule.other.nodes
        mid, half = (mesh.boundaries[1:] + mesh.boundaries[:-1])[:, None] / 2, mesh.lengths / 2
        there = _rows(pieces, (mid + half[:, None] * x).ravel())
        here = (values[:, g.nodes] @ g.rule.other.values.T).reshape(there.shape)
        inside = np.tile(np.abs(x) < 1, mesh.elements)
        gap = np.abs(here - there)[:, inside].max()
        if not gap <= MEETING * np.abs(values).max():
            raise ValueError(
                f"expected pieces that meet, as a path is continuous, found gaps of {gap:g} or so"
            )
    return mesh, values


def _rows(pieces: Any, t: Array) -> Array:
    """Return their values at times (K,) as (n, K), whichever axis is that of the times."""
    values = np.asarray(pieces(t), dtype=float)
    return np.moveaxis(values, pieces.axis, -1).reshape(-1, t.size)
