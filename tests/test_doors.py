"""To and from other packages: each door is tried where its neighbour is installed."""

import pickle

import casadi as ca
import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt import scenes
from actionopt.solver.input.arguments import read_guess

START, END = ao.Event(0.0, [0.3]), ao.Event(1.0, [-0.2])
QUIET = {"print_time": 0, "ipopt.print_level": 0, "ipopt.sb": "yes"}


def lagrangian(q, v, t, *, m, l, g):
    return m[0] * (l * v[0]) ** 2 / 2 + m[1] * g * l * np.cos(q[0]) + 0.1 * t * q[0]


DRIVEN = ao.System(lagrangian, ["theta"], parameters={"m": [1.0, 1.2], "l": 1.1, "g": 9.81})
ON_CIRCLE = ao.System(
    lambda q, v, t, *, g: v @ v / 2 - g * q[1],
    ["x", "y"],
    parameters={"g": 9.81},
    constraint=lambda q, t: (q @ q - 1) / 2,
)
ARC = [ao.Event(t, [np.sin(a), -np.cos(a)]) for t, a in ((0.0, 0.3), (1.0, 0.2))]
KEPLER = ao.System(lambda q, v, t: v @ v / 2 + 1 / np.sqrt(q @ q), ["x", "y"])
TRANSFER = ao.Problem(KEPLER, ao.Event(0.0, [1.0, 0.0]), ao.Event(1.5, [0.0, 1.0]))
LONG = 5.3156608  # S of the longer way round; the short one has 2.32


@pytest.fixture(scope="module")
def swing():
    return ao.solve(ao.Problem(DRIVEN, START, END, parameters={"g": 5.0}), tol=1e-10)


@pytest.fixture(scope="module")
def long_way():
    return ao.solve(TRANSFER, guess=[[1, 0, -1, 0], [0, -1, 0, 1]])


# -- CasADi ------------------------------------------------------------------------------------


def test_the_dynamics_are_those_of_the_system():
    f = DRIVEN.dynamics_function()
    assert f.name_in() == ["q", "v", "t", "m", "l", "g"]
    found = f(q=0.3, v=1.0, t=0.5, m=[1.0, 1.2])["a"]
    # m0 l^2 a = -m1 g l sin theta + t / 10
    exact = (-1.2 * 9.81 * 1.1 * np.sin(0.3) + 0.05) / 1.1**2
    assert float(found) == pytest.approx(exact, rel=1e-14)
    assert float(f(q=0.3, v=1.0, t=0.5)["a"]) != float(found)  # an array has no one default


def test_the_dynamics_know_the_tension():
    # q.q = 1 differentiated twice: q.a + v^2 = 0, with a = (0, -g) + lam q.
    q, v = np.array([0.6, -0.8]), 1.5 * np.array([0.8, 0.6])
    a, lam = ON_CIRCLE.dynamics_function()(q, v, 0.0, 9.81)
    exact = -(1.5**2) - 9.81 * 0.8
    assert float(lam) == pytest.approx(exact, rel=1e-14)
    assert np.allclose(a.full().ravel(), [exact * 0.6, -9.81 - exact * 0.8], rtol=1e-14)


def test_a_parameter_whose_name_is_taken_is_an_input_all_the_same():
    spring = ao.System(
        lambda q, v, t, *, a: v[0] ** 2 / 2 - a * q[0] ** 2 / 2, ["x"], parameters={"a": 3.0}
    )
    f = spring.dynamics_function()
    assert f.name_in()[3:] == ["parameter_1"]
    assert float(f(2.0, 0.0, 0.0, 5.0)[0]) == -10.0


def test_the_discrete_action_is_stationary_with_the_ends_free_in_its_gradient(swing):
    f = swing.action_function()
    found = f(Q=swing.path.values, m=[1.0, 1.2])  # g = 5 is the problem's
    assert float(found["S"]) == pytest.approx(swing.action, rel=1e-14)
    gradient = found["gradient"].full()
    assert np.abs(gradient[:, 1:-1]).max() < 1e-10
    assert -gradient[0, 0] == pytest.approx(swing.momenta[0][0], rel=1e-12)
    assert gradient[0, -1] == pytest.approx(swing.momenta[1][0], rel=1e-12)
    # The index is the number of negative eigenvalues between the ends.
    inner = np.linalg.eigvalsh(found["hessian"].full()[1:-1, 1:-1])
    assert (inner < 0).sum() == swing.morse_index
    step = 1e-5 * np.cos(np.arange(gradient.size))[None]
    ahead, behind = (f(Q=swing.path.values + k * step, m=[1.0, 1.2])["gradient"] for k in (1, -1))
    assert np.allclose(
        (ahead - behind).full().ravel() / 2, found["hessian"].full() @ step.ravel(), atol=1e-12
    )


