"""Call a function in a process of its own, which may crash, hang or take too much memory."""

from __future__ import annotations

import importlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

try:
    import resource
except ImportError:  # not on this system
    resource = None

HOME = str(Path(__file__).parents[2])
THREADED = ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "NUMEXPR_NUM", "VECLIB_MAXIMUM")
ONE_THREAD = {f"{library}_THREADS": "1" for library in THREADED}
POLL = 0.1  # seconds between two looks at what a process has used; ad hoc
MARK = "ACTIONOPT_MARK"  # the file in which a process says from where its time counts


class Died(RuntimeError):
    """The process ended without an answer: how, and the last line of all that it `said`."""

    def __init__(self, code: int, said: str) -> None:
        how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        last = said.strip().splitlines()[-1:] or [""]
        super().__init__(f"the process died with {how}; {last[0]}")
        self.said = said


class Overrun(TimeoutError):
    """The process was ended: it had used so much processor time (s), where that can be read."""

    def __init__(self, said: str, used: float | None) -> None:
        super().__init__(said)
        self.used = used


def run(target: str, *arguments: Any, limit: float, processor: float | None = None) -> Any:
    """Return what the function `target` returns, computed on one thread in a new process.

    Parameters
    ----------
    target : str
        "module:function".
    *arguments
        Plain data, as JSON has it; so is what is returned. What is printed is thrown away.
    limit : float
        Seconds, the process's start included; then it is ended with all its children.
    processor : float, optional
        Seconds of processor time of the process and its children since its last `count_anew`, if it
        calls that; then it is ended as well. Read from outside, where the system has /proc: a
        bound that the system sets changes what some programs do.

    Raises
    ------
    Overrun
        A TimeoutError.
    Died
    """
    # This very package, wherever it was found.
    places = os.pathsep.join(filter(None, [HOME, os.environ.get("PYTHONPATH")]))
    begin = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        result, mark = Path(folder, "result.json"), Path(folder, "mark")
        process = subprocess.Popen(
            [sys.executable, "-m", __name__, target, json.dumps(arguments), str(result)],
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": places, MARK: str(mark)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,  # so that children of its own die with it
        )
        try:
            said = None
            while said is None:
                left = limit - (perf_counter() - begin)
                try:
                    pause = left if processor is None else min(left, POLL)
                    _, said = process.communicate(timeout=max(pause, 0.0))
                except subprocess.TimeoutExpired:
                    used = _processor_time_of(process.pid)
                    begun = used is not None and mark.is_file()
                    if used is not None and begun:
                        used -= float(mark.read_text())
                    if begun and processor is not None and used is not None and used > processor:
                        raise Overrun(f"no answer in {processor:g} s", used) from None
                    if left <= POLL:
                        raise Overrun(f"no answer in {limit:g} s of the clock", used) from None
        finally:
            _end(process)
        if result.is_file():
            return json.loads(result.read_text(encoding="utf-8"))
    raise Died(process.returncode, said.decode(errors="replace"))


def processor_time() -> float:
    """Return the seconds of the processor that this process and its children have used."""
    return process_time() + children_time()


def children_time() -> float:
    """Return the seconds of the processor that this process's children have used.

    Those that nobody has waited for, too, where the system has /proc.
    """
    ended = resource.getrusage(resource.RUSAGE_CHILDREN) if resource else None
    return _time_of_children(os.getpid()) + (ended.ru_utime + ended.ru_stime if ended else 0.0)


def count_anew() -> None:
    """Let the processor time that `run` allows count from here, in a process that it started."""
    if place := os.environ.get(MARK):
        part = Path(place).with_suffix(".part")
        part.write_text(repr(processor_time()), encoding="utf-8")
        part.replace(place)


def _processor_time_of(pid: int) -> float | None:
    """Return the processor time (s) of a process and its children; None where none can be read."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:  # it has just ended, or the system has no /proc
        return None
    ticks = sum(map(int, fields[11:15]))  # its own, and those of children it has waited for
    return ticks / os.sysconf("SC_CLK_TCK") + _time_of_children(pid)


def _time_of_children(pid: int) -> float:
    """Return the processor time (s) of a process's children that it has not waited for."""
    total = 0.0
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):
            total += sum(
                _processor_time_of(int(child)) or 0.0 for child in task.read_text().split()
            )
    return total


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
