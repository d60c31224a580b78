"""The command line, as a user meets it."""

import argparse
import dataclasses
import json
import math
import os
import re
import subprocess
import sys
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

import actionopt as ao
from actionopt import scenes
from actionopt.cli import main, question, sweeping

OWN = """
import actionopt as ao

def lagrangian(q, v, t, *, m, k):
    return m * v[0] ** 2 / 2 - k * q[0] ** 2 / 2

spring = ao.System(lagrangian, ["x"], parameters={"m": 1.0, "k": 4.0}, name="spring")
"""
OBJECT = OWN + "problem = ao.Problem(spring, ao.Event(0, [0]), ao.Event(1, [1]))\n"
FUNCTION = OWN + (
    "def problem(*, duration=1.0):\n"
    "    return ao.Problem(spring, ao.Event(0, [0]), ao.Event(duration, [1]))\n"
)
SCENE = (
    "from actionopt import scenes\ndef scene(**given):\n    return scenes.get('kepler', **given)\n"
)


def run(capsys, *arguments):
    """Return exit code, standard output and standard error of the command."""
    code = main(arguments)
    out, err = capsys.readouterr()
    return code, out, err


def solved(capsys, *arguments):
    """Return what `solve ... --json` prints, as data."""
    code, out, err = run(capsys, "solve", *arguments, "--json")
    assert (code, err) == (0, "")
    return json.loads(out)


def rows(out):
    """Return the table as a dictionary of its first column."""
    return {line[:17].strip(): line[17:].strip() for line in out.splitlines()[1:]}


# -- list ------------------------------------------------------------------------------------


def test_list_names_every_scene_in_one_line(capsys):
    code, out, _ = run(capsys, "list")
    lines = out.splitlines()
    assert code == 0
    assert [line.split()[0] for line in lines[1:]] == list(scenes.SCENES)
    rod = next(line for line in lines if line.startswith("rod_pendulum"))
    assert rod.split()[1:4] == ["x,", "y", "1"]
    assert rod.endswith(scenes.get("rod_pendulum").title)


@pytest.mark.slow
def test_list_and_help_import_no_matplotlib():
    code = "import sys; from actionopt.cli import main; main(['list']); print(*sys.modules)"
    command = [sys.executable, "-c", code]
    modules = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert "casadi" in modules
    assert "matplotlib" not in modules


# -- solve -----------------------------------------------------------------------------------


def test_solve_prints_a_table_of_what_was_found(capsys):
    code, out, err = run(capsys, "solve", "pendulum")
    scene = scenes.get("pendulum")
    table = rows(out)
    assert (code, err) == (0, "")
    assert out.startswith("pendulum: the path is stationary")
    assert float(table["action"]) == pytest.approx(scene.action, abs=1e-8)
    assert float(table["error estimate"]) <= 1e-8
    assert float(table["forward deviation"].split(",")[0]) <= 1e-8
    assert table["forward deviation"].endswith("agrees")
    assert table["the action is"] == "minimum, index 0"
    assert float(table["energy drift"]) <= 1e-8
    assert "solve" in table["time"] and "compare" in table["time"]
    assert set(table) >= {"unknowns", "mesh", "iterations"}


@pytest.mark.long
def test_a_duration_that_is_found_is_told(capsys):
    found = solved(capsys, "kepler_at_energy", "--no-compare")
    assert found["duration"] == pytest.approx(scenes.get("kepler").problem.duration)
    assert "duration" not in solved(capsys, "pendulum", "--no-compare")


def test_list_tells_of_a_scene(capsys):
    code, out, _ = run(capsys, "list", "pendulum")
    scene = scenes.get("pendulum")
    assert code == 0
    assert scene.title in out and scene.source in out
    for name, value in scenes.parameters("pendulum").items():
        assert f"{name}={value!r}" in out
    assert "the path, acceleration, action" in out
    code, _, err = run(capsys, "list", "pendulm")
    assert code != 0 and "did you mean 'pendulum'" in err


