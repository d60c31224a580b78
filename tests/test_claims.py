"""What the pages say about the scenes, sentence by sentence, is so."""

import numpy as np
import pytest
from helpers import a_quarter, at_once, solved

from actionopt import Event, Problem, scenes, solve, solve_all
from actionopt.gallery.subject import Subject
from actionopt.plot import conserved_data
from actionopt.scenes import project


class Seen:
    """A scene's motion: q and v by the coordinates' names, at equal times, and what is on it."""

    def __init__(self, name):
        self.scene = scenes.get(name)
        self.solution = s = solved(name, tol=1e-10)
        subject = Subject(self.scene, s)
        self.t, self.T = subject.t, subject.duration
        self.q, self.v = subject.q, subject.v
        for k, coordinate in enumerate(s.problem.system.coordinates):
            setattr(self, coordinate, subject.q[k])
            setattr(self, f"v{coordinate}", subject.v[k])
        self.p = s.momentum(self.t)
        self.H = s.energy(self.t)
        self.a = s.acceleration(self.t)
        self.lamda = s.multipliers(self.t) if s.problem.system.m else None
        self.n = {k: float(x) for k, x in s.problem.parameters.items() if np.ndim(x) == 0}
        self.joints = np.array([e.t for e in s.problem.through])
        self.f = self.scene.facts
        self.bodies = np.array(
            [
                [project(x.points)[:, 0] for x in self.scene.draw(q, t) if x.kind == "body"]
                for q, t in zip(self.q.T, self.t, strict=True)
            ]
        ).transpose(1, 2, 0)  # (B, 2, K)

    @property
    def speed(self):
        """Of the bodies in the picture, (B, K - 1)."""
        return np.linalg.norm(np.diff(self.bodies, axis=2), axis=1) / (self.t[1] - self.t[0])

    @property
    def kept(self):
        """Names of what is conserved by symmetry."""
        data = conserved_data(self.solution)
        names = ("H", *self.solution.problem.system.coordinates)
        return {name for name, kept in zip(names, data.kept, strict=True) if kept}


def same(a, b, tol=1e-7):
    return bool(np.max(np.abs(np.asarray(a) - b)) <= tol * max(1.0, np.max(np.abs(b))))


def rising(x):
    return bool(np.all(np.diff(x) > 0))


def falling(x):
    return rising(-np.asarray(x))


def constant(x, tol=1e-7):
    return bool(np.ptp(x) <= tol * max(1.0, np.max(np.abs(x))))


def parabola(s, x, tol=1e-7):
    return same(np.polyval(np.polyfit(s.t, x, 2), s.t), x, tol)


def line(s, x, tol=1e-7):
    return same(np.polyval(np.polyfit(s.t, x, 1), s.t), x, tol)


def turns(x):
    """Return how often x changes its direction."""
    return int(np.sum(np.diff(np.sign(np.diff(x))) != 0))


def path_of(s, name):
    """Return whether another scene has this path, and the bodies are where its are."""
    other = Seen(name)
    return same(other.bodies, s.bodies, 1e-7)


def twin(s, name):
    return same(Seen(name).q, s.q, 1e-7)


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def fitted(s, columns, x):
    """Return whether x is a combination of the columns."""
    A = np.stack([c + 0 * s.t for c in columns], axis=1)
    return same(A @ np.linalg.lstsq(A, x, rcond=None)[0], x)


def ellipse(s, x, y):
    """Return whether points lie on an ellipse about the origin."""
    return fitted(s, [x**2, x * y, y**2], 1 + 0 * x)


def on_supports(s):
    """Return how a beam sags that its ends do not hold level."""
    asked = s.solution.problem
    ends = (Event(e.t, e.q) for e in (asked.start, asked.end))
    return solve(Problem(asked.system, *ends, parameters=asked.parameters))


def curvature(s):
    return s.a[0] / np.sqrt(1 - s.vy**2)


def at_events(s, k):
    """Return the times of all events, and a coordinate there."""
    events = s.solution.problem.joints_found
    return [e.t for e in events], [e.q[k] for e in events]


def times_of(part):
    return np.linspace(part.start.t, part.end.t, 5)


def links(s):
    places = np.stack([np.zeros((2, s.t.size)), *s.bodies])
    return np.diff(places, axis=0)


def cycloid(s):
    """Return whether points lie on a cycloid below y = 0, and the angles of the wheel there."""
    R = scenes.parameters("brachistochrone")["R"]
    angle = np.arccos(1 - s.y / R)
    return same(R * (angle - np.sin(angle)), s.x), angle


def crossings(s):
    """How often the one curve of all bodies crosses itself: a chain of k loops k - 1 times."""
    x, y = (np.concatenate(list(s.q[i::2, :-1])) for i in (0, 1))
    z = x + 1j * y
    step = np.roll(z, -1) - z
    apart = z[None] - z[:, None]

    def cross(a, b):
        return (np.conj(a) * b).imag

    with np.errstate(all="ignore"):
        along = cross(apart, step[None]) / cross(step[:, None], step[None])
    inside = (along > 0) & (along < 1)
    return np.sum(np.triu(inside & inside.T, 2))


def pressed(s):
    """Return when a scene's path touches, whether nothing presses elsewhere, and evenly there."""
    (force,), (arc,) = s.solution.contact_force(s.t), s.solution.contacts
    on = (arc.begin <= s.t) & (s.t <= arc.end)
    return on, not force[~on].any() and force[on].min() > 0 and constant(force[on])