@pytest.mark.long
def test_an_opti_finds_the_path_again():
    held = ao.solve(ao.Problem(ON_CIRCLE, *ARC))
    program, Q = held.opti()
    program.set_initial(Q, held.path.values + 0.05 * np.sin(np.pi * held.mesh.nodes))
    program.solver("ipopt", QUIET)
    answer = program.solve()
    assert np.allclose(answer.value(Q), held.path.values, atol=1e-7)


@pytest.mark.long
def test_an_opti_goes_round_an_obstacle():
    disc = ao.System(lambda q, v, t: v @ v / 2, ["x", "y"], obstacle=lambda q, t: q @ q - 1)
    way = ao.solve(ao.Problem(disc, ao.Event(0.0, [-2.0, 0.3]), ao.Event(1.0, [2.0, 0.0])))
    program, _ = way.opti()
    program.solver("ipopt", QUIET)
    assert program.solve().value(program.f) == pytest.approx(way.action, rel=1e-6)


@pytest.mark.long
def test_an_opti_goes_through_events_and_keeps_integrals():
    free = ao.System(lambda q, v, t: v @ v / 2, ["x", "y"], integral=lambda q, v, t: q[1])
    ends = ao.Event(0.0, [0.0, 1.0]), ao.Event(1.0, [2.0, 1.0])
    way = ao.Problem(free, *ends, through=[ao.Event(0.5, [None, 0.0])])  # two straight lines
    area = ao.Problem(free, *ends, integral=0.5)  # y = 1 - 3 t (1 - t)
    for problem, exact in ((way, 4.0), (area, 3.5)):
        held = ao.solve(problem)
        program, Q = held.opti()
        program.solver("ipopt", QUIET)
        answer = program.solve()
        assert held.action == pytest.approx(exact, rel=1e-12)
        assert answer.value(program.f) == pytest.approx(exact, rel=1e-8)
        assert np.allclose(answer.value(Q), held.path.values, atol=1e-7)


def test_what_an_opti_does_not_hold_is_refused():
    damped = ao.System(lambda q, v, t: v @ v / 2, ["x"], force=lambda q, v, t: -v)
    free = ao.System(lambda q, v, t: v @ v / 2, ["x"])
    start, far = ao.Event(0.0, [0.0]), ao.Event(1.0, None, on=lambda q, t: q[0] - 1)
    for system, end, word in ((damped, ao.Event(1.0, [1.0]), "forces"), (free, far, "surface")):
        with pytest.raises(ValueError, match=word):
            ao.solve(ao.Problem(system, start, end)).opti()


def test_what_is_no_sum_over_nodes_is_refused():
    closed = ao.Problem(KEPLER, ao.Event(0.0, [1.0, None]), ao.Periodic(2 * np.pi))
    loop = ao.solve(closed, guess=lambda t: np.stack([np.cos(t), np.sin(t)]), throw=False)
    for ask in (loop.action_function, loop.opti):
        with pytest.raises(ValueError, match="found one that closes"):
            ask()


# -- sympy: installed for all tests alone, so these are long -------------------------------------


@pytest.mark.long
def test_a_lagrangian_of_sympy_is_that_of_numpy(swing):
    pytest.importorskip("sympy")
    from sympy import Symbol, cos, symbols
    from sympy.physics.mechanics import dynamicsymbols

    theta, t = dynamicsymbols("theta"), dynamicsymbols._t
    m1, m2, l, g = symbols("m1 m2 l g", positive=True)
    L = m1 * (l * theta.diff(t)) ** 2 / 2 + m2 * g * l * cos(theta) + t * theta / 10
    values = {m1: 1.0, "m2": 1.2, l: 1.1}
    rate = Symbol("omega")
    plain = L.subs(theta.diff(t), rate)
    for law, v in ((L, [theta.diff(t)]), (plain, [rate]), (L, None)):
        system = ao.System.from_sympy(law, [theta], v, t, parameters=values)
        assert system.coordinates == ("theta",)
        assert sorted(system.parameters) == ["g", "l", "m1", "m2"]
        problem = ao.Problem(system, START, END, parameters={"g": 5.0})
        assert ao.solve(problem).action == pytest.approx(swing.action, rel=1e-9)


