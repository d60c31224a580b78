"""The words of the course, each with the lesson that brings it."""

from __future__ import annotations

from actionopt.gallery.course.lesson import Lesson
from actionopt.gallery.course.lessons import BY_NAME
from actionopt.gallery.course.spoken import translate
from actionopt.gallery.page import frame
from actionopt.tools.words import say

WORDS = (  # name, word, lesson, what it means
    ("event", "event", "hunt", "A place together with a time: where and when a path starts, "
     "or ends."),
    ("path", "path", "hunt", "A place for every time between two events, whether a body goes "
     "that way or not."),
    ("motion", "motion", "hunt", "A path that a body takes by itself: S is stationary there."),
    ("action", "action", "hunt", "The number S of a path: L, summed over its time."),
    ("lagrangian", "Lagrangian", "hunt", "The function L of place, velocity and time that is "
     "summed; T - V in mechanics."),
    ("stationary", "stationary", "first", "Small bends change S to second order only: least, "
     "greatest, or a saddle."),
    ("variation", "variation", "first", "A small bend of a path, zero at its ends."),
    ("euler", "law of Euler and Lagrange", "local", "What S stationary says of each moment: "
     "d/dt (dL/dv) = dL/dx."),
    ("gauge", "gauge", "gauge", "What may be added to L without a change of any motion: the "
     "time derivative of a function F(x, t)."),
    ("caustic", "caustic", "stones", "A curve that many rays or motions touch; beyond it none "
     "of them comes."),
    ("focus", "kinetic focus", "least", "The event at which neighbouring motions with the same "
     "start meet again."),
    ("saddle", "saddle", "least", "A stationary path from which some bends lower S, and others "
     "raise it."),
    ("index", "index", "least", "The number of independent bends that lower S: as many as there "
     "are foci on the way."),
    ("constraint", "constraint", "push", "An equation f = 0 that all paths compared must keep."),
    ("multiplier", "multiplier", "push", "The factor lambda of a constraint, which gives its "
     "force."),
    ("symmetry", "symmetry", "symmetry", "A change of all paths that leaves S as it is, to "
     "first order."),
    ("conserved", "conserved", "symmetry", "The same at all times, on every motion of a system."),
    ("momentum", "momentum", "slopes", "The slope p of L with the velocity."),
    ("energy", "energy function", "slopes", "H = p v - L; T + V in most of mechanics."),
    ("hbar", "constant of Planck", "sum", "The action hbar for which the arrow of a path turns "
     "by one radian."),
)  # fmt: skip


def page(title: str) -> str:
    """Return the words as a page."""
    lead = say("{count} words of the course, in the order of its lessons.", count=len(WORDS))
    rows = "".join(
        f'<dt id="{name}">{translate(word)}</dt><dd>{translate(text)} '
        f'<a href="{lesson}.html">{translate(BY_NAME[lesson].title)}</a></dd>'
        for name, word, lesson, text in WORDS
    )
    main = f"""<article class="lesson"><header class="title">
<p class="crumb"><a href="../course.html">{say("The course")}</a></p>
<h1>{say(title)}</h1><p class="lead">{lead}</p></header><dl class="words">{rows}</dl></article>"""
    return frame(say(title), main, root="../", description=lead)


def links(lesson: Lesson) -> str:
    """Return links to the words that a lesson brings; nothing if there are none."""
    brought = ", ".join(
        f'<a href="glossary.html#{name}">{translate(word)}</a>'
        for name, word, of, _ in WORDS
        if of == lesson.name
    )
    return f'<p class="remark">{say("New words:")} {brought}</p>' if brought else ""
