"""The comparison with forward integration: it must agree with motions and contradict the rest.

The curves compared are closed forms, wrapped so that they look like solutions; solvers are run only
for the last tests, whose meshes are what a solution's is.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest
import systems
from helpers import a_quarter, slow
from motions import ellipse, growing, kicked, of_scene, oscillation, pendulum
from scipy.optimize import brentq
from scipy.special import ndtr

from actionopt import Event, Mesh, Problem, Solution, State, System, integrate, scenes, solve
from actionopt.analysis.motion import compare as compare_module
from actionopt.analysis.motion import picard
from actionopt.analysis.motion.compare import KINK_CUT, _Parts, compare, is_motion
from actionopt.analysis.motion.flow import Flow
from actionopt.mechanics.laws.compiled import Pointwise

ACCURATE = 3e-11  # what forward integration makes of these motions, as its own tests say


class Exact:
    """What is asked of the curve `exact(t) -> (q, v)` of a problem."""

    def __call__(self, t):
        return self.exact(np.asarray(t))[0]

    def velocity(self, t):
        return self.exact(np.asarray(t))[1]

    @property
    def start(self):
        t0 = self.problem.start.t
        return State(t0, self(t0), self.velocity(t0))


@dataclass
class Curve(Exact):
    """A curve `exact(t) -> (q, v)` that looks like a solution of error `error`."""

    problem: Problem
    exact: Callable
    mesh: Mesh = field(init=False)
    error: float = 1e-12
    elements: int = 8
    degree: int = 12

    def __post_init__(self):
        ends = self.problem.start.t, self.problem.end.t
        self.mesh = Mesh.uniform(*ends, self.elements, self.degree)


def between(system, exact, t0, t1, **options):
    """Return the curve `exact` as a solution of the problem between two of its own points."""
    events = [Event(t, exact(np.array(t))[0]) for t in (t0, t1)]
    return Curve(Problem(system, *events), exact, **options)


OSCILLATOR = System(lambda q, v, t: v[0] ** 2 / 2 - 2 * q[0] ** 2, ["x"])
FREE = systems.particle("x y")
ORBIT = systems.kepler()


MOTIONS = {
    "oscillator": (OSCILLATOR, oscillation(2.0)),
    "pendulum": pendulum(2.0, 1.3, 9.81),
    "turning wire": of_scene("turning_wire"),
    "damped": of_scene("damped_oscillator"),
    "driven": of_scene("driven_oscillator"),
    "growing": growing(0.4, 2.0),
}


# -- motions ---------------------------------------------------------------------------------


@pytest.mark.quick("3.0-turning wire", "1.0-damped", "3.0-growing", "1.0-driven")
@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("t1", [1.0, 3.0])
def test_motions_agree_and_their_energy_balances(name, t1):
    found = compare(between(*MOTIONS[name], 0.0, t1))
    assert found.agrees
    for number in (found.position, found.velocity, found.arrival, found.local):
        assert number < ACCURATE
    # From the motions themselves, not from forward integration: round-off, and the quadrature
    # of the work on elements that resolve the motion to 1e-12.
    assert found.energy_drift < 1e-11
    assert found.arrival <= found.position


@pytest.mark.parametrize("name", ["turning wire", "damped", "driven", "growing"])
def test_work_is_done_where_the_energy_balance_says_so(name):
    system, exact = MOTIONS[name]
    t = np.array([0.0, 3.0])
    before, after = system.energy(*exact(t), t)
    assert abs(after - before) > 0.1  # or the balance would hold whatever the work


@pytest.mark.long
@pytest.mark.parametrize("name", ["driven", "growing"])
def test_energy_balance_sees_work_that_is_wrong(name):
    """The same curve under parameters a hundredth larger."""
    system, exact = MOTIONS[name]
    curve = between(system, exact, 0.0, 2.0)
    changed = {key: 1.01 * value for key, value in system.parameters.items()}
    curve.problem = Problem(system, curve.problem.start, curve.problem.end, parameters=changed)
    assert compare(curve).energy_drift > 1e-4


@pytest.mark.long
def test_motion_whose_every_element_is_unstable():
    """The pendulum from its upper rest round to it: errors grow by e^20 in an element."""
    system = systems.pendulum("angle")

    def exact(t):
        return 4 * np.arctan(np.exp(t))[None, ...] - np.pi, 2 / np.cosh(t)[None, ...]

    found = compare(between(system, exact, -40.0, 40.0, elements=4))
    assert found.position > 1 and found.amplified > 1  # the whole tells nothing
    assert found.agrees

    def late(t):  # the energy is wrong by 1e-6 of the kinetic energy
        q, v = exact(t)
        return q, (1 + 5e-7) * v

    assert not compare(between(system, late, -40.0, 40.0, elements=4)).agrees


@pytest.mark.long
@pytest.mark.parametrize(("length", "time"), [(1.0, 1.0), (1e-10, 1e-15), (1.5e11, 3e7)])
def test_deviations_have_no_units(length, time):
    """A circular orbit whose radius is wrong by 1e-6, on any scale."""
    mu = length**3 / time**2
    system = System(
        lambda q, v, t, *, mu: (v[0] ** 2 + v[1] ** 2) / 2 + mu / np.hypot(q[0], q[1]),
        ["x", "y"],
        parameters={"mu": mu},
    )

    def exact(t):
        a, r = t / time, length * (1 + 1e-6)
        along, across = np.stack([np.cos(a), np.sin(a)]), np.stack([-np.sin(a), np.cos(a)])
        return r * along, r / time * across

    found = compare(between(system, exact, 0.0, 3 * time))
    # Radius r (1 + d) at the rate 1: the speed is 1.5 d above that of the circle, so that in
    # linear theory the motion moves out by 3 d (1 - cos t) and stays behind by 6 d (t - sin t).
    out, behind = 3 * (1 - np.cos(3)), 6 * (3 - np.sin(3))
    off = out * np.sin(3) - behind * np.cos(3)  # in y, whose size is r
    assert found.position == pytest.approx(off * 1e-6, rel=1e-3)
    assert not found.agrees


@pytest.mark.long
def test_reference_error_covers_what_forward_integration_does_wrong():
    for tol in (1e-3, 1e-6, 1e-9):
        found = compare(between(ORBIT, ellipse(1.0, 0.8, 1.0), 0.0, 7.0), tol=tol)
        assert found.position < 3 * found.reference_error
        assert found.reference_error < 1e3 * found.position


@pytest.mark.long
@pytest.mark.parametrize("name", ["pendulum", "turning wire", "damped"])
def test_regular_motions_are_followed_from_the_curve(name, monkeypatch):
    """By Picard's iteration, and as far as CVODES follows them: nothing is left to that."""
    curve = between(*MOTIONS[name], 0.0, 3.0)
    t = np.linspace(0.0, 3.0, 31)
    start = State(0.0, *MOTIONS[name][1](0.0))
    followed = integrate(curve.problem.system, start, 3.0)(t)
    monkeypatch.delattr(Flow, "integrator")
    path = compare(curve).path
    assert np.max(np.abs(path(t) - followed)) < ACCURATE * np.max(np.abs(followed))


