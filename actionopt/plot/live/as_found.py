"""Questions that a page cannot ask: it keeps the ends that were found, or shows the path alone."""

from __future__ import annotations

from html import escape

from actionopt.analysis.solution import Solution
from actionopt.mechanics.question.events import Event
from actionopt.mechanics.question.problem import Periodic, Problem
from actionopt.plot._files import svg
from actionopt.plot._names import UnitNames
from actionopt.plot._paths import paths
from actionopt.plot.live.law import law
from actionopt.solver.input.arguments import Guess
from actionopt.solver.solve import solve
from actionopt.tools.words import number, say

PAGE_TOL = 1e-10  # of the path that the page has as its answer
PINNED_WITHIN = 1e-6  # of the coordinates' sizes: what a path may move that is solved again

# What of a question is kept as it was found; what is said of it.
ENDS_KEPT = (
    (
        lambda p: isinstance(p.end, Periodic),
        "The path closes. The page keeps its ends where they were found, and compares paths "
        "between these: its kind is that among them.",
    ),
    (
        lambda p: p.is_infinite or p.has_tails,
        "An end is at infinite time. The page shows the window in which the path was solved, and "
        "keeps the ends of that window.",
    ),
    (
        lambda p: p.free_time,
        "The time was to be found. The page keeps the one that was found, {T}, and compares paths "
        "that take as long: its kind is that among them.",
    ),
    (
        lambda p: p.on_surface,
        "Where the path meets a surface was to be found. The page keeps the place, and compares "
        "paths to there: its kind is that among them.",
    ),
)
# What of a question leaves nothing to be bent.
ALONE = (
    (lambda p: bool(p.through or p.laws), "events between its ends"),
    (lambda p: p.integral is not None, "a given integral"),
    (lambda p: bool(p.system.r), "an obstacle"),
    (lambda p: p.system.order > 1, "accelerations"),
)
SHOWN_ALONE = (
    "This page cannot solve a question with {what} again, so no path can be bent here. It shows "
    "the path that was found: S = {S}."
)
LOST_ALONE = (
    "Between the ends that were found the page's method does not find this path again, so no path "
    "can be bent here. It shows the path that was found: S = {S}."
)


def answer(question: Problem, guess: Guess | None, units: UnitNames) -> tuple[Solution, str, bool]:
    """Return what a page shows of a question, what it says of that, and whether it can be bent.

    Raises ValueError for a law that a page cannot compute, SolveError if no path is found.
    """
    alone = next((what for holds, what in ALONE if holds(question)), "")
    if not alone:
        law(question.system)
    found = solve(question, tol=PAGE_TOL, guess=guess)
    S = f"{number(found.action)} {units.action}".rstrip()
    if alone:
        return found, say(SHOWN_ALONE, what=say(alone), S=S), False
    asked = question.asked or question  # whose times and places may be known by now
    kept = [words for holds, words in ENDS_KEPT if holds(asked)]
    if not kept:
        return found, "", True
    T = f"{number(found.path.mesh.boundaries[-1] - found.path.mesh.boundaries[0], 4)} {units.time}"
    pinned = _pin(found)
    if not pinned:
        return found, say(LOST_ALONE, S=S), False
    return pinned, " ".join(say(words, T=T.rstrip()) for words in kept), True


def _pin(found: Solution) -> Solution | None:
    """Return the path between the events at its ends, if it is found again between these."""
    path, problem = found.path, found.problem
    t = path.mesh.boundaries[[0, -1]]
    ends = (Event(float(x), path(x).tolist()) for x in t)
    try:
        between = Problem(problem.system, *ends, parameters=problem.parameters)
        again = solve(between, guess=path, tol=PAGE_TOL, throw=False)
    except ValueError:  # an end that its own constraint refuses, by rounding
        return None
    nodes = path.mesh.nodes
    off = abs(again(nodes) - path(nodes)).max(axis=1) / problem.lengths
    return again if again.success and off.max() <= PINNED_WITHIN else None


def still(solution: Solution, units: UnitNames, words: str) -> str:
    """Return a path that cannot be bent, as HTML."""
    drawn = svg(lambda figure: paths(solution, figure.subplots(), units=units, compare=False))
    said = escape(words)
    drawn = drawn[drawn.index("<svg") :].replace("<svg", f'<svg role="img" aria-label="{said}"', 1)
    return f'<figure class="found">{drawn}<figcaption>{said}</figcaption></figure>'
