"""The runner: planted misbehaviour costs one cell, and is called by its name."""

import json
import re
import runpy
import signal
import subprocess
import sys
import time
import types
from dataclasses import asdict, fields, replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from actionopt import suite
from actionopt.cli import main
from actionopt.suite import cell, runner, solvers
from actionopt.suite.cell import Cell, attempt, evaluate, limit
from actionopt.suite.expression import nlp
from actionopt.suite.program import Given
from actionopt.suite.runner import Limits
from actionopt.suite.verdict import SAME_POINT, verdict
from actionopt.tools import process

PLANTED = str(Path(__file__).with_name("planted.py"))


def planted(name, problem="pendulum"):
    return Cell(f"{PLANTED}:{name}", problem)


def verdicts(tmp_path, *cells, limits=None):
    records = runner.run(cells, tmp_path / "r.jsonl", limits=limits or Limits(20, 4), jobs=2)
    return [verdict(r, "stationary") for r in records], records


@pytest.fixture
def at_home(monkeypatch):
    """Cells run in this process, whose bounds are left alone: each of their own takes a second."""

    def run(target, asked, memory, seconds, *, limit, processor):
        return json.loads(json.dumps(attempt(Cell(**asked))))

    monkeypatch.setattr(runner.process, "run", run)


@pytest.mark.long
def test_planted_answers_are_called_by_their_names():
    cells = [
        *(planted(name) for name in ("right", "wrong", "nothing", "gives_up")),
        planted("other", "kepler_two_ways"),
        planted("saddle", "pendulum_long"),
    ]
    records = [evaluate(cell) for cell in cells]
    found = [verdict(record, "stationary") for record in records]
    assert found == ["right", "wrong", "wrong", "failed", "other", "right"]
    found = [verdict(record, "minimise") for record in records]
    assert found == ["right", "wrong", "wrong", "failed", "other", "saddle"]
    assert records[1]["distance"] == pytest.approx(0.01)


def test_what_a_solver_is_given_leaves_no_way_round_the_counts():
    record = evaluate(planted("hides"))
    assert record["outcome"] == "answered", record
    assert record["evaluations"] == {"f": 3} and record["history"][0][0] == 1


def test_functions_are_refused_in_a_process_where_they_are_not_counted(monkeypatch):
    problem = suite.get("pendulum").view()
    given = Given(problem)
    given.objective(np.zeros(given.n))
    monkeypatch.setattr("os.getpid", lambda: -1)  # as after a fork
    with pytest.raises(RuntimeError, match="expected calls in the process of the solver"):
        given.objective(np.zeros(given.n))
    assert problem.counts == {"f": 1}


def test_what_a_solver_says_of_the_problem_is_not_taken_for_true(tmp_path, monkeypatch):
    """A process may say anything: only what it found is taken from it."""
    monkeypatch.setattr(runner.process, "run", lambda *arguments, **limits: dict(FORGED))
    (record,) = runner.run([Cell("ipopt", "pendulum")], tmp_path / "r.jsonl")
    assert (record["solver"], record["n"], record["unbounded"]) == ("ipopt", 31, False)
    assert verdict(record, "minimise") == "wrong"


FORGED = {"outcome": "answered", "said": "unbounded", "x": [0.0] * 31, "evaluations": {}}
FORGED |= {"solver": "other", "n": 1, "unbounded": True, "far_below": True, "allowed": 99}


@pytest.mark.quick("sleqp")
@pytest.mark.parametrize("solver", ["ipopt", "sleqp", "uno"])
def test_solvers_that_find_no_bottom_are_right(solver):
    record = evaluate(Cell(solver, "oscillator_past"))
    assert record["said"] == "unbounded"
    assert verdict(record, "minimise") == "right"


def test_one_that_returns_the_saddle_is_not():
    record = evaluate(Cell("qrsqp", "oscillator_past"))
    assert record["said"] == "solved"
    assert verdict(record, "minimise") == "saddle"
    assert verdict(record, "stationary") == "right"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("raises", "RuntimeError: no"),
        ("too_short", "ValueError: expected x of shape .31,. .*found shape .30,."),
        ("mute", "ValueError: .*found shape .31,. and 'perhaps'"),
        ("takes_too_much", "TypeError: .*missing 1 required positional argument: 'tolerance'"),
    ],
)
def test_a_mistake_in_a_file_is_not_the_solver_s(name, said):
    record = evaluate(planted(name))
    assert record["outcome"] == verdict(record, "minimise") == "error"
    assert re.match(said, record["word"])
    assert "Traceback" in record["trace"] and said[:5] in record["trace"]