# -- what is no motion -----------------------------------------------------------------------


def faster(t):
    q, v = MOTIONS["pendulum"][1](t)
    return q, 1.001 * v


def parabola(t):
    return (1 - t**2)[None, ...], (-2 * t)[None, ...]


@pytest.mark.quick("system3-<lambda>-3.0-off3-1.0")
@pytest.mark.parametrize(
    ("system", "curve", "t1", "off", "error"),
    [
        # how far off it is at least: locally, in place and at the end
        (MOTIONS["pendulum"][0], faster, 1.5, (1e-5, 1e-4, 1e-5), 1e-12),
        (OSCILLATOR, oscillation(2.02), 3.0, (1e-4, 1e-2, 0.0), 1e-12),  # another Lagrangian's
        (OSCILLATOR, parabola, 1.0, (1e-3, 0.0, 0.0), 1e-12),  # smooth, between the right events
        (OSCILLATOR, oscillation(2.5), 3.0, (1e-4, 1e-2, 0.0), 1.0),  # whatever error it claims
    ],
)
def test_what_is_no_motion_is_contradicted(system, curve, t1, off, error):
    found = compare(between(system, curve, 0.3, t1, error=error))
    assert not found.agrees
    assert all(np.array([found.local, found.position, found.arrival]) > off)
    assert found.energy_drift > 1e-3 or curve is faster


