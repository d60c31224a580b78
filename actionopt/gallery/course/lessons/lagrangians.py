"""Lessons on the Lagrangian: its sign, what may be added to it, and its slope."""

from actionopt.gallery.course.lesson import Exercise, Lesson

T_MINUS_V = Lesson(
    "minus",
    "Why T minus V?",
    (5, 5, 15, 20),
    "The sign is no mystery: with T plus V the ball would fall upwards. And what is added to V "
    "everywhere alike changes no path.",
    predict=(
        "Energy is T plus V. The action has T minus V. What would happen in a world in which the "
        "sum T + V were stationary? Sketch the ball's path there.",
    ),
    attempt=(
        "Here L = T - (1 - 2 s) V. Press Solve, and slide s from 0 to 1, from T - V to T + V: when "
        "is the path straight, and how does it hang then? Slide the mass, which is in T and V "
        "alike: does the path change?",
    ),
    explain=(
        "From the lesson before: the slope of S with the middle place is the force less mass times "
        "acceleration. T gives the second, V the first, and they must have opposite signs for the "
        "two to balance. With a plus the acceleration would be along the slope of V, uphill.",
        "For the conserved energy the signs are equal, and that is no contradiction: "
        "energy is p v less L, and T is counted twice in p v. For a mass on a spring T and V have "
        "the same mean over a period, so that the action of a period is zero, though the energy is "
        "not.",
        "Deeper reasons exist. A clock that is moved and lifted shows a different time: it goes "
        "slower with speed, by T / (m c^2), and faster with height, by V / (m c^2). So T - V is, "
        "but for a factor, what the clock of the ball loses, and the ball's free flight is the one "
        "on "
        "which its own clock goes furthest ahead.",
    ),
    watch="Ask which way the arc bends at s = 1/2, before they slide on.",
    wrong="T - V is the energy that is left; or with T + V nothing changes but the sign of S.",
    trap="T - V is not conserved and is not an energy that the body has.",
    scenes=("projectile", "oscillator"),
    explorer="minus",
    parts=("parameters",),
    exercises=(
        Exercise(
            "Solve for the ball with L = T + V. How far below or above the straight line is it "
            "halfway?",
            """\
import actionopt as ao

wrong = ao.System(lambda q, v, t: v @ v / 2 + 9.81 * q[1], ["x", "y"])
path = ao.solve(ao.Problem(wrong, ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [3.0, 1.0])))
below = 0.5 - float(path(0.5)[1])
print("halfway it is", below, "m below the straight line")
""",
            "{below:.4g} m below: it falls upwards, and has to be thrown downwards.",
            "below",
            "m",
            label="below the straight line",
        ),
        Exercise(
            "A mass on a spring moves as x = cos(t), in SI units with m = k = 1. What are the "
            "means "
            "of T and V over a period, and what is S of a whole period?",
            """\
import numpy as np

t = np.linspace(0, 2 * np.pi, 20001)
T, V = np.sin(t) ** 2 / 2, np.cos(t) ** 2 / 2
kinetic, potential = (np.trapezoid(E, t) / (2 * np.pi) for E in (T, V))
S = round(np.trapezoid(T - V, t), 12) + 0.0  # without round-off
print(kinetic, potential, "J, S =", S, "J s")
""",
            "{kinetic:.4g} J and {potential:.4g} J: the same, and so S = {S:.0f} J s.",
            "S",
            "J s",
            label="S of a period",
        ),
        Exercise(
            "Add 5 J to V everywhere. By how much does S of the ball change, and its path?",
            """\
import numpy as np

import actionopt as ao

ends = ao.Event(0.0, [0.0, 0.0]), ao.Event(1.0, [3.0, 1.0])
first, second = (
    ao.solve(ao.Problem(ao.System(lambda q, v, t: v @ v / 2 - 9.81 * q[1] - c, ["x", "y"]), *ends))
    for c in (0.0, 5.0)
)
change = second.action - first.action
t = np.linspace(0, 1, 101)
apart = float(np.max(np.abs(first(t) - second(t))))
print(change, "J s;", apart, "m")
""",
            "S changes by {change:.4g} J s, for every path alike. The path does not change: where "
            "the zero of V is makes no difference.",
            "change",
            "J s",
            label="change of S",
        ),
    ),
)