def test_a_file_that_does_not_load(tmp_path):
    for text, message in (("def solve(", "line 1"), ("def other(): pass", "to define 'solve'")):
        (tmp_path / "mine.py").write_text(text)
        with pytest.raises(ValueError, match=message):
            solvers.check(f"{tmp_path}/mine.py:solve")
    with pytest.raises(ValueError, match=r"found no .*nowhere.py"):
        solvers.check(f"{tmp_path}/nowhere.py:solve")
    (tmp_path / "mine.py").write_text("import nothing_of_the_kind\ndef solve(p, x): return x")
    record = evaluate(Cell(f"{tmp_path}/mine.py:solve", "pendulum"))
    assert record["outcome"] == "error"
    assert "No module named 'nothing_of_the_kind'" in record["word"]
    assert "line 1" in record["trace"]


@pytest.mark.long
def test_a_solver_sees_no_answer():
    record = evaluate(planted("peeks"))
    assert record["outcome"] == "answered", record["trace"]
    assert record["said"] == "gave up"  # it had looked at more than a few things
    # This start is the answer, nearly.
    near = evaluate(replace(planted("looks_up", "rod_pendulum"), start="near"))
    assert near["outcome"] == "answered", near["trace"]
    with pytest.raises(LookupError):
        runpy.run_path(PLANTED)["peeks"](suite.get("pendulum"), None)  # the oracle can fail


@pytest.mark.long
def test_a_crash_and_a_hang_cost_one_cell_each(tmp_path):
    found, records = verdicts(tmp_path, planted("crash"), planted("right"))
    assert found == ["failed", "right"]
    assert "SIGABRT" in records[0]["word"]
    with pytest.raises(process.Died, match="exit code 3"):
        process.run("os:_exit", 3, limit=20)
    found, records = verdicts(tmp_path, planted("hang"), limits=Limits(0.2, 4))
    assert found == ["limit"]
    assert 0.2 < records[0]["processor"] <= records[0]["wall"] and records[0]["load"] >= 0


@pytest.mark.slow
def test_time_is_that_of_the_processor_of_the_program_and_those_it_calls(tmp_path, monkeypatch):
    found, records = verdicts(tmp_path, planted("calls"), limits=Limits(0.5, 4))
    assert found == ["limit"] and records[0]["processor"] > 0.5
    monkeypatch.setattr(runner, "CLOCK_FACTOR", 1.0)
    found, records = verdicts(tmp_path, planted("sleep"), limits=Limits(4, 4))
    assert found == ["failed"] and records[0]["word"] == "no answer in 5 s of the clock"
    assert records[0]["processor"] < 4 and records[0]["wall"] >= 5
    assert not runner._holds(records[0], Limits(4, 4))  # it may have been the machine


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="no /proc")
def test_time_of_a_child_that_nobody_waits_for_is_counted():
    child = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        begin, late = process.children_time(), time.monotonic() + 20
        while process.children_time() < begin + 0.05:
            assert time.monotonic() < late
    finally:
        child.kill()
        child.wait()


@pytest.mark.slow
def test_memory_has_a_limit(tmp_path):
    pytest.importorskip("resource")
    found, records = verdicts(tmp_path, planted("memory"), limits=Limits(30, 1.0))
    assert found == ["limit"]
    assert records[0]["word"] == "out of memory"


def test_bounds_are_set_in_bytes_and_seconds(monkeypatch):
    resource, said = pytest.importorskip("resource"), []
    monkeypatch.setattr(resource, "setrlimit", lambda *given: said.append(given))
    monkeypatch.setattr(signal, "alarm", said.append)
    limit(2.5, 7.9)
    assert said == [(resource.RLIMIT_AS, (2684354560, 2684354560)), 12]


