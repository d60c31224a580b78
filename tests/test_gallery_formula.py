"""The formulas that pages typeset are the Lagrangians that are solved."""

import ast
import importlib
import inspect
import itertools
import operator
import re
import xml.etree.ElementTree as ET
from fractions import Fraction

import numpy as np
import pytest
from helpers import a_quarter, at_once, solved

from actionopt import scenes
from actionopt.gallery import units
from actionopt.gallery.texts import texts
from actionopt.mechanics.laws import written
from actionopt.plot._names import units_of
from actionopt.tools import formula as F
from actionopt.tools.mathml import inline, mathml
from actionopt.tools.mathml import symbol as marked_symbol

OPERATORS = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv
}  # fmt: skip
LAWS = "lagrangian length constraint force obstacle integral".split()
POINTS = 7
STEP = 1e-30  # of a complex step: derivatives without cancellation


def parts(node):
    """Return name, index and number of time derivatives of a symbol."""
    index = ast.unparse(node.slice) if isinstance(node, ast.Subscript) else ""
    name, digits, primes = re.fullmatch(
        f"([A-Za-z]+)(\\d*)({F.PRIME}*)", ast.unparse(node).partition("[")[0]
    ).groups()
    return name, index or digits, len(primes)


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
        self.higher = {}  # of the number of derivatives
        self.scene = scene
        for symbol, node in definitions:
            self.known["".join(parts(symbol)[:2])] = self(node)

    def __call__(self, node):
        match node:
            case ast.Constant(value):
                return value
            case ast.Name() | ast.Subscript():
                return self.symbol(*parts(node))
            case ast.BinOp(base, ast.Pow(), power):
                value = self(base)
                return np.sum(value**2, axis=0) if np.ndim(value) == 2 else value ** self(power)
            case ast.BinOp(a, operator, b):
                return OPERATORS[type(operator)](self(a), self(b))
            case ast.Call(ast.Name("size"), [argument]):
                value = self(argument)
                return np.sqrt(np.sum(value**2, axis=0)) if np.ndim(value) == 2 else np.abs(value)
            case ast.Call(ast.Name("rate"), [argument]):
                moved = self.q + 1j * STEP * self.v, self.v, self.t + 1j * STEP
                return Values(self.scene, *moved)(argument).imag / STEP
            case ast.Call(ast.Name("over"), [over, term]):
                letters = ast.unparse(over).split(" < ")
                bodies = [n[1:] for n in self.names if n[0] == "x"]
                total = 0.0
                for chosen in itertools.combinations(bodies, len(letters)):
                    self.indices = dict(zip(letters, chosen, strict=True))
                    total = total + self(term)
                return total
            case ast.Call(ast.Name(function), [argument]):
                return getattr(np, function)(self(argument))
        raise AssertionError(node)

    def named(self, rows):
        return dict(zip(self.names, rows, strict=True))

    def symbol(self, name, index, primes):
        if index and index[0] in self.indices:
            index = str(eval(index, {}, {k: int(i) for k, i in self.indices.items()}))
        key = name + index
        if primes:
            return self.rates[key] if primes == 1 else self.higher[primes][key]
        if key in self.known:
            return self.known[key]
        table = {"r": self.known, "v": self.rates}[name]
        return np.array([table[a + index] for a in "xyz" if a + index in table])


def at_random(scene):
    rng = np.random.default_rng(5)
    n = scene.problem.system.n
    return 0.3 + rng.random((n, POINTS)), rng.standard_normal((n, POINTS)) / 4, rng.random(POINTS)


