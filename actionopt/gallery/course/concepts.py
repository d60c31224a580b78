"""Twenty questions on ideas: a right answer and two wrong ones each, and why each is so."""

from __future__ import annotations

from dataclasses import dataclass

from actionopt.gallery.course.lessons import BY_NAME
from actionopt.gallery.course.spoken import translate
from actionopt.gallery.page import frame
from actionopt.tools.words import say


@dataclass(frozen=True)
class Question:
    """A question on an idea of a lesson; of its answers (text, why) the first alone is right."""

    name: str
    lesson: str
    text: str
    answers: tuple[tuple[str, str], ...]


QUESTIONS = (
    Question(
        "twice",
        "first",
        "A motion is bent, and then bent twice as much. By which factor does the change of S grow?",
        (
            ("By four.", "The slope of S is zero at a motion: the square of the bend is left."),
            ("By two.", "So it is where S has a slope. At a motion it has none."),
            ("Not at all.", "To first order S does not change. To second order it does."),
        ),
    ),
    Question(
        "sides",
        "first",
        "The straight line of the thrown ball is bent a little upwards, and then downwards. "
        "What does S do?",
        (
            ("It falls one way and rises the other.", "It has a slope: this path is no motion."),
            ("It rises both ways.", "That would make the straight line the motion."),
            ("It falls both ways.", "At a greatest value S would be stationary: a motion again."),
        ),
    ),
    Question(
        "zero",
        "minus",
        "V is measured from another floor: 5 J more everywhere. What changes?",
        (
            ("S of every path, by the same.", "By -5 J times the duration, whatever the path."),
            ("The motion.", "A force is a slope of V, and the slopes are the same."),
            ("Nothing.", "S does: V is summed over the time."),
        ),
    ),
    Question(
        "plus",
        "minus",
        "Let T + V be stationary in place of T - V. Where does the ball go?",
        (
            ("Below the straight line.", "The acceleration is along the slope of V: upwards."),
            ("On the same parabola.", "The sign of V is that of the force."),
            ("On the straight line.", "So it would without any V."),
        ),
    ),
    Question(
        "heavy",
        "minus",
        "A ball of twice the mass is thrown, with the same ends and the same time. Its way is",
        (
            ("the same.", "The mass is a factor of T and V alike, and so of S."),
            ("flatter.", "Twice the weight has twice the mass to move."),
            ("higher.", "T and V grow alike: nothing is gained by flying high."),
        ),
    ),
    Question(
        "period",
        "minus",
        "What is S of a mass on a spring, over one whole period?",
        (
            ("Zero.", "T and V have the same mean."),
            ("Its energy times the period.", "That is the sum of T + V, not of T - V."),
            ("Negative.", "So it is for parts of a period, those far from the middle."),
        ),
    ),
    Question(
        "gauge",
        "gauge",
        "To L is added d/dt (c y^2 / 2). What happens to the momentum p and to the motion?",
        (
            ("p changes, the motion does not.", "p has c y more: the slope of F with y."),
            ("Neither changes.", "L has a term with the velocity more, and p is its slope."),
            ("Both change.", "S of all paths rises by one number, so the lowest stays."),
        ),
    ),
    Question(
        "water",
        "light",
        "Light goes from 1 m above the water to 1 m below it, 1 m sideways. Where does it cross?",
        (
            ("Past the middle.", "A longer way in the air saves time in the water."),
            ("In the middle.", "The straight way is shortest, not fastest."),
            ("Straight above its end.", "The detour in the air then costs more than it saves."),
        ),
    ),
    Question(
        "two",
        "stones",
        "How many throws of one energy hit a target that is inside the safety parabola?",
        (
            ("Two.", "A flat one and a steep one: a square root has two signs."),
            ("One.", "So it is on the safety parabola itself."),
            ("As many as one likes.", "The energy gives the speed: the angle alone is free."),
        ),
    ),
    Question(
        "steep",
        "stones",
        "Which of the two throws has the larger W?",
        (
            ("The steep one.", "It has touched the caustic on its way, and is a saddle."),
            ("The flat one.", "It is least of all ways of this energy."),
            ("Both have the same.", "Both are stationary, each with a value of its own."),
        ),
    ),
    Question(
        "saddle",
        "least",
        "A mass on a spring moves for longer than half a period. Its S is",
        (
            ("a saddle.", "Slow bends lower it, and fast ones raise it."),
            ("least.", "So it is up to the focus, after half a period."),
            ("greatest.", "A fast wiggle always costs: it has much T and little V."),
        ),
    ),
    Question(
        "index",
        "least",
        "With m = k = 1 in SI units the mass moves for 10 s. How many independent bends lower S?",
        (
            ("Three.", "Three foci were passed, one each half period."),
            ("One alone.", "Each further focus gives one way down more."),
            ("Infinitely many.", "Of all fast wiggles none lowers it."),
        ),
    ),
    Question(
        "soft",
        "string",
        "The motion of a mass on a spring ends at its first focus. Its first shape of bends "
        "changes S",
        (
            ("not at all.", "Tension and springs are in balance: the shape is soft."),
            ("upwards.", "So it does before the focus."),
            ("downwards.", "So it does past the focus."),
        ),
    ),
    Question(
        "bottom",
        "push",
        "A bob swings through its lowest point. Its rod pulls with",
        (
            ("more than its weight.", "It carries the weight and turns the velocity round."),
            ("its weight.", "So it would if the bob hung at rest."),
            ("less than its weight.", "So it does near the ends of a wide swing."),
        ),
    ),
    Question(
        "wire",
        "push",
        "A wire turns and takes a bead along, which slides outwards. The force of the wire does",
        (
            ("work on the bead.", "It is across the wire, and the wire itself moves that way."),
            ("no work: it is across the wire.", "So it is only if the wire rests."),
            ("work that is negative.", "The bead becomes faster."),
        ),
    ),
    Question(
        "flight",
        "symmetry",
        "A ball flies without air. Which of its momenta is conserved?",
        (
            ("The horizontal one alone.", "x is missing in L, and y is in it."),
            ("Both.", "Without friction the energy is conserved, not every momentum."),
            ("Neither.", "A shift along x changes no S, so one of them is."),
        ),
    ),
    Question(
        "fast",
        "slopes",
        "A body is nearly as fast as light. How large is p v beside its kinetic energy?",
        (
            ("Less than twice as large.", "Near the speed of light both become alike."),
            ("Twice as large.", "So it is for slow bodies alone."),
            ("More than twice as large.", "Kinetic energy grows faster with v than p v does."),
        ),
    ),
    Question(
        "patch",
        "phase",
        "Many pendulums start in a small patch of the plane of q and p. Later its area is",
        (
            ("unchanged.", "That is Liouville's theorem: it is stretched, and becomes thin."),
            ("larger.", "It becomes longer, but thinner as well."),
            ("smaller.", "So it would with friction."),
        ),
    ),
    Question(
        "turn",
        "sum",
        "Past a focus one bend lowers S that raised it before. The sum over its arrows is turned",
        (
            ("back by a quarter of a turn.", "From an eighth forwards to an eighth backwards."),
            ("by half a turn.", "Each arrow goes to its mirror image, not to its opposite."),
            ("not at all.", "Its length alone stays: the arrows turn the other way."),
        ),
    ),
    Question(
        "closed",
        "slits",
        "At a dark place behind two slits one of them is closed. The place becomes",
        (
            ("brighter.", "The arrows of two slits cancelled there. Now one is left."),
            ("darker.", "Arrows are added, not brightnesses."),
            ("neither.", "It was dark by two arrows that are opposite, not by none."),
        ),
    ),
)  # fmt: skip