def test_a_run_is_resumed_where_it_stopped(tmp_path, at_home):
    file = tmp_path / "r.jsonl"
    cells = [Cell("ipopt", name) for name in ("oscillator", "pendulum")]
    runner.run(cells[:1], file)
    with open(file, "a") as out:
        out.write('{"solver": "ipopt", "problem": "pen')  # torn off by an interruption
    shown = []
    records = runner.run(cells, file, show=lambda *progress: shown.append(progress))
    assert [verdict(r, "minimise") for r in records] == ["right", "right"]
    assert [(done, total) for done, total, _ in shown] == [(2, 2)]
    assert {r["problem"] for r in runner.load(file)} == {"oscillator", "pendulum"}
    again = runner.run(cells, file, show=lambda *progress: shown.append(progress))
    assert again == records
    assert len(shown) == 1
    runner.run(cells, file, show=lambda *progress: shown.append(progress), again=True)
    assert len(shown) == 3


def test_a_run_that_is_interrupted_begins_no_more_cells(tmp_path, monkeypatch):
    begun = []

    def run_one(cell, about, limits):
        begun.append(cell)
        time.sleep(0.1 * (len(begun) > 1))  # while the first is told
        return about

    def interrupted(done, total, record):
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "run_one", run_one)
    cells = [Cell("ipopt", "oscillator", repeats=k) for k in range(1, 9)]
    with pytest.raises(KeyboardInterrupt):
        runner.run(cells, tmp_path / "r.jsonl", show=interrupted)
    assert 0 < len(begun) < len(cells)


def test_what_has_changed_runs_again(tmp_path, monkeypatch):
    """An edited file, more time after too little, another mesh; and nothing else."""
    mine, file, shown = tmp_path / "mine.py", tmp_path / "r.jsonl", []

    def ran(limits=None, **asked):
        shown.clear()
        cell = Cell(f"{mine}:solve", "pendulum", **asked)
        records = runner.run(
            [cell], file, limits=limits, show=lambda *progress: shown.append(progress)
        )
        return len(shown), records[0]["outcome"]

    def pretended(target, asked, memory, seconds, *, limit, processor):
        if "sleep" in mine.read_text() and processor < 1:
            raise runner.process.Overrun("late", processor)
        return {"outcome": "answered"}

    monkeypatch.setattr(runner.process, "run", pretended)
    slow = "import time\ndef solve(p, x):\n    time.sleep(1)\n    return x, None, False"
    mine.write_text(slow)
    assert ran(Limits(0.9, 8)) == (1, "limit")
    assert ran(Limits(0.9, 8)) == (0, "limit")
    assert ran(Limits(0.5, 8)) == (0, "limit")
    assert ran(Limits(30, 8)) == (1, "answered")
    assert ran(Limits(60, 8)) == (0, "answered")
    mine.write_text(slow.replace("time.sleep(1)", "p.n"))
    assert ran() == (1, "answered")
    assert ran() == (0, "answered")
    assert ran(elements=10) == (1, "answered")
    assert ran(elements=8, degree=4) == (0, "answered")  # what it is by default
    assert ran(start="perturbed") == (1, "answered")
    assert ran(parameters={"decades": 2}) == (1, "answered")
    assert ran(repeats=2) == (1, "answered")


@pytest.mark.quick("sqpmethod", "sqpmethod:osqp")
@pytest.mark.parametrize(
    "solver", ["ipopt", "sqpmethod", "sqpmethod:osqp", "qrsqp", "fatrop", "sleqp", "uno"]
)
def test_plugins_of_the_wheel(solver):
    problem = suite.get("pendulum")
    answer = solvers.run(solver, problem, problem.start())
    assert not problem.counts  # the judge's counts are its own
    assert problem.distance(answer.x) < SAME_POINT
    assert answer.said == "solved"
    counts = answer.evaluations
    assert counts["f"] > 0 and counts["grad"] > 0 and counts.get("hess", 0) + counts.get("hprod", 0)
    assert "c" not in counts and "jac" not in counts
    assert set(counts) <= {"f", "grad", "hess", "hprod"}
    visited = answer.program.visited
    assert len(visited) == counts["f"]
    np.testing.assert_array_equal(visited[0], problem.start())
    (k, f, v), last = problem.history(visited)[0], problem.history(visited)[-1]
    assert (k, f, v) == (1, problem.objective(problem.start()), 0.0)
    assert last[1] == pytest.approx(problem.f_star, rel=1e-6)


