"""The chapter comes out, closed forms and published values too, and nobody pays for others."""

import importlib

import numpy as np
import pytest
from helpers import a_quarter, at_once

import actionopt as ao
from actionopt import chapter, cli, scenes
from actionopt.chapter import ROWS, Line, Row
from actionopt.chapter._row import other_numbers
from actionopt.scenes._scene import system as derived

TOL = 1e-11
CLOSED_FORM = 1e-10  # of a path and its action, at tol = 1e-11


@pytest.mark.quick(
    "12.2-varied path q + alpha eta of a",
    "12.3.1-free and bound particle in a f",
    "12.4-particle in an inverted cone",
    "12.4-degrees of freedom: conditions",
)
@pytest.mark.parametrize("row", a_quarter(ROWS), ids=lambda row: f"{row.section}-{row.system[:30]}")
def test_every_row_comes_out(row):
    lines = list(row.check())
    assert lines
    assert [line for line in lines if not line.agrees] == []


def test_rows_are_in_the_chapter_s_order_and_cover_it():
    sections = [row.section for row in ROWS]
    assert sections == sorted(sections)
    assert {"12.2", "12.3", "12.3.1", "12.3.2", "12.4", "12.5.1", "12.5.2", "12.5.4"} <= {*sections}


def test_a_line_agrees_within_its_tolerance_only():
    assert Line("x", 2.0, 2.0 + 1e-11).agrees
    assert not Line("x", 2.0, 2.0 + 1e-9).agrees
    assert not Line("x", 2.0, np.nan).agrees
    assert not Line("x", True, False).agrees and Line("x", "a", "a").agrees
    assert Line("x", 1e6, 1e6 + 1e-5).error == pytest.approx(1e-11, rel=1e-3)


# -- the command ---------------------------------------------------------------------------------


def test_command_prints_expected_found_and_error(capsys):
    assert cli.main(["chapter", "12.5.3"]) == 0
    printed = capsys.readouterr().out
    assert "two particles on a line" in printed and "12.4" not in printed
    assert all(word in printed for word in ("expected", "found", "error", "0 missed"))
    [drift] = [line for line in printed.splitlines() if "drift" in line]
    assert len(drift.split()) == 5


def test_command_fails_if_anything_misses(capsys, monkeypatch):
    def check():
        yield Line("good", 1.0, 1.0)
        yield Line("g", 9.81, 9.82)

    monkeypatch.setattr(chapter, "ROWS", (Row("12.9", "a row that misses", check),))
    assert cli.main(["chapter"]) == 1
    printed = capsys.readouterr().out
    [missed] = [line for line in printed.splitlines() if "MISSED" in line]
    assert missed.split()[:3] == ["g", "9.81", "9.82"]
    assert "2 comparisons, 1 missed" in printed


def test_command_names_the_sections(capsys):
    assert cli.main(["chapter", "13"]) == 1
    assert "12.3.1" in capsys.readouterr().err


# -- accuracy and costs ----------------------------------------------------------------------


def test_other_numbers_are_other_numbers():
    assert other_numbers("kepler")["mu"] != scenes.parameters("kepler")["mu"]
    assert "links" not in other_numbers("chain")


@pytest.mark.quick("turning_wire-spared1-paid1", "damped_oscillator-spared2-paid2")
@pytest.mark.parametrize(
    ("name", "spared", "paid"),
    [
        ("kepler", ("constraint", "force"), ("second",)),
        ("turning_wire", ("force", "curvature"), ("constraint_jacobian",)),
        ("damped_oscillator", ("constraint",), ("force", "force_jacobian")),
        ("rod_pendulum", ("force",), ("constraint_curvature",)),
    ],
)
def test_what_a_scene_does_not_use_costs_nothing(name, spared, paid):
    """Neither derived nor evaluated; on a system of its own, that nothing else has asked."""
    scene, file = scenes.get(name), importlib.import_module(f"actionopt.scenes.{name}")
    system = derived.__wrapped__(file, scene.problem.system.coordinates)
    events = scene.problem.start, scene.problem.end
    stats = ao.solve(ao.Problem(system, *events), tol=TOL, guess=scene.guess).stats
    for used in (stats["derived"], stats["evaluations"]):
        assert not [function for function in used if any(word in function for word in spared)]
        assert all(function in used for function in paid)
    assert (stats["rows"] > 0) == any("constraint" in word for word in paid)
    if system.structure.linear:
        assert "ipopt" not in stats["iterations"]


# -- published values ------------------------------------------------------------------------


@at_once(
    ("duration", "S", "index"),
    [
        (1.0, 0.435769830834361359, 0),
        (2.5, -0.0373144326408811096, 0),
        (4.0, -0.0270127940596106813, 1),
        (7.0, 0.652420695635872722, 2),
        (10.0, 0.0612673713666770404, 3),
        (13.0, 1.12612253020643422, 4),
    ],
)
def test_oscillator_of_feynman_and_hibbs(duration, S, index):
    """Problem 3-8: S = ((a^2 + b^2) cos T - 2 a b) / (2 sin T) with a = 0.3, b = -0.7."""
    scene = scenes.get("oscillator", start=0.3, end=-0.7, duration=duration)
    solution = ao.solve(scene.problem, tol=TOL)
    assert abs(solution.action - S) < CLOSED_FORM
    assert solution.morse_index == index


def test_pendulum_of_the_test_set_for_differential_algebraic_equations():
    """J. Cash, driver pendul3.f of MEBDFDAE: from (1, 0) upwards at speed 1, with g = 1."""
    system = scenes.get("rod_pendulum").problem.system
    end = [0.867348640604551746, 0.497701050476373918]  # good to 4e-12
    problem = ao.Problem(
        system,
        ao.Event(0.0, [1.0, 0.0]),
        ao.Event(1.0, np.array(end) / np.hypot(*end)),
        parameters={"m": 1.0, "l": 1.0, "g": 1.0},
    )
    solution = ao.solve(problem, tol=TOL)
    assert np.max(np.abs(solution.start.v - [0.0, 1.0])) < 1e-10
    assert np.max(np.abs(solution.end.v - [-0.0337480180329866, 0.0588130114660716])) < 1e-10
    # x'' = -lambda x
    force = 0.493103151528274442 * solution(1.0)
    assert np.max(np.abs(solution.constraint_force(1.0) - force)) < 1e-9
    assert abs(solution.action + 0.1562656602849295043) < 1e-10
    assert solution.morse_index == 0


def test_lambert_s_problem_of_vallado():
    """Vallado, Fundamentals of Astrodynamics, example 7-5: short way, km and s, six decimals."""
    problem = ao.Problem(
        scenes.get("kepler").problem.system,
        ao.Event(0.0, [15945.34, 0.0]),
        ao.Event(4560.0, [12214.83899, 10249.46731]),
        parameters={"mu": 398600.4418},
    )
    solution = ao.solve(problem, tol=TOL)
    # published, and recomputed with more digits
    assert np.max(np.abs(solution.start.v - [2.058913, 2.915965])) < 1e-6
    assert np.max(np.abs(solution.end.v - [-3.451565, 0.910315])) < 1e-6
    assert np.max(np.abs(solution.start.v - [2.0589133537073095, 2.9159643516499399])) < 1e-9
    assert abs(solution.action - 1.234962554912745e5) < 1e-9 * 1.2e5
    assert solution.morse_index == 0


@pytest.mark.long
def test_no_line_is_blank():
    [row] = [row for row in ROWS if row.system.startswith("all symmetries affine")]
    last = list(row.check())[-1]
    assert (last.expected, last.found) == ("none", "none")
