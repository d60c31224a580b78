"""Section 12.5: energy, cyclic coordinates, symmetries, velocity-dependent potentials."""

import numpy as np

from actionopt.chapter._row import (
    PATH_OFF,
    RATE_OFF,
    ROUND_OFF,
    Line,
    along,
    constants,
    path,
    row,
    worst,
)
from actionopt.mechanics.conservation.symmetry import (
    cyclic,
    find_symmetries,
    is_mechanical,
    noether,
)


def _changes(name: str) -> bool:
    """Return whether H changes along a scene's path."""
    _, solution, _, _, t = along(name)
    H = solution.energy(t)
    return bool(np.ptp(H) > RATE_OFF * max(1.0, np.max(np.abs(H))))


@row("12.5.1", "energy of closed, driven and magnetic systems")
def energy():
    for name in ("pendulum", "oscillating_wall", "charge_planar", "moving_pivot", "hoop_bead"):
        system = along(name)[0].problem.system
        yield Line(f"{name}: H changes iff dL/dt", system.structure.depends_on_time, _changes(name))
    for name, mechanical in (
        ("pendulum", True),
        ("double_pendulum", True),
        ("kepler_spherical", True),
        ("oscillating_wall", False),
        ("charge_planar", False),
        ("rotating_frame_free", False),
    ):
        found = along(name)[0].problem.system.energy_is_mechanical
        yield Line(f"{name}: H = T + V", mechanical, found)

    def kinetic(q, v, t, *, m, R, w):
        return m * R**2 * (v[0] ** 2 + (w * np.sin(q[0])) ** 2) / 2

    hoop = along("hoop_bead")[0].problem.system
    yield Line("hoop_bead: H = T + V", False, is_mechanical(hoop, kinetic))
    yield from constants("double_pendulum")


@row("12.5.2", "cyclic coordinates, found by themselves")
def cyclic_coordinates():
    for name, expected in (("kepler_spherical", "phi"), ("heavy_top", "phi, psi")):
        yield from path(name)
        solution = along(name)[1]
        momenta = cyclic(solution.problem.system)
        yield Line(f"{name}: cyclic", expected, ", ".join(momenta))
        for coordinate, momentum in momenta.items():
            yield Line(f"{name}: p_{coordinate} constant", 0.0, momentum.drift(solution), RATE_OFF)
        yield from constants(name)


@row("12.5.3", "two particles on a line, U(a q1 + b q2)", "two_on_a_line")
def two_on_a_line():
    scene, solution, q, v, t = along("two_on_a_line")
    found = noether(scene.problem.system, lambda q, t, *, a, b: [b, -a])
    book = scene.facts["conserved"]["b p1 - a p2"](q, v, t)
    yield worst("b p1 - a p2", book, found(q, v, t), ROUND_OFF)
    yield Line("its drift", 0.0, found.drift(solution), RATE_OFF)


@row(
    "12.5.4",
    "Noether: oscillator in the plane, N bodies, a screw, energy from time",
    *("oscillator_2d", "two_body", "screw"),
)
def symmetries():
    scene, _, q, v, t = along("oscillator_2d")
    turn = noether(scene.problem.system, lambda q, t: [-q[1], q[0]])
    book = scene.facts["conserved"]["angular momentum"](q, v, t)
    yield worst("oscillator_2d: m (x y' - y x')", book, turn(q, v, t), ROUND_OFF)
    scene, _, q, v, t = along("screw")
    found = noether(scene.problem.system, lambda q, t, *, c: [c, 1.0])
    book = scene.facts["conserved"]["screw momentum"](q, v, t)
    yield worst("screw: screw momentum", book, found(q, v, t), ROUND_OFF)
    _, solution, q, v, t = along("pendulum")
    H = noether(solution.problem.system, [0.0], time=-1.0)
    yield worst("pendulum: H of t -> t + d", solution.energy(t), H(q, v, t), ROUND_OFF)
    for name in ("two_body", "figure_eight"):
        scene, solution, q, v, t = along(name)
        system, n = scene.problem.system, scene.problem.system.n
        move = noether(system, [1.0, 0.0] * (n // 2))

        def turning(q, t, n=n):
            return [(-1) ** (i + 1) * q[i + 1 - 2 * (i % 2)] for i in range(n)]

        spin = noether(system, turning)
        facts = scene.facts["conserved"]
        for what, I in (("momentum, x", move), ("angular momentum", spin)):
            yield worst(f"{name}: {what}", facts[what](q, v, t), I(q, v, t), ROUND_OFF)
            yield Line(f"{name}: its drift", 0.0, I.drift(solution), RATE_OFF)
    try:
        noether(along("kepler")[0].problem.system, [1.0, 0.0])
        verdict = "accepted"
    except ValueError:
        verdict = "refused"
    yield Line("kepler: translation along x", "refused", verdict)


@row("12.5.4", "all symmetries affine in q and t, found by themselves")
def found_symmetries():
    for name, expected in (
        ("two_on_a_line", "q1: 1, q2: 2; t: 1; q1: t, q2: 2 t"),
        ("oscillator_2d", "t: 1; x: -y, y: x"),
        ("kepler", "t: 1; x: -y, y: x"),
        ("heavy_top", "phi: 1; psi: 1; t: 1"),
        ("turning_wire", "x: -1.5 y, y: 1.5 x, t: 1"),
        ("oscillating_wall", "none"),
    ):
        solution = along(name)[1]
        found = find_symmetries(solution.problem.system, parameters=solution.problem.parameters)
        yield Line(f"{name}: d/dd of", expected, "; ".join(map(str, found)) or "none")
        for symmetry in found:
            yield Line(f"{name}: drift", 0.0, symmetry.conserved.drift(solution), RATE_OFF)


@row(
    "12.5.1",
    "charge in uniform E and B, in the plane and in space, in two gauges",
    *("charge_planar", "charge_spatial", "charge_gauge"),
)
def charge():
    scene, solution, _, v, t = along("charge_planar")
    speed = np.hypot(v[0], v[1] + scene.facts["drift"])  # in the frame that drifts along -y
    turning = np.hypot(*solution.acceleration(t)) / speed
    yield worst("charge_planar: cyclotron frequency e B / m", scene.facts["cyclotron"], turning)
    gauged, other, _, _, _ = along("charge_gauge")
    yield worst("other A: same path", solution(t), other(t), 1e-11)
    F = gauged.facts["gauge"](other(t[[0, -1]]), t[[0, -1]])
    yield Line("other A: action", float(F[1] - F[0]), other.action - solution.action, 1e-11)


@row(
    "12.5.1",
    "moving constraints: rotating hoop, turning wire, moving pivot",
    *("hoop_bead", "turning_wire", "turning_wire_radial", "moving_pivot"),
)
def moving():
    yield Line("turning_wire: energy changes", True, _changes("turning_wire"))
    yield Line("turning_wire_radial: H changes", False, _changes("turning_wire_radial"))
    yield Line("hoop_bead: H changes", False, _changes("hoop_bead"))
    yield Line("moving_pivot: H changes", True, _changes("moving_pivot"))
    scene, solution, q, v, t = along("turning_wire")
    radial = along("turning_wire_radial")[1]
    yield worst("the wire in r: same motion", np.hypot(*solution(t)), radial(t)[0], PATH_OFF)
    book = scene.facts["multipliers"](q, v, t)
    yield worst("turning_wire: multiplier", book, solution.multipliers(t), RATE_OFF)