@pytest.mark.long
def test_evaluations_are_those_the_solver_says():
    """CasADi's own counters, where each call is of one function."""
    problem = suite.get("rod_pendulum")
    answer = solvers.run("ipopt", problem, problem.start())
    quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "calc_lam_p": False}
    plain = ca.nlpsol("plain", "ipopt", nlp(problem), quiet)
    found = plain(x0=problem.start(), lbg=0.0, ubg=0.0)
    np.testing.assert_allclose(answer.x, np.asarray(found["x"]).ravel(), atol=1e-10)
    names = {"f": "f", "c": "g", "grad": "grad_f", "jac": "jac_g", "hess": "hess_l"}
    stats = plain.stats()
    assert answer.evaluations == {k: stats[f"n_call_nlp_{name}"] for k, name in names.items()}


@pytest.mark.long
def test_the_least_of_bare_repeats_is_the_time():
    problem, busy = suite.get("pendulum"), iter((0.01, 0.06, 0.03))

    def solve(program, x0):
        program.objective(x0)
        end = time.process_time() + next(busy)
        while time.process_time() < end:
            pass
        return x0

    module = types.ModuleType("sleeper")
    module.solve = solve
    sys.modules["sleeper"] = module
    try:
        answer = solvers.run("sleeper:solve", problem, problem.start(), repeats=3)
    finally:
        del sys.modules["sleeper"]
    assert 0.03 <= answer.seconds < 0.06 and len(answer.times) == 3
    assert answer.evaluations == {"f": 1}  # of one of them


def test_a_solver_that_is_not_installed_is_absent(monkeypatch):
    monkeypatch.setattr(solvers.ca, "has_nlpsol", lambda name: name != "uno")
    monkeypatch.setattr(solvers.ca, "has_conic", lambda name: name != "osqp")
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    for solver, word in (("uno", "uno"), ("sqpmethod:osqp", "osqp"), ("scipy:SLSQP", "SciPy")):
        record = evaluate(Cell(solver, "pendulum"))
        assert record["outcome"] == "absent"
        assert word in record["word"]
    assert verdict(evaluate(Cell("ipopt", "pendulum")), "minimise") == "right"


def test_a_solver_without_constraints_is_not_asked_for_them():
    pytest.importorskip("scipy.optimize")
    record = evaluate(Cell("scipy:L-BFGS-B", "rod_pendulum"))
    assert record["outcome"] == "absent" and "takes constraints" in record["word"]
    record = evaluate(Cell("scipy:L-BFGS-B", "pendulum"))
    assert record["outcome"] == "answered" and record["evaluations"]["f"] > 10


def test_solvers_that_do_not_exist_are_refused():
    for name, message in (
        ("ipop", "expected a solver among"),
        ("ipopt:osqp", "sqpmethod or"),
        ("sqpmethod:gurobi", "with one of"),
        ("scipy:slsqp", "one of .*SLSQP"),  # else it would be scored, as failed
    ):
        with pytest.raises(ValueError, match=message):
            solvers.check(name)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--jobs", "0"], "expected one job or more, found 0"),
        (["--seconds", "-1"], "expected a positive number of seconds, found -1.0"),
        (["--out", "no/such/folder/r.jsonl"], "folder that is there .*'no/such/folder/r.jsonl'"),
    ],
)
def test_nothing_runs_for_what_the_command_refuses(
    tmp_path, capsys, monkeypatch, arguments, message
):
    monkeypatch.chdir(tmp_path)
    asked = ["suite", "run", "--solver", "ipopt", "--problem", "pendulum", *arguments]
    assert main(asked) == 1
    assert re.search(message, capsys.readouterr().err)
    assert not list(tmp_path.iterdir())


