"""What a live page knows of a problem: its law, a mesh that resolves its path, and the answer."""

from __future__ import annotations

from typing import Any

import numpy as np

from actionopt.analysis.solution import Solution
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.mechanics.question.problem import Periodic, Problem
from actionopt.plot._names import NO_UNITS, UnitNames, planar
from actionopt.plot.data.exploration import LONGEST_CONTINUED, motion
from actionopt.plot.live.law import law
from actionopt.solver.solve import solve
from actionopt.tools.greek import letter
from actionopt.tools.lobatto import lgl
from actionopt.tools.types import Array

HANDLE_SPANS = 8  # between the handles
# Elements and degrees, from what costs a page least: the first that has S is taken.
PAGE_MESHES = ((8, 6), (8, 8), (8, 10), (8, 14), (16, 10), (16, 14), (32, 12), (64, 12))
SAME_S = 1e-10  # of S, and of how far S ranges on the way, where it cancels


def data(problem: Problem, solution: Solution, units: UnitNames = NO_UNITS) -> dict[str, Any]:
    """Return what the page needs to compute, for JSON.

    Raises ValueError as `check` does.
    """
    check(problem)
    if problem.asked is not None:  # the page keeps the times that were found
        solution = solution.between_times
        problem = solution.problem
    system, names = problem.system, problem.system.coordinates
    found = on_small_mesh(problem, solution)
    mesh = found.mesh
    rule = lgl(mesh.degrees[0])
    continued = motion(solution, problem.start.t + LONGEST_CONTINUED * problem.duration)
    return {
        "law": law(system),
        "rule": {
            "nodes": rule.nodes.tolist(),
            "weights": rule.weights.tolist(),
            "derivative": rule.derivative.tolist(),
            "barycentric": rule.barycentric.tolist(),
        },
        "elements": mesh.elements,
        "spans": HANDLE_SPANS,
        "start": problem.start.t,
        "duration": problem.duration,
        "longest": continued.end - problem.start.t,
        "q0": list(problem.start.q),
        "q1": list(problem.end.q),
        "p": problem.packed[0].tolist(),
        "sizes": problem.lengths.tolist(),
        "answer": found.path(mesh.nodes).T.ravel().tolist(),
        "action": solution.action,
        "conjugate": None if None in (*problem.start.q, *problem.end.q) else continued.times,
        "parameters": _parameters(problem),
        "coordinates": [
            {
                "name": letter(name),
                "unit": units.coordinate(name),
                "force": units.generalized_force(name),
            }
            for name in names
        ],
        "pairs": planar(names),
        "units": {"time": units.time, "energy": units.energy, "action": units.action},
    }


def check(problem: Problem) -> None:
    """Raise ValueError for a question that a page cannot ask, or a law that it cannot compute."""
    found = (
        "a path that closes: its end follows its start; give the end event of one turn"
        if isinstance(problem.end, Periodic)
        else "a time that is free; give it the time that `solve` finds"
        if problem.free_time
        else "an event on a surface; give it the place that `solve` finds"
        if problem.on_surface
        else "an event at infinite time; give it a time"
        if problem.is_infinite or problem.has_tails
        else "an obstacle, which a path along it touches only in parts; leave it out"
        if problem.system.r
        else ""
    )
    if found:
        raise ValueError(
            "expected events at two times that pin the ends or leave them free, and nothing else "
            f"for the path of a page to obey but constraints, found {found}"
        )
    law(problem.system)


def on_small_mesh(problem: Problem, solution: Solution) -> Solution:
    """Return the solution on the first of `PAGE_MESHES` whose action is that of the path."""
    size = abs(solution.action) + float(np.ptp(_running(solution)))
    found = solution
    for elements, degree in PAGE_MESHES:
        mesh = Mesh.uniform(problem.start.t, problem.end.t, elements, degree)
        found = solve(problem, guess=solution, mesh=mesh, throw=False)
        if abs(found.action - solution.action) <= SAME_S * size:
            return found
    return found


def _running(solution: Solution) -> Array:
    """Return the action up to each of the mesh's boundaries, roughly."""
    t = np.linspace(solution.problem.start.t, solution.problem.end.t, 200)
    L = solution.problem.system.lagrangian(
        solution(t), solution.velocity(t), t, parameters=solution.problem.parameters
    )
    return np.cumsum(L) * (t[1] - t[0])


def _parameters(problem: Problem) -> list[dict[str, Any]]:
    """Return the parameters that may slide: numbers of which the constraints know nothing.

    An event that lies on a surface would lie on no other.
    """
    system, found, place = problem.system, [], 0
    held = set()
    if system.m:
        held = set(system.pointwise("constraint").function.jac_sparsity(0, 2).get_col())
    for name, value in system.table.values(problem.parameters).items():
        count = int(np.size(value))
        for k, x in enumerate(np.ravel(value)):
            if place + k not in held:
                label = letter(name) + (f"[{k}]" if np.ndim(value) else "")
                found.append({"name": label, "place": place + k, "value": float(x)})
        place += count
    return found
