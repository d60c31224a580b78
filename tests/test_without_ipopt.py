"""Where CasADi has no Ipopt, as in a browser: what does not need it works, what does says so."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import actionopt as ao

PROGRAM = """
import casadi
assert not casadi.has_nlpsol("ipopt")

import actionopt as ao
from actionopt import scenes

for name in scenes.SCENES:
    scene = scenes.get(name)
    try:
        path = ao.solve(scene.problem, guess=scene.guess)
        known = scene.action
        assert known is None or abs(path.action - known) < 1e-7 * max(1, abs(known)), name
    except ao.SolveError as error:
        print(name, error)
try:
    ao.solve(scenes.get("pendulum").problem, method="ipopt")
except ValueError as error:
    print(error)
"""


@pytest.mark.slow
def test_all_scenes_but_one_are_solved_without_it(tmp_path):
    real = Path(find_spec("casadi").origin).parent
    (tmp_path / "casadi").mkdir()
    for file in real.iterdir():  # the same CasADi, all its files but the plugin
        if "nlpsol_ipopt" not in file.name and file.name != "__pycache__":
            (tmp_path / "casadi" / file.name).symlink_to(file)
    package = Path(ao.__file__).parent.parent
    start = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(package)!r}]\n"
    done = subprocess.run(
        [sys.executable, "-c", start + PROGRAM], capture_output=True, text=True, check=True
    )
    unfound, refused = done.stdout.splitlines()
    assert unfound.startswith("chain_on_floor ") and "this CasADi is without Ipopt" in unfound
    assert refused == "expected another method than 'ipopt': this CasADi is without Ipopt"
