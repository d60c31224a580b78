"""The problems, in the order of the report."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.problems import (
    chain,
    double_pendulum,
    lattice,
    plane,
    questions,
    single,
    three_bodies,
)
from benchmarks.problems._case import Case, Ends
from benchmarks.problems._stored import others

__all__ = ["INTEGRATED", "QUICK", "Case", "Ends", "load"]

INTEGRATED = (double_pendulum, three_bodies, chain, lattice)  # references come from a file
QUICK = ("oscillator_long", "pendulum", "kepler", "rod_pendulum", "double_pendulum")


def load() -> dict[str, Case]:
    """Return every case by name, in the order of the report."""
    modules = (single, plane, questions, *INTEGRATED)
    return {c.name: _with_others(c) for module in modules for c in module.cases()}


def _with_others(case: Case) -> Case:
    def ends():
        pair = zip(case.ends(), others(case.name), strict=True)
        return tuple(replace(e, others=paths) for e, paths in pair)

    return replace(case, ends=ends)