@pytest.mark.long
def test_json_has_the_same_and_more(capsys):
    found = solved(capsys, "pendulum")
    assert found["name"] == "pendulum"
    assert found["action"] == pytest.approx(scenes.get("pendulum").action, abs=1e-8)
    assert found["forward"]["agrees"]
    assert found["forward"]["reference_error"] <= found["forward"]["allowed"]
    assert found["rounds"][-1]["elements"] == found["mesh"]["elements"]
    assert found["time"]["total"] > 0
    assert (found["kind"], found["morse_index"]) == ("minimum", 0)
    assert solved(capsys, "drag_linear")["kind"] is None  # a forced path has no index


def test_without_comparison_nothing_is_integrated(capsys, monkeypatch):
    monkeypatch.setattr(ao.Solution, "compare", None)
    assert "forward" not in solved(capsys, "pendulum", "--no-compare")
    assert "forward deviation" not in rows(run(capsys, "solve", "pendulum", "--no-compare")[1])


def test_settings_tolerance_and_principle_are_passed_on(capsys):
    found = solved(capsys, "oscillator", "--set", "duration=10", "--tol=1e-12", "--no-compare")
    scene = scenes.get("oscillator", duration=10)
    assert found["action"] == pytest.approx(scene.action, abs=1e-11)
    code, _, err = run(
        capsys, "solve", "oscillator", "--set", "duration=10", "--principle", "least"
    )
    assert code == 1
    assert "unbounded below" in err


def test_settings_may_be_lists(capsys):
    found = solved(
        capsys, "double_pendulum", "--no-compare", "--set", "end=[0.9, 0.6]", "--set=duration=.3"
    )
    direct = ao.solve(scenes.get("double_pendulum", end=[0.9, 0.6], duration=0.3).problem)
    assert found["action"] == pytest.approx(direct.action, abs=1e-9)


@pytest.mark.long
def test_pictures_and_solutions_are_written(capsys, tmp_path):
    picture, file = tmp_path / "pendulum.png", tmp_path / "pendulum.npz"
    code, _, err = run(capsys, "solve", "pendulum", "--plot", str(picture), "--out", str(file))
    assert (code, err) == (0, "")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert file.stat().st_size > 0


# -- a file of one's own ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("other", "said"), [("scene.problem", False), ("scene.problem.replace()", True)]
)
def test_a_file_with_a_scene_and_another_problem_says_which_is_taken(capsys, tmp_path, other, said):
    file = tmp_path / "both.py"
    file.write_text(
        f"from actionopt import scenes\nscene = scenes.get('pendulum')\nproblem = {other}\n"
    )
    code, out, err = run(capsys, "solve", str(file), "--no-compare")
    assert code == 0 and out.startswith("pendulum")
    assert ("defines `scene` and `problem`: the scene is taken" in err) == said


@pytest.mark.parametrize(
    ("text", "setting", "name"),
    [
        (OBJECT, "k=9", "spring"),
        (FUNCTION, "duration=0.5", "spring"),
        (SCENE, "eccentricity=0.3", "kepler"),
    ],
)
def test_a_file_may_define_a_problem_a_scene_or_a_function(capsys, tmp_path, text, setting, name):
    file = tmp_path / "my_scene.py"
    file.write_text(text)
    assert solved(capsys, str(file), "--set", setting, "--no-compare")["name"] == name


def test_settings_reach_the_parameters_of_a_file(capsys, tmp_path):
    # x(t) = sin(w t) / sin(w T): S = m w cot(w T) / 2 between (0, 0) and (T, 1).
    file = tmp_path / "spring.py"
    file.write_text(OBJECT)
    found = solved(capsys, str(file), "--set", "k=9", "--no-compare")
    assert found["action"] == pytest.approx(3 / math.tan(3) / 2, abs=1e-9)
    file.write_text(FUNCTION)
    found = solved(capsys, str(file), "--set", "duration=0.5", "--no-compare")
    assert found["action"] == pytest.approx(2 / math.tan(1) / 2, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n", "to define `problem` or `scene`.*found neither"),
        ("problem = 3\n", "found 3"),
        ("problem = 1 / 0\n", "my_scene.py, line 1: ZeroDivisionError"),
        ("x = 1\ny = = 2\n", "my_scene.py, line 2: SyntaxError"),
        (FUNCTION.replace("duration", "length"), "unknown parameter 'duration'"),
        (OBJECT, "unknown parameter 'duration'"),
    ],
)
def test_files_that_do_not_work_say_why(capsys, tmp_path, text, message):
    file = tmp_path / "my_scene.py"
    file.write_text(text)
    code, out, err = run(capsys, "solve", str(file), "--set", "duration=2")
    assert (code, out) == (1, "")
    assert re.search(message, err)
    assert "Traceback" not in err


