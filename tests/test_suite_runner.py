"""The runner: planted misbehaviour costs one cell, and is called by its name."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from actionopt import suite
from actionopt.cli import main
from actionopt.suite import runner, solvers
from actionopt.suite.cell import Cell, evaluate
from actionopt.suite.runner import Limits
from actionopt.suite.verdict import STATIONARY, VERDICTS, judge

PLANTED = str(Path(__file__).with_name("planted.py"))


def planted(name, problem="pendulum"):
    return Cell(f"{PLANTED}:{name}", problem)


def verdicts(tmp_path, *cells, limits=None):
    records = runner.run(cells, tmp_path / "r.jsonl", limits=limits or Limits(20, 4), jobs=2)
    return [r["verdict"] for r in records], records


def test_planted_answers_are_called_by_their_names():
    cells = [planted(name) for name in ("right", "wrong", "nothing", "gives_up", "raises")]
    records = [evaluate(cell) for cell in (*cells, planted("other", "kepler_two_ways"))]
    found = [record["verdict"] for record in records]
    assert found == ["right", "wrong", "wrong", "failed", "failed", "other"]
    assert records[1]["distance"] == pytest.approx(0.01)
    assert records[4]["word"] == "RuntimeError: no"


def test_a_crash_and_a_hang_cost_one_cell_each(tmp_path):
    cells = [planted("crash"), planted("vanish"), planted("right")]
    found, records = verdicts(tmp_path, *cells)
    assert found == ["failed", "failed", "right"]
    assert "SIGABRT" in records[0]["word"]
    assert "exit code 3" in records[1]["word"]
    found, records = verdicts(tmp_path, planted("hang"), limits=Limits(2, 4))
    assert found == ["limit"]
    assert 2 <= records[0]["wall"] < 5


def test_memory_has_a_limit(tmp_path):
    pytest.importorskip("resource")
    found, records = verdicts(tmp_path, planted("memory"), limits=Limits(30, 1.0))
    assert found == ["limit"]
    assert records[0]["word"] == "out of memory"


def test_a_run_is_resumed_where_it_stopped(tmp_path):
    file = tmp_path / "r.jsonl"
    cells = [Cell("ipopt", name) for name in ("oscillator", "pendulum")]
    runner.run(cells[:1], file)
    with open(file, "a") as out:
        out.write('{"solver": "ipopt", "problem": "pen')  # torn off by an interruption
    shown = []
    records = runner.run(cells, file, show=lambda *progress: shown.append(progress))
    assert [r["verdict"] for r in records] == ["right", "right"]
    assert [(done, total) for done, total, _ in shown] == [(2, 2)]
    assert {r["problem"] for r in runner.load(file)} == {"oscillator", "pendulum"}
    again = runner.run(cells, file, show=lambda *progress: shown.append(progress))
    assert again == records
    assert len(shown) == 1


def test_judged_by_the_point_and_not_by_the_word():
    problem = suite.get("pendulum_long")
    assert judge(problem, problem.x_star, claimed=False).verdict == "right"
    assert judge(problem, problem.x_star + 1e-2, claimed=True).verdict == "wrong"
    assert judge(problem, problem.x_star + 1e-2, claimed=False).verdict == "failed"
    assert judge(problem, problem.others[0], claimed=True).verdict == "other"
    assert judge(problem, np.zeros(3), claimed=True).verdict == "wrong"
    forgotten, problem.others = problem.others[0], ()
    assert judge(problem, forgotten, claimed=True).verdict == "new"
    assert judge(problem, forgotten + 1e-2, claimed=True).verdict == "wrong"


@pytest.mark.parametrize("name", ["oscillator", "figure_eight", "rod_pendulum"])
def test_three_digits_of_the_path_are_enough(name):
    """Along the softest direction, where next to no residual tells."""
    problem = suite.get(name)
    rows, cols = problem.hessian_structure
    H = np.zeros((problem.n, problem.n))
    H[rows, cols] = problem.hessian(problem.x_star, problem.lam_star)
    H[cols, rows] = H[rows, cols]
    values, vectors = np.linalg.eigh(H * problem.unit[:, None] * problem.unit)
    soft = vectors[:, np.argmin(np.abs(values))] * problem.unit
    soft /= problem.distance(problem.x_star + soft)
    for distance, verdict in ((5e-4, "right"), (2e-3, "wrong")):
        for side in (1, -1):
            found = judge(problem, problem.x_star + side * distance * soft, claimed=True)
            assert found.verdict == verdict and found.residual <= STATIONARY


def test_a_small_residual_is_not_enough():
    """On a fine mesh a smooth deviation of a hundredth leaves next to no residual."""
    problem = suite.get("pendulum", elements=64, degree=8)
    s = problem.mesh.nodes[1:-1] / problem.mesh.nodes[-1]
    x = problem.x_star + 0.01 * problem.unit * np.sin(np.pi * s)
    assert problem.residual(x) < STATIONARY
    assert judge(problem, x, claimed=True).verdict == "wrong"


def test_success_in_tiny_units_is_no_success():
    """Absolute tolerances are met at once where the action is 1e-36 J s."""
    problem = suite.get("oscillator_atomic")
    answer = solvers.run("ipopt", problem, problem.start())
    assert answer.claimed
    assert judge(problem, answer.x, answer.claimed).verdict == "wrong"


@pytest.mark.parametrize(
    "solver", ["ipopt", "sqpmethod", "sqpmethod:osqp", "qrsqp", "fatrop", "sleqp", "uno"]
)
def test_plugins_of_the_wheel(solver):
    problem = suite.get("pendulum")
    answer = solvers.run(solver, problem, problem.start())
    assert judge(problem, answer.x, answer.claimed).verdict == "right"
    assert sum(answer.evaluations.values()) > 0


def test_a_solver_that_is_not_installed_is_absent(monkeypatch):
    monkeypatch.setattr(solvers.ca, "has_nlpsol", lambda name: name != "uno")
    monkeypatch.setattr(solvers.ca, "has_conic", lambda name: name != "osqp")
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    for solver, word in (("uno", "uno"), ("sqpmethod:osqp", "osqp"), ("scipy:SLSQP", "SciPy")):
        record = evaluate(Cell(solver, "pendulum"))
        assert record["verdict"] == "absent"
        assert word in record["word"]
    assert evaluate(Cell("ipopt", "pendulum"))["verdict"] == "right"


def test_solvers_that_do_not_exist_are_refused():
    for name, message in (
        ("ipop", "expected a solver among"),
        ("ipopt:osqp", "sqpmethod or"),
        ("sqpmethod:gurobi", "with one of"),
    ):
        with pytest.raises(ValueError, match=message):
            solvers.check(name)


def test_the_command(tmp_path, capsys):
    results = tmp_path / "results.jsonl"
    command = ["suite", "run", "--solver", "ipopt", "--problem", "pendulum", "-o", str(results)]
    assert main(command) == 0
    out, err = capsys.readouterr()
    assert "1/1 ipopt pendulum: right" in err
    assert out.split()[:2] == ["solver", "right"]
    assert json.loads(results.read_text())["verdict"] == "right"
    assert main(["suite", "report", "-o", str(results), "--to", str(tmp_path / "page")]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "page" / "index.html")
    assert main(["suite", "list", "--tag", "near collision"]) == 0
    assert "kepler_near_collision" in capsys.readouterr().out
    assert main(["suite", "run", "--solver", "ipop", "-o", str(results)]) == 1
    assert "expected a solver" in capsys.readouterr().err
    assert main(["suite", "dump", str(tmp_path / "all"), "--problem", "oscillator"]) == 0
    assert (tmp_path / "all" / "oscillator.nl").is_file()


@pytest.mark.slow
def test_the_whole_suite_with_ipopt(tmp_path):
    from time import perf_counter

    clock = perf_counter()
    cells = [Cell("ipopt", name) for name in suite.FAMILIES]
    records = runner.run(cells, tmp_path / "r.jsonl", jobs=2)
    assert perf_counter() - clock < 300
    assert {r["verdict"] for r in records} <= set(VERDICTS) - {"limit"}
    easy = {name for name, family in suite.FAMILIES.items() if not family.tags}
    right = {r["problem"] for r in records if r["verdict"] == "right"}
    assert len(right & easy) >= len(easy) - 3
