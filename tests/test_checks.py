"""What is no plain number, or in no order that means anything, is refused in a sentence."""

import numpy as np
import pytest
from helpers import at_once

import actionopt as ao
from actionopt.mechanics.laws.tracing import parameter_names
from actionopt.scenes import circle, from_file
from actionopt.tools.checks import items, number, numbers

STATE, PLACE = ["q", "v", "t"], ["q", "t"]


def taking(names):
    return eval(f"lambda {names}: 0")


@at_once(
    "names",
    ["qdot, q, t", "q_dot, q, t", "t, q, v", "v, q, t", "t, x, xdot", "q, t, v", "v, x, t",
     "thetadot, theta, t", "dq_dt, q, t", "time, pos, vel", "v, q, t, *, l", "t, q, v, *, l"],
)  # fmt: skip
def test_arguments_in_another_order_are_refused(names):
    with pytest.raises(ValueError, match=r"expected lagrangian\(q, v, t\).*found lagrangian\("):
        parameter_names(taking(names), "lagrangian", STATE)


@at_once(
    "names",
    ["x, xdot, t", "q, q_dot, time", "theta, omega, t", "r, v, t", "u, v, t", "v, vdot, t",
     "t, tdot, lam", "x, dx, t", "d, dd, t", "v, w, t", "q, p, t", "x, y, z", "q, v, s",
     "v, v_t, x", "*state"],
)  # fmt: skip
def test_names_of_their_own_are_not(names):
    assert parameter_names(taking(names), "lagrangian", STATE) == []


@pytest.mark.parametrize("role", ["constraint", "obstacle", "on"])
def test_places_have_an_order_too(role):
    with pytest.raises(ValueError, match=rf"expected {role}\(q, t\).*found {role}\(t, q\)"):
        parameter_names(taking("t, q"), role, PLACE)
    assert parameter_names(taking("x, time"), role, PLACE) == []


class Labelled:
    """As much of a pandas Series as is looked at."""

    def __init__(self, values, labels):
        self.values, self.axes, self.iloc = values, [labels], None

    def __array__(self, dtype=None, copy=None):
        return np.array(self.values, dtype)

    def __iter__(self):
        return iter(self.values)


class Length(float):
    """As much of a quantity with a unit as is looked at."""

    magnitude = 1.0

    def __float__(self):
        raise TypeError("it has a dimension")


class Traced:
    """A number of another package that is not to be taken out of it."""

    def __float__(self):
        raise RuntimeError("it requires grad")

    __array__ = __float__


def test_labels_are_refused_where_they_say_another_order():
    plain, named = Labelled([1.0, 2.0], [0, 1]), Labelled([1.0, 2.0], ["y", "x"])
    assert numbers(plain, "q").tolist() == items(plain, "q") == [1.0, 2.0]
    for taken in (numbers, items):
        with pytest.raises(ValueError, match=r"found labels \['y', 'x'\], which are not read"):
            taken(named, "q")
    with pytest.raises(ValueError, match="labels"):
        ao.Event(0.0, named)


@pytest.mark.parametrize("value", [Traced(), Length(1.0), [Traced()], [Length(1.0)]])
def test_numbers_of_other_packages_are_refused(value):
    with pytest.raises(ValueError, match="expected"):
        numbers(value, "parameter 'l'")
    if not isinstance(value, list):
        with pytest.raises(ValueError, match="expected a number for the time"):
            number(value, "the time")


def test_numbers_with_units_are_not_converted():
    class Lengths(Labelled):
        magnitude = np.ones(2)

    with pytest.raises(ValueError, match=r"expected plain numbers for q, .*units"):
        numbers(Lengths([1.0, 2.0], [0, 1]), "q")


def test_a_circle_has_its_radius_first():
    for wrong in (([0, 0], 1.0), (1.0, (0, 0, 0)), (1.0, 2.0)):
        with pytest.raises(ValueError, match="expected"):
            circle(*wrong)
    with pytest.raises(ValueError, match=r"circle\(radius, \(x, y\)\)"):
        circle([0.0, 0.0], 1.0)
    assert circle(2.0, (1, 0)).points[:, 0] == pytest.approx([3, 0])


def test_rows_come_before_the_place_they_pass_through():
    with pytest.raises(ValueError, match=r"expected integrate_pfaffian\(rows, through\)"):
        ao.integrate_pfaffian([0.0, 0.0], lambda q: [q[1], q[0]])
    with pytest.raises(ValueError, match=r"expected .* for through"):
        ao.integrate_pfaffian(lambda q: [q[1], q[0]], ["x", "y"])


def test_a_time_is_no_text():
    path = ao.Path(ao.Mesh.uniform(0.0, 1.0, 1, 1), [[0.0, 1.0]])
    assert path(0.5) == path(np.array(0.5)) == 0.5
    with pytest.raises(ValueError, match=r"expected .* for the times, found '0.5'"):
        path("0.5")


def test_of_a_problem_and_a_scene_in_a_file_the_scene_is_taken(tmp_path):
    file = tmp_path / "both.py"
    file.write_text(
        "from actionopt import scenes\n"
        "scene = scenes.get('pendulum')\n"
        "problem = scenes.get('kepler').problem\n"
    )
    assert from_file(file).problem.system.coordinates == ("theta",)


@pytest.mark.parametrize(
    "value",
    [
        np.ma.masked,
        np.ma.array([1.0, 9.0], mask=[0, 1]),
        [np.ma.array([1, 9], mask=[0, 1]), [1, 1]],
    ],
)
def test_what_is_masked_is_no_number(value):
    with pytest.raises(ValueError, match="masked entries are no numbers"):
        numbers(value, "the masses")
    assert numbers(np.ma.array([1.0, 9.0]), "the masses").tolist() == [1, 9]
