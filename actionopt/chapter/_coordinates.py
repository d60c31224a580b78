"""Sections 12.3.1 and 12.3.2: coordinates, moving frames, total time derivatives."""

import numpy as np

from actionopt import scenes
from actionopt.chapter._row import PATH_OFF, RATE_OFF, ROUND_OFF, TOL, Line, along, path, row, worst
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.solver.solve import solve


@row(
    "12.3.1",
    "one motion in Cartesian, polar and spherical coordinates",
    *("kepler_polar", "kepler_spherical"),
)
def coordinates():
    _, flat, (x, y), _, t = along("kepler")
    polar, spherical = along("kepler_polar")[1], along("kepler_spherical")[1]
    r, phi = polar(t)
    yield worst("polar: same path", [x, y], [r * np.cos(phi), r * np.sin(phi)])
    yield Line("polar: same action", flat.action, polar.action, 1e-11)
    r, theta, phi = spherical(t)
    tilt = scenes.parameters("kepler_spherical")["inclination"]
    tilted = np.stack([x, np.cos(tilt) * y, np.sin(tilt) * y])
    found = np.stack([
        r * np.sin(theta) * np.cos(phi), r * np.sin(theta) * np.sin(phi), r * np.cos(theta)
    ])  # fmt: skip
    yield worst("spherical: same path", tilted, found)
    yield Line("spherical: same action", flat.action, spherical.action, 1e-11)


@row("12.3.1", "forces along the unit vectors of spherical coordinates")
def spherical_forces():
    """F = (-V_r, -V_phi / (r sin theta), -V_theta / r) = m (...), for V = r^2 cos theta phi."""

    def lagrangian(q, v, t, *, m):
        (r, th, ph), (u, w, z) = q, v
        T = m * (u**2 + (r * np.sin(th) * z) ** 2 + (r * w) ** 2) / 2
        return T - r**2 * np.cos(th) * ph

    m = 1.3
    system = System(lagrangian, ["r", "theta", "phi"], parameters={"m": m})
    rng = np.random.default_rng(12)
    q, v = rng.uniform(0.5, 1.5, (3, 20)), rng.uniform(-1.0, 1.0, (3, 20))
    (r, th, ph), (u, w, z) = q, v
    a, b, c = system.acceleration(q, v, 0.0)
    s = np.sin(th)
    book = {
        "F_r": (-2 * r * np.cos(th) * ph, m * (a - r * s**2 * z**2 - r * w**2)),
        "F_phi": (
            -r * np.cos(th) / s,
            m * (2 * s * u * z + 2 * r * np.cos(th) * z * w + r * s * c),
        ),
        "F_theta": (r * s * ph, m * (2 * u * w - r * s * np.cos(th) * z**2 + r * b)),
    }
    for name, (force, formula) in book.items():
        yield worst(name, force, formula, ROUND_OFF)


@row("12.3.1", "free and bound particle in a frame that turns at w")
def rotating_frame():
    for name in ("rotating_frame_free", "rotating_frame_bound"):
        yield from path(name)
        _, solution, q, v, t = along(name)
        problem = solution.problem
        w, m = (float(problem.parameters[x]) for x in "wm")
        k = float(problem.parameters.get("k", 0.0))

        def rotate(q, t, w=w):
            c, s = np.cos(w * t), np.sin(w * t)
            return np.stack([q[0] * c - q[1] * s, q[0] * s + q[1] * c])

        still = System(
            lambda q, v, t, *, m, k: m * (v @ v) / 2 - k * (q @ q) / 2,
            ["x", "y"],
            parameters={"m": m, "k": k},
        )
        ends = [Event(e.t, rotate(np.array(e.q), e.t)) for e in (problem.start, problem.end)]
        inertial = solve(Problem(still, *ends), tol=TOL)
        yield worst(f"{name}: maps onto the frame at rest", inertial(t), rotate(q, t))
        yield Line(f"{name}: same action", inertial.action, solution.action, PATH_OFF)
        # m a = F - 2 m w x v - m w x (w x r)
        coriolis = 2 * m * w * np.stack([v[1], -v[0]])
        force = -k * q + coriolis + m * w**2 * q
        yield worst(
            f"{name}: Coriolis, centrifugal", force, m * solution.acceleration(t), ROUND_OFF
        )


@row("12.3.2", "total time derivative dF(q, t)/dt added to L")
def gauge():
    for name in ("oscillator_gauge", "driven_oscillator"):
        yield from path(name)
        scene, solution, _, _, t = along(name)
        twin = along(scene.facts["twin"])[1]
        yield worst(f"{name}: path of {scene.facts['twin']}", twin(t), solution(t), 1e-11)
        F = scene.facts["gauge"](solution(t[[0, -1]]), t[[0, -1]])
        difference = solution.action - twin.action
        yield Line(f"{name}: action differs by F2 - F1", float(F[1] - F[0]), difference, 1e-11)


@row("12.3.2", "spring on an oscillating wall", "oscillating_wall")
def oscillating_wall():
    """Find x'' + w0^2 x = A w^2 cos wt, whether the term in sin^2 wt is kept or dropped."""
    _, solution, q, v, t = along("oscillating_wall")
    problem = solution.problem
    m, k, A, w = (float(problem.parameters[x]) for x in "mkAw")
    found = solution.acceleration(t) + k / m * q
    yield worst("B = A w^2", A * w**2 * np.cos(w * t), found[0], ROUND_OFF)

    def without_square(q, v, t, *, m, k, A, w):
        return m * v[0] ** 2 / 2 - m * A * w * np.sin(w * t) * v[0] - k * q[0] ** 2 / 2

    values = {"m": m, "k": k, "A": A, "w": w}
    other = System(without_square, ["x"], parameters=values)
    without = solve(Problem(other, problem.start, problem.end), tol=TOL)
    yield worst("the term dropped: same path", solution(t), without(t), 1e-11)
    T = problem.duration
    term = m * A**2 * w**2 / 2 * (T / 2 - np.sin(2 * w * T) / (4 * w))
    yield Line("the term dropped: action", solution.action - term, without.action, RATE_OFF)