@pytest.mark.long
def test_a_parameter_without_a_value_is_asked_for():
    pytest.importorskip("sympy")
    from sympy import symbols

    x, v, t, k = symbols("x v t k")
    system = pickle.loads(pickle.dumps(ao.System.from_sympy(v**2 / 2 - k * x**2 / 2, x, v, t)))
    with pytest.raises(ValueError, match="'k', which has no default"):
        ao.Problem(system, START, END)
    with pytest.raises(ValueError, match="'k', which has no default"):
        system.energy([0.0], [1.0], 0.0)
    solution = ao.solve(ao.Problem(system, START, END, parameters={"k": 4.0}))
    # x = 0.3 cos 2t + b sin 2t
    b = (-0.2 - 0.3 * np.cos(2)) / np.sin(2)
    assert solution.start.v == pytest.approx([2 * b], rel=1e-8)


@pytest.mark.long
def test_functions_of_sympy_are_those_of_casadi():
    sympy = pytest.importorskip("sympy")
    x, y, v, w, t = sympy.symbols("x y v w t")
    V = sympy.Piecewise((x**2, x < 0), (x**3, True)) + sympy.Abs(x) * sympy.Max(x, y, 0)
    V += sympy.Heaviside(x) + sympy.sec(x) + sympy.Mod(x, 2) + sympy.atan2(y, x) * sympy.pi
    L = v**2 / 2 + w**2 - V - sympy.coth(x) ** 2 - sympy.Min(x, y) * sympy.sign(y)
    system = ao.System.from_sympy(L, sympy.Matrix([x, y]), (v, w), t)
    for place in ((-1.5, 0.2), (0.7, -1.3)):
        values = dict(zip((x, y, v, w), (*place, 0.5, 0.25), strict=True))
        exact = float(L.subs(values))
        assert float(system.lagrangian(place, [0.5, 0.25], 0.0)) == pytest.approx(exact, rel=1e-14)


@pytest.mark.long
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda x, v, t, f: (f(t).diff(t, 2) * f(t), [f(t)], None, t), "L may depend on q, v"),
        (lambda x, v, t, f: (v**2 - f(x), x, v, t), "give it as an expression of t"),
        (lambda x, v, t, f: (v**2, x), "expected velocities"),
        (lambda x, v, t, f: (v**2, [x, t], [v], None), "a velocity for each"),
        (lambda x, v, t, f: ("v**2", x, v, t), "lagrangian as an expression of sympy"),
        (lambda x, v, t, f: (v**2, "x", "v", "t"), "expected symbols of sympy"),
        (lambda x, v, t, f: ([v**2, v**2], x, v, t), "one expression"),
    ],
)
def test_what_is_no_lagrangian_of_sympy_is_refused(wrong, message):
    sympy = pytest.importorskip("sympy")
    with pytest.raises(ValueError, match=message):
        ao.System.from_sympy(*wrong(*sympy.symbols("x v t"), sympy.Function("f")))


@pytest.mark.long
def test_laws_beside_the_lagrangian_are_checked_like_it():
    sympy = pytest.importorskip("sympy")
    x, v, t, k = sympy.symbols("x v t k")
    with pytest.raises(ValueError, match="velocity v in a law"):
        ao.System.from_sympy(v**2, x, v, t, constraint=v)
    with pytest.raises(ValueError, match=r"'kk' is in none of the laws.*mean 'k'"):
        ao.System.from_sympy(v**2, x, v, t, force=k * x, parameters={"kk": 1.0})
    forced = ao.System.from_sympy(v**2 / 2, x, v, t, force=-k * v, parameters={k: 0.5})
    assert forced.force([1.0], [2.0], 0.0) == -1.0


