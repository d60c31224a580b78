"""A process that runs one peer: requests come in as JSON lines, answers go out as JSON lines.

Each peer has a process of its own, so that a slow one can be ended, and what it prints is not
mistaken for an answer.
"""

from __future__ import annotations

import gc
import json
import os
import resource
import sys
import time
import warnings
from functools import cache
from importlib import metadata

from benchmarks import peers, problems

AGAIN = 6  # solves in a row, end points back and forth
ENOUGH = 1.0  # seconds of them
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
        return {"status": "", "time": seconds, "error": case.error(answer.curve, both[0])}
    times, errors = [], []
    for k in range(AGAIN):
        ends = both[(k + 1) % 2]
        answer, seconds, said = _attempt(lambda: peer.again(answer, case, ends, setting))  # noqa: B023
        if answer is None:
            return {"status": said, "time": seconds}
        times.append(seconds)
        errors.append(case.error(answer.curve, ends))
        if sum(times) > ENOUGH:
            break
    return {"status": "", "time": sorted(times)[len(times) // 2], "error": max(errors)}


def _version(package: str) -> str:
    if package == "actionopt":
        import actionopt

        return actionopt.__version__
    return metadata.version(package)


def main() -> None:
    """Serve requests until the input ends."""
    replies = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # solvers talk
    os.dup2(1, 2)
    warnings.simplefilter("ignore")
    try:
        peer = peers.get(sys.argv[1])
    except ImportError as error:
        print(json.dumps({"ready": False, "status": f"cannot be imported: {error}"}), file=replies)
        return
    _cases()
    gc.freeze()  # what is imported need not be searched before every measurement
    hello = {
        "ready": True,
        "settings": list(peer.settings),
        "versions": {p: _version(p) for p in ("numpy", *peer.packages)},
    }
    print(json.dumps(hello), file=replies, flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        print(json.dumps(measure(peer, **request)), file=replies, flush=True)


if __name__ == "__main__":
    main()
