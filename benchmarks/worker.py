"""What runs one peer: requests come in by a pipe, and answers go out.

Each peer has a process of its own, so that a slow one can be ended, and what it prints is not
mistaken for an answer.
"""

from __future__ import annotations

import gc
import os
import resource
import time
import warnings
from contextlib import suppress
from functools import cache

from benchmarks import peers, problems
from benchmarks.results import version

AGAIN = 6  # solves in a row, end points back and forth
ENOUGH = 1.0  # seconds of them
CANNOT = {
    "energy": "cannot find how long a path of given energy takes",
    "orbit": "cannot find how long a closed path of given energy takes",
    "infinity": "cannot end at infinite times",
}
_last: dict = {}  # the last cold answer


@cache
def _cases():
    return problems.load()


@cache
def _ends(name: str):
    return _cases()[name].ends()


def _seconds() -> float:
    """Return the processor time of this process and of compilers that it started."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def _attempt(work):
    """Return what `work` returns, or None, its seconds, and the sentence of its failure.

    Seconds of the processor: on one thread they are those of the clock on a machine that does
    nothing else, and they stay the same on one that does.
    """
    clock = _seconds()
    try:
        answer, said = work(), ""
    except (peers.Failed, peers.Unable) as error:
        answer, said = None, f"{type(error).__name__.lower()}: {error}"
    except Exception as error:
        answer, said = None, f"{type(error).__name__}: {error}"
    return answer, _seconds() - clock, said


def measure(peer: peers.Peer, case_name: str, start: str, setting, kind: str) -> dict:
    """Run one request: kind is "cold", or "again" for a median of solves in a row."""
    case = _cases()[case_name]
    if case.asks not in peer.answers:
        return {"status": f"unable: {CANNOT[case.asks]}", "time": 0.0}
    both = _ends(case_name)
    gc.collect()
    key = (case_name, start, str(setting))
    if kind == "again" and key in _last:
        answer = _last[key]
    else:
        _last.clear()
        answer, seconds, said = _attempt(lambda: peer.cold(case, both[0], start, setting))
        if answer is None:
            return {"status": said, "time": seconds}
        _last[key] = answer
    if kind == "cold":
        return {
            "status": "",
            "time": seconds,
            "error": case.error(answer.curve, both[0], answer.duration),
        }
    times, errors = [], []
    for k in range(AGAIN):
        ends = both[(k + 1) % 2]
        last = answer
        answer, seconds, said = _attempt(lambda: peer.again(last, case, ends, setting))  # noqa: B023
        if answer is None:
            return {"status": said, "time": seconds}
        times.append(seconds)
        errors.append(case.error(answer.curve, ends, answer.duration))
        if sum(times) > ENOUGH:
            break
    return {"status": "", "time": sorted(times)[len(times) // 2], "error": max(errors)}


def serve(pipe, name: str) -> None:
    """Answer requests to the peer `name` until the other end is closed."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # solvers talk
    os.dup2(1, 2)
    warnings.simplefilter("ignore")
    try:
        peer = peers.get(name)
    except ImportError as error:
        pipe.send({"ready": False, "status": f"cannot be imported: {error}"})
        return
    _cases()
    gc.freeze()  # what is imported need not be searched before every measurement
    versions = {p: version(p) for p in ("numpy", *peer.packages)}
    pipe.send({"ready": True, "settings": peer.settings, "versions": versions})
    with suppress(EOFError):
        while True:
            pipe.send(measure(peer, **pipe.recv()))
