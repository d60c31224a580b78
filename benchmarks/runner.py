"""Peers in processes of their own, asked one at a time and ended when they take too long."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Sequence
from contextlib import suppress

from actionopt.tools.process import ONE_THREAD
from benchmarks import problems, worker

START_LIMIT = 120.0  # seconds for a peer's imports


class Worker:
    """One peer's process."""

    def __init__(self, peer: str) -> None:
        spawn = multiprocessing.get_context("spawn")
        self.pipe, theirs = spawn.Pipe()
        self.process = spawn.Process(target=worker.serve, args=(theirs, peer))
        self.process.start()
        theirs.close()
        self.hello = self.reply(START_LIMIT)

    def ask(self, request: dict, limit: float) -> dict | None:
        """Return the reply, or None if it did not come in time."""
        with suppress(OSError):
            self.pipe.send(request)
        return self.reply(limit)

    def reply(self, limit: float) -> dict | None:
        """Return what comes within `limit` seconds, None if that is nothing."""
        try:
            return self.pipe.recv() if self.pipe.poll(limit) else None
        except (EOFError, OSError):  # it ended
            return None

    def close(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.join()


class Bench:
    """All peers, each started when first asked; `limit` is in seconds a solve."""

    def __init__(self, names: Sequence[str], limit: float) -> None:
        self.names, self.limit = list(names), limit
        self.workers: dict[str, Worker] = {}
        os.environ.update(ONE_THREAD)  # of the processes that are started
        self.cases = problems.load()

    def starts(self, case: str) -> Sequence[str]:
        """Return the first guesses to try on a problem."""
        return self.cases[case].starts

    def settings(self, peer: str) -> list:
        """Return a peer's ladder; one step for a peer that is not there, to say so."""
        hello = self._worker(peer).hello
        return hello["settings"] if hello and hello["ready"] else [None]

    def versions(self) -> dict[str, str]:
        """Return the versions of all peers' packages."""
        found: dict[str, str] = {}
        for peer in self.names:
            found.update((self._worker(peer).hello or {}).get("versions", {}))
        return found

    def ask(self, peer: str, request: dict) -> dict:
        """Run one request; a peer that takes too long is ended and says so."""
        mine = self._worker(peer)
        if not mine.hello or not mine.hello["ready"]:
            said = mine.hello["status"] if mine.hello else "its process ended"
            return {"status": f"unable: {said}", "time": 0.0}
        clock = time.perf_counter()
        # "Again" means a cold solve and several more.
        limit = self.limit * (1 if request["kind"] == "cold" else 3)
        reply = mine.ask(request, limit)
        if reply is not None:
            return reply
        seconds = time.perf_counter() - clock
        mine.close()
        del self.workers[peer]
        what = f"no answer in {limit:g} s" if seconds >= limit else "its process ended"
        return {"status": what, "time": seconds}

    def _worker(self, peer: str) -> Worker:
        if peer not in self.workers:
            self.workers[peer] = Worker(peer)
        return self.workers[peer]

    def close(self) -> None:
        """End all processes."""
        for each in self.workers.values():
            each.close()