def test_start_that_is_not_the_curve_s_own():
    """The state at the start is a claim of its own, and so is compared with the curve."""

    class Claim(Curve):
        @property
        def start(self):
            return State(0.0, [1.0], [0.01])

    ends = Event(0.0, [1.0]), Event(3.0, [np.cos(6.0)])
    found = compare(Claim(Problem(OSCILLATOR, *ends), oscillation(2.0)))
    assert found.local > 1e-4
    assert not found.agrees


@pytest.mark.long
@pytest.mark.parametrize("width", [*slow(1e-2), 1e-3])
def test_a_kick_that_the_curve_knows_or_not(width):
    system, exact = kicked(width, 0.613)
    found = compare(between(system, exact, 0.0, 1.0))
    assert found.agrees
    assert max(found.position, found.local) < ACCURATE
    assert found.reference_error < ACCURATE

    def straight(t):
        return 0.1 * np.asarray(t)[None, ...], 0.1 + 0 * np.asarray(t)[None, ...]

    found = compare(between(system, straight, 0.0, 1.0))
    assert found.position > 1
    assert not found.agrees


def test_kink_between_two_motions_shows_locally():
    """Free motion that turns at t = 1, where elements meet: each piece alone is a motion."""

    def bent(t):
        side = np.where(np.asarray(t) < 1, -1.0, 1.0)
        return np.stack([side * (t - 1), 1 + 0 * t]), np.stack([side, 0 * side])

    found = compare(between(FREE, bent, 0.0, 2.0, elements=4))
    # Halfway from the middle of an element, 0.25 before the kink, the motion goes on straight.
    assert found.local == pytest.approx(0.5)
    assert found.position == pytest.approx(2.0)
    assert found.energy_drift < 1e-12  # the energy alone would not have told
    assert not found.agrees


# -- what cannot be told ---------------------------------------------------------------------


def fall(t):
    """From rest at the distance one into the centre at pi / sqrt(8), and out again; (x, y)."""
    t = np.asarray(t, dtype=float)
    a = np.array([brentq(lambda a, s=s: a + np.sin(a) - np.sqrt(8) * s, 0, 7) for s in t.flat])
    a = a.reshape(t.shape)
    rate = np.sqrt(8) / (1 + np.cos(a))
    return np.stack([(1 + np.cos(a)) / 2, 0 * a]), np.stack([-np.sin(a) / 2 * rate, 0 * a])


@pytest.mark.slow
def test_a_motion_through_a_singularity_cannot_be_told():
    found = compare(between(ORBIT, fall, 0.0, 1.5))
    assert found.agrees is None
    assert "singularity" in found.reason and "nothing contradicts the path" in found.reason
    assert found.local < ACCURATE  # of the pieces apart from it
    assert np.isnan(found.position) and np.isnan(found.arrival) and np.isnan(found.energy_drift)
    assert found.path is not None
    t = np.linspace(0.0, 1.0, 11)
    assert found.path.mesh.boundaries[-1] > 1.0
    np.testing.assert_allclose(found.path(t), fall(t)[0], rtol=0, atol=1e-7)


