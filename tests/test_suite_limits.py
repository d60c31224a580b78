"""Bounds and inequalities reach every solver and every file, and all come to one answer."""

import argparse
import stat
import sys

import casadi as ca
import numpy as np
import pytest
from helpers import at_once

from actionopt import suite
from actionopt.suite import asl, commands, nl, solvers
from actionopt.suite.families import Family
from actionopt.suite.limits import Bounds
from actionopt.suite.solvers import run

CEILING = Family(  # a stone that may not fly higher, and the ceiling sinks
    "ceiling",
    "projectile",
    4,
    3,
    limits=Bounds(coordinates=[(-np.inf, np.inf), (-1.0, lambda t: 1.0 - 0.1 * t)]),
)
# A body that may not come into a disc.
DISC = Family("disc", "rod_pendulum", 4, 4, limits=Bounds(constraints=[(0.0, np.inf)]))
QUIET = {"print_time": 0, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-11}

SOLVER = """\
#!{python}
import sys

import casadi as ca

builder = ca.NlpBuilder()
builder.import_nl(sys.argv[1] + ".nl", {{"verbose": False}})
nlp = {{"x": ca.vertcat(*builder.x), "f": builder.f, "g": ca.vertcat(*builder.g)}}
solver = ca.nlpsol("s", "ipopt", nlp, {quiet})
found = solver(
    x0=builder.x_init, lbx=builder.x_lb, ubx=builder.x_ub, lbg=builder.g_lb, ubg=builder.g_ub
)
dual = [-v for v in found["lam_g"].nonzeros()] if {duals} else []
x = found["x"].nonzeros()
with open(sys.argv[1] + ".sol", "w") as out:
    print("made by hand\\n  in two lines\\n\\nOptions\\n3\\n1\\n1\\n0", file=out)
    print(len(builder.g), len(dual), len(x), len(x), sep="\\n", file=out)
    print(*dual, *x, "objno 0 {code}", sep="\\n", file=out)
"""


def program(tmp_path, code=0, duals=True):
    """Return a solver that reads .nl files."""
    file = tmp_path / "solver"
    text = SOLVER.format(python=sys.executable, quiet=QUIET, code=code, duals=duals)
    file.write_text(text)
    file.chmod(file.stat().st_mode | stat.S_IXUSR)
    return file


def test_methods_that_know_no_bounds_are_told():
    problem = suite.TestProblem(CEILING)
    with pytest.raises(solvers.Absent, match="takes bounds"):
        run("scipy:BFGS", problem, problem.start())


@pytest.mark.parametrize(
    ("limits", "found"),
    [
        (Bounds(coordinates=[(1.0, 1.0)]), "lower bound of coordinate 0 below the upper one"),
        (Bounds(constraints=[(1.0, lambda t: -t)]), "lower bound of constraint 0 not above"),
    ],
)
def test_bounds_that_cross_are_refused(limits, found):
    with pytest.raises(ValueError, match=found):
        problem = suite.TestProblem(Family("crossed", "rod_pendulum", 2, limits=limits))
        solvers.run("ipopt", problem, problem.start())


@pytest.mark.long
def test_a_solver_that_reads_nl_files(tmp_path):
    problem = suite.get("rod_pendulum")
    name = f"asl:{program(tmp_path)}"
    answer = run(name, problem, problem.start())
    assert problem.distance(answer.x) < 1e-7
    np.testing.assert_allclose(answer.lam, problem.lam_star, atol=1e-7)  # the sign is ours
    assert (answer.said, answer.word) == ("solved", "made by hand in two lines")
    assert answer.evaluations == {} and not solvers.is_counted(name)
    assert answer.seconds > 0.0
    assert run(f"asl:{program(tmp_path, 300)}", problem, problem.start()).said == "unbounded"
    bare = run(f"asl:{program(tmp_path, 502, duals=False)}", problem, problem.start())
    assert bare.said == "gave up" and bare.lam is None
    with pytest.raises(ValueError, match="found no 'nowhere'"):
        solvers.check("asl:nowhere")
    with pytest.raises(RuntimeError, match="true left no answer, code 0"):
        run("asl:true", problem, problem.start())
    first = solvers.content(name)
    program(tmp_path, 1)
    assert solvers.content(name) != first  # an edited solver is another one