def page(title: str) -> str:
    """Return the questions as a page: an answer is opened, and says whether it is right."""
    lead = say(
        "{count} questions with three answers each. Open the one that you think is right.",
        count=len(QUESTIONS),
    )
    rows = "".join(f'<li id="{x.name}">{_question(k, x)}</li>' for k, x in enumerate(QUESTIONS))
    main = f"""<article class="lesson"><header class="title">
<p class="crumb"><a href="../course.html">{say("The course")}</a></p>
<h1>{say(title)}</h1><p class="lead">{lead}</p></header>
<ol class="concepts">{rows}</ol></article>"""
    return frame(say(title), main, root="../", description=lead)


def _question(k: int, question: Question) -> str:
    marks = (say("Right."), say("No."), say("No."))
    answers = [
        f'<details class="choice" name="{question.name}"><summary>{translate(text)}</summary>'
        f"<p><b>{mark}</b> {translate(why)}</p></details>"
        for mark, (text, why) in zip(marks, question.answers, strict=True)
    ]
    at = k % len(answers)  # where the right one stands
    shown = "".join([*answers[1 : at + 1], answers[0], *answers[at + 1 :]])
    title = translate(BY_NAME[question.lesson].title)
    about = say("From the lesson {title}", title=f'<a href="{question.lesson}.html">{title}</a>')
    return f'<p>{translate(question.text)}</p>{shown}<p class="remark">{about}</p>'
