"""The families of test problems: a scene, its parameters, a mesh, and what makes it hard.

A family adds no physics. What a scene cannot say is said by a `change` of it: a constraint stated
twice, an end exactly at the conjugate time.

Any member can be had in units that range over so many decades along the path: the same optimum,
and no number in it of the size of its neighbours. Newton's method does not feel it, and what
follows gradients does; `NAME_scaled` are three of them. Easy families have hard relatives of the
same scene:

- where the scene knows its conjugate times and takes a duration, a member past the first of them:
  the objective is unbounded below, and the only stationary point a saddle;
- the others of the table `HARD`, each for a reason that is its own: its tags.

And each member of any family has a start far from the optimum, "perturbed".

Scenes with non-conservative forces are no families. They have no objective; as equations alone they
would be square systems, whose second derivatives are third ones of the Lagrangian. Nothing else
here has those, so that neither they nor a copy of the physics could be checked against another.
"""

from __future__ import annotations

import functools
import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from typing import Any

import numpy as np

from actionopt import scenes
from actionopt.mechanics.laws.tracing import suggestion
from actionopt.mechanics.question.problem import Event, Problem
from actionopt.mechanics.system import System
from actionopt.scenes import Facts, Scene
from actionopt.suite import obstacles
from actionopt.suite.limits import UNLIMITED, Bounds
from actionopt.tools.immutable import immutable
from actionopt.tools.shown import one_line
from actionopt.tools.types import Array


@immutable
class Family:
    """A family of test problems, of any size.

    Parameters
    ----------
    name, scene : str
        The family's name and its scene's.
    elements, degree : int
        Default mesh, fine enough for the discrete optimum to lie near the continuous path.
    parameters : mapping
        The scene's parameters, where they differ from its own defaults.
    tags : tuple of str
        What is special about it; none for an easy one.
    change : callable, optional
        Applied to the scene: what its parameters cannot express.
    waypoints : tuple of tuple of float
        Coordinates (n, K) at equal times that tell the path meant from others, where the scene
        has neither a closed form nor a guess.
    bends : tuple of tuple of float
        Amplitudes (n,) of half sine waves that, added to the straight line, lead to other
        stationary points.
    decades : float
        Powers of ten over which the units of the unknowns range, evenly from the first to the
        last; 0 for those the scene is written in.
    start : str
        The default starting point, where it is not the scene's guess or the straight line.
    limits : Bounds
        Bounds of coordinates and constraint functions.
    why : str
        Why Ipopt with its defaults takes more than fifty iterations, or fails, where it does so.
    made : callable, optional
        Of the family's name and parameters: its own scene, where `scenes` has none.
    once : mapping
        Parameters with which that states each row once.
    """

    name: str
    scene: str
    elements: int = 8
    degree: int = 4
    parameters: Mapping[str, Any] = field(default_factory=dict)
    tags: tuple[str, ...] = ()
    change: Callable[[Scene], Scene] | None = None
    waypoints: tuple[tuple[float, ...], ...] = ()
    bends: tuple[tuple[float, ...], ...] = ()
    decades: float = 0.0
    start: str = ""
    limits: Bounds = UNLIMITED
    why: str = ""
    made: Callable[..., Scene] | None = None
    once: Mapping[str, Any] = field(default_factory=dict)

    __repr__ = one_line

    def build(self, **parameters: Any) -> Scene:
        """Return the scene, changed as this family has it.

        Raises ValueError for a parameter the scene does not have or values it refuses.
        """
        scene = self._scene({**self.parameters, **parameters})
        return self.change(scene) if self.change else scene

    def plain(self, **parameters: Any) -> Scene:
        """Return the scene before the change, its rows stated once."""
        return self._scene({**self.parameters, **parameters, **self.once})

    def _scene(self, parameters: dict[str, Any]) -> Scene:
        if self.made is None:
            return scenes.get(self.scene, **parameters)
        known = inspect.signature(self.made).parameters
        for name in parameters:
            if name not in known:
                raise ValueError(
                    f"unknown parameter {name!r} of {self.name}{suggestion(name, tuple(known)[1:])}"
                )
        return self.made(self.name, **parameters)


# -- changes ---------------------------------------------------------------------------------


@functools.cache
def _stated_twice(name: str) -> System:
    """Return the system of the scene `name` with its constraint stated twice, in two units."""
    module = importlib.import_module(f"actionopt.scenes.{name}")
    plain = scenes.get(name).problem.system

    @functools.wraps(module.constraint)  # the parameters are read off the signature
    def twice(q, t, **parameters):
        f = module.constraint(q, t, **parameters)
        return f, 2 * f

    return System(
        module.lagrangian,
        plain.coordinates,
        parameters=plain.parameters,
        constraint=twice,
        name=name,
    )