GAUGE = Lesson(
    "gauge",
    "What may be added",
    (5, 15, 10, 15),
    "Add the time derivative of any F(x, t) to L: S of every path rises by the same number, and no "
    "motion changes.",
    predict=(
        "Two friends write down different Lagrangians for one ball, and both find the right "
        "parabola. By what may their Lagrangians differ?",
    ),
    observe=(
        "Slide c, and drag the path: by how much does S rise, for this path and for that? Then add "
        "c y, which is no time derivative, and look what moves.",
    ),
    explain=(
        "The integral of dF/dt is F at the end less F at the start, whatever the way between. The "
        "ends are given, so this is one number for all paths. The landscape of S rises rigidly: "
        "its level places stay where they were, and a lowest place stays a lowest place.",
        "What does change is the momentum, by the slope of F with x, and S itself. Neither is a "
        "thing to be measured alone. The kinetic energy of a ball seen from a train differs by "
        "just such a term: that is why both observers find the same motion.",
    ),
    steps=(
        ("Two Lagrangians:", "L2 = L1 + dF/dt"),
        ("Summed over the time, with the ends 0 and T:", "S2 = S1 + F(x(T),T) - F(x(0),0)"),
        ("Bend the path, its ends kept: what F adds is the same as before.", "dS2/da = dS1/da"),
    ),
    watch="Read S of two paths before and after, and compare the differences only.",
    wrong="By a constant alone; or any term may be added that has the right unit.",
    trap="Another S is not another physics: only differences between paths count.",
    figure="gauge",
    scenes=("oscillator_gauge", "charge_gauge"),
    exercises=(
        Exercise(
            "A ball of 1 kg goes straight up from 0 m to 1 m in 1 s. To its L is added "
            "d/dt (c y^2 / 2) with c = 6 kg/s. By how much does S of its motion rise?",
            """\
import actionopt as ao

ends = ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])


def ball(c):
    return ao.System(lambda q, v, t: v[0] ** 2 / 2 - 9.81 * q[0] + c * q[0] * v[0], ["y"])


plain, other = (ao.solve(ao.Problem(ball(c), *ends)) for c in (0.0, 6.0))
rise = other.action - plain.action
print(rise, "J s")
""",
            "By {rise:.4g} J s, which is F at the end, c / 2 times 1 m^2, less F at the start, "
            "zero.",
            "rise",
            "J s",
            label="rise of S",
        ),
        Exercise(
            "The same ball is watched from a lift that rises with 3 m/s: take "
            "m (v - 3 m/s)^2 / 2 as its kinetic energy, and V as before. By how much does S "
            "change, and how far does the path move?",
            """\
import numpy as np

import actionopt as ao

ends = ao.Event(0.0, [0.0]), ao.Event(1.0, [1.0])
ground, lift = (
    ao.solve(
        ao.Problem(ao.System(lambda q, v, t: (v[0] - u) ** 2 / 2 - 9.81 * q[0], ["y"]), *ends)
    )
    for u in (0.0, 3.0)
)
change = lift.action - ground.action
t = np.linspace(0, 1, 101)
apart = float(np.max(np.abs(lift(t) - ground(t))))
print(change, "J s;", apart, "m")
""",
            "S changes by {change:.4g} J s: what is added, m u^2 / 2 - m u v, is the time "
            "derivative of m u^2 t / 2 - m u y. The path does not move.",
            "change",
            "J s",
            label="change of S",
        ),
    ),
)

SLOPES = Lesson(
    "slopes",
    "Momentum is a slope",
    (5, 10, 15, 15),
    "The slope of L with the velocity is the momentum p, and where its tangent meets the axis of L "
    "stands -H.",
    predict=(
        "L is drawn against the velocity v. At one point of the curve you may draw one straight "
        "line. Can the momentum be read from it, and the energy?",
    ),
    observe=(
        "Drag the point along L. The slope of the tangent is p, and it meets the axis at -H. The "
        "arrow is p v: for which body is it twice the energy of motion?",
    ),
    explain=(
        "A curve is known by its points, L for each v. It is known as well by its tangents: where "
        "that of the slope p meets the axis, for each p. The second is Legendre's transform, and "
        "its value, with the other sign, is H.",
        "It leads back: the slope of H with p is v. Nothing is lost where L bends upwards "
        "everywhere, for then each slope occurs once.",
        "For a slow body p v is twice T, and H = T + V. For a fast one L is no difference of T and "
        "V at all, and still p is the slope, and H the energy.",
    ),
    steps=(
        ("The slope:", "p = dL/dv"),
        ("The tangent at v, followed to the axis, has fallen by p v:", "-H = L - p v"),
        ("So the energy function is", "H = p v - L"),
        ("Its slope with p, by the product rule:", "dH/dp = v + p dv/dp - dL/dv dv/dp"),
        ("The last two terms cancel, since p is the slope of L:", "dH/dp = v"),
    ),
    watch="Twice T holds for slow bodies alone: take the fast one before they write it down as a "
    "rule.",
    wrong="H is T + V by definition, and p is m v.",
    trap="The momentum is not always m v: it is what L says.",
    figure="legendre",
    scenes=("charge_planar",),
    exercises=(
        Exercise(
            "A body of 2 kg moves at 3 m/s where V = 5 J. What are p v and L, and where does the "
            "tangent meet the axis?",
            """\
m, v, V = 2.0, 3.0, 5.0
L, p = m * v**2 / 2 - V, m * v
meets = L - p * v
print(p * v, "J,", L, "J,", meets, "J")
work, lagrangian = p * v, L
""",
            "p v = {work:.4g} J, twice T, and L = {lagrangian:.4g} J. The tangent meets the axis "
            "at {meets:.4g} J, which is -(T + V).",
            "meets",
            "J",
            label="where it meets",
        ),
        Exercise(
            "With m = c = 1 a free body has L = -sqrt(1 - v^2). What are its momentum and its "
            "energy at v = 0.8?",
            """\
import numpy as np


def L(v):
    return -np.sqrt(1 - v**2)


v, h = 0.8, 1e-6
p = (L(v + h) - L(v - h)) / (2 * h)  # the slope
H = p * v - L(v)
print(p, H)
""",
            "p = {p:.4g} and H = {H:.4g}: five thirds of the energy at rest.",
            "H",
            label="H",
        ),
    ),
)
