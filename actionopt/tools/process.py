"""Call a function in a process of its own, which may crash, hang or take too much memory."""

from __future__ import annotations

import importlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HOME = str(Path(__file__).parents[2])
THREADED = ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "NUMEXPR_NUM", "VECLIB_MAXIMUM")
ONE_THREAD = {f"{library}_THREADS": "1" for library in THREADED}


class Died(RuntimeError):
    """The process ended without an answer: how, and the last line of all that it `said`."""

    def __init__(self, code: int, said: str) -> None:
        how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        last = said.strip().splitlines()[-1:] or [""]
        super().__init__(f"the process died with {how}; {last[0]}")
        self.said = said


def run(target: str, *arguments: Any, limit: float) -> Any:
    """Return what the function `target` returns, computed on one thread in a new process.

    Parameters
    ----------
    target : str
        "module:function".
    *arguments
        Plain data, as JSON has it; so is what is returned. What is printed is thrown away.
    limit : float
        Seconds, the process's start included; then it is ended with all its children.

    Raises
    ------
    TimeoutError
    Died
    """
    # This very package, wherever it was found.
    places = os.pathsep.join(filter(None, [HOME, os.environ.get("PYTHONPATH")]))
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder, "result.json")
        process = subprocess.Popen(
            [sys.executable, "-m", __name__, target, json.dumps(arguments), str(result)],
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": places},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,  # so that children of its own die with it
        )
        try:
            _, said = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            raise TimeoutError(f"no answer in {limit:g} s") from None
        finally:
            _end(process)
        if result.is_file():
            return json.loads(result.read_text(encoding="utf-8"))
    raise Died(process.returncode, said.decode(errors="replace"))


def _end(process: subprocess.Popen) -> None:
    """End the process and its children, and wait for it."""
    if process.poll() is None:
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
        process.communicate()


def function(target: str) -> Any:
    """Return the function that "module:function" names."""
    module, _, name = target.partition(":")
    return getattr(importlib.import_module(module), name)


def main(target: str, arguments: str, file: str) -> None:
    """Call the function and write what it returns."""
    answer = function(target)(*json.loads(arguments))
    Path(file).write_text(json.dumps(answer), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
