"""What the live figure says, in English; its script fills the braces."""

from __future__ import annotations

from actionopt.tools.words import say

PAGE_WORDS = {
    "path": "The path",
    "lagrangian": "L along the path",
    "alpha": "S along the present bend",
    "missing": "Missing force",
    "square": "the area is S; one square is {x}",
    "solve": "Solve",
    "relax": "Relax",
    "hunt": "Let it hunt",
    "bend": "Bend it",
    "wave": "Make waves",
    "half": "Half the bend",
    "restart": "Start over",
    "stop": "Stop",
    "show": "Show the motion",
    "parameters": "Parameters",
    "duration": "Duration",
    "coordinate": "Coordinate",
    "at": "Path at t = {t}",
    "same": "as on the motion",
    "more": "{x} more than on the motion",
    "less": "{x} less than on the motion",
    "best": "best so far {x}",
    "minimum": "minimum",
    "saddle": "saddle, index {k}",
    "degenerate": "degenerate: the end is conjugate to the start",
    "slope": "first order: slope {here} on your path, {there} on the motion",
    "slopes": "first order: slope {here} on your path, {there} on the straight line",
    "steepest": "first order: the steepest slope of S is {x} here",
    "distance": "distance from the Lagrange\u2013d\u2019Alembert equations: {x}",
    "forced": "a force without a potential acts: no action is stationary",
    "once": "Newton\u2019s method, one step.",
    "solved": "Newton\u2019s method, {k} steps.",
    "stationary": "Here the slope is zero in every direction.",
    "elsewhere": "No stationary path was found near yours; this one is elsewhere.",
    "lost": "The motion could not be followed farther.",
    "unmarked": "Conjugate times are marked for the numbers given at first alone.",
    "halved": "Half the bend: the change of S went from {a} to {b}, {r} of it.",
    "quarter": "A quarter: on the motion nothing is left of the first order.",
    "straighten": "Half would be first order: the straight line is not stationary.",
    "hint": "Drag a handle. The motion is hidden until you ask for it.",
    "nothing": "The path is not bent. Drag a handle, or press \u201cBend it\u201d.",
    "arrived": "Downhill as far as it goes: this is a path of least action among its neighbours.",
    "runs": "The path runs away and S falls without end: the motion is on no valley\u2019s floor.",
    "level": "The slope is zero here: bend the path a little, and let go.",
    "hunted": "The machine moved one handle at a time, {k} trials, and kept what lowered S.",
    "picture": "What moves",
    "film": "What moves, on the motion",
    "play": "Play",
    "pause": "Pause",
    "clock": "t = {t}",
    "sum": "Sum over paths",
    "hbar": "\u0127",
    "neighbours": "Neighbours, coloured by the phase of exp(iS/\u0127)",
    "spiral": "An arrow exp(iS/\u0127) for each, end to end",
    "turned": "The sum of all arrows is turned by {found}\u00b0; "
    "by {known}\u00b0 for small \u0127.",
    "focus": "At the focus S does not change to second order: all the neighbours agree, "
    "and the sum is as long as it gets.",
}


def words() -> dict[str, str]:
    """Return the words of the live figure in the current language."""
    return {key: say(text) for key, text in PAGE_WORDS.items()}
