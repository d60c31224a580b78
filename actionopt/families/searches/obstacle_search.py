"""Curves to all sides of an obstacle, from which least paths along it are sought."""

from __future__ import annotations

import numpy as np

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.contact.first_contacts import lines

SIDE_SPREAD = np.array([0.3, 1.0, 3.0])  # of the coordinates' sizes, how far curves go to a side
CURVE_WAVES, CURVE_ELEMENTS = 3, 64  # sines of a curve, and its elements; ad hoc


def curves(problem: Problem, starts: int, seed: int) -> list[Path | None]:
    """Return the straight line (None), lines past all of the obstacle on either side, and others.

    Those are `starts` random curves and their mirror images.
    """
    degree = 2 * problem.system.order - 1  # the least that there is
    mesh = Mesh.uniform(problem.start.t, problem.end.t, CURVE_ELEMENTS, degree)
    line = Transcription(problem, mesh, problem.lengths).straight().T
    sines = np.sin(
        np.pi * np.outer(np.arange(1, CURVE_WAVES + 1), mesh.nodes_since / mesh.duration)
    )
    drawn = np.random.default_rng(seed).standard_normal((starts, problem.system.n, CURVE_WAVES))
    drawn *= np.resize(SIDE_SPREAD, starts)[:, None, None] / np.arange(1, CURVE_WAVES + 1)
    aside = [sign * problem.measures[:, None] * (a @ sines) for a in drawn for sign in (1, -1)]
    return [*lines(problem, mesh), *(Path(mesh, line + away) for away in aside)]
