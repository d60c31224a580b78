"""Every example runs, draws, and gives the number it promises."""

import re
import runpy
import tempfile
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SLOW = ("02_two_paths", "06_convergence", "08_gallery", "09_pork_chop", "10_fronts")


def hello_action(found):
    # 9.648145299028 by Jacobi's elliptic functions: m g l = 9.81, theta from 0.3 to -0.2 in 1 s.
    assert abs(found["solution"].action - 9.648145299028) <= 1e-10
    assert found["solution"].compare().position <= 1e-9
    assert found["on_the_moon"].problem.system.derived == found["solution"].problem.system.derived


def tension_in_a_rod(found):
    assert np.max(np.abs(found["tension"] - found["expected"])) <= 1e-8


def least_or_stationary(found):
    assert np.max(np.abs(np.subtract(found["changes"], found["expected"]))) <= 1e-10
    assert "conjugate point" in found["refusal"]


def two_paths(found):
    assert [path.kind for path in found["found"]] == ["minimum", "minimum"]
    assert found["found"][1].action > found["found"][0].action + 10
    assert np.abs(np.array(found["times"]) - 0.6).max() <= 1e-9


def symmetries(found):
    assert len(found["symmetries"]) == 7
    assert max(found["changes"]) <= 1e-10
    turned = found["turn"](found["q"], found["v"], found["t"])
    assert np.max(np.abs(turned - found["by_hand"])) <= 1e-12
    # Momentum and energy as every textbook has them are among the quantities.
    (m1, m2), v = (1.0, 3.0), found["v"]
    first = [values[0] for values in found["quantities"]]
    assert min(abs(x - (m1 * v[0] + m2 * v[2])[0]) for x in first) <= 1e-10


def convergence(found):
    assert np.all(found["errors"] <= found["estimates"])
    assert np.all(found["estimates"] <= found["tols"])
    assert abs(found["orders"][2] - 4) <= 0.05 and abs(found["orders"][3] - 6) <= 0.05


def your_own_system(found):
    assert max(abs(solution.start.v[0]) for solution in found["solutions"]) <= 1e-9
    assert max(found["errors"] + found["deviations"]) <= 1e-9
    assert abs(found["quarter"] - 1.0030) <= 1e-4


def gallery(found):
    for scene, solution in zip(found["found"], found["solutions"], strict=True):
        assert abs(solution.action - scene.action) <= 1e-10 * abs(scene.action)
    index = found["folder"] / "index.html"
    assert found["visualize"]() == index
    pages = [found["folder"] / name / "index.html" for name in found["chosen"]]
    assert all(page.is_file() for page in (index, *pages))


def pork_chop(found):
    for (runs, planets), least in zip(found["maps"], (2.98, 48.43), strict=True):
        assert runs.success.all() and runs.branch.max() == 0
        assert found["misses"](runs).max() <= 1e-9
        assert abs(found["excess"](runs, planets)[0].min() - least) <= 0.01


def fronts(found):
    for runs, off in zip(found["found"], (1e-4, 1e-3, 1e-2), strict=True):
        assert runs.success.all() and runs.branch.max() == 0
        momenta, by_action = found["slopes"](runs)
        assert np.abs(momenta - by_action).max() <= off * np.abs(momenta).max()


PROMISES = {
    "01_hello_action": hello_action,
    "02_two_paths": two_paths,
    "03_least_or_stationary": least_or_stationary,
    "04_tension_in_a_rod": tension_in_a_rod,
    "05_symmetries": symmetries,
    "06_convergence": convergence,
    "07_your_own_system": your_own_system,
    "08_gallery": gallery,
    "09_pork_chop": pork_chop,
    "10_fronts": fronts,
}


def test_every_example_has_a_promise():
    assert [file.stem for file in EXAMPLES] == sorted(PROMISES)


@pytest.mark.long
@pytest.mark.parametrize(
    "file",
    [pytest.param(f, marks=[pytest.mark.slow] * (f.stem in SLOW), id=f.stem) for f in EXAMPLES],
)
def test_example(file, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    found = runpy.run_path(str(file))
    assert pyplot.get_fignums() == []  # nothing is drawn before it is asked for
    PROMISES[file.stem](found)
    found["visualize"]()
    pyplot.gcf().canvas.draw()
    pyplot.close("all")


def test_the_code_of_the_readme_runs():
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    found = {}
    exec(code, found)
    assert found["solution"].compare().position <= 1e-8