def redundant(scene: Scene) -> Scene:
    """State the one constraint of a scene a second time: the multipliers are not unique."""
    asked = scene.problem
    system = _stated_twice(scene.name)
    problem = Problem(system, asked.start, asked.end, parameters=asked.parameters)
    return replace(scene, problem=problem)


def conjugate(scene: Scene) -> Scene:
    """End an oscillator's motion from `start` at the first conjugate time, where all paths meet.

    The paths are q(t) = start cos(w t) + c sin(w t) for any c, all with S = 0.
    """
    asked = scene.problem
    w = float(np.sqrt(asked.parameters["k"] / asked.parameters["m"]))
    x = float(asked.start.q[0])  # type: ignore[arg-type]
    problem = asked.replace(end=Event(np.pi / w, [-x]))
    facts = Facts(
        velocity=lambda t: -w * x * np.sin(w * np.asarray(t))[None],
        action=0.0,
        flat=lambda t: np.sin(w * np.asarray(t))[None],
    )
    return replace(
        scene, problem=problem, exact=lambda t: x * np.cos(w * np.asarray(t))[None], facts=facts
    )


# -- the table -------------------------------------------------------------------------------

# Through the highest points of both bobs, nearly at rest there: the double pendulum, 17 times.
# fmt: off
OVER_THE_TOP = (
    (1.0, 1.78, 2.31, 2.63, 2.78, 2.84, 2.86, 2.89, 2.93, 2.98, 3.02, 3.0, 2.82, 2.37, 1.66, 0.85,
     -0.2),
    (0.5, 0.47, 0.84, 1.3, 1.72, 2.03, 2.23, 2.31, 2.26, 2.09, 1.79, 1.36, 0.78, 0.06, -0.57, -0.7,
     0.05),
)
# fmt: on

# Scenes as they are.
PLAIN_SCENES = (
    "oscillator oscillator_2d oscillator_gauge oscillating_wall driven_oscillator two_on_a_line "
    "projectile pendulum rod_pendulum polar_pendulum kepler kepler_polar kepler_spherical "
    "two_body figure_eight charge_planar charge_spatial hoop_bead inverted_cone "
    "heavy_top moving_pivot rotating_frame_bound rotating_frame_free screw sliding_wedge "
    "sliding_off_circle rolling_cylinder turning_wire turning_wire_radial"
).split()
SCENE_MESHES = {  # elements and degree where 8 of degree 4 are too few
    **dict.fromkeys(("kepler", "kepler_polar", "kepler_spherical", "figure_eight"), (12, 6)),
    **dict.fromkeys(("two_body", "hoop_bead", "heavy_top"), (8, 6)),
}
STEADY = "steady motion"  # the straight line is the path: no solver may start there
CYCLIC = "two angles hardly enter: f is nearly flat along them, and falls in other directions"
REASON = (
    "so long a time has many paths, and spurious minima between them: on the way most "
    "Hessians have many negative eigenvalues"
)
OTHER_MINIMA = (
    "figure_eight",
    "kepler",
    "two_body",
    "rod_pendulum",
)  # plain ones with other minima
SPECIAL = {
    "inverted_cone": {"tags": (STEADY,), "start": "perturbed"},
    "heavy_top": {"tags": (STEADY, "several optima"), "start": "perturbed", "why": CYCLIC},
    "hoop_bead": {"tags": ("several optima",), "bends": ((1.5,), (-1.5,))},
    **{name: {"tags": ("several optima",)} for name in OTHER_MINIMA},
}
EASY = tuple(
    Family(name, name, *SCENE_MESHES.get(name, ()), **SPECIAL.get(name, {}))
    for name in PLAIN_SCENES
)