# -- failures --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["keplr"], "did you mean 'kepler'"),
        (["nowhere.py"], "found no file 'nowhere.py'"),
        (["path.npz"], "a file FILE.py that defines `problem`, found 'path.npz'"),
        (["kepler", "--set", "mas=1"], "has no parameter 'mas'"),
        (["kepler", "--tol", "0"], "expected tol between"),
        (["damped_oscillator", "--principle", "least"], "non-conservative"),
    ],
)
def test_failures_are_one_message_and_exit_code_one(
    capsys, monkeypatch, tmp_path, arguments, message
):
    monkeypatch.chdir(tmp_path)
    code, _, err = run(capsys, "solve", *arguments)
    assert code == 1
    assert err.startswith("actionopt: ") and message in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--plot", "picture.xyz"], r"ends in .*\.png.*found 'picture\.xyz'"),
        (["--plot", "x"], r"ends in .*\.png.*found 'x', which has no ending"),
        (["--plot", "no/such/folder/a.png"], "folder that is there .*'no/such/folder/a.png'"),
        (["--save", "no/such/folder/a.npz"], "folder that is there .*'no/such/folder/a.npz'"),
        (["--save", "x"], r"ends in \.npz, found 'x'"),
    ],
)
def test_where_nothing_can_be_written_nothing_is_solved(
    capsys, monkeypatch, tmp_path, arguments, message
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys.modules["actionopt.solver.solve"], "solve", None)
    code, out, err = run(capsys, "solve", "pendulum", "--no-compare", *arguments)
    assert (code, out) == (1, "")
    assert err.startswith("actionopt: ") and re.search(message, err)
    assert "Traceback" not in err and "partial" not in err and "Errno" not in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["solve", "kepler", "--set", "mu=2", "a=3"], "--set before each setting: --set a=3$"),
        (["solve", "kepler", "--sett", "mu=2"], "unrecognized arguments: --sett mu=2"),
        (["gallery"], "arguments are required: OUTDIR$"),
        (["suite", "list", "--elements", "0"], "--elements: .*at least 1, found '0'"),
        (["suite", "list", "--elements", "-5"], "--elements: .*at least 1, found '-5'"),
        (["suite", "dump", "x", "--degree", "1.5"], "--degree: .*at least 1, found '1.5'"),
    ],
)
def test_arguments_that_make_no_sense_exit_with_2(capsys, arguments, message):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    assert re.search(message, capsys.readouterr().err.strip())


def test_a_list_says_where_a_mesh_is_too_coarse(capsys):
    code, out, err = run(
        capsys,
        "suite",
        "list",
        "--degree",
        "1",
        "--problem=oscillator",
        "--problem=kepler_polar_singular",
    )
    assert (code, err) == (0, "")
    kinds = {line.split()[0]: line.split()[2] for line in out.splitlines()[1:3]}
    assert kinds == {"oscillator": "minimum", "kepler_polar_singular": "none"}
    assert "none: no optimum near the path on such a mesh (1 of 2)" in out


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="pipes of another kind")
@pytest.mark.parametrize("unbuffered", [[], pytest.param(["-u"], marks=pytest.mark.slow)])
def test_a_reader_that_has_seen_enough_is_no_error(unbuffered):
    read, write = os.pipe()
    os.close(read)  # as `head` does, sooner or later
    command = [sys.executable, *unbuffered, "-m", "actionopt", "list", "pendulum"]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


