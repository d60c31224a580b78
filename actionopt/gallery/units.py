"""SI units of the parameters of the scenes.

A symbol means the same in most scenes; where it does not, the scene has a row of its own. That
every Lagrangian comes out in joules is a test.
"""

from __future__ import annotations

PARAMETER_UNITS = {
    "m": "kg", "m1": "kg", "m2": "kg", "M": "kg", "l": "m", "l1": "m", "l2": "m", "R": "m",
    "A": "m", "g": "m/s^2", "a": "m/s^2", "k": "N/m", "b": "kg/s", "w": "rad/s", "angle": "rad",
    "e": "C", "B": "T", "E": "V/m", "Ex": "V/m", "Ez": "V/m", "mu": "m^3/s^2",
    "G": "m^3/(kg s^2)", "spare": "J", "I1": "kg m^2", "I3": "kg m^2", "inertia": "", "n": "",
}  # fmt: skip
SCENE_UNITS = {
    "drag_quadratic": {"c": "kg/m"},
    "oscillator_gauge": {"c": "kg/s^2"},
    "chain_on_floor": {"c": "m"},
    "light_around_star": {"M": "m"},
    "brachistochrone": {"h": "m"},
    "descent_to_wall": {"h": "m", "lean": "rad"},
    "exit_path": {"w": "rad/s", "a": "m", "beta": ""},
    "great_ellipse": {"a": "m", "b": "m"},
    "fish_eye": {"a": "m"},
    "kink": {"a": "m"},
    "mirage": {"h": "m", "low": "m", "first": "m", "last": "m"},
    "henon_heiles": {"a": "m"},
    "lyapunov_orbit": {"D": "m"},
    "vacuum_decay": {"a": "m", "b": ""},
    "zermelo": {"w": "rad/m"},
    "screw": {"c": "rad/m", "k": "J"},
    "two_on_a_line": {"a": "", "b": ""},
    "descent_through_gate": {"h": "m"},
    "rope_of_length": {"h": "m"},
    "rope_on_floor": {"h": "m", "floor": "m"},
    "beam_on_floor": {"B": "N m^2", "w": "N/m"},
    "string_to_wall": {"far": "m", "lean": "rad"},
    "smoothest_way": {"apart": "m", "high": "m", "low": "m"},
    "clamped_beam": {"B": "N m^2", "f": "N/m"},
    "buckled_beam": {"B": "N m^2", "P": "N"},
    "throw_at_cart": {"u": "m/s", "far": "m", "high": "m"},
}
FACTS = {
    "top_speed": "m/s", "sag": "m", "euler_load": "N", "lean": "rad", "shortening": "m",
    "period": "s", "contact_time": "s", "circle": "m", "drift": "m/s", "terminal_speed": "m/s",
    "contact_angle": "rad", "rest_angle": "rad", "tilt": "rad", "cyclotron": "rad/s",
    "oscillation": "rad/s", "spin": "rad/s", "block_acceleration": "m/s^2",
    "rolling_acceleration": "m/s^2", "wedge_acceleration": "m/s^2", "friction": "N",
    "period_action": "J s", "fall_time": "s", "waist": "m", "area": "m^2", "whole_action": "J s",
    "high_duration": "s", "other_duration": "s", "contact_begin": "s", "contact_end": "s",
    "contact_force": "m/s^2", "direct_length": "m", "mirage_length": "m",
    "foot": "m", "optical_length": "m", "turning": "rad", "bow": "rad", "caustic": "m",
    "joachimsthal": "m^2", "spread": "m", "leap": "s", "cart_energy": "J", "radius": "m",
    "rope_length": "m", "volume": "m^3", "begin_impulse": "N", "end_impulse": "N",
}  # fmt: skip
BARE_CONTACT = {"contact_begin": "", "contact_end": "", "contact_force": ""}  # along a parameter
SCENE_FACTS = {
    **dict.fromkeys(("chain_on_floor", "rope_on_floor"), BARE_CONTACT),
    **dict.fromkeys(  # S in square metres
        ("rope_round_post", "string_to_wall", "way_round_ball"),
        BARE_CONTACT | {"contact_force": "m"},
    ),
    "beam_on_floor": {"contact_begin": "m", "contact_end": "m", "contact_force": "N/m"},
}


def unit(scene: str, parameter: str) -> str:
    """Return the unit of a scene's parameter, as text; nothing for a pure number."""
    return SCENE_UNITS.get(scene, {}).get(parameter, PARAMETER_UNITS.get(parameter, ""))


def fact_unit(scene: str, name: str) -> str:
    """Return the unit of one of the numbers of a scene's facts, as text."""
    return SCENE_FACTS.get(scene, {}).get(name, FACTS.get(name, ""))


def html(unit: str) -> str:
    """Return a unit as HTML, its powers raised.

    >>> html("kg m^2")
    'kg m<sup>2</sup>'
    """
    head, *rest = unit.split("^")
    return head + "".join(f"<sup>{part[0]}</sup>{part[1:]}" for part in rest)