def test_a_solver_beside_the_interpreter_is_found(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="found no 'solver'"):
        asl.find("solver")
    here = program(tmp_path)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    assert asl.find("solver") == here.resolve()


def test_bounds_read_back_from_an_nl_file(tmp_path):
    for family in (CEILING, DISC):
        problem = suite.TestProblem(family)
        nl.write(problem, tmp_path / "a.nl")
        builder = ca.NlpBuilder()
        builder.import_nl(str(tmp_path / "a.nl"), {"verbose": False})
        np.testing.assert_array_equal(builder.x_lb, problem.bounds[0])
        np.testing.assert_array_equal(builder.x_ub, problem.bounds[1])
        np.testing.assert_array_equal(builder.g_lb, problem.constraint_bounds[0])
        np.testing.assert_array_equal(builder.g_ub, problem.constraint_bounds[1])


def test_a_solution_file_that_ends_too_soon_is_none(tmp_path):
    (tmp_path / "a.sol").write_text("said\n\nOptions\n3\n1\n1\n0\n0\n0\n2\n2\n1.5\n")
    with pytest.raises((ValueError, IndexError)):
        asl.read(tmp_path / "a.sol")


@pytest.mark.parametrize(("text", "found"), [("mass=2", 2), ("mass=2.0", 2.0), ("a=1e3", 1000)])
def test_a_parameter_of_a_member_is_read(text, found):
    name, value = commands._setting(text)
    assert (name, value, type(value)) == (text.partition("=")[0], found, type(found))


@pytest.mark.parametrize("text", ["mass", "=2", "mass=heavy"])
def test_what_is_no_parameter_of_a_member_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="expected NAME=NUMBER, found"):
        commands._setting(text)


@at_once(
    ("number", "meaning"),
    [(-1, "solved"), (0, "solved"), (103, "solved"), (200, "infeasible"), (399, "unbounded"),
     (400, "gave up"), (599, "gave up"), (999, "gave up")],
)  # fmt: skip
def test_numbers_of_ampl_have_a_meaning(number, meaning):
    assert asl.AmplResult(np.zeros(1), None, "", number).meaning == meaning


def test_answers_of_a_solver_in_another_process(tmp_path, monkeypatch):
    program = suite.get("rod_pendulum", 2, 2)
    monkeypatch.setattr(asl, "find", lambda name: tmp_path / name)
    asked = []

    def answer(binary, stub):
        asked.append((binary, stub.with_suffix(".nl").is_file()))
        return asl.AmplResult(np.zeros(program.n), np.ones(program.m), "said", 200)

    monkeypatch.setattr(asl, "run", answer)
    solve = solvers._asl("mine", tmp_path)(program, program.start())
    x, lam, said, word = solve(program.start())
    assert (said, word, x.sum(), lam.sum()) == ("infeasible", "said", 0.0, program.m)
    assert asked == [(tmp_path / "mine", True)]
    monkeypatch.setattr(asl, "run", lambda *x: asl.AmplResult(np.zeros(0), None, "no", 500))
    x, lam, said, word = solve(program.start())
    assert np.isnan(x).all() and (x.size, lam, said, word) == (program.n, None, "gave up", "no")


def test_a_solver_that_leaves_no_answer_is_told(tmp_path):
    binary = tmp_path / "silent"
    binary.write_text("#!/bin/sh\necho at length $2; exit 3\n")
    binary.chmod(0o755)
    (tmp_path / "problem.sol").write_text("of another run")
    with pytest.raises(RuntimeError, match="silent left no answer, code 3: at length -AMPL"):
        asl.run(binary, tmp_path / "problem")
    answer = "a, b,Options,1,7,2,2,1,1,5,6,7,objno 0 100,".replace(",", "\\n")
    binary.write_text(f"#!/bin/sh\nprintf '{answer}' > $1.sol\n")
    found = asl.run(binary, tmp_path / "problem")
    assert (found.x.tolist(), found.lam.tolist()) == ([7.0], [-5.0, -6.0])
    assert (found.message, found.number) == ("a b", 100)
