"""The formulas that pages typeset are the Lagrangians that are solved."""

import importlib
import inspect
import itertools
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from actionopt import scenes
from actionopt.gallery import formula as F
from actionopt.gallery import units
from actionopt.gallery.mathml import mathml
from actionopt.gallery.texts import texts
from actionopt.plot import SI

POINTS = 7
STEP = 1e-30  # of a complex step: derivatives without cancellation


class Values:
    """Values of formulas at points: scalars (K,), vectors (d, K)."""

    def __init__(self, scene, q, v, t, definitions=()):
        self.names = scene.problem.system.coordinates
        self.q, self.v, self.t = q, v, t
        parameters = scene.problem.system.table.values(scene.problem.parameters)
        self.known = {name: np.asarray(value) for name, value in parameters.items()}
        self.indices = {}
        self.known |= {"t": t} | dict(zip(self.names, q, strict=True))
        self.rates = dict(zip(self.names, v, strict=True))
        self.scene = scene
        for symbol, node in definitions:
            self.known[symbol.name + symbol.index] = self(node)

    def __call__(self, node):
        match node:
            case F.Number(text):
                return float(text)
            case F.Symbol(name, index, primes):
                return self.symbol(name, index, primes)
            case F.Sum(terms):
                return sum(-self(x) if minus else self(x) for minus, x in terms)
            case F.Product(factors):
                values = [self(x) for x in factors]
                return np.prod(np.broadcast_arrays(*values), axis=0)
            case F.Fraction(top, bottom):
                return self(top) / self(bottom)
            case F.Power(base, F.Number("2")):
                value = self(base)
                return np.sum(value**2, axis=0) if np.ndim(value) == 2 else value**2
            case F.Power(base, exponent):
                return self(base) ** self(exponent)
            case F.Call(function, argument):
                return getattr(np, function)(self(argument))
            case F.Size(argument):
                value = self(argument)
                return np.sqrt(np.sum(value**2, axis=0)) if np.ndim(value) == 2 else np.abs(value)
            case F.Rate(argument):
                moved = self.q + 1j * STEP * self.v, self.v, self.t + 1j * STEP
                return Values(self.scene, *moved)(argument).imag / STEP
            case F.Over(over, term):
                letters = over.replace("<", "").split()
                bodies = [n[1:] for n in self.names if n[0] == "x"]
                total = 0.0
                for chosen in itertools.combinations(bodies, len(letters)):
                    self.indices = dict(zip(letters, chosen, strict=True))
                    total = total + self(term)
                return total
        raise AssertionError(node)

    def symbol(self, name, index, primes):
        if index and index[0] in self.indices:
            index = str(eval(index, {}, {k: int(i) for k, i in self.indices.items()}))
        key = name + index
        if primes:
            return self.rates[key]
        if key in self.known:
            return self.known[key]
        table = {"r": self.known, "v": self.rates}[name]
        return np.array([table[a + index] for a in "xyz" if a + index in table])


def at_random(scene):
    rng = np.random.default_rng(5)
    n = scene.problem.system.n
    return 0.3 + rng.random((n, POINTS)), rng.standard_normal((n, POINTS)), rng.random(POINTS)


@pytest.mark.parametrize("name", scenes.SCENES)
def test_the_formulas_are_what_is_solved(name):
    scene = scenes.get(name)
    system, given = scene.problem.system, scene.problem.parameters
    q, v, t = at_random(scene)
    module = importlib.import_module(f"actionopt.scenes.{name}")
    for function in ("lagrangian", "constraint", "force"):
        if not hasattr(module, function):
            continue
        found = F.formula(inspect.getdoc(getattr(module, function)))
        value = Values(scene, q, v, t, found.definitions)
        if function == "lagrangian":
            wanted = system.lagrangian(q, v, t, parameters=given)
            values = value(found.sides[-1])
        elif function == "constraint":
            wanted = system.constraint(q, t, parameters=given)
            assert found.sides[-1] == F.Number("0")
            values = []
            for i in range(system.m):
                value.indices = {"i": i + 1}
                values.append(value(found.sides[1]))
        else:
            wanted = system.force(q, v, t, parameters=given)
            values = np.atleast_2d(value(found.sides[-1]))
        np.testing.assert_allclose(values, wanted, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", scenes.SCENES)
def test_mathml_is_well_formed_and_says_the_same(name):
    system = scenes.get(name).problem.system
    for found in texts(name).formulas:
        written = mathml(found, {*system.coordinates, *system.parameters})
        tree = ET.fromstring(written)
        assert tree.get("alttext") == found.text
        leaves = [e.text for e in tree.iter() if e.tag in ("mi", "mn", "mo")]
        assert all(leaves)
        arity = {"mfrac": 2, "msup": 2, "msub": 2, "mover": 2, "munder": 2, "msubsup": 3}
        for element in tree.iter():
            assert len(element) == arity.get(element.tag, len(element))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("L = m (x", "expected '\\)', found 'the end'"),
        ("L = m x'^", "expected a symbol or a bracket"),
        ("L = m % 2", "expected a formula, found ' % 2'"),
        ("L = m x) / 2", "expected the end, found '\\)'"),
    ],
)
def test_what_is_no_formula(text, message):
    with pytest.raises(ValueError, match=message):
        F.formula(text)


