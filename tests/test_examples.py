"""Every example runs, draws, and gives the number it promises."""

import re
import runpy
from pathlib import Path

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
from matplotlib import pyplot

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


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


PROMISES = {
    "01_hello_action": hello_action,
    "02_tension_in_a_rod": tension_in_a_rod,
    "03_least_or_stationary": least_or_stationary,
}


def test_every_example_has_a_promise():
    assert [file.stem for file in EXAMPLES] == sorted(PROMISES)


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_example(file):
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