@pytest.mark.long
@at_once("name", scenes.SCENES)
def test_the_formulas_are_what_is_solved(name):
    scene = scenes.get(name)
    system, given = scene.problem.system, scene.problem.parameters
    q, v, t = at_random(scene)
    more = np.random.default_rng(6).standard_normal((system.order - 1, *q.shape))
    module = importlib.import_module(f"actionopt.scenes.{name}")
    for function in ("lagrangian", "constraint", "force", "obstacle", "integral"):
        if not hasattr(module, function):
            continue
        found = F.formula(inspect.getdoc(getattr(module, function)))
        value = Values(scene, q, v, t, found.definitions)
        if function == "lagrangian":
            given = {name: given[name] for name in (scene.problem.plain or system).parameters}
            law, (*below, highest) = scene.problem.plain or system, (q, v, *more)
            value.higher = dict(enumerate(map(value.named, more), 2))
            state = np.concatenate(below).T, highest.T, t[:, None]
            wanted = law.pointwise("value")(*state, law.table.pack(law.table.values(given)))[0][
                :, 0
            ]
            values = value(found.sides[-1])
        elif function == "integral":
            wanted = [module.integral(*at) for at in zip(q.T, v.T, t, strict=True)]
            values = value(found.sides[-1])
        elif function == "obstacle":
            wanted = system.obstacle(q, t, parameters=given)
            values = np.atleast_2d(value(found.sides[-1]))
        elif function == "constraint":
            wanted = system.constraint(q, t, parameters=given)
            assert ast.unparse(found.sides[-1]) == "0"
            values = []
            for i in range(system.m):
                value.indices = {"i": i + 1}
                values.append(value(found.sides[1]))
        else:
            wanted = system.force(q, v, t, parameters=given)
            values = np.atleast_2d(value(found.sides[-1]))
        np.testing.assert_allclose(values, wanted, rtol=1e-13, atol=1e-13)


def unfulfilled(name, change=lambda text: text):
    """Return by how much the solution misses the equations written, in parts of their terms."""
    scene, solution = scenes.get(name), solved(name, tol=1e-12)
    system, t = scene.problem.system, np.linspace(0, scene.problem.duration, 41)[1:-1]
    for event in solution.problem.through:  # where the velocity jumps
        t = t[np.abs(t - event.t) > scene.problem.duration / 80]
    for arc in solution.contacts:  # they are those of the free motion
        t = t[(t < arc.begin - scene.problem.duration / 80) | (t > arc.end + 1e-2)]
    h, order = 1e-3 * scene.problem.duration, system.order  # differences of order 8

    def v(t):  # the highest derivative that a motion is told by
        return solution.derivatives(t)[-1]

    weights = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    a = sum(w / h * (v(t + k * h) - v(t - k * h)) for k, w in enumerate(weights, 1))
    value = Values(scene, solution(t), solution.velocity(t), t)
    known = [*solution.derivatives(t)[2:], a]
    value.higher = dict(enumerate(map(value.named, known), 2))
    lamda = solution.multipliers(t) if order == 1 else ()
    value.known |= {"lamda": lamda[0]} if system.m == 1 else {}
    value.known |= {f"lamda{k + 1}": row for k, row in enumerate(lamda)}
    missed, least = [], np.max(np.abs(v(t))) / scene.problem.duration  # where all terms vanish
    value.known |= dict(zip(("kappa",), scene.problem.kappa, strict=False))
    law = (scene.problem.laws or (system,))[0]
    for text in written.equations(law, law.table):
        left, right = F.formula(change(text.replace("integral_multipliers_1", "kappa"))).sides
        size = max(np.max(np.abs(value(n))) for side in (left, right) for n in terms(side))
        missed.append(np.max(np.abs(value(left) - value(right))) / max(size, least))
    return max(missed)