def test_a_path_that_is_no_motion_is_a_failure(capsys, monkeypatch):
    # The same path, said to be that of a pendulum with other gravity.
    def solve(problem, **choices):
        found = ao.solve(problem, **choices)
        other = ao.Problem(problem.system, problem.start, problem.end, parameters={"g": 9.0})
        return dataclasses.replace(found, problem=other)

    monkeypatch.setattr(sys.modules["actionopt.solver.solve"], "solve", solve)
    code, out, err = run(capsys, "solve", "pendulum")
    assert code == 1
    assert float(rows(out)["forward deviation"].split(",")[0]) > 1e-3
    assert "the path is no motion" in err


@pytest.mark.long
def test_a_path_of_which_it_cannot_be_told_is_printed_and_no_failure(capsys, monkeypatch):
    compare = ao.Solution.compare

    def unfollowed(self, **changes):
        nothing = dict.fromkeys(("position", "velocity", "arrival", "reference_error"), math.nan)
        changes = {"reason": "it stops at t = 0.3", "path": None} | nothing | changes
        return dataclasses.replace(compare(self), **changes)

    monkeypatch.setattr(ao.Solution, "compare", unfollowed)
    code, out, err = run(capsys, "solve", "pendulum")
    assert (code, err) == (0, "")
    assert rows(out)["forward deviation"].endswith("cannot tell: it stops at t = 0.3")
    found = solved(capsys, "pendulum")["forward"]
    assert found["agrees"] is None and found["position"] is None
    assert found["reason"] == "it stops at t = 0.3"

    monkeypatch.setattr(ao.Solution, "compare", lambda s: unfollowed(s, local=0.1, reason=""))
    code, out, err = run(capsys, "solve", "pendulum")
    assert code == 1
    assert rows(out)["forward deviation"].startswith("1.0e-01 from piece to piece")
    assert "the path is no motion" in err and "nan" not in err


def test_a_gallery_that_cannot_be_written_says_where(capsys):
    assert main(["gallery", "/dev/null/gallery"]) == 1
    err = capsys.readouterr().err
    assert "a place that can be written or read, found '/dev/null" in err and "Errno" not in err


@pytest.mark.parametrize("setting", ["mu", "mu=", "=1", "mu=one", "2x=1", "mu=__import__('os')"])
def test_settings_that_are_none(capsys, setting):
    with pytest.raises(SystemExit) as stop:
        main(["solve", "kepler", "--set", setting])
    assert stop.value.code == 2
    assert "expected NAME=VALUE" in capsys.readouterr().err


def test_an_interrupt_exits_with_130(capsys, monkeypatch):
    def interrupted(name, **settings):
        raise KeyboardInterrupt

    monkeypatch.setattr(scenes, "get", interrupted)
    code, _, err = run(capsys, "solve", "kepler")
    assert code == 130
    assert "interrupted" in err


@pytest.mark.long
def test_the_module_is_the_command():
    command = [sys.executable, "-m", "actionopt", "--version"]
    out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert out == f"actionopt {ao.__version__}\n"