@pytest.mark.long
def test_a_system_is_written_as_sympy_does():
    sympy = pytest.importorskip("sympy")
    from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

    written = ON_CIRCLE.to_sympy()
    x, y = dynamicsymbols("x y")
    L, q, v, t = written
    assert (L, q, v) == (written.lagrangian, (x, y), (x.diff(t), y.diff(t)))
    g = written.parameters["g"]
    assert sympy.expand(L - (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 + g * y) == 0
    method = LagrangesMethod(L, q, hol_coneqs=list(written.constraint))
    theirs = method.form_lagranges_equations()
    mine = [row.lhs for row in written.equations]
    names = dict(zip(written.multipliers, method.lam_vec, strict=True))
    signs = [-1, 1]  # of the multiplier: sympy's is on one side or the other
    assert any(
        all(
            sympy.expand(a.subs({k: s * lam for k, lam in names.items()}) - b) == 0
            for a, b in zip(mine[:2], theirs, strict=True)
        )
        for s in signs
    )
    assert mine[2] == (x**2 + y**2) / 2 - sympy.Rational(1, 2)
    assert r"\frac{d^{2}}{d t^{2}} x" in written.latex()
    again = ao.System.from_sympy(*written, constraint=written.constraint, parameters={"g": 9.81})
    state = [0.6, -0.8], [0.8, 0.6], 0.0
    assert np.allclose(again.acceleration(*state), ON_CIRCLE.acceleration(*state), rtol=1e-14)


@pytest.mark.long
def test_every_scene_is_written_or_says_why_not():
    pytest.importorskip("sympy")
    for name in ("kepler", "heavy_top", "turning_wire", "drag_quadratic", "double_pendulum"):
        system, values = scenes.get(name).problem.system, scenes.get(name).problem.parameters
        written = system.to_sympy()
        again = ao.System.from_sympy(
            *written, constraint=written.constraint or None, force=written.force or None
        )
        q, v = 0.3 + 0.1 * np.arange(system.n), 0.2 - 0.3 * np.arange(system.n)
        named = {k: x for k, x in values.items() if k in again.parameters}
        for ask in ("lagrangian", "energy", "force"):
            here = getattr(system, ask)(q, v, 0.4, parameters=values)
            there = getattr(again, ask)(q, v, 0.4, parameters=named)
            assert np.allclose(here, there, rtol=1e-13), (name, ask)
    table = ca.interpolant("V", "bspline", [np.arange(6.0)], np.arange(6.0) ** 2)
    measured = ao.System(lambda q, v, t: v[0] ** 2 - ca.sqrt(q[0]) * ca.erfinv(q[0]), ["x"])
    assert table is not None
    with pytest.raises(ValueError, match="without a counterpart"):
        measured.to_sympy()


# -- scipy -------------------------------------------------------------------------------------


def test_a_path_is_a_ppoly_and_back(long_way):
    pytest.importorskip("scipy")
    path = long_way.path
    pieces = path.to_ppoly()
    t = np.linspace(0.0, 1.5, 401)
    assert np.abs(pieces(t) - path(t)).max() < 1e-13
    assert np.abs(pieces.derivative()(t) - path.velocity(t)).max() < 1e-11 * 10
    assert np.abs(ao.Path.from_ppoly(pieces)(t) - path(t)).max() < 1e-13


def splines(t, q, v):
    from scipy import interpolate as ip

    yield ip.CubicSpline(t, q.T)
    yield ip.CubicSpline(t, q, axis=1)
    yield ip.make_interp_spline(t, q, axis=1, k=5)
    yield ip.make_interp_spline(t, q.T)
    yield ip.BPoly.from_derivatives(t, np.stack([q.T, v.T], axis=1))


def test_splines_are_paths_exactly(long_way):
    pytest.importorskip("scipy")
    knots, t = np.linspace(0.0, 1.5, 21), np.linspace(0.0, 1.5, 301)
    for spline in splines(knots, long_way(knots), long_way.velocity(knots)):
        values = spline(t) if spline.axis else spline(t).T
        assert np.abs(ao.Path.from_ppoly(spline)(t) - values).max() < 1e-13


def test_a_curve_of_scipy_that_guesses_is_stretched_over_the_times_asked():
    interpolate = pytest.importorskip("scipy.interpolate")
    curve = interpolate.CubicSpline([1.0, 2.0, 4.0], [[0.1], [0.3], [-0.2]])
    found = read_guess(
        ao.Problem(systems.oscillator(), ao.Event(0.0, 0.1), ao.Event(6.0, -0.2)), curve
    )
    assert found(np.array([0.0, 2.0, 6.0]))[0] == pytest.approx([0.1, 0.3, -0.2])


def test_what_is_no_continuous_spline_is_no_path():
    scipy = pytest.importorskip("scipy.interpolate")
    with pytest.raises(ValueError, match="pieces that meet"):
        ao.Path.from_ppoly(scipy.PPoly(np.array([[0.0, 0.0], [1.0, 2.0]]), [0.0, 1.0, 2.0]))
    for wrong in (3.0, np.sin):
        with pytest.raises(ValueError, match="piecewise polynomials of scipy"):
            ao.Path.from_ppoly(wrong)


def motion(t, y):
    cube = np.hypot(y[0], y[1]) ** 3
    return np.stack([y[2], y[3], -y[0] / cube, -y[1] / cube])


def test_what_scipy_says_of_a_curve_is_a_guess(long_way):
    pytest.importorskip("scipy")
    from scipy.integrate import solve_bvp, solve_ivp

    t = np.linspace(0.0, 1.5, 21)
    q, v = long_way(t), long_way.velocity(t)
    state = [*long_way.start.q, *long_way.start.v]
    dense = solve_ivp(motion, (0.0, 1.5), state, rtol=1e-5, dense_output=True)
    sparse = solve_ivp(motion, (0.0, 1.5), state, rtol=1e-5)
    ends = solve_bvp(
        motion, lambda a, b: np.array([a[0] - 1, a[1], b[0], b[1] - 1]), t, np.vstack([q, v])
    )
    for guess in (*splines(t, q, v), dense, dense.sol, sparse, ends, ends.sol):
        assert ao.solve(TRANSFER, guess=guess).action == pytest.approx(LONG, abs=1e-6)
    energy = float(long_way.energy(0.0))
    when = ao.Problem(KEPLER, TRANSFER.start, ao.Event(None, [0.0, 1.0]), energy=energy)
    assert ao.solve(when, guess=dense).duration == pytest.approx(1.5, rel=1e-8)
    with pytest.raises(ValueError, match="expected a guess of 1 coordinates"):
        ao.solve(ao.Problem(DRIVEN, START, END), guess=ends)


# -- pandas and xarray -------------------------------------------------------------------------


@pytest.mark.long
def test_a_table_is_a_guess_by_its_labels(long_way):
    pd = pytest.importorskip("pandas")
    t = np.linspace(0.0, 1.5, 21)
    whole = long_way.to_dataframe(t)
    assert list(whole.columns) == ["x", "y", "v_x", "v_y", "p_x", "p_y", "energy"]
    assert whole["v_y"].to_numpy() == pytest.approx(long_way.velocity(t)[1], rel=1e-14)
    x, y = long_way(t)
    for guess in (whole, pd.DataFrame({"y": y, "x": x}), pd.DataFrame({"t": t, "y": y, "x": x})):
        assert ao.solve(TRANSFER, guess=guess).action == pytest.approx(LONG, abs=1e-6)
    with pytest.raises(ValueError, match="none called 'x' among y, z"):
        ao.solve(TRANSFER, guess=pd.DataFrame({"y": y, "z": x}))
    with pytest.raises(ValueError, match="times of the guess"):
        ao.solve(TRANSFER, guess=pd.DataFrame({"t": list("abc"), "y": y[:3], "x": x[:3]}))


@pytest.mark.long
def test_a_solution_is_a_dataset():
    pytest.importorskip("xarray")
    held = ao.solve(ao.Problem(ON_CIRCLE, *ARC))
    data = held.to_xarray([0.0, 0.5, 1.0])
    assert float(data.q.sel(coordinate="y", t=0.5)) == held(0.5)[1]
    assert float(data.multipliers.sel(t=0.5)[0]) == held.multipliers(0.5)[0]
    assert data.attrs["action"] == held.action and data.attrs["status"] == "SOLVED"
    assert held.to_xarray().t.size == held.mesh.nodes.size


@pytest.mark.parametrize(("names", "twice"), [(["x", "v_x"], "v_x"), (["x", "energy"], "energy")])
def test_no_column_of_a_table_takes_the_place_of_another(names, twice):
    pytest.importorskip("pandas")
    system = ao.System(lambda q, v, t: v @ v / 2, names)
    path = ao.solve(ao.Problem(system, ao.Event(0, [0, 5]), ao.Event(1, [1, 7])))
    with pytest.raises(ValueError, match=f"found '{twice}' for both"):
        path.to_dataframe()
