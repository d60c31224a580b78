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


REFUSED = "expected another method than 'ipopt': this CasADi is without Ipopt"
CELLS = """
import tempfile
import casadi
from test_guide import DOCS, run
assert not casadi.has_nlpsol("ipopt")
_, wrong, count = run((DOCS / "browser.md").read_text(), tempfile.mkdtemp())
print(wrong, count)
"""


@pytest.fixture
def without_ipopt(tmp_path):
    """A function that runs a program where CasADi has no Ipopt, and returns what it prints."""
    real = Path(find_spec("casadi").origin).parent
    (tmp_path / "casadi").mkdir()
    for file in real.iterdir():  # the same CasADi, all its files but the plugin
        if "nlpsol_ipopt" not in file.name and file.name != "__pycache__":
            (tmp_path / "casadi" / file.name).symlink_to(file)
    places = str(tmp_path), str(Path(ao.__file__).parent.parent), str(Path(__file__).parent)
    start = f"import sys; sys.path[:0] = {places}\n"

    def call(program):
        command = [sys.executable, "-c", start + program]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    return call


@pytest.mark.slow
def test_all_scenes_but_three_are_solved_without_it(without_ipopt):
    *unfound, refused = without_ipopt(PROGRAM).splitlines()
    assert [said.split()[0] for said in unfound] == [
        "beam_on_floor",
        "chain_on_floor",
        "rope_on_floor",
    ]
    assert all("this CasADi is without Ipopt" in said for said in unfound)
    assert refused == REFUSED


@pytest.mark.slow
def test_the_page_for_a_browser_states_what_is_found_without_it(without_ipopt):
    assert without_ipopt(CELLS).splitlines() == [REFUSED, "[] 4"]