def bent_there_alone(s):
    """Return whether the direction of the velocity turns in contact only."""
    on, _ = pressed(s)
    v = s.v / np.linalg.norm(s.v, axis=0)
    before, behind = np.argmax(on), on.size - np.argmax(on[::-1])
    return all(constant(row[:before]) and constant(row[behind:]) for row in v)


W = {  # scene: sentences: whether they are so
    "rope_round_post": {
        "answer": lambda s: (
            bent_there_alone(s) and same(np.hypot(*s.q[:, pressed(s)[0]]), s.n["R"])
        ),
        "look": lambda s: bent_there_alone(s) and pressed(s)[1],
        "contact": lambda s: pressed(s)[1],
    },
    "way_round_ball": {
        "answer": lambda s: (
            bent_there_alone(s) and same(np.linalg.norm(s.q[:, pressed(s)[0]], axis=0), s.n["R"])
        ),
        "look": lambda s: same(np.cross(s.q[:, 0], s.q[:, -1]) @ s.q, 0),
        "contact": lambda s: pressed(s)[1],
    },
    "chain_on_floor": {
        "answer": lambda s: (
            same(s.y[pressed(s)[0]], 0) and np.all(np.abs(s.vy / s.vx)[s.y < 1e-3] < 0.1)
        ),
        "look": lambda s: s.vy[0] < -2 * s.vx[0] and np.max(np.abs(np.diff(s.vy / s.vx))) < 0.1,
        "contact": lambda s: pressed(s)[1] and same(s.y[pressed(s)[0]], 0),
    },
    "fish_eye": {
        "answer": lambda s: fitted(s, [s.x, s.y, 1], s.x**2 + s.y**2),
        "look": lambda s: (
            fitted(s, [s.x, s.y, 1], s.x**2 + s.y**2)
            and abs(np.argmin(np.hypot(s.x, s.y)) - np.argmin(s.speed[0])) <= 1
        ),
    },
    "brachistochrone": {
        "answer": lambda s: cycloid(s)[0],
        "look": lambda s: s.vy[0] > s.vx[0] and line(s, cycloid(s)[1]),
    },
    "descent_to_wall": {
        "answer": lambda s: (
            cycloid(s)[0]
            and same(np.arctan2(s.vy[-1], s.vx[-1]), scenes.parameters("descent_to_wall")["lean"])
        ),
        "look": lambda s: s.vy[0] > s.vx[0] and falling(s.vy / s.vx) and s.vy[-1] > 0,
    },
    "great_ellipse": {
        "answer": lambda s: s.theta.max() > max(s.theta[0], s.theta[-1]) + 0.01,
        "look": lambda s: np.argmax(s.theta) == np.argmax(s.vphi) not in (0, s.t.size - 1),
    },
    "light_around_star": {
        "answer": lambda s: (
            same(s.r, s.r[::-1]) and abs(s.t[np.argmin(s.r)] - s.T / 2) < 0.02 * s.T
        ),
        "look": lambda s: (
            turns(s.r) == 1 and s.vr[0] < 0 < s.vr[-1] and np.argmin(s.r) == np.argmax(s.vphi)
        ),
    },
    "mirage": {
        "answer": lambda s: s.vy[0] < 0 < s.vy[-1] and turns(s.y) == 1 and s.y.min() > 0,
        "look": lambda s: (
            fitted(s, [1, s.x, s.x**2], s.y) and abs(s.x[np.argmin(s.y)]) < 0.02 * s.x[-1]
        ),
    },
    "zermelo": {
        "answer": lambda s: (s.y[1:-1] > s.x[1:-1] * s.y[-1] / s.x[-1]).all(),
        "look": lambda s: (s.y[1:-1] > s.x[1:-1] * s.y[-1] / s.x[-1]).all() and rising(s.x),
    },
    "catenoid": {
        "answer": lambda s: same(s.y, s.f["waist"] * np.cosh((s.x - s.x[-1] / 2) / s.f["waist"])),
        "look": lambda s: turns(s.y) == 1 and abs(s.t[np.argmin(s.y)] - s.T / 2) < 0.02 * s.T,
    },
    "kink": {
        "answer": lambda s: constant(s.H) and abs(s.H[0]) < 1e-9 and s.vx[0] < 0.05 * s.vx.max(),
        "look": lambda s: (
            abs(s.t[np.argmax(s.vx)] - s.T / 2) < 0.02 * s.T and same(s.vx, s.vx[::-1])
        ),
    },
    "exit_path": {
        "answer": lambda s: np.abs(s.y).max() > 0.1 * s.n["a"],
        "look": lambda s: (
            turns(s.y) == 1 and np.abs(s.p[:, -s.t.size // 8 :]).max() < 0.15 * np.abs(s.p).max()
        ),
    },
    "vacuum_decay": {
        "answer": lambda s: s.solution.morse_index == 1 == s.f["morse_index"],
        "look": lambda s: falling(s.x) and parabola(s, np.log(s.x), 1e-6),
    },
    "chain": {
        "answer": lambda s: falling(np.abs(s.lamda).max(axis=1)),
        "look": lambda s: rising(s.speed.max(axis=1)),
        "motion": lambda s: (
            constant(np.linalg.norm(links(s), axis=1)) and rising([np.ptp(b[0]) for b in s.bodies])
        ),
        "path": lambda s: (
            np.argmax([np.ptp(b[0]) for b in s.bodies]) == 4 and np.all(s.q[::2, 0] > 0)
        ),
        "conserved": lambda s: s.kept == {"H"},
    },
    "charge_gauge": {
        "answer": lambda s: (
            twin(s, "charge_planar") and not same(s.p, Seen("charge_planar").p, 1e-2)
        ),
        "look motion": lambda s: path_of(s, "charge_planar"),
        "path": lambda s: twin(s, "charge_planar"),
        "conserved": lambda s: s.kept == {"H", "y"} and Seen("charge_planar").kept == {"H"},
    },
    "charge_planar": {
        "answer": lambda s: (
            fitted(s, [1, np.cos(2 * s.t), np.sin(2 * s.t)], s.x)
            and fitted(s, [1, np.cos(2 * s.t), np.sin(2 * s.t)], s.y + 0.15 * s.t)
        ),
        "look": lambda s: s.vx[0] < 0 < s.x[-1] - s.x[0] and np.all(cross(s.v, s.a) < 0),
        "motion": lambda s: s.vx[0] < 0 < s.x[-1] - s.x[0],
        "path": lambda s: fitted(s, [1, np.cos(2 * s.t), np.sin(2 * s.t)], s.vx),
        "conserved": lambda s: s.kept == {"H"},
    },
    "charge_spatial": {
        "answer": lambda s: constant(s.a[2]) and s.n["Ez"] == pytest.approx(s.a[2, 0]),
        "look": lambda s: falling(s.vz) and constant(s.a[2]),
        "motion": lambda s: falling(s.vz),
        "path": lambda s: (
            parabola(s, s.z) and fitted(s, [1, np.cos(2 * s.t), np.sin(2 * s.t)], s.vx)
        ),
        "conserved": lambda s: s.kept == {"H"},
    },
    "damped_oscillator": {
        "answer": lambda s: s.solution.problem.system.structure.forced,
        "look": lambda s: abs(np.interp(-1.0, -s.x[::-1], s.vx[::-1])) < s.vx[0],
        "motion": lambda s: turns(s.x) == 1 and slower_back(s),
        "path": lambda s: s.vx[0] > Seen("oscillator").vx[0],
        "conserved": lambda s: not s.kept and falling(s.H) and 0.45 < s.H[-1] / s.H[0] < 0.5,
    },
    "double_pendulum": {
        "answer": lambda s: s.solution.kind == "minimum" and np.max(np.abs(s.v)) > 8,
        "look": lambda s: 2.8 < s.theta1.max() < np.pi and s.theta2.min() < -2.8,
        "motion": lambda s: np.all(
            s.bodies[:, 1].max(axis=1) > s.bodies[:, 1][:, [0, -1]].max(axis=1) + 1
        ),
        "path": lambda s: np.all(
            np.max(np.abs(s.q - s.q[:, :1] - (s.q[:, -1:] - s.q[:, :1]) * s.t / s.T), axis=1) > 2
        ),
        "conserved": lambda s: s.kept == {"H"},
    },
    "drag_linear": {
        "answer": lambda s: (
            -s.vy[-1] / s.vx[-1] > np.interp(s.y[-1], s.y[:60], s.vy[:60] / s.vx[:60])
            and falling(s.vx)
        ),
        "look": lambda s: s.x[np.argmax(s.y)] > 1.5,
        "motion": lambda s: falling(s.vx),
        "path": lambda s: fitted(s, [np.exp(-0.5 * s.t)], s.vx),
        "conserved": lambda s: not s.kept and falling(s.p[0]) and falling(s.H),
    },
    "drag_quadratic": {
        "answer": lambda s: 0.975 < s.vs[-1] / s.f["terminal_speed"] < 0.985,
        "look": lambda s: rising(s.vs) and np.diff(s.s[::25])[-2] > 0.97 * np.diff(s.s[::25])[-1],
        "motion": lambda s: s.vs[-25] > 0.93 * s.vs[-1],
        "path": lambda s: s.a[0, 0] > 0.97 * 9.81 and s.a[0, -1] < 0.05 * 9.81,
        "conserved": lambda s: not s.kept and falling(np.diff(s.H)),
    },
    "driven_oscillator": {
        "answer look path": lambda s: twin(s, "oscillating_wall"),
        "motion": lambda s: s.x[0] < s.x.max() < 1.3 * s.x[0] and s.x[-1] < 0,
        "conserved": lambda s: not s.kept,
    },
    "figure_eight": {
        "answer": lambda s: (
            same(s.q[:2, -1], s.q[2:4, 0])
            and same(s.q[2:4, -1], s.q[4:, 0])
            and same(s.q[4:, -1], s.q[:2, 0])
        ),
        "look": lambda s: same(s.q[4:, -1], s.q[:2, 0]) and s.x3[-1] < s.x3[0],
        "motion": lambda s: s.f["period"] == pytest.approx(3 * s.T),
        "path": lambda s: same(s.x1 + s.x2 + s.x3, 0) and same(s.y1 + s.y2 + s.y3, 0),
        "conserved": lambda s: s.kept == {"H"} and constant(s.p[::2].sum(axis=0)),
    },
    "heavy_top": {
        "answer": lambda s: constant(s.theta) and constant(s.vphi) and s.vphi[0] > 0,
        "look": lambda s: constant(s.theta) and s.vpsi[0] > 30 * s.vphi[0],
        "motion": lambda s: s.phi[-1] == pytest.approx(1) and s.psi[-1] > 5 * 2 * np.pi,
        "path": lambda s: line(s, s.phi) and line(s, s.psi) and constant(s.theta),
        "conserved": lambda s: s.kept == {"H", "phi", "psi"} and constant(s.p[1]),
    },
    "henon_heiles": {
        "answer": lambda s: same(np.sum(s.q * s.v, axis=0)[[0, -1]], 0, 1e-9),
        "look": lambda s: (
            same(np.sum(s.q * s.v, axis=0)[[0, -1]], 0, 1e-9)
            and abs(np.arctan2(s.x, s.y)[-1] - np.pi / 3) < 1e-12
        ),
    },
    "hoop_bead": {
        "answer": lambda s: s.n["w"] ** 2 > s.n["g"] / s.n["R"] and turns(s.theta) == 1,
        "look": lambda s: s.theta.max() > s.f["rest_angle"] and turns(s.theta) == 1,
        "motion": lambda s: turns(s.theta) == 1 and s.vtheta[0] > 0 > s.vtheta[-1],
        "path": lambda s: turns(s.theta) == 1,
        "conserved": lambda s: (
            s.kept == {"H"}
            and not constant(
                s.scene.kinetic(s.q, s.v, s.t) - s.n["g"] * s.n["R"] * np.cos(s.theta), 1e-2
            )
        ),
    },
    "inverted_cone": {
        "answer": lambda s: (
            s.l[0] == pytest.approx(9.81 * np.cos(0.5) / (s.vphi[0] * np.sin(0.5)) ** 2)
        ),
        "look motion": lambda s: constant(s.l),
        "path": lambda s: constant(s.l) and line(s, s.phi),
        "conserved": lambda s: s.kept == {"H", "phi"} and same(s.p[0], 0),
    },
    "kepler": {
        "answer": lambda s: falling(np.hypot(*s.v)) and rising(np.hypot(*s.q)),
        "look": lambda s: np.hypot(*s.v)[0] > 3 * np.hypot(*s.v)[-1],
        "motion": lambda s: constant(cross(s.q, s.v)) and falling(s.speed[0]),
        "path": lambda s: falling(np.hypot(*s.v)) and np.argmax(np.hypot(*s.a)) == 0,
        "conserved": lambda s: s.kept == {"H"},
    },
    "kepler_at_energy": {
        "answer": lambda s: (
            {round(T, 9) for T in (s.T, s.f["other_duration"])}
            < {round(path.duration, 9) for path in solve_all(s.scene.problem)}
        ),  # either way round
        "look": lambda s: (
            s.f["other_duration"] > s.T and falling(np.hypot(*s.v)) and rising(np.hypot(*s.q))
        ),
    },
    "kepler_polar": {
        "answer": lambda s: "phi" in s.kept,
        "look motion": lambda s: path_of(s, "kepler"),
        "path": lambda s: rising(s.r) and rising(s.phi) and falling(s.vphi),
        "conserved": lambda s: s.kept == {"H", "phi"} and same(s.p[1], s.r**2 * s.vphi),
    },
    "kepler_spherical": {
        "answer motion": lambda s: np.linalg.matrix_rank(space(s), 1e-6) == 2,
        "look": lambda s: same(s.r, Seen("kepler_polar").r),
        "path": lambda s: (
            np.all(np.ptp(s.q, axis=1) > 0.5) and np.linalg.matrix_rank(space(s), 1e-6) == 2
        ),
        "conserved": lambda s: s.kept == {"H", "phi"},
    },
    "lyapunov_orbit": {
        "answer": lambda s: s.x[0] < 0 == s.x[-1] and rising(s.x) and rising(s.y),
        "look": lambda s: same([s.vx[0], s.vy[-1]], 0, 1e-8),
    },
    "moving_pivot": {
        "answer": lambda s: s.f["tilt"] == pytest.approx(np.arctan(3 / 9.81)),
        "look": lambda s: (
            s.f["tilt"] > 0 and s.theta.min() > -2 * s.f["tilt"] - s.theta.max() - 1e-6
        ),
        "motion": lambda s: same(s.bodies[0, 0] - np.sin(s.theta), 1.5 * s.t**2),
        "path": lambda s: turns(s.theta + s.f["tilt"]) == 1,
        "conserved": lambda s: not s.kept,
    },
    "oscillating_wall": {
        "answer": lambda s: not s.solution.problem.system.structure.forced,
        "look": lambda s: s.n["w"] > np.sqrt(s.n["k"] / s.n["m"]),
        "motion": lambda s: not same(np.diff(s.x), np.diff(0.3 * np.cos(3 * s.t)), 1e-3),
        "path": lambda s: s.vx[0] > 0 and s.x[0] < s.x.max() and s.x[-1] < 0,
        "conserved": lambda s: not s.kept and np.diff(s.H).min() < 0 < np.diff(s.H).max(),
    },
    "oscillator": {
        "answer": lambda s: s.solution.kind == "minimum" and np.pi > s.T,
        "look": lambda s: s.x.max() > 2 * s.x[0] and turns(s.x) == 1,
        "motion": lambda s: turns(s.x) == 1,
        "path": lambda s: fitted(s, [np.cos(s.t), np.sin(s.t)], s.x) and s.vx[0] > 0,
        "conserved": lambda s: (
            s.kept == {"H"}
            and falling(s.p[0])
            and same(s.p[0] - s.p[0, 0], -cumulative(s, s.x), 1e-3)
        ),
    },
    "oscillator_2d": {
        "answer look": lambda s: ellipse(s, s.x, s.y),
        "motion": lambda s: np.argmax(np.hypot(*s.v)) == np.argmin(np.hypot(*s.q)),
        "path": lambda s: all(
            fitted(s, [np.cos(2**0.5 * s.t), np.sin(2**0.5 * s.t)], x) for x in s.q
        ),
        "conserved": lambda s: s.kept == {"H"} and constant(cross(s.q, s.p)),
    },
    "oscillator_gauge": {
        "answer": lambda s: twin(s, "oscillator"),
        "look motion": lambda s: path_of(s, "oscillator"),
        "path": lambda s: abs(s.solution.action - Seen("oscillator").solution.action) > 0.1,
        "conserved": lambda s: not s.kept and not constant(s.H, 1e-2),
    },
    "pendulum": {
        "answer": lambda s: s.f["period"] > 2 * np.pi / np.sqrt(9.81),
        "look": lambda s: turns(s.theta) == 1 and s.theta.max() > s.theta[0],
        "motion": lambda s: abs(s.vtheta[np.argmax(s.theta)]) < 0.1,
        "path": lambda s: 0.785 < s.theta.max() < 0.795 and s.theta[-1] < 0,
        "conserved": lambda s: s.kept == {"H"},
    },
    "pendulum_over_top": {
        "answer": lambda s: np.pi / np.sqrt(s.n["g"] / s.n["l"]) < s.T,
        "look": lambda s: falling(s.vtheta) and s.vtheta[-1] < 0.2 * s.vtheta[0],
    },
    "polar_pendulum": {
        "answer": lambda s: np.argmax(-s.lamda[0]) == np.argmin(np.abs(s.theta)),
        "look": lambda s: (
            np.argmin(-s.lamda[0]) == np.argmax(np.abs(s.theta)) and np.all(s.lamda < 0)
        ),
        "motion": lambda s: path_of(s, "pendulum"),
        "path": lambda s: constant(s.r) and turns(s.theta) == 1,
        "conserved": lambda s: s.kept == {"H"} and same(s.p[0], 0),
    },
    "projectile": {
        "answer": lambda s: constant(s.vx) and constant(s.a[1]),
        "look": lambda s: constant(s.vx) and not constant(s.vy, 0.1),
        "motion path": lambda s: line(s, s.x) and parabola(s, s.y),
        "conserved": lambda s: s.kept == {"H", "x"} and line(s, s.p[1]) and falling(s.p[1]),
    },
    "rod_pendulum": {
        "answer path": lambda s: same(s.x**2 + s.y**2, 1),
        "look": lambda s: np.all(s.lamda < 0),
        "motion": lambda s: path_of(s, "pendulum"),
        "conserved": lambda s: s.kept == {"H"} and same(s.x * s.vx + s.y * s.vy, 0),
    },
    "rolling_cylinder": {
        "answer": lambda s: np.all(s.lamda < 0) and s.a[1, 0] > 0,
        "look": lambda s: s.vx[0] < 0 < s.vx[-1] and turns(s.x) == 1 and rising(s.vx),
        "motion": lambda s: same(s.x, 0.2 * s.phi),
        "path": lambda s: parabola(s, s.x) and same(s.x, 0.2 * s.phi),
        "conserved": lambda s: s.kept == {"H"},
    },
    "rotating_frame_bound": {
        "answer": lambda s: same(s.a, 2 * 0.8 * np.stack([s.vY, -s.vX]) + (0.8**2 - 2) * s.q),
        "look": lambda s: s.n["w"] * s.T > 1,
        "motion": lambda s: ellipse(s, *s.bodies[0]),
        "path": lambda s: not ellipse(s, s.X, s.Y),
        "conserved": lambda s: (
            s.kept == {"H"}
            and same(
                s.H,
                s.scene.kinetic(s.q, s.v, s.t) + (s.X**2 + s.Y**2) - 0.8 * cross(s.q, s.p),
            )
        ),
    },
    "rotating_frame_free": {
        "answer look": lambda s: line(s, s.bodies[0, 0]) and line(s, s.bodies[0, 1]),
        "motion": lambda s: constant(s.speed[0]),
        "path": lambda s: not line(s, s.X, 0.1) and not line(s, s.Y, 0.1),
        "conserved": lambda s: (
            s.kept == {"H"}
            and same(turned(s, s.p), np.gradient(s.bodies[0], s.t, axis=1)[:, 1:2], 1e-3)
        ),
    },
    "screw": {
        "answer conserved": lambda s: s.kept == {"H"} and constant(1.5 * s.p[0] + s.p[1]),
        "look": lambda s: rising(s.z) and s.phi[0] - 1.5 * s.z[0] > 0,
        "motion": lambda s: turns(s.phi - 1.5 * s.z) == 1,
        "path": lambda s: (
            line(s, 1.5 * 0.25 * s.phi + s.z)
            and not line(s, s.phi, 1e-2)
            and not line(s, s.z, 1e-2)
        ),
    },
    "sliding_off_circle": {
        "answer": lambda s: (
            np.cos(s.f["contact_angle"]) == pytest.approx(2 / 3)
            and scenes.get("sliding_off_circle", m=2.0, R=3.0).facts["contact_angle"]
            == s.f["contact_angle"]
        ),
        "look": lambda s: falling(s.lamda[0]) and s.lamda[0, 0] > 0 > s.lamda[0, -1],
        "motion": lambda s: s.lamda[0, -1] < 0 and s.f["contact_time"] < s.T,
        "path": lambda s: constant(s.r) and rising(s.vtheta),
        "conserved": lambda s: s.kept == {"H"} and same(s.p[0], 0),
    },
    "sliding_wedge": {
        "answer": lambda s: s.vx[-1] < 0 < s.vs[-1] and constant(s.p[0]),
        "look": lambda s: s.vs[0] < 0 < s.vs[-1] and turns(s.s) == 1 and s.x[-1] < s.x[0],
        "motion": lambda s: np.all(s.a[0] < 0) and np.all(s.a[1] > 0),
        "path": lambda s: parabola(s, s.x) and parabola(s, s.s),
        "conserved": lambda s: s.kept == {"H", "x"},
    },
    "three_on_a_circle": {
        "answer": lambda s: all(
            constant(np.hypot(*(s.q - np.roll(s.q, 2, axis=0))[i : i + 2])) for i in (0, 2, 4)
        ),
        "look": lambda s: (
            same(s.q[:, -1], np.roll(s.q[:, 0], -2)) and constant(np.hypot(s.x1, s.y1))
        ),
    },
    "throw_at_energy": {
        "answer": lambda s: np.allclose(
            [path.duration for path in solve_all(s.scene.problem)],
            [s.f["high_duration"], s.T],
            rtol=1e-9,
        ),
        "look": lambda s: s.y.max() < 0.4 * s.x[-1] and 0.5 * s.f["high_duration"] > s.T,
    },
    "four_on_an_eight": {
        "answer": lambda s: same(s.q[:, -1], np.roll(s.q[:, 0], -2)),
        "look": lambda s: crossings(s) == 1,
    },
    "turning_wire": {
        "answer": lambda s: not constant(s.H, 0.1),
        "look": lambda s: s.lamda[0, 0] < 0 < s.lamda[0, -1],
        "motion": lambda s: turns(np.hypot(s.x, s.y)) == 1 and np.hypot(s.x, s.y)[1] < 0.5,
        "path": lambda s: s.solution.problem.system.m == 1,
        "conserved": lambda s: not s.kept and not s.solution.problem.system.structure.forced,
    },
    "turning_wire_radial": {
        "answer": lambda s: same(s.a, 1.5**2 * s.q),
        "look": lambda s: path_of(s, "turning_wire"),
        "motion": lambda s: turns(s.r) == 1 and s.vr[0] < 0 < s.vr[-1],
        "path": lambda s: fitted(s, [np.exp(1.5 * s.t), np.exp(-1.5 * s.t)], s.r),
        "conserved": lambda s: (
            s.kept == {"H"} and rising(s.scene.kinetic(s.q, s.v, s.t)[s.t > 0.5])
        ),
    },
    "two_body": {
        "answer": lambda s: line(s, (s.x1 + 0.5 * s.x2) / 1.5),
        "look": lambda s: (
            rising((s.x1 + 0.5 * s.x2) / 1.5)
            and np.ptp(s.x2 - (s.x1 + 0.5 * s.x2) / 1.5) > np.ptp(s.x1 - (s.x1 + 0.5 * s.x2) / 1.5)
        ),
        "motion": lambda s: (
            line(s, (s.x1 + 0.5 * s.x2) / 1.5) and line(s, (s.y1 + 0.5 * s.y2) / 1.5)
        ),
        "path": lambda s: (
            line(s, (s.x1 + 0.5 * s.x2) / 1.5)
            and constant(cross(s.q[:2] - s.q[2:], s.v[:2] - s.v[2:]))
        ),
        "conserved": lambda s: (
            s.kept == {"H"} and constant(s.p[0] + s.p[2]) and constant(s.p[1] + s.p[3])
        ),
    },
    "two_on_a_line": {
        "answer": lambda s: line(s, -0.5 * s.q1 - s.q2),
        "look": lambda s: rising(s.q1) and rising(s.q2) and np.all(s.a[0] * s.a[1] <= 0),
        "motion": lambda s: turns(s.q2 - s.q1) >= 1,
        "path": lambda s: (
            np.all(s.a[0] * s.a[1] <= 0)
            and fitted(s, [1, s.t, np.cos(1.25**0.5 * s.t), np.sin(1.25**0.5 * s.t)], s.q1)
        ),
        "conserved": lambda s: s.kept == {"H"} and constant(-0.5 * s.p[0] - s.p[1]),
    },
    "billiard_circle": {
        "answer": lambda s: constant(np.diff(s.joints)) and constant(cross(s.q, s.v)),
        "look": lambda s: constant(cross(s.q, s.v)) and constant(np.hypot(s.vx, s.vy)),
        "conserved": lambda s: s.kept == {"H"} and constant(cross(s.q, s.p)),
    },
    "billiard_ellipse": {
        "answer": lambda s: constant(about_foci(s)[0] * about_foci(s)[1]),
        "look": lambda s: np.all(about_foci(s)[0] * about_foci(s)[1] < -0.1),
        "conserved": lambda s: s.kept == {"H"} and not constant(s.p[0] * s.p[1], 0.1),
    },
    "billiard_stadium": {
        "answer": lambda s: constant(s.H) and np.all(np.abs(np.diff(by_leg(s, cross))) > 0.05),
        "look": lambda s: (
            np.ptp(np.diff(s.joints)) > 0.1 and np.all(np.abs(np.diff(by_leg(s, cross))) > 0.05)
        ),
        "conserved": lambda s: s.kept == {"H"} and constant(np.hypot(*s.p)),
    },
    "bouncing_down": {
        "answer": lambda s: constant(np.diff(s.joints)),
        "look": lambda s: rising(np.hypot(*np.diff(s.solution(s.joints)))),
        "energies": lambda s: constant(s.H),
    },
    "beam_on_floor": {
        "answer": lambda s: (
            pressed(s)[1]
            and same(s.solution.contact_force(1.3)[0], s.n["w"])
            and same(
                s.solution.contact_impulses[0],
                s.n["w"] * np.array([s.f["contact_begin"], s.T - s.f["contact_end"]]) / 3,
            )
        ),
        "look": lambda s: (
            same([s.vy[pressed(s)[0]], s.a[0, pressed(s)[0]]], 0.0)
            and same(s.solution.acceleration(s.f["contact_begin"]), 0.0)
            and s.a[0, s.t < s.f["contact_begin"]][-1] > 0.01  # of a rate that is not zero
        ),
        "contact": lambda s: pressed(s)[1] and same(s.y[pressed(s)[0]], 0.0),
    },
    "clamped_beam": {
        "answer": lambda s: same(5 * s.y.min(), on_supports(s)(1.0)),
        "look": lambda s: (
            same(s.vy[[0, -1]], 0) and s.a[0, 0] * s.a[0, 100] < 0 < s.a[0, 0] * s.a[0, -1]
        ),
    },
    "buckled_beam": {
        "answer": lambda s: same(s.n["B"] * curvature(s), -s.n["P"] * s.y),
        "look": lambda s: np.argmax(np.abs(curvature(s))) == 100 and same(curvature(s)[[0, -1]], 0),
    },
    "reaching_hand": {
        "answer": lambda s: (
            same(np.hypot(s.vx, s.vy)[100], 15 / 8 * np.hypot(s.x[-1], s.y[-1]) / s.T)
            and np.argmax(np.hypot(s.vx, s.vy)) == 100
            and same(s.v[:, [0, -1]], 0)
        ),
        "look": lambda s: same(s.a[:, [0, -1]], 0) and same(s.v[:, [0, -1]], 0),
    },
    "smoothest_way": {
        "answer": lambda s: all(
            same(np.diff(part.path.acceleration(times_of(part)), 2), 0)  # a line in time
            for part in s.solution.parts
        ),
        "look": lambda s: (
            np.abs(s.y - np.interp(s.t, *at_events(s, 1))).max() > 0.1
            and same(*(s.solution.acceleration(s.joints + e) for e in (-1e-9, 1e-9)), 1e-6)
        ),
        "conserved": lambda s: (
            np.abs(s.solution.impulses[:, :2]).min() > 0.1 and same(s.solution.impulses[:, 2:], 0)
        ),
    },
    "descent_through_gate": {
        "answer": lambda s: np.ptp(by_leg(s, wheel)) > 0.1,
        "look": lambda s: (
            np.ptp(by_leg(s, lambda q, v: v[1] / v[0])[[0, 1]]) > 0.1
            and constant((s.vx**2 + s.vy**2) / s.y)
        ),
        "conserved": lambda s: s.kept == {"H"} and np.abs(s.solution.impulses[0, 0]) > 0.1,
    },
    "dido": {
        "answer": lambda s: (
            constant(np.hypot(s.x - s.f["radius"], s.y)) and same(s.vx[[0, -1]], 0.0)
        ),
        "look": lambda s: (
            same(s.vx[[0, -1]], 0.0) and falling(s.a[0] * 0 + np.unwrap(np.arctan2(s.vy, s.vx)))
        ),
    },
    "heron": {
        "answer": lambda s: constant(s.vx) and constant(np.abs(s.vy)) and s.vy[0] < 0 < s.vy[-1],
        "look": lambda s: line(s, np.where(s.t < s.joints[0], -s.y, s.y)),
        "conserved": lambda s: s.kept == {"H", "x"},
    },
    "rainbow": {
        "answer": lambda s: (
            all(scenes.get("rainbow", b=b).facts["bow"] < s.f["bow"] for b in (0.3, 0.6, 0.85, 0.9))
            and abs(np.degrees(s.f["bow"]) - 42) < 0.2
        ),
        "look": lambda s: (
            turned_by(s)[0] < -0.1 and turned_by(s)[1] < -1 and turned_by(s)[2] < -0.1
        ),
        "conserved": lambda s: s.kept == {"H"} and constant(cross(s.q, s.p)),
    },
    "rope_of_length": {
        "answer": lambda s: fitted(s, [1, np.cosh(s.x / 0.7), np.sinh(s.x / 0.7)], s.y),
        "look": lambda s: rising(s.vy / s.vx) and abs((s.vy / s.vx)[np.argmin(s.y)]) < 0.05,
    },
    "rope_on_floor": {
        "answer": lambda s: (
            pressed(s)[1]
            and same(s.y[pressed(s)[0]], 0.5)
            and same(s.y + 0.1, 0.6 * np.sqrt(1 + (s.vy / s.vx) ** 2))
        ),
        "look": lambda s: (
            fitted(s, [1, s.y, s.y**2], (s.vy / s.vx) ** 2) and same(s.y[[0, -1]], [1.5, 1.2])
        ),
        "contact": lambda s: pressed(s)[1] and same(s.y[pressed(s)[0]], 0.5),
    },
    "snell": {
        "answer": lambda s: s.solution.kind == "minimum",
        "look": lambda s: (
            rising(by_leg(s, lambda q, v: -v[1] / v[0]))
            and falling(by_leg(s, lambda q, v: np.hypot(*v)))
        ),
        "conserved": lambda s: constant(s.p[0]) and not constant(s.p[1], 0.1),
    },
    "soap_bridge": {
        "answer": lambda s: constant(np.hypot(s.x - 0.6, s.y)),
        "look": lambda s: np.argmax(s.y) == s.t.size // 2 and rising(s.x),
    },
    "string_to_wall": {
        "answer": lambda s: same(
            np.arctan2(s.vy[-1], s.vx[-1]), scenes.parameters(s.scene.name)["lean"]
        ),
        "look": lambda s: (
            all(constant(v[s.t < s.f["contact_begin"]]) for v in s.v)
            and all(constant(v[s.t > s.f["contact_end"]]) for v in s.v)
            and same(np.arctan2(s.vy[-1], s.vx[-1]), scenes.parameters(s.scene.name)["lean"])
        ),
        "contact": lambda s: same(
            s.solution.contact_force(
                np.linspace(s.f["contact_begin"], s.f["contact_end"], 9)[1:-1]
            ),
            s.f["contact_force"],
        ),
    },
    "throw_at_cart": {
        "answer": lambda s: same(
            s.q - np.outer([s.n["u"], 0.0], s.t),
            scenes.get("throw_at_energy", start=(0.0, 0.0), end=(3.0, 0.5), spare=2.0).exact(s.t),
        ),
        "look": lambda s: s.x[-1] > 3.5,
        "conserved": lambda s: "x" in s.kept and constant(s.p[0]),
    },
}


def slower_back(s):
    """Return whether x turns at its top, and is slower where it comes by again, short of it."""
    top = np.argmax(s.x)
    out, back = s.x[: top + 1], (s.x[top:] > s.x[0]) & (s.x[top:] < 2.1)
    before = np.interp(s.x[top:][back], out, s.vx[: top + 1])
    return bool(np.all(np.abs(s.vx[top:][back]) < before))


def by_leg(s, quantity):
    """Return a quantity of q and v in the middle of each leg, (k + 1,)."""
    ends = np.r_[0.0, s.joints, s.T]
    middle = (ends[1:] + ends[:-1]) / 2
    return np.array([quantity(s.solution(t), s.solution.velocity(t)) for t in middle])


def about_foci(s):
    """Return the angular momenta of unit mass about the foci of the table, (2, K)."""
    c = np.sqrt(s.n["a"] ** 2 - s.n["b"] ** 2) if "a" in s.n else np.sqrt(3.0)
    return np.array([(s.x - x) * s.vy - s.y * s.vx for x in (-c, c)])


def wheel(q, v):
    """Return the radius of the wheel that draws the cycloid there."""
    return q[1] * (1 + (v[1] / v[0]) ** 2) / 2


def turned_by(s):
    """Return by how much the way turns at each event, (k,); below zero to the right."""
    angle = by_leg(s, lambda q, v: np.arctan2(v[1], v[0]))
    return (np.diff(angle) + np.pi) % (2 * np.pi) - np.pi


def space(s):
    """Return the places in space of a scene in spherical coordinates, (3, K)."""
    across = s.r * np.sin(s.theta)
    return np.stack([across * np.cos(s.phi), across * np.sin(s.phi), s.r * np.cos(s.theta)])


def cumulative(s, x):
    """Return the integral of x from the start, by trapezes."""
    return np.r_[0.0, np.cumsum((x[1:] + x[:-1]) / 2 * np.diff(s.t))]


def turned(s, p):
    """Return a vector in the axes of the table as it is seen at rest."""
    c, w = np.cos(s.n["w"] * s.t), np.sin(s.n["w"] * s.t)
    return np.stack([c * p[0] - w * p[1], w * p[0] + c * p[1]])


@pytest.mark.quick("buckled_beam", "lyapunov_orbit", "reaching_hand", "throw_at_cart", "zermelo")
@pytest.mark.parametrize("name", a_quarter(scenes.SCENES, 1))
def test_what_a_page_says_of_its_scene_is_so(name):
    words, seen = scenes.get(name).words, Seen(name)
    said = {"answer", "look", *words.captions}
    assert said == {sentence for sentences in W[name] for sentence in sentences.split()}
    for sentences, holds in W[name].items():
        assert holds(seen), sentences


@pytest.mark.long
def test_the_claims_can_fail():
    assert not W["projectile"]["answer"](Seen("drag_linear"))
    assert not W["kepler"]["motion"](Seen("oscillator_2d"))
    assert not W["charge_gauge"]["look motion"](Seen("projectile"))


@pytest.mark.long
def test_beside_a_scene_are_others():
    for name in scenes.SCENES:
        words = scenes.get(name).words
        assert words.question.endswith("?") and words.answer and words.look
        assert words.beside and set(words.beside) <= set(scenes.SCENES) - {name}


@pytest.mark.long
@at_once("name", scenes.SCENES)
def test_the_kinetic_energy_of_a_scene_can_be_asked_for(name):
    """Whatever parameters its ends have of their own: the page of every scene draws it."""
    scene = scenes.get(name)
    q = np.array([scene.problem.start.near, scene.problem.end.near], dtype=float).T
    t = np.array([scene.problem.start.t, scene.problem.end.t])
    inside = q.mean(axis=1, keepdims=True) + 0.1  # some are singular at their ends
    if scene.problem.system.order > 1:
        assert scene.kinetic is None
        return
    T = scene.kinetic(inside, np.ones_like(inside), t[:1])
    assert np.all(np.isfinite(T))