def test_order_of_operations():
    tree = F.formula("L = -k x^2 / 2 + m g l cos theta1").sides[1]
    x = F.Power(F.Symbol("x"), F.Number("2"))
    first = F.Fraction(F.Product((F.Symbol("k"), x)), F.Number("2"))
    cosine = F.Call("cos", F.Symbol("theta", "1"))
    second = F.Product((*map(F.Symbol, "mgl"), cosine))
    assert tree == F.Sum(((True, first), (False, second)))


# -- units: powers of kg, m, s and A ---------------------------------------------------------

BASE = {
    "kg": (1, 0, 0, 0), "m": (0, 1, 0, 0), "s": (0, 0, 1, 0), "rad": (0, 0, 0, 0),
    "N": (1, 1, -2, 0), "J": (1, 2, -2, 0), "C": (0, 0, 1, 1), "T": (1, 0, -2, -1),
    "V": (1, 2, -3, -1),
}  # fmt: skip
NONE = np.zeros(4, dtype=int)


def powers(unit):
    """Return the powers in a unit written as kg m^2 or m^3/(kg s^2)."""
    over, _, under = unit.partition("/")
    total = NONE
    for sign, part in ((1, over), (-1, under.strip("()"))):
        for factor in part.split():
            name, _, exponent = factor.partition("^")
            total = total + sign * int(exponent or 1) * np.array(BASE[name])
    return total


class Powers:
    """Powers of formulas; the terms of a sum must agree."""

    def __init__(self, known):
        self.known = known

    def __call__(self, node):
        match node:
            case F.Number():
                return NONE
            case F.Symbol(name, index, primes):
                rate = primes * powers("s")
                here = self.known.get(name + index, self.known.get(name))
                if here is None and name[0] in "rvxy":  # the place of a body, in space
                    here, rate = powers("m"), max(primes, name == "v") * powers("s")
                return here - rate
            case F.Sum(terms):
                first, *others = (self(term) for _, term in terms)
                assert all((other == first).all() for other in others), node
                return first
            case F.Product(factors):
                return sum(self(x) for x in factors)
            case F.Fraction(top, bottom):
                return self(top) - self(bottom)
            case F.Power(base, exponent):
                return int(exponent.text) * self(base)
            case F.Call(_, argument):
                assert not self(argument).any(), node
                return NONE
            case F.Size(argument) | F.Over(_, argument):
                return self(argument)
            case F.Rate(argument):
                return self(argument) - powers("s")
        raise AssertionError(node)


@pytest.mark.parametrize("name", scenes.SCENES)
def test_every_lagrangian_is_an_energy(name):
    system = scenes.get(name).problem.system
    known = {p: powers(units.unit(name, p)) for p in system.parameters}
    known |= {c: powers(SI.coordinate(c)) for c in system.coordinates} | {"t": powers("s")}
    lagrangian = texts(name).formulas[0]
    for symbol, node in lagrangian.definitions:
        known[symbol.name] = Powers(known)(node)
    per_mass = powers("kg") if lagrangian.remark == "for unit mass" else NONE
    np.testing.assert_array_equal(Powers(known)(lagrangian.sides[-1]), powers("J") - per_mass)


def test_every_number_that_is_known_has_its_unit():
    for name in scenes.SCENES:
        assert set(scenes.get(name).facts.numbers) <= set(units.FACTS), name
