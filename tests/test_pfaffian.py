"""Differential constraints: what Frobenius' theorem says of textbook cases, and their motion."""

import numpy as np
import pytest
import systems
from helpers import at_once

import actionopt as ao
from actionopt import scenes
from actionopt.mechanics.pfaffian import frobenius, integrate_pfaffian

FORMULA_TOLERANCE = 1e-11


def rolling_sphere(q, *, R):
    """No slipping: x' = R w_y, y' = -R w_x, with w from Euler angles (z, x', z'') phi theta psi."""
    x, y, phi, theta, psi = q
    # w_x = theta' cos phi + psi' sin theta sin phi, w_y = theta' sin phi - psi' sin theta cos phi
    return [
        [1, 0, 0, -R * np.sin(phi), R * np.sin(theta) * np.cos(phi)],
        [0, 1, 0, R * np.cos(phi), R * np.sin(theta) * np.sin(phi)],
    ]


def not_spinning(q, *, R):
    """The same, and w_z = phi' + psi' cos theta = 0."""
    return [*rolling_sphere(q, R=R), [0, 0, 1, 0, np.cos(q[3])]]


CASES = [
    # rows, n, exact, integrable
    (lambda q: [1.0, -0.2], 2, True, True),
    (lambda q: [q[0], q[1], q[2]], 3, True, True),
    (lambda q: [-q[1], q[0]], 2, False, True),
    (lambda q: [q[1] * q[2], q[0] * q[2], q[0] * q[1]], 3, True, True),
    (lambda q: [np.exp(q[1]) * x for x in (q[1] * q[2], q[0] * q[2], q[0] * q[1])], 3, False, True),
    (lambda q: [-q[1], q[0], 1.0], 3, False, False),
    (lambda q: [np.sin(q[2]), -np.cos(q[2]), 0.0], 3, False, False),  # a skate
    # q1' = q2 q3', q2' = 0: the second condition makes the first integrable
    (lambda q: [[1.0, 0.0, -q[1]], [0.0, 1.0, 0.0]], 3, False, True),
]


@at_once(("rows", "n", "exact", "integrable"), CASES)
def test_integrability(rows, n, exact, integrable):
    found = frobenius(rows, n)
    assert (found.exact, found.integrable) == (exact, integrable)
    assert (found.row is None) == integrable and (found.defect == 0.0) == integrable


@pytest.mark.parametrize(("rows", "row"), [(rolling_sphere, 0), (not_spinning, 2)])
def test_a_sphere_rolling_on_a_plane_is_refused(rows, row):
    with pytest.raises(ValueError, match=rf"row {row} is not.*sphere.*non-holonomic"):
        integrate_pfaffian(rows, [0.1, 0.2, 0.3, 0.4, 0.5], parameters={"R": 1.0})


def test_rolling_in_differential_form_is_the_rolling_scene():
    scene = scenes.get("rolling_cylinder")
    known = scene.problem.system
    values = {k: float(x) for k, x in scene.problem.parameters.items()}

    def lagrangian(q, v, t, *, m, R, inertia, angle, g):
        kinetic = m * (v[0] ** 2 + inertia * (R * v[1]) ** 2) / 2
        return kinetic + m * g * q[0] * np.sin(angle)

    rolling = integrate_pfaffian(
        lambda q, *, R: [1.0, -R], scene.problem.start.q, parameters=values
    )
    system = ao.System(lagrangian, ["x", "phi"], parameters=values, constraint=rolling)
    assert system.degrees_of_freedom == known.degrees_of_freedom == 1
    solution = ao.solve(ao.Problem(system, scene.problem.start, scene.problem.end), tol=1e-11)
    t = np.linspace(0, scene.problem.end.t, 9)
    assert np.max(np.abs(solution(t) - scene.exact(t))) < FORMULA_TOLERANCE
    # friction: an exact row keeps its own multiplier
    assert np.max(np.abs(solution.multipliers(t) - scene.facts["friction"])) < 1e-9
    # another radius needs no other constraint
    other = ao.Problem(system, ao.Event(0, [0, 0]), ao.Event(1, [1.0, 2.0]), parameters={"R": 0.5})
    assert ao.solve(other).success


@pytest.mark.long
def test_a_leaf_of_two_rows_that_are_integrable_together():
    def rows(q):  # q2 constant, and then q1 - q2 q3 constant
        return [[1.0, 0.0, -q[1]], [0.0, 1.0, 0.0]]

    f = integrate_pfaffian(rows, [0.5, 2.0, 1.0])
    system = systems.particle("a b c", constraint=f)
    on = np.array([0.5 + 2.0 * 0.7, 2.0, 1.7])
    assert np.max(np.abs(system.constraint(on, 0.0))) < FORMULA_TOLERANCE
    assert np.max(np.abs(system.constraint(on + [0, 0, 0.1], 0.0))) > 0.09


def test_other_mistakes_are_explained():
    with pytest.raises(ValueError, match="independent rows"):
        frobenius(lambda q: [[1.0, q[0]], [2.0, 2 * q[0]]], 2)
    with pytest.raises(ValueError, match="needs the parameter 'R'"):
        frobenius(lambda q, *, R: [1.0, -R], 2)
    with pytest.raises(ValueError, match="2 values, found 3"):
        integrate_pfaffian(lambda q: [1.0, 2.0, 3.0], [0.0, 0.0])
    with pytest.raises(ValueError, match="zero there"):
        integrate_pfaffian(lambda q: [-q[1], q[0]], [0.0, 0.0])