OPTIMA = ("several optima",)
TURNS = ("many turns", *OPTIMA)
REDUNDANT = ("redundant constraints", "LICQ fails", "MFCQ fails")
SADDLE = ("unbounded below", "saddle only")
SCALING = ("badly scaled units",)
SCALE_DECADES = 8.0
SCALED = tuple(
    replace(family, name=f"{family.name}_scaled", tags=SCALING, decades=SCALE_DECADES)
    for family in EASY
    if family.name in ("pendulum", "kepler", "rod_pendulum")
)
HARD = (
    Family("oscillator_past", "oscillator", 8, 6, {"duration": 10.0}, SADDLE),
    Family("oscillator_2d_past", "oscillator_2d", 8, 6, {"duration": 3.0}, SADDLE),
    Family("wall_past", "oscillating_wall", 8, 6, {"duration": 4.0}, SADDLE),
    Family("frame_past", "rotating_frame_bound", 8, 6, {"duration": 5.0}, SADDLE),
    Family("oscillator_gauge_past", "oscillator_gauge", 8, 6, {"duration": 4.0}, SADDLE),
    Family("driven_oscillator_past", "driven_oscillator", 8, 6, {"duration": 2.5}, SADDLE),
    Family("two_on_a_line_past", "two_on_a_line", 8, 6, {"duration": 4.0}, SADDLE),
    Family("charge_planar_past", "charge_planar", 8, 6, {"duration": 4.0}, SADDLE),
    Family("charge_spatial_past", "charge_spatial", 8, 6, {"duration": 4.0}, SADDLE),
    Family(
        "oscillator_conjugate",
        "oscillator",
        8,
        8,
        {"duration": 1.0},
        ("conjugate end", "degenerate"),
        conjugate,
    ),
    Family(
        "oscillator_nearly_conjugate",
        "oscillator",
        8,
        8,
        {"duration": np.pi * (1 - 1e-6), "end": -1.0},
        ("nearly conjugate end", "ill-conditioned"),
    ),
    Family("oscillator_stiff", "oscillator", 64, 8, {"k": 1e4}, (*SADDLE, "stiff potential")),
    Family("charge_strong", "charge_planar", 32, 8, {"B": 40.0}, (*SADDLE, "stiff potential")),
    Family(
        "oscillator_atomic",
        "oscillator",
        8,
        4,
        {"m": 1.67e-27, "k": 500.0, "start": 1e-11, "end": 5e-12, "duration": 4e-15},
        (*SCALING, "absolute tolerances"),
        why="all derivatives are below its absolute tolerances at the start already",
    ),
    Family(
        "kepler_planet",
        "kepler",
        12,
        6,
        {"mu": 1.32712440018e20, "a": 1.495978707e11, "eccentricity": 0.2},
        SCALING,
    ),
    Family(
        "wire_layer",
        "turning_wire_radial",
        32,
        8,
        {"w": 60.0},
        ("thin layer",),
    ),
    Family(
        "wire_layer_bound",
        "turning_wire",
        64,
        8,
        {"w": 60.0},
        ("thin layer",),
    ),
    Family(
        "kepler_near_collision",
        "kepler",
        96,
        10,
        {"eccentricity": 0.97, "start": -0.2},
        ("near collision", "several optima"),
        start="coarse",
    ),
    Family(
        "two_body_near_collision",
        "two_body",
        64,
        10,
        {"eccentricity": 0.95, "start": -0.2},
        ("near collision", "several optima"),
        start="coarse",
    ),
    Family(
        "kepler_polar_singular",
        "kepler_polar",
        96,
        10,
        {"eccentricity": 0.95, "start": -0.2},
        ("coordinate singularity", "near collision"),
        why="a step takes r through zero, where f falls without bound",
    ),
    Family(
        "kepler_spherical_singular",
        "kepler_spherical",
        64,
        8,
        {"inclination": 1.5},
        ("coordinate singularity",),
    ),
    Family("rod_pendulum_redundant", "rod_pendulum", tags=REDUNDANT, change=redundant),
    Family(
        "polar_pendulum_redundant",
        "polar_pendulum",
        tags=REDUNDANT,
        change=redundant,
    ),
    Family(
        "pendulum_long",
        "pendulum",
        12,
        8,
        {"duration": 3.0},
        ("several optima", "saddle only"),
        bends=((2.0,), (-2.0,), (5.0,), (-5.0,)),
    ),
    Family(
        "pendulum_over_the_top",
        "pendulum",
        16,
        8,
        {"amplitude": 3.1, "duration": 2.5},
        ("near separatrix",),
    ),
    Family(
        "kepler_two_ways",
        "kepler",
        16,
        8,
        {"eccentricity": 0.3},
        OPTIMA,
        bends=((0.0, -2.0), (0.0, 2.0)),
    ),
    Family(
        "hoop_bead_fast",
        "hoop_bead",
        16,
        8,
        {"w": 12.0},
        ("several optima", "stiff potential"),
        bends=((2.0,), (-2.0,), (4.0,), (-4.0,)),
    ),
    Family(
        "double_pendulum",
        "double_pendulum",
        24,
        8,
        tags=OPTIMA,
        waypoints=OVER_THE_TOP,
        bends=((0.0, 0.0), (4.0, 0.0), (-4.0, 0.0)),
    ),
    Family("chain", "chain", 8, 6, tags=OPTIMA),
    Family(
        "chain_long",
        "chain",
        6,
        6,
        {"links": 20},
        (*OPTIMA, "many constraints"),
        why="minima far from the path, along which the Hessian has 129 negative eigenvalues",
    ),
    Family("pendulum_turns", "pendulum", 48, 8, {"duration": 18.0}, TURNS, why=REASON),
    Family("rod_pendulum_turns", "rod_pendulum", 24, 8, {"duration": 8.0}, TURNS, why=REASON),
    Family("polar_pendulum_turns", "polar_pendulum", 32, 8, {"duration": 12.0}, TURNS, why=REASON),
    Family("moving_pivot_turns", "moving_pivot", 24, 8, {"duration": 12.0}, TURNS, why=REASON),
    Family(
        "inverted_cone_turns",
        "inverted_cone",
        24,
        8,
        {"duration": 8.0},
        (*TURNS, STEADY),
        start="perturbed",
        why=REASON,
    ),
    Family(
        "heavy_top_turns",
        "heavy_top",
        16,
        6,
        {"duration": 0.8},
        (*TURNS, STEADY),
        start="perturbed",
        why=f"{CYCLIC}; {REASON}",
    ),
)

