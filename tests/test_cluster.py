"""The page "From a laptop to a cluster": its pieces of code run, where what they need is there."""

import ast
import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import same_bits
from test_guide import agree, stated

PAGE = Path(__file__).parent.parent / "docs" / "cluster.md"
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def needs(block):
    return re.findall(r"^# needs (\w+)$", block, re.MULTILINE)


@pytest.mark.long
def test_the_pieces_of_code_run_and_find_what_they_say(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names, values = {}, 0
    for block in (block for block in BLOCKS if "# file" not in block):
        if not all(map(importlib.util.find_spec, needs(block))):
            continue
        for statement, comment in stated(block):
            code = ast.unparse(statement)
            if comment:
                assert agree(eval(code, names), comment), code
                values += 1
            else:
                exec(code, names)
    assert values >= 4


@pytest.mark.skipif(
    shutil.which("mpiexec") is None or importlib.util.find_spec("mpi4py") is None,
    reason="needs mpiexec and mpi4py",
)
def test_two_ranks_of_mpi_find_the_same(tmp_path):
    import actionopt as ao

    script = next(block for block in BLOCKS if "# file far.py" in block)
    (tmp_path / "far.py").write_text(script, encoding="utf-8")
    command = ["mpiexec", "-n", "2", sys.executable, "-m", "mpi4py.futures", "far.py"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=100)
    with np.load(tmp_path / "far.npz") as kept:
        found = dict(kept)
    here = ao.sweep(ao.scenes.get("pendulum").problem, {"t1": np.linspace(0.4, 0.9, 50)})
    for name in ("action", "momenta"):
        same_bits(found[name], getattr(here, name), because="tasks do not depend on who does them")
    assert here.success.all()
