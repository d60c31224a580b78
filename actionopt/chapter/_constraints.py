"""Section 12.4: constraints solved, multipliers, contact, degrees of freedom."""

import numpy as np

from actionopt.analysis.contact import contact_loss
from actionopt.analysis.motion.forward import integrate
from actionopt.chapter._row import PATH_OFF, RATE_OFF, ROUND_OFF, TOL, Line, along, row, worst
from actionopt.mechanics.pfaffian import integrate_pfaffian
from actionopt.mechanics.question.events import State
from actionopt.mechanics.question.problem import Problem
from actionopt.mechanics.system import System
from actionopt.solver.solve import solve


@row("12.4", "block on a sliding wedge", "sliding_wedge")
def wedge():
    _, solution, _, _, t = along("sliding_wedge")
    m, M, angle, g = (float(solution.problem.parameters[x]) for x in ("m", "M", "angle", "g"))
    s, c = np.sin(angle), np.cos(angle)
    expected = -m * g * s * c / (M + m * s**2)
    yield worst("acceleration of the wedge", expected, solution.acceleration(t)[0], ROUND_OFF)


@row("12.4", "particle in an inverted cone", "inverted_cone")
def cone():
    scene, solution, _, _, _ = along("inverted_cone")
    system, values = scene.problem.system, scene.problem.parameters
    angle, g = float(values["angle"]), float(values["g"])
    w = float(solution.start.v[1])
    l0 = g * np.cos(angle) / (w * np.sin(angle)) ** 2
    yield Line("l0 = g cos / (w^2 sin^2)", l0, float(solution(0.3)[0]))
    expected = np.sqrt(3) * np.sin(angle) * w

    def pull(l):  # l'' with the angular momentum of the circle
        return system.acceleration([l, 0], [0, w * (l0 / l) ** 2], 0.0, parameters=values)[0]

    h = 1e-3 * l0
    slope = (8 * (pull(l0 + h) - pull(l0 - h)) - pull(l0 + 2 * h) + pull(l0 - 2 * h)) / (12 * h)
    yield Line("sqrt(3) sin w, linearised", expected, float(np.sqrt(-slope)), RATE_OFF)
    # A perturbed motion: a root of l'(t) after a whole oscillation; its square is even in the
    # amplitude, which two amplitudes remove.
    period = 2 * np.pi / expected
    found = []
    for part in (1e-3, 5e-4):
        l = l0 * (1 + part)
        state = State(0.0, np.array([l, 0.0]), np.array([0.0, w * (l0 / l) ** 2]))
        motion = integrate(system, state, 1.1 * period, tol=1e-13, parameters=values)
        low, high = 0.9 * period, 1.1 * period
        for _ in range(50):
            t = (low + high) / 2
            low, high = (t, high) if motion.velocity(t)[0] > 0 else (low, t)
        found.append(2 * np.pi / t)
    limit = (4 * found[1] - found[0]) / 3
    yield Line("sqrt(3) sin w, perturbed motion", expected, float(limit), 1e-6)


@row(
    "12.4",
    "pendulum with the multiplier of r = l, and in Cartesian coordinates",
    *("polar_pendulum", "rod_pendulum"),
)
def pendulum():
    _, polar, (r, theta), (_, rate), t = along("polar_pendulum")
    m, g = (float(polar.problem.parameters[x]) for x in "mg")
    tension = -(m * r * rate**2 + m * g * np.cos(theta))
    yield worst("tension -(m r theta'^2 + m g cos)", tension, polar.multipliers(t)[0], RATE_OFF)
    yield worst("Q_r = lambda df/dr (12.9)", tension, polar.constraint_force(t)[0], RATE_OFF)
    yield worst("Q_theta = 0", 0.0, polar.constraint_force(t)[1], RATE_OFF)
    rod = along("rod_pendulum")[1]
    radial = np.stack([np.sin(theta), -np.cos(theta)])
    yield worst("Cartesian: the same force", tension * radial, rod.constraint_force(t), RATE_OFF)


@row("12.4", "cylinder rolling down a slope: friction, a force and a torque", "rolling_cylinder")
def rolling():
    scene, solution, _, _, t = along("rolling_cylinder")
    R = float(scene.problem.parameters["R"])
    force, torque = solution.constraint_force(t)
    yield worst("friction", scene.facts["friction"], force, RATE_OFF)
    yield worst("torque of the friction", -R * scene.facts["friction"], torque, RATE_OFF)


@row("12.4", "mass sliding off a fixed circle", "sliding_off_circle")
def sliding():
    scene, solution, (_, theta), (_, rate), t = along("sliding_off_circle")
    m, R, g = (float(scene.problem.parameters[x]) for x in "mRg")
    normal = m * g * np.cos(theta) - m * R * rate**2
    yield worst("normal force", normal, solution.multipliers(t)[0], RATE_OFF)
    [contact] = contact_loss(solution)
    yield Line("cos theta where it leaves", 2 / 3, float(np.cos(contact.state.q[1])), 1e-9)
    yield Line("time at which it leaves", scene.facts["contact_time"], contact.t, 1e-9)


@row("12.4", "degrees of freedom: conditions on velocities")
def freedom():
    scene, solution, _, _, t = along("rolling_cylinder")
    problem = scene.problem
    yield Line("rolling cylinder", 1.0, float(problem.system.degrees_of_freedom))
    values = dict(problem.parameters)
    f = integrate_pfaffian(lambda q, *, R: [1.0, -R], solution.start.q, parameters=values)

    def lagrangian(q, v, t, *, m, R, inertia, angle, g):
        T = m * (v[0] ** 2 + inertia * (R * v[1]) ** 2) / 2
        return T + m * g * q[0] * np.sin(angle)

    system = System(lagrangian, ["x", "phi"], parameters=values, constraint=f)
    found = solve(Problem(system, problem.start, problem.end), tol=TOL)
    yield worst("x' - R phi' = 0 given: same path", solution(t), found(t), PATH_OFF)

    def sphere(q, *, R):  # no slipping; Euler angles phi (about z), theta, psi
        _, _, phi, theta, _ = q
        s, c = np.sin(phi), np.cos(phi)
        return [
            [1, 0, 0, -R * s, R * np.sin(theta) * c],
            [0, 1, 0, R * c, R * np.sin(theta) * s],
            [0, 0, 1, 0, np.cos(theta)],
        ]

    try:
        integrate_pfaffian(sphere, [0.0, 0.0, 0.1, 0.7, 0.2], parameters={"R": 1.0})
        verdict = "accepted"
    except ValueError as error:
        verdict = "non-holonomic" if "non-holonomic" in str(error) else str(error)
    yield Line("sphere rolling without spinning", "non-holonomic", verdict)