@pytest.mark.long
def test_public_names_are_all_there_and_rooms_cost_nothing_until_asked_for():
    code = (
        "import sys, actionopt as ao\n"
        "assert 'actionopt.plot' not in sys.modules\n"
        "line = ao.System(lambda q, v, t: v @ v - q @ q, ['x'])\n"
        "ao.solve(ao.Problem(line, ao.Event(0, 0), ao.Event(1, 1)))\n"
        "kinds = 'rays through unfixed obstacle free_contact nearest_points'.split()\n"
        "solver = [m.split('.')[-1] for m in sys.modules if m.startswith('actionopt.solver.')]\n"
        "assert 'solve' in solver and not set(kinds) & set(solver)\n"
        "assert 'actionopt.analysis.motion.compare' not in sys.modules\n"
        "slow = {'numpy.ma', 'multiprocessing', 'json', 'pathlib', 'numpy.polynomial'}\n"
        "assert not {*slow, 'actionopt.mechanics.question.rest'} & set(sys.modules)\n"
        "assert all(callable(getattr(ao, name)) or name == 'Status' for name in ao.__all__)\n"
        "rooms = {'chapter', 'gallery', 'plot', 'scenes', 'suite'}\n"
        "assert set(dir(ao)) == {*ao.__all__, *rooms, '__version__'}\n"
        "assert all(hasattr(ao, name) for name in ao.__all__)\n"
        "assert ao.scenes.get('pendulum').name == 'pendulum'\n"
        "assert 'matplotlib' not in sys.modules and ao.plot.save\n"
        "try:\n    ao.nothing\nexcept AttributeError as error:\n    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "module 'actionopt' has no attribute 'nothing'", done.stderr


@pytest.mark.long
def test_a_solve_along_an_obstacle_tells_its_contact(capsys):
    assert main(["solve", "rope_round_post"]) == 0
    said = capsys.readouterr().out
    assert "contact" in said and "row 0, from 0.401166 to 0.604719" in said
    assert "forward" not in said and "minimum, index 0" in said
    assert main(["solve", "rope_round_post", "--json"]) == 0
    (arc,) = json.loads(capsys.readouterr().out)["contacts"]
    assert arc["begin"] == pytest.approx(0.4011663523427598, rel=1e-7)


def test_a_solve_may_be_given_a_time(capsys):
    assert main(["solve", "pendulum", "--seconds", "1e-9"]) == 1
    assert "the time that was given ran out" in capsys.readouterr().err
    assert main(["solve", "pendulum", "--seconds", "100", "--no-compare"]) == 0


# -- sweep -----------------------------------------------------------------------------------


@pytest.mark.long
def test_a_sweep_prints_what_was_found_and_writes_it(capsys, tmp_path):
    arrays, picture = tmp_path / "map.npz", tmp_path / "map.png"
    over = ("--over", "g=9:10:3", "--over", "end.theta=-0.2:0.2:4")
    files = ("--out", str(arrays), "--plot", str(picture), "--resume", str(tmp_path / "part"))
    code, out, err = run(capsys, "sweep", "pendulum", *over, "--index", "--set", "l=1.1", *files)
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == "pendulum: 12 paths"
    assert "12 SOLVED" in out and "index          0 of 12" in out
    with np.load(arrays) as kept:
        found = dict(kept)
    assert found["action"].shape == found["index"].shape == (3, 4)
    assert found["g"].tolist() == [9.0, 9.5, 10.0] and found["end.theta"].size == 4
    problem = scenes.get("pendulum", l=1.1).problem.replace(parameters={"g": 9.0})
    problem = problem.replace(end=ao.Event(problem.end.t, [-0.2]))
    assert found["action"][0, 0] == pytest.approx(ao.solve(problem).action)
    assert picture.read_bytes().startswith(b"\x89PNG") and (tmp_path / "part").is_file()


def test_a_sweep_moves_an_event_between_the_ends(capsys, tmp_path):
    file, arrays = tmp_path / "waypoint.py", tmp_path / "map.npz"
    file.write_text(
        "import actionopt as ao\n"
        "free = ao.System(lambda q, v, t: v[0] ** 2 / 2, ['x'])\n"
        "between = [ao.Event(1.0, [1.0])]\n"
        "problem = ao.Problem(free, ao.Event(0, [0]), ao.Event(2, [0]), through=between)\n"
    )
    over = "--over", "through.0.t=0.5:1.5:3"
    code, _, err = run(capsys, "sweep", str(file), *over, "--out", str(arrays))
    assert (code, err) == (0, "")
    with np.load(arrays) as kept:
        t, S = kept["through.0.t"], kept["action"]
    assert pytest.approx(1 / (2 * t) + 1 / (2 * (2 - t))) == S


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("--over", "g=9:10"), 2, "expected NAME=FROM:TO:COUNT"),
        (("--over", "g=9:10:0"), 2, "expected NAME=FROM:TO:COUNT"),
        ((), 2, "--over"),
        (("--over", "g=9:10:2", "--jobs", "2", "--dask", "here"), 2, "not allowed with"),
        (("--over", "g=9:10:2", "--jobs", "0"), 1, "expected one job or more, found 0"),
        (("--over", "g=9:10:2", "--over", "g=1:2:3"), 1, "expected each name once"),
        (("--over", "h=9:10:2"), 1, "the parameters are m, l, g"),
        (("--over", "g=9:10:2", "--out", "map.txt"), 1, "a file that ends in .npz, .nc"),
        (("--over", "t1=-2:-1:2"), 1, "expected the end event after the start event"),
        (
            (*("--over", "g=9:10:2", "--over", "t1=1:2:2", "--over", "l=1:2:2"), "--plot", "a.png"),
            1,
            "expected one or two axes to draw, found 3",
        ),
    ],
)
def test_a_sweep_that_makes_no_sense_says_why(capsys, arguments, code, message):
    try:
        found, _, err = run(capsys, "sweep", "pendulum", *arguments)
    except SystemExit as stop:
        found, err = stop.code, capsys.readouterr().err
    assert found == code and message in err