def test_the_command(tmp_path, capsys, monkeypatch, at_home):
    monkeypatch.setattr("actionopt.tools.progress.LOG_PACE", 0.0)
    monkeypatch.setattr("actionopt.suite.report._figure", lambda *arguments: "")
    results = tmp_path / "results.jsonl"
    command = ["suite", "run", "--solver", "ipopt", "--problem", "pendulum", "-o", str(results)]
    assert main(command) == 0
    out, err = capsys.readouterr()
    assert "1/1 ipopt pendulum: right" in err
    assert out.split()[:3] == ["minimise:", "solver", "right"]
    assert "stationary:" in out
    assert json.loads(results.read_text())["at"] == "optimum"
    assert main(["suite", "report", "-o", str(results), "--to", str(tmp_path / "page")]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "page" / "index.html")
    assert main(["suite", "list", "kepler", "--problem", "oscillator"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 3
    assert main(["suite", "run", "--solver", "ipop", "-o", str(results)]) == 1
    assert "expected a solver" in capsys.readouterr().err
    broken = tmp_path / "broken.py"
    broken.write_text("def solve(problem, x0):\n    return undefined")
    command = ["suite", "run", "--solver", f"{broken}:solve", "--problem", "pendulum"]
    assert main([*command, "-o", str(results)]) == 1
    assert "has a mistake" in (said := capsys.readouterr().err)
    assert "line 2, in solve" in said and "'undefined' is not defined" in said
    with pytest.raises(SystemExit):
        main(["suite", "report", "-o", str(results)])  # nowhere by default
    assert "--to" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["suite", "run", "--help"])
    assert "def solve(problem, x0):" in capsys.readouterr().out
    assert main(["suite", "dump", str(tmp_path / "all"), "--problem", "oscillator"]) == 0
    assert (tmp_path / "all" / "oscillator.nl").is_file()


@pytest.mark.slow
def test_the_command_for_problems_of_a_tag(tmp_path, capsys, at_home):
    assert main(["suite", "list", "--tag", "near collision"]) == 0
    assert "kepler_near_collision" in capsys.readouterr().out
    coarse = ["suite", "run", "--solver", "ipopt", "--tag", "stiff potential", "--elements", "8"]
    assert main([*coarse, "-o", str(tmp_path / "coarse.jsonl"), "--repeats", "1"]) == 0
    assert "left out: oscillator_stiff: expected a discrete optimum" in capsys.readouterr().err
    assert "oscillator_stiff" not in (tmp_path / "coarse.jsonl").read_text()
    assert main([*coarse, "--problem", "oscillator_stiff", "-o", str(tmp_path / "none")]) == 1
    assert "use more elements" in capsys.readouterr().err


def test_a_process_writes_what_its_function_returns(tmp_path):
    process.main("math:hypot", "[3, 4]", str(tmp_path / "out"))
    assert (tmp_path / "out").read_text() == "5.0"
    assert process.function("os.path:basename")("a/b") == "b"
    before = process.process_time()
    assert process.processor_time() >= before


@pytest.mark.parametrize(
    ("code", "said", "words"),
    [
        (-9, "first\nlast\n", "the process died with signal SIGKILL; last"),
        (3, "", "the process died with exit code 3; "),
    ],
)
def test_how_a_process_died_is_told(code, said, words):
    error = process.Died(code, said)
    assert (str(error), error.said) == (words, said)


def bare(**given):
    return Cell(**dict.fromkeys(field.name for field in fields(Cell)) | given)


@pytest.mark.parametrize(
    ("error", "outcome", "word", "clock"),
    [
        (process.Overrun("no answer in 9 s", 9.5), "limit", "no answer in 9 s", None),
        (
            process.Overrun("no answer in 90 s of the clock", 2.0),
            "failed",
            "no answer in 90 s of the clock",
            True,
        ),
        (process.Overrun("no answer", None), "limit", "no answer", None),
        (process.Died(-11, "x"), "failed", "the process died with signal SIGSEGV; x", None),
        (process.Died(1, "MemoryError: y"), "limit", "out of memory", None),
        (process.Died(1, "std::bad_alloc"), "limit", "out of memory", None),
    ],
)
def test_what_came_of_a_process_that_did_not_answer(error, outcome, word, clock, monkeypatch):
    def run(*asked, **limits):
        raise error

    monkeypatch.setattr(process, "run", run)
    found = runner.attempt(bare(problem="pendulum"), Limits(seconds=5.0, memory=100.0))
    assert (found["outcome"], found["word"], found.get("clock")) == (outcome, word, clock)
    assert (found["allowed"], found["memory"]) == (5.0, 100.0)


def test_a_process_answers_or_is_ended():
    assert process.run("math:hypot", 3, 4, limit=60.0) == 5.0
    with pytest.raises(process.Overrun, match="no answer in 0 s of the clock"):
        process.run("time:sleep", 60, limit=0.0)


def test_a_cell_is_run_within_its_bounds(monkeypatch):
    told = []
    monkeypatch.setattr(cell, "limit", lambda *x: told.append(x))
    monkeypatch.setattr(cell, "attempt", lambda asked: {"said": asked.solver})
    found = cell.run_within(asdict(bare(solver="s")), 100.0, 5.0)
    assert found["said"] == "s" and found["processor"] > 0 and told == [(100.0, 5.0)]


def test_the_time_of_a_process_counts_anew(tmp_path, monkeypatch):
    monkeypatch.setenv(process.MARK, str(tmp_path / "mark"))
    process.count_anew()
    told = float((tmp_path / "mark").read_text())
    assert 0 <= process.processor_time() - told < 1.0
    monkeypatch.delenv(process.MARK)
    process.count_anew()  # nobody asked


class Optimizer:
    def __init__(self, x=None, error=None):
        self.x, self.error = x, error

    def set_ftol_rel(self, tol):
        self.tol = tol

    def optimize(self, x):
        self.begun = x
        if self.error:
            raise self.error
        return self.x

    def last_optimize_result(self):
        return 3


def test_answers_of_nlopt_and_cyipopt(monkeypatch):
    program = types.SimpleNamespace(n=2, bounds=(np.zeros(2), np.ones(2)))
    monkeypatch.setitem(sys.modules, "nlopt", types.SimpleNamespace())
    made = Optimizer(np.full(2, 0.5))
    monkeypatch.setattr(solvers, "nlopt_problem", lambda program, algorithm: made)
    x, lam, said, word = solvers._nlopt("LD_SLSQP")(program, None)(np.array([-1.0, 0.3]))
    assert made.begun.tolist() == [0.0, 0.3] and made.tol == solvers.NLOPT_STOP
    assert (x.tolist(), lam, said, word) == ([0.5, 0.5], None, "solved", "3")
    made.error = RuntimeError("no way")
    x, lam, said, word = solvers._nlopt("LD_SLSQP")(program, None)(np.array([-1.0, 0.3]))
    assert (x.tolist(), said, word) == ([-1.0, 0.3], "gave up", "RuntimeError no way")
    made.error = MemoryError()
    with pytest.raises(MemoryError):
        solvers._nlopt("LD_SLSQP")(program, None)(np.zeros(2))

    def refuse(program, algorithm):
        raise ValueError("no such algorithm")

    monkeypatch.setattr(solvers, "nlopt_problem", refuse)
    with pytest.raises(solvers.Absent, match="no such algorithm"):
        solvers._nlopt("LD_NONE")(program, None)
    told = {}

    class Problem:
        def __init__(self, **given):
            told.update(given)

        def add_option(self, name, value):
            told[name] = value

        def solve(self, x):
            return x + 1, {"status": 0, "mult_g": np.ones(1)}

    monkeypatch.setitem(sys.modules, "cyipopt", types.SimpleNamespace(Problem=Problem))
    monkeypatch.setattr(solvers, "cyipopt_arguments", lambda program: {"n": 2})
    x, lam, said, word = solvers._cyipopt("")(program, None)(np.zeros(2))
    assert (x.tolist(), lam.tolist(), said, word) == ([1.0, 1.0], [1.0], "solved", "0")
    assert told == {"n": 2, "print_level": 0, "sb": "yes"}
    for name, prepare in (("nlopt", solvers._nlopt), ("cyipopt", solvers._cyipopt)):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(solvers.Absent, match="is not installed, pip install"):
            prepare("LD_SLSQP")


def test_what_answers_depend_on(tmp_path, monkeypatch):
    file = tmp_path / "own.py"
    file.write_text("a = 1\n")
    first = solvers.content(f"{file}:solve")
    file.write_text("a = 2\n")
    assert first.startswith("sha256 ") and solvers.content(f"{file}:solve") != first
    assert solvers.content("json:dumps").startswith("sha256 ")
    assert solvers.content("no_such_module:f") == "absent"

    def none(name):
        raise solvers.metadata.PackageNotFoundError

    monkeypatch.setattr(solvers.metadata, "version", none)
    assert solvers.content("scipy:SLSQP") == "absent"
