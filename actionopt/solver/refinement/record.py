"""What was done on the way to a path: counts, rounds of refinement, and where the time went."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

from actionopt.discrete.action.transcription import Transcription


class Clock:
    """Adds the time that its body takes to one of the `times`."""

    def __init__(self, times: dict[str, float], name: str) -> None:
        self.times, self.name = times, name

    def __enter__(self) -> None:
        self.started = perf_counter()

    def __exit__(self, *_: object) -> None:
        self.times[self.name] += perf_counter() - self.started


@dataclass(eq=False)
class Record:
    """Statistics of a search for `Solution.stats`; they are never used for decisions."""

    # By method: "newton", "descent", "ipopt", "continuation".
    iterations: Counter[str] = field(default_factory=Counter)
    evaluations: Counter[str] = field(default_factory=Counter)  # by function
    # One for each mesh on which the path was found: elements, degrees, unknowns, the estimate of
    # the error if there was one, and the seconds.
    rounds: list[dict[str, Any]] = field(default_factory=list)
    # Seconds, by what they were spent on.
    time: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    def clock(self, name: str) -> Clock:
        """Return what adds the time that the body takes to `name`."""
        return Clock(self.time, name)

    def round(self, tr: Transcription, seconds: float) -> None:
        """Note that a path was found on a mesh."""
        degrees = tr.mesh.degrees
        self.rounds.append(
            {
                "elements": tr.mesh.elements,
                "degrees": [min(degrees), max(degrees)],
                "unknowns": tr.layout.size,
                "estimate": None,  # until it is measured
                "time": seconds,
            }
        )

    def after(self, earlier: Record) -> Record:
        """Return the record of both, the rounds of this one alone."""
        time = defaultdict(float, earlier.time)
        for name, seconds in self.time.items():
            time[name] += seconds
        return Record(
            earlier.iterations + self.iterations,
            earlier.evaluations + self.evaluations,
            self.rounds,
            time,
        )
