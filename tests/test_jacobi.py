"""Jacobi fields on the elements of a path, and the mesh that resolves them."""

import numpy as np
import pytest
import systems
from helpers import at_once

import actionopt as ao
from actionopt import Event, Mesh, Problem, System
from actionopt.analysis.quadratic.jacobi import _stationary, fields, finer, improve
from actionopt.analysis.quadratic.second_variation import form
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath


def at_rest(lagrangian, T=1.0, elements=5, degree=12, start=0.0):
    """Return d2S at the path q = 0 of one coordinate."""
    system = System(lagrangian, ["x"])
    problem = Problem(system, Event(start, [0.0]), Event(start + T, [0.0]))
    mesh = Mesh.uniform(start, start + T, elements, degree)
    path = Path(mesh, np.zeros((1, mesh.nodes.size)))
    return form(DiscretePath.of(problem, path, lengths=np.ones(1)))


@at_once("push", [3.0, -3.0])
@at_once("start", [0.0, -7.0])
@at_once("element", range(5))
def test_a_coefficient_that_varies_within_one_element_refines_that_one(element, start, push):
    centre = start + (element + 0.5) / 5

    def lagrangian(q, v, t):
        return v[0] ** 2 / 2 - push * np.exp(-(((t - centre) / 0.02) ** 2)) * q[0] ** 2 / 2

    found = at_rest(lagrangian, start=start)
    mesh = finer(found.tr.mesh, 1e-4, form=found)
    inside = (mesh.boundaries[:-1] >= start + element / 5 - 1e-9) & (
        mesh.boundaries[1:] <= start + (element + 1) / 5 + 1e-9
    )
    changed = (np.array(mesh.degrees) != 12) | (mesh.lengths < 0.19)
    assert np.array_equal(changed, inside)


@pytest.mark.parametrize("w", [0.5, 2.0, 9.0])
def test_fields_of_an_oscillator_are_sines(w):
    found = at_rest(lambda q, v, t: (v[0] ** 2 - w**2 * q[0] ** 2) / 2, elements=4)
    mesh = found.tr.mesh
    last = None
    for a, first, after in zip(fields(found)[0], mesh.offsets[:-1], mesh.offsets[1:], strict=True):
        sine = np.sin(w * mesh.nodes[first : after + 1])
        field = a[:, 0, 0]
        scale = (field @ sine) / (sine @ sine)
        assert np.max(np.abs(field - scale * sine)) <= 1e-9 * abs(scale)
        assert last is None or scale != 0
        last = scale


def conjugate_ends(start, end):
    system = systems.oscillator()
    problem = Problem(system, Event(0.0, [start]), Event(np.pi, [end]))
    return Transcription(problem, Mesh.uniform(0.0, np.pi, 6, 14), np.ones(1))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("bump", [0.3, -0.3])
def test_a_path_of_a_family_is_found_near_by(side, bump):
    """Half a period from x to -x: what is no part of the family goes, the rest may stay."""
    tr = conjugate_ends(side, -side)
    t = tr.mesh.nodes[:, None]
    near = tr.pack(side * np.cos(t) + bump * np.exp(-(((t - 1) / 0.3) ** 2)) * np.sin(t))
    found, force = _stationary(tr, near, 1)
    assert np.max(np.abs(tr.residual(found))) <= 1e-12 and force <= 1e-12
    rest = tr.coordinates(found) - side * np.cos(t)
    size = (rest * np.sin(t)).sum() / (np.sin(t) ** 2).sum()
    assert np.max(np.abs(rest - size * np.sin(t))) <= 1e-11
    far = tr.pack(side * np.cos(t) + 5 * bump * np.exp(-(((t - 1) / 0.3) ** 2)) * np.sin(t))
    assert _stationary(tr, far, 1) is None  # another one, if any


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("miss", [1e-3, -1e-3])
def test_no_path_is_found_where_there_is_none(side, miss):
    """Only a force in proportion to the miss would hold one."""
    tr = conjugate_ends(side, -side + miss)
    _, force = _stationary(tr, tr.pack(side * np.cos(tr.mesh.nodes[:, None])), 1)
    assert abs(miss) / 10 < force < 10 * abs(miss)


@pytest.mark.long
@pytest.mark.parametrize("off", [1e-4, pytest.param(-1e-4, marks=pytest.mark.slow)])
def test_a_path_of_a_family_is_polished_with_its_duration(off):
    """All motions of an isotropic oscillator close in 2 pi, and none in the times beside."""
    system = systems.oscillator("x y")
    asked = Problem(system, Event(0.0, None), ao.Periodic(None), energy=1.0)
    mesh = Mesh.uniform(0.0, 2 * np.pi + off, 8, 4)
    s = mesh.nodes * 2 * np.pi / mesh.duration
    path = Path(mesh, np.array([np.cos(s), 0.9 * np.sin(s)]))
    at = DiscretePath.of(asked.found_at([0.0, mesh.duration]), path)
    found, _ = improve(at, 1e-9, 1, with_form=True)
    assert found.mesh.duration == pytest.approx(2 * np.pi, rel=1e-9)
    q, v = found.Q.T, found.path.velocity(found.mesh.nodes)
    assert np.abs((q * q + v * v).sum(axis=0) / 2 - 1.0).max() <= 1e-6


@at_once("angle", [0.3, 2.0, 3.7, 5.5])
@at_once("size", [0.95, 1.05])
def test_a_nonlinear_family_is_approached_to_rounding(angle, size):
    """From the centre of a quartic bowl and back: any direction will do, with one amplitude."""
    bowl = System(lambda q, v, t: v @ v / 2 - (q @ q) ** 2 / 4, ["x", "y"])
    line = System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 4 / 4, ["x"])
    T, mesh = 2.0, Mesh.uniform(0.0, 2.0, 4, 12)
    along = ao.solve(
        Problem(line, Event(0.0, [0.0]), Event(T, [0.0])),
        guess=lambda t: [1.854 * np.sin(np.pi * t / T)],
        tol=1e-12,
    )
    known = along(mesh.nodes)[0]
    assert np.max(known) == pytest.approx(7.4163 / 4, rel=1e-4)  # of a period 7.4163 / amplitude
    problem = Problem(bowl, Event(0.0, [0.0, 0.0]), Event(T, [0.0, 0.0]))
    tr = Transcription(problem, mesh, np.full(2, 1.854))
    Q = size * known[:, None] * [np.cos(angle), np.sin(angle)]
    found = tr.coordinates(_stationary(tr, tr.pack(Q), 1)[0])
    assert np.max(np.abs(np.linalg.norm(found, axis=1) - known)) <= 1e-9