# With inequalities: unilateral contact, whose times and multipliers the scenes have in closed form
# or from a solve that is accurate to round-off.
UNILATERAL, WEAKLY = ("unilateral contact",), ("unilateral contact", "weak complementarity")
GRAZING = {"extra": 0.0, "lower": 1.0}  # at a node, in the middle
FLOOR = Bounds(coordinates=[(0.0, np.inf)])
CONTACTS = tuple(
    Family(
        name,
        name,
        elements,
        4,
        parameters,
        tags,
        bends=((0.0, 3.0), (0.0, -3.0)) if name.startswith(("disc", "pegs")) else (),
        start="perturbed" if STEADY in tags else "",
        limits=FLOOR if "bounds on coordinates" in tags else UNLIMITED,
        made=made,
        once=once,
    )
    for name, made, elements, parameters, tags, once in (
        ("string_floor", obstacles.string_on_floor, 12, {"extra": 2.0}, UNILATERAL, {}),
        (
            "string_floor_bounds",
            obstacles.string_on_floor,
            12,
            {"extra": 2.0},
            (*UNILATERAL, "bounds on coordinates"),
            {},
        ),
        ("string_grazing", obstacles.string_on_floor, 12, GRAZING, WEAKLY, {}),
        (
            "string_floor_twice",
            obstacles.string_on_floor,
            12,
            {"extra": 2.0, "twice": True},
            (*UNILATERAL, "LICQ fails"),
            {"twice": False},
        ),
        ("string_bump", obstacles.string_over_bump, 12, {}, UNILATERAL, {}),
        ("string_waves", obstacles.oscillating_floor, 24, {}, UNILATERAL, {}),
        ("wall_straight", obstacles.along_wall, 8, {}, (*WEAKLY, STEADY), {}),
        (
            "wall_both_sides",
            obstacles.along_wall,
            8,
            {"both": True},
            (*WEAKLY, "LICQ fails", "MFCQ fails", STEADY),
            {"both": False},
        ),
        ("disc", obstacles.round_discs, 16, {}, (*UNILATERAL, *OPTIMA), {}),
        (
            "discs",
            obstacles.round_discs,
            24,
            {"centres": ((-1.5, 0.3), (1.5, -0.2)), "ends": ((-3.5, 0), (3.5, 0))},
            (*UNILATERAL, *OPTIMA),
            {},
        ),
        ("ball", obstacles.round_ball, 16, {}, UNILATERAL, {}),
        ("pegs", obstacles.round_pegs, 24, {}, (*UNILATERAL, *OPTIMA), {}),
        ("rod_floor", obstacles.links_on_floor, 16, {}, (*UNILATERAL, *OPTIMA), {}),
        ("chain_floor", obstacles.links_on_floor, 24, {"links": 3}, (*UNILATERAL, *OPTIMA), {}),
    )
)

FAMILIES: dict[str, Family] = {family.name: family for family in (*EASY, *SCALED, *HARD, *CONTACTS)}


def sample(curve: Callable[[Array], Any], t: Array, n: int) -> Array:
    """Return a curve's values at the times t (K,), one row a time: (K, n)."""
    values = np.asarray(curve(t), dtype=float)
    return values.reshape(n, t.size).T