def test_a_sweep_names_what_may_be_tried_again_and_tries_it(capsys, monkeypatch, tmp_path):
    from actionopt.families.sweeps import sweep as module

    def misses(*given):
        answers = work(*given)
        answers["status"][2], answers["action"][2] = "NOT_FOUND", np.nan
        answers["unsought"][2] = True
        return answers

    work = module.work
    monkeypatch.setattr(module, "work", misses)
    asked = "sweep", "pendulum", "--over", "t1=0.5:0.6:4", "--resume", str(tmp_path / "part")
    code, out, _ = run(capsys, *asked)
    assert code == 0 and "1 not found, 1 of them not searched for at length: --retry\n" in out
    code, out, _ = run(capsys, *asked, "--retry")
    assert code == 0 and "4 SOLVED" in out and "--retry" not in out
    assert (tmp_path / "part.retry").exists()


def test_an_interrupted_sweep_prints_what_is_done(capsys, monkeypatch):
    from actionopt.families.sweeps import sweep as module

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "work", stop)
    code, out, _ = run(capsys, "sweep", "pendulum", "--over", "t1=0.5:0.6:3")
    assert code == 130 and out.startswith("pendulum: 3 paths, interrupted\n")
    assert "3 UNREACHED" in out


def test_what_was_found_is_told(capsys):
    assert main(["solve", "snell", "--no-compare"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"event 1 found +t = [\d.]+, x = ", said) and "impulse at event 1" in said
    found = solved(capsys, "dido", "--no-compare")
    assert found["kappa"] == pytest.approx([-np.pi]) and found["events"][0]["event"] == "end"
    assert "duration" not in found


def test_a_shell_completes_scenes_and_a_sweep_is_tried_again_from_a_file():
    assert question._scenes(prefix="p") == scenes.SCENES
    assert sweeping._file_of_runs("a.npz") == "a.npz"
    with pytest.raises(argparse.ArgumentTypeError, match="actionopt sweep kepler --retry"):
        sweeping._file_of_runs("kepler")


@pytest.mark.parametrize(("time", "text"), [(1.0, "1 s"), (0.99, "990 ms"), (12.345, "12.3 s")])
def test_times_are_printed(time, text):
    assert question.seconds(time) == text


def test_who_solves_a_sweep(monkeypatch):
    for jobs in (None, 1):
        with sweeping._executor(argparse.Namespace(dask=None, jobs=jobs)) as who:
            assert who is None
    with sweeping._executor(argparse.Namespace(dask=None, jobs=2)) as who:
        assert who._max_workers == 2
    asked = []

    def client(address):
        asked.append(address)
        return nullcontext(SimpleNamespace(get_executor=lambda: "workers"))

    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=client))
    with sweeping._executor(argparse.Namespace(dask="here:1", jobs=None)) as who:
        assert (who, asked) == ("workers", ["here:1"])
    monkeypatch.setitem(sys.modules, "distributed", None)
    missing = sweeping._executor(argparse.Namespace(dask="here:1", jobs=None))
    with pytest.raises(ValueError, match="expected Dask to be installed for --dask"), missing:
        pass