def test_a_motion_that_cannot_be_begun_cannot_be_told():
    """In polar coordinates from the centre the angle has no inertia."""
    system = System(lambda q, v, t: (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2, ["r", "angle"])

    def out(t):
        return np.stack([1 * t, 0 * t]), np.stack([1 + 0 * t, 0 * t])

    found = compare(between(system, out, 0.0, 1.0))
    assert found.agrees is None and found.path is None
    assert "cannot be begun" in found.reason and "singular mass matrix" in found.reason


def test_a_tolerance_that_is_none():
    with pytest.raises(ValueError, match="tol"):
        compare(between(OSCILLATOR, oscillation(2.0), 0.0, 1.0), tol=0.0)


# -- what is not smooth, on the mesh of a solution -------------------------------------------


@dataclass
class Claim(Exact):
    """The curve `exact` on the mesh of a solution, with its error estimate."""

    solution: Solution
    exact: Callable

    def __getattr__(self, name):
        return getattr(self.solution, name)


def test_one_run_confirms_a_motion_and_nothing_else(monkeypatch):
    solution = solve(scenes.get("pendulum").problem)
    wrong = Claim(solution, lambda t: (1.001 * solution(t), solution.velocity(t)))
    assert is_motion(wrong) is False
    monkeypatch.setattr(compare_module, "compare", None)
    assert is_motion(solution) is True


def solved(system, exact, t0, t1, **options):
    return solve(Problem(system, *(Event(t, exact(np.array(t))[0]) for t in (t0, t1))), **options)


def judge(system, exact, wrong, t0, t1, **options):
    """Compare what the solver finds; and then another curve, that is to be contradicted."""
    solution = solved(system, exact, t0, t1, **options)
    found = compare(solution)
    assert found.agrees is True and found.reason == ""
    assert found.path is not None
    t = found.path.mesh.nodes
    size = np.max(np.abs(exact(t)[0]), axis=1)[:, None]
    # The path begins with the solution's velocity, and so has its error.
    assert np.max(np.abs(found.path(t) - exact(t)[0]) / size) < found.allowed
    assert found.reference_error < max(1e-3 * solution.error, ACCURATE)
    # The velocity is that of a polynomial, in elements that may be short.
    assert found.velocity < max(found.allowed, 1e-6)
    assert found.energy_drift < max(found.allowed, 1e-6)
    assert np.all(solution(t)[:, [0, -1]] == exact(t)[0][:, [0, -1]])
    assert compare(Claim(solution, exact)).agrees is True
    if wrong is not None:
        assert compare(Claim(solution, wrong)).agrees is False
    return solution, found


def stepped(c, force=5.0):
    """A force that is switched on at t = c."""
    system = System(
        lambda q, v, t, *, c: v[0] ** 2 / 2 + np.where(t > c, force, 0.0) * q[0],
        ["x"],
        parameters={"c": c},
    )

    def exact(t, c=c):
        since = np.maximum(t - c, 0.0)
        v0 = 1 - force * (1 - c) ** 2 / 2
        return (v0 * t + force * since**2 / 2)[None, ...], (v0 + force * since)[None, ...]

    return system, exact


@pytest.mark.long
@pytest.mark.parametrize(
    ("c", "tol"), a_quarter([(0.3141592, 1e-8), (0.37, 1e-3), (0.25, 1e-8), (1 / 3, 1e-3)])
)
def test_a_force_that_is_switched_on(c, tol):
    system, exact = stepped(c)
    # A rough solution allows that it comes a little late.
    late = None if tol == 1e-3 else lambda t: exact(t, c + 1e-3)
    judge(system, exact, late, 0.0, 1.0, tol=tol)


def test_a_velocity_that_is_wrong_after_a_jump_is_told():
    system, exact = stepped(0.25)
    solution = solved(system, exact, 0.0, 1.0, tol=1e-8)
    late = Claim(solution, lambda t: (exact(t)[0], exact(t)[1] + 0.01 * (np.asarray(t) > 0.9)))
    fastest = np.max(np.abs(exact(1.0)[1]))
    assert compare(late).velocity == pytest.approx(0.01 / fastest, rel=1e-2)


@pytest.mark.long
@pytest.mark.parametrize(("c", "spring"), a_quarter([(0.25, 4.0), (0.3141592, 0.0)]))
def test_a_mass_that_jumps(c, spring):
    """The momentum is continuous. With a spring, oscillations of two frequencies."""
    masses = 1.0, 3.0
    system = System(
        lambda q, v, t, *, c: (
            np.where(t > c, masses[1], masses[0]) * v[0] ** 2 / 2 - spring * q[0] ** 2 / 2
        ),
        ["x"],
        parameters={"c": c},
    )

    def exact(t, kept=1.0):
        """`kept` is the part of the momentum that is there after the jump."""

        def through(m, q, p, t):
            if not spring:
                return q + p / m * t, p / m + 0 * t
            w = np.sqrt(spring / m)
            a, b = np.cos(w * t), np.sin(w * t)
            return q * a + p / (m * w) * b, p / m * a - q * w * b

        before = through(masses[0], 0.2, 1.0, t)
        q, v = through(masses[0], 0.2, 1.0, c)
        after = through(masses[1], q, kept * masses[0] * v, t - c)
        return tuple(np.where(t > c, y, x)[None, ...] for x, y in zip(before, after, strict=True))

    judge(system, exact, lambda t: exact(t, 3.0), 0.0, 1.0)  # 3: the velocity kept, not momentum
    judge(system, exact, lambda t: exact(t, 1.001), 0.0, 1.0)


@pytest.mark.slow
def test_a_constraint_that_turns_faster_at_once():
    """A bead on a wire: the wire's angle has a kink, and so has the path."""
    c = 0.3

    def angle(t):
        return 0.3 * t + np.where(t > c, 1.5 * (t - c), 0.0)

    system = systems.particle(
        "x y", constraint=lambda q, t: q[0] * np.sin(angle(t)) - q[1] * np.cos(angle(t))
    )

    def exact(t, kept=1.0):
        """The velocity along the wire is continuous: r'' = w^2 r."""

        def along(w, r, s, t):
            return r * np.cosh(w * t) + s / w * np.sinh(w * t), s * np.cosh(
                w * t
            ) + r * w * np.sinh(w * t)

        r, s = along(0.3, 1.0, 0.2, t)
        later = along(
            1.8, *(k * x for k, x in zip((1.0, kept), along(0.3, 1.0, 0.2, c), strict=True)), t - c
        )
        r, s = np.where(t > c, later[0], r), np.where(t > c, later[1], s)
        a, w = angle(t), np.where(t > c, 1.8, 0.3)
        out, across = np.stack([np.cos(a), np.sin(a)]), np.stack([-np.sin(a), np.cos(a)])
        return r * out, s * out + r * w * across

    judge(system, exact, lambda t: exact(t, 1.01), 0.0, 1.0)


@pytest.mark.long
@pytest.mark.parametrize("width", [6e-4, 1e-5])  # the first is a thousandth wide at half its height
def test_a_pulse_that_the_mesh_resolves(width):
    c = 0.6131
    system = System(
        lambda q, v, t, *, w: (
            v[0] ** 2 / 2 + q[0] * np.exp(-(((t - c) / w) ** 2)) / (w * np.sqrt(np.pi))
        ),
        ["x"],
        parameters={"w": width},
    )

    def exact(t):
        u = np.sqrt(2) * (np.asarray(t) - c) / width
        bell = np.exp(-(u**2) / 2) / np.sqrt(2 * np.pi)
        return (width / np.sqrt(2) * (u * ndtr(u) + bell))[None, ...], ndtr(u)[None, ...]

    there = Mesh([0.0, c - 6 * width, c, c + 6 * width, 1.0], [4, 24, 24, 4])
    missed = exact(1.0)[0][0]

    def straight(t):
        return missed * np.asarray(t)[None, ...], missed + 0 * np.asarray(t)[None, ...]

    coarse = solved(system, exact, 0.0, 1.0, mesh=there)
    judge(system, exact, straight, 0.0, 1.0, guess=coarse)


@pytest.mark.quick("1000000000.0")
@pytest.mark.parametrize("t0", [0.0, 1e6, 1e9])
def test_times_far_from_zero(t0):
    """A driven oscillator: where t is known to eps t, so is the force."""
    system = System(
        lambda q, v, t: (v[0] ** 2 - q[0] ** 2) / 2 + 5 * np.cos(3 * t) * q[0],
        ["x"],
    )

    def exact(t, off=0.0):
        s = np.asarray(t) - t0
        phase = 3 * t0
        x = np.cos(s) + 2 * np.sin(s) - 5 / 8 * np.cos(3 * s + phase) + off * np.sin(np.pi * s / 2)
        rate = -np.sin(s) + 2 * np.cos(s) + 15 / 8 * np.sin(3 * s + phase)
        return x[None, ...], (rate + off * np.pi / 2 * np.cos(np.pi * s / 2))[None, ...]

    solution = solved(system, exact, t0, t0 + 2.0)
    found = compare(solution)
    assert found.agrees is True and found.reason == ""
    assert found.path is not None
    t = solution.mesh.nodes
    # 3 t is rounded twice, and t itself: the force is off by 5 sin(3 t) of that, for 2 s.
    close = 10 * np.spacing(3 * t0) * 2**2 + ACCURATE
    assert np.max(np.abs(found.path(t) - exact(t)[0])) < close + 3 * solution.error
    assert found.reference_error < close
    wrong = max(1e-5, 100 * found.allowed)
    assert compare(Claim(solution, lambda t: exact(t, wrong))).agrees is False


# -- a solution ------------------------------------------------------------------------------


def test_where_a_motion_can_be_begun_again():
    mesh, kinked = SimpleNamespace(boundaries=np.arange(5.0)), np.array([0, 1, 1, 0], dtype=bool)
    parts = SimpleNamespace(mesh=mesh, kinked=kinked, smooth=lambda t: ~kinked[t.astype(int)])
    assert _Parts.cut(parts, 0.0, 1.0) == pytest.approx(KINK_CUT)
    assert _Parts.cut(parts, 1.0, 4.0) == 3.5
    assert _Parts.cut(parts, 1.0, 3.2) is None


@pytest.mark.long
@pytest.mark.parametrize(
    ("law", "T", "most"), [(systems.pendulum(), 3.0, 1450), (systems.spring(), 1.0, 1100)]
)
def test_how_often_a_comparison_asks_for_forces(law, T, most, monkeypatch):
    """Pieces are followed as far as judging them needs, and the second run by as many panels."""
    found = solve(Problem(law, Event(0.0, 0.0), Event(T, 1.0)), tol=1e-8)
    counts, ask = [], Pointwise.__call__

    def counted(self, *arguments):
        if self is law.pointwise("even_motion"):
            counts.append(len(arguments[0]))
        return ask(self, *arguments)

    monkeypatch.setattr(Pointwise, "__call__", counted)
    assert found.compare().agrees
    assert 600 < sum(counts) < most  # two hundred each, at least


@pytest.mark.long
def test_a_motion_under_constraints_is_integrated_once_and_once_more(monkeypatch):
    """Rates of Baumgarte's terms, which differ by the mesh, are one where panels bound them."""
    spans, integrate_once = [], picard.PicardIntegrator._integrate

    def integrate(self, state, span, *others):
        spans.append(span)
        return integrate_once(self, state, span, *others)

    monkeypatch.setattr(picard.PicardIntegrator, "_integrate", integrate)
    assert solve(scenes.get("rod_pendulum").problem).compare().agrees
    assert len(spans) == 2