def terms(node):
    """Yield the terms of a sum."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
        yield from terms(node.left)
        node = node.right
    yield node


@pytest.mark.quick(
    "catenoid",
    "drag_linear",
    "figure_eight",
    "heavy_top",
    "inverted_cone",
    "mirage",
    "sliding_off_circle",
    "two_on_a_line",
)
@pytest.mark.parametrize("name", a_quarter(scenes.SCENES, 2))
def test_the_equations_of_motion_vanish_on_the_solution(name):
    assert unfulfilled(name) < 1e-8


def test_sums_are_divided_by_what_stands_below_them():
    for name, expected in (
        (
            "fish_eye",
            "2 (x x'^2 / a^2 + 2 y x' y' / a^2 - x y'^2 / a^2) / (x^2 / a^2 + y^2 / a^2 + 1)",
        ),
        ("light_around_star", "2 M r' phi' / (1 - 2 M / r) - 2 r r' phi'"),
    ):
        law = scenes.get(name).problem.system
        sides = [row.split(" = ")[1] for row in written.equations(law, law.table)]
        assert expected in sides


def test_equations_that_are_wrong_do_not_vanish():
    assert unfulfilled("pendulum", lambda text: text.replace("sin", "cos")) > 1e-3
    assert unfulfilled("charge_planar", lambda text: text.replace("= -e", "= e")) > 1e-3


@at_once("name", scenes.SCENES)
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
        ("L = m (x", "expected a formula, found 'm \\(x': '\\(' was never closed"),
        ("L = m x'^", 'expected a formula, found "m x\'\\^": invalid syntax'),
        ("L = m % 2", "expected a formula, found 'm % 2'"),
        ("L = m x) / 2", "unmatched '\\)'"),
    ],
)
def test_what_is_no_formula(text, message):
    with pytest.raises(ValueError, match=message):
        F.formula(text)


def test_order_of_operations():
    side = F.formula("L = -k x^2 / 2 + m g l cos theta1 / 3 b").sides[1]
    assert ast.dump(side) == ast.dump(
        ast.parse("(0 - (k * x**2) / 2) + (m * g * l * cos(theta1) / 3) * b", mode="eval").body
    )


@at_once("name", scenes.SCENES)
def test_every_parameter_of_a_law_has_a_unit(name):
    module = importlib.import_module(f"actionopt.scenes.{name}")
    laws = [getattr(module, law) for law in LAWS if hasattr(module, law)]
    taken = [p for law in laws for p in inspect.signature(law).parameters.values()]
    listed = units.PARAMETER_UNITS | units.SCENE_UNITS.get(name, {})
    assert not {p.name for p in taken if p.kind is p.KEYWORD_ONLY} - {*listed}


def test_along_a_parameter_nothing_is_told_in_seconds_but_a_time():
    for name in scenes.SCENES:
        scene = scenes.get(name)
        if scene.measure is None or units_of(scene).time:
            continue
        for fact in scene.facts.numbers:
            if fact.startswith("contact_"):
                assert " s" not in f" {units.fact_unit(name, fact)}".replace("/", " "), (name, fact)


@pytest.mark.parametrize(
    ("name", "marked"),
    [
        ("x'", '<mover accent="true"><mi>x</mi><mo>&#x2D9;</mo></mover>'),
        ("x" + 5 * "'", "<msup><mi>x</mi>"),
        ("Ex", "<msub><mi>E</mi><mi>x</mi></msub>"),
    ],
)
def test_a_symbol_has_dots_an_order_or_an_index(name, marked):
    found = marked_symbol(name)
    assert found.startswith(f'<math alttext="{name}"><mrow>') and marked in found
    assert ("<mn>5</mn>" in found) == name.endswith(5 * "'")


@at_once(
    ("text", "marked"),
    [
        ("x^(1/2)", "<msup><mi>x</mi><mrow><mn>1</mn><mo>/</mo><mn>2</mn></mrow></msup>"),
        ("1/2 x", "<mfrac><mn>1</mn><mn>2</mn></mfrac>"),
        ("exp(x)", "<msup><mi>e</mi><mrow><mi>x</mi></mrow></msup>"),
        ("df/dx", "<mrow><mi>d</mi><mi>f</mi></mrow><mrow><mi>d</mi><mi>x</mi></mrow>"),
        ("dL/dx", "<mrow><mi>&#x2202;</mi><mi>L</mi></mrow>"),
        ("f(x)", "<mi>f</mi><mo>&#x2061;</mo>"),
    ],
)
def test_what_formulas_seldom_have_is_written_too(text, marked):
    assert marked in inline(text, ())


def test_squared_sines_of_one_share_are_collected():
    cosine, sine = ((((name, "theta"), Fraction(2)),) for name in ("cos", "sin"))
    found = written._collect({cosine: Fraction(3), sine: Fraction(3)})
    assert found == {written.UNIT_PRODUCT: Fraction(3)}
    apart = {cosine: Fraction(3), sine: Fraction(1)}
    assert written._collect(dict(apart)) == apart
