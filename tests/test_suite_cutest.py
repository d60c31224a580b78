"""`interfaces.Cutest` does what PyCUTEst's documentation says of `CUTEstProblem`, name by name."""

import inspect

import numpy as np
import pytest

from actionopt import suite
from actionopt.suite.families import Family
from actionopt.suite.interfaces import Cutest
from actionopt.suite.limits import Bounds

sparse = pytest.importorskip("scipy.sparse")

# Signatures of the documentation of PyCUTEst 1.8, section "CUTEstProblem class".
SIGNATURES = {
    "all_to_free": "(x)",
    "free_to_all": "(x, use_zeros=False)",
    "varnames": "()",
    "connames": "()",
    "objcons": "(x)",
    "obj": "(x, gradient=False)",
    "grad": "(x, index=None)",
    "cons": "(x, index=None, gradient=False)",
    "lag": "(x, v, gradient=False)",
    "lagjac": "(x, v=None)",
    "jprod": "(p, transpose=False, x=None)",
    "hess": "(x, v=None)",
    "ihess": "(x, cons_index=None)",
    "hprod": "(p, x=None, v=None)",
    "gradhess": "(x, v=None, gradient_of_lagrangian=True)",
    "sobj": "(x, gradient=False)",
    "sgrad": "(x, index=None)",
    "scons": "(x, index=None, gradient=False)",
    "slagjac": "(x, v=None)",
    "sphess": "(x, v=None)",
    "isphess": "(x, cons_index=None)",
    "gradsphess": "(x, v=None, gradient_of_lagrangian=True)",
    "report": "()",
}
CONSTRAINED = (
    "v0 cl cu is_eq_cons is_linear_cons nnzj eq_cons_first linear_cons_first".split()
)  # None without constraints


@pytest.fixture
def bound():
    """Return a constrained problem, a point, multipliers and a direction."""
    problem = suite.get("rod_pendulum", elements=3)
    random = np.random.default_rng(5)
    x = problem.start() + random.uniform(-0.1, 0.1, problem.n)
    return Cutest(problem), x, random.uniform(-1, 1, problem.m), random.uniform(-1, 1, problem.n)


@pytest.fixture
def free():
    problem = suite.get("pendulum", elements=3)
    random = np.random.default_rng(6)
    x = problem.start() + random.uniform(-0.1, 0.1, problem.n)
    return Cutest(problem), x, random.uniform(-1, 1, problem.n)


def differences(function, x, step=1e-5):
    """Return the derivative of a function by central differences, one column an unknown."""
    columns = [
        (function(x + step * e) - function(x - step * e)) / (2 * step) for e in np.eye(x.size)
    ]
    return np.array(columns).T


def row(matrix, size):
    """Return the entries of a sparse row, which it has to be."""
    assert isinstance(matrix, sparse.coo_matrix) and matrix.shape == (1, size)
    return matrix.toarray()[0]


def dense(matrix):
    assert isinstance(matrix, sparse.coo_matrix)
    return matrix.toarray()


def test_methods_have_its_names_and_arguments():
    for name, signature in SIGNATURES.items():
        parameters = list(inspect.signature(getattr(Cutest, name)).parameters.values())[1:]
        plain = [p.replace(annotation=inspect.Parameter.empty) for p in parameters]
        assert str(inspect.Signature(plain)) == signature, name
    assert not hasattr(Cutest, "sjac")  # no name of its


def test_attributes(bound, free):
    c, _, _, _ = bound
    n, m = c.problem.n, c.problem.m
    assert (c.name, c.n, c.m) == ("rod_pendulum", n, m)
    assert (c.n_full, c.n_free, c.n_fixed) == (n, n, 0)
    np.testing.assert_array_equal(c.x0, c.problem.start())
    np.testing.assert_array_equal(c.bl, np.full(n, -1e20))  # infinite is 1e20
    np.testing.assert_array_equal(c.bu, np.full(n, 1e20))
    np.testing.assert_array_equal(c.vartype, np.zeros(n))  # all real
    for vector in (c.v0, c.cl, c.cu):
        np.testing.assert_array_equal(vector, np.zeros(m))
    assert c.is_eq_cons.dtype == bool and c.is_eq_cons.all()
    assert c.is_linear_cons.shape == (m,) and not c.is_linear_cons.any()
    assert c.eq_cons_first is True and c.linear_cons_first is True
    assert c.nnzj == np.count_nonzero(c.cons(c.x0 + 0.1, gradient=True)[1])
    assert c.nnzh == np.count_nonzero(np.triu(c.sphess(c.x0 + 0.1, c.v0 + 1).toarray()))
    assert len(set(c.varnames())) == n and c.varnames()[:2] == ["x[1]", "y[1]"]
    assert len(set(c.connames())) == m and c.connames()[0] == "f[1]"
    assert c.sifParams is None and c.sifOptions is None
    assert str(c) == f"CUTEst problem rod_pendulum (default params) with {n} variables and " + (
        f"{m} constraints"
    )
    assert Cutest(suite.get("rod_pendulum", 3, decades=2)).sifParams is None
    assert Cutest(suite.get("kepler", eccentricity=0.5)).sifParams == {"eccentricity": 0.5}
    assert Cutest(suite.get("rolling_cylinder")).is_linear_cons.all()
    rod = Cutest(suite.get("rod_floor", elements=2))  # its length is not, the floor is
    assert rod.is_linear_cons.tolist() == [name.startswith("f1") for name in rod.connames()]
    assert rod.linear_cons_first is False
    assert all(getattr(free[0], name) is None for name in CONSTRAINED)
    x = np.arange(float(n))
    np.testing.assert_array_equal(c.all_to_free(c.free_to_all(x)), x)


def test_objective_and_constraints(bound, free):
    c, x, _, _ = bound
    f, values = c.objcons(x)
    assert f == c.obj(x) == c.sobj(x) == c.problem.objective(x)
    np.testing.assert_array_equal(values, c.problem.constraints(x))
    np.testing.assert_array_equal(c.cons(x), values)
    np.testing.assert_array_equal(c.scons(x), values)  # c alone: the Jacobian is to be asked for
    assert c.cons(x, index=2) == c.scons(x, index=2) == values[2]
    u, y, _ = free
    assert u.objcons(y) == (u.obj(y), None)
    assert u.cons(y) is None and u.cons(y, gradient=True) is None and u.scons(y) is None


def test_first_derivatives(bound):
    c, x, v, _ = bound
    g, J = differences(c.obj, x), differences(c.cons, x)
    close = {"atol": 1e-6}
    assert c.obj(x, gradient=True)[0] == c.obj(x)
    np.testing.assert_allclose(c.grad(x), g, **close)
    np.testing.assert_array_equal(c.obj(x, gradient=True)[1], c.grad(x))
    np.testing.assert_array_equal(row(c.sobj(x, gradient=True)[1], c.n), c.grad(x))
    np.testing.assert_array_equal(row(c.sgrad(x), c.n), c.grad(x))
    values, found = c.cons(x, gradient=True)
    np.testing.assert_array_equal(values, c.cons(x))
    assert isinstance(found, np.ndarray)
    np.testing.assert_allclose(found, J, **close)
    np.testing.assert_array_equal(dense(c.scons(x, gradient=True)[1]), found)
    np.testing.assert_array_equal(c.grad(x, index=3), found[3])
    np.testing.assert_array_equal(row(c.sgrad(x, index=3), c.n), found[3])
    ci, Ji = c.cons(x, index=3, gradient=True)
    assert ci == values[3] and Ji.shape == (c.n,)
    np.testing.assert_array_equal(Ji, found[3])
    np.testing.assert_array_equal(row(c.scons(x, index=3, gradient=True)[1], c.n), found[3])
    # The Lagrangian is objective + multipliers * constraints.
    value, slope = c.lag(x, v, gradient=True)
    assert value == c.lag(x, v) == pytest.approx(c.obj(x) + v @ values, rel=1e-14)
    np.testing.assert_allclose(slope, g + J.T @ v, **close)
    for g_v, at in ((c.grad(x), {}), (slope, {"v": v})):
        np.testing.assert_allclose(c.lagjac(x, **at)[0], g_v, atol=1e-13)
        np.testing.assert_array_equal(c.lagjac(x, **at)[1], found)
        np.testing.assert_allclose(row(c.slagjac(x, **at)[0], c.n), g_v, atol=1e-13)
        np.testing.assert_array_equal(dense(c.slagjac(x, **at)[1]), found)


def test_without_constraints_what_is_of_them_is_none(free):
    u, x, p = free
    assert u.lag(x, None) is None and u.jprod(p) is None
    np.testing.assert_array_equal(u.lagjac(x)[0], u.grad(x))
    assert u.lagjac(x)[1] is None and u.slagjac(x)[1] is None
    g, H = u.gradhess(x)
    np.testing.assert_array_equal(g, u.grad(x))
    np.testing.assert_array_equal(H, u.hess(x))
    g, H = u.gradsphess(x)
    np.testing.assert_array_equal(row(g, u.n), u.grad(x))
    np.testing.assert_array_equal(dense(H), u.ihess(x))
    np.testing.assert_allclose(u.hess(x), differences(u.grad, x), atol=1e-6)
    np.testing.assert_array_equal(u.ihess(x + 0.1), u.hess(x + 0.1))


def test_second_derivatives(bound):
    c, x, v, _ = bound
    H = differences(lambda y: c.lagjac(y, v)[0], x)
    np.testing.assert_allclose(c.hess(x, v), H, atol=1e-6)
    np.testing.assert_array_equal(dense(c.sphess(x, v)), c.hess(x, v))  # both triangles
    np.testing.assert_allclose(c.ihess(x), differences(c.grad, x), atol=1e-6)
    np.testing.assert_array_equal(dense(c.isphess(x)), c.ihess(x))
    np.testing.assert_array_equal(dense(c.isphess(x, cons_index=1)), c.ihess(x, 1))
    split = c.ihess(x) + sum(v[i] * c.ihess(x, cons_index=i) for i in range(c.m))
    np.testing.assert_allclose(c.hess(x, v), split, atol=1e-12)
    for of_lagrangian, slope in ((True, c.lagjac(x, v)[0]), (False, c.grad(x))):
        g, J, H = c.gradhess(x, v, gradient_of_lagrangian=of_lagrangian)
        np.testing.assert_array_equal(g, slope)
        np.testing.assert_array_equal(J, c.cons(x, gradient=True)[1])
        np.testing.assert_array_equal(H, c.hess(x, v))  # of the Lagrangian in any case
        g, J, H = c.gradsphess(x, v, gradient_of_lagrangian=of_lagrangian)
        np.testing.assert_array_equal(row(g, c.n), slope)
        assert dense(J).shape == (c.m, c.n) and dense(H).shape == (c.n, c.n)


LAST_JACOBIAN = {
    "cons": lambda c, y, v: c.cons(y, gradient=True),
    "scons": lambda c, y, v: c.scons(y, gradient=True),
    "lagjac": lambda c, y, v: c.lagjac(y),
    "slagjac": lambda c, y, v: c.slagjac(y, v),
    "gradhess": lambda c, y, v: c.gradhess(y, v),
    "jprod": lambda c, y, v: c.jprod(y, x=y),
}
LAST_HESSIAN = {
    "hess": lambda c, y, v: c.hess(y, v),
    "sphess": lambda c, y, v: c.sphess(y, v),
    "gradhess": lambda c, y, v: c.gradhess(y, v),
    "gradsphess": lambda c, y, v: c.gradsphess(y, v, False),
    "hprod": lambda c, y, v: c.hprod(y, x=y, v=v),
}


@pytest.mark.parametrize("by", LAST_JACOBIAN)
def test_products_without_x_use_the_last_jacobian(bound, by):
    c, x, v, p = bound
    with pytest.raises(RuntimeError, match="no Jacobian was computed yet"):
        c.jprod(p)
    y = x + 0.3
    expected = Cutest(c.problem).jprod(p, x=y)
    LAST_JACOBIAN[by](c, y, v)
    c.obj(x), c.cons(x), c.grad(x), c.grad(x, index=0)  # none of which computes it anew
    np.testing.assert_array_equal(c.jprod(p), expected)
    J = c.cons(x, gradient=True)[1]
    np.testing.assert_allclose(c.jprod(v, transpose=True), J.T @ v, atol=1e-14)
    np.testing.assert_allclose(c.jprod(p), J @ p, atol=1e-14)
    assert np.max(np.abs(c.jprod(p) - expected)) > 1e-2  # the oracle can fail


@pytest.mark.parametrize("by", LAST_HESSIAN)
def test_products_without_x_use_the_last_hessian(bound, by):
    c, x, v, p = bound
    with pytest.raises(RuntimeError, match="no Hessian was computed yet"):
        c.hprod(p)
    y = x + 0.3
    LAST_HESSIAN[by](c, y, v)
    c.obj(x), c.grad(x), c.ihess(x), c.ihess(x, 0)
    np.testing.assert_allclose(c.hprod(p), c.problem.hessian_product(y, v, p), atol=1e-11)
    np.testing.assert_allclose(c.hprod(p, x=x, v=-v), c.hess(x, -v) @ p, atol=1e-11)
    np.testing.assert_allclose(c.hprod(p), c.hess(x, -v) @ p, atol=1e-11)
    assert np.max(np.abs(c.hprod(p) - c.problem.hessian_product(x, None, p))) > 1e-3


def test_products_without_constraints(free):
    u, x, p = free
    np.testing.assert_allclose(u.hprod(p, x=x), u.hess(x) @ p, atol=1e-12)
    u.ihess(x + 0.3)
    np.testing.assert_allclose(u.hprod(p), u.hess(x + 0.3) @ p, atol=1e-12)


def test_what_it_refuses(bound, free):
    c, x, v, p = bound
    u, y, _ = free
    for call in (
        lambda: c.obj(x[1:]),
        lambda: c.hprod(p[1:]),
        lambda: c.jprod(p, transpose=True),
        lambda: c.hprod(p, x=x),  # v must be specified
        lambda: c.gradhess(x),
        lambda: c.lag(x, v[1:]),
        lambda: u.hprod(y, x=y, v=y),
        lambda: u.gradhess(y, v=y),
    ):
        with pytest.raises(RuntimeError, match=r"wrong shape|should not be specified"):
            call()
    for call in (
        lambda: c.hess(x),
        lambda: c.sphess(x),
        lambda: u.hess(y, v),
        lambda: c.cons(x, index=c.m),
        lambda: c.scons(x, index=-1),
        lambda: c.ihess(x, cons_index=c.m),
    ):
        with pytest.raises(AssertionError, match=r"v must be|Invalid constraint index"):
            call()


def test_the_report_counts_in_its_units(bound, free):
    c, x, v, p = bound
    assert list(c.report()) == ["f", "g", "H", "Hprod", "c", "cg", "cH", "tsetup", "trun"]
    assert all(c.report()[name] == 0 for name in ("f", "g", "H", "Hprod", "c", "cg", "cH"))
    c.obj(x, gradient=True)
    c.objcons(x)
    c.cons(x, gradient=True)
    c.hess(x, v)
    c.hprod(p)
    found = c.report()
    assert {k: found[k] for k in ("f", "g", "H", "Hprod")} == {"f": 2, "g": 1, "H": 1, "Hprod": 1}
    assert {k: found[k] for k in ("c", "cg", "cH")} == {"c": 2, "cg": 1, "cH": 1}
    for i in range(c.m):  # all of them one by one are once
        c.cons(x, index=i)
    assert c.report()["c"] == 3
    assert found["tsetup"] >= 0 and found["trun"] >= 0
    u, y, _ = free
    u.obj(y)
    assert u.report()["f"] == 1
    assert [u.report()[name] for name in ("c", "cg", "cH")] == [None] * 3


def test_bounds_and_inequalities():
    sides = Bounds(coordinates=[(-0.5, np.inf), (-np.inf, lambda t: t)], constraints=[(0, 3.0)])
    c = Cutest(suite.TestProblem(Family("walls", "rod_pendulum", 3, limits=sides)))
    node = c.problem.mesh.nodes[1:-1]
    np.testing.assert_array_equal(c.bl[::2], -0.5)
    np.testing.assert_array_equal(c.bu[::2], 1e20)
    np.testing.assert_array_equal(c.bl[1::2], -1e20)
    np.testing.assert_array_equal(c.bu[1::2], node)
    assert not c.is_eq_cons.any() and c.eq_cons_first is True
    np.testing.assert_array_equal(c.cl, 0)
    # Rows are weighted with the quadrature, and so are their bounds: c = w f.
    f = c.problem.scene.problem.system.pointwise("constraint")
    Q = (c.x0 + 0.1).reshape(-1, 2)
    values = f(Q, node[:, None], c.problem.scene.problem.packed)[0].ravel()
    np.testing.assert_allclose(c.cons(c.x0 + 0.1) / c.cu, values / 3, rtol=1e-12)
    mixed = Bounds(constraints=[(-np.inf, 1.0)])
    c = Cutest(suite.TestProblem(Family("above", "polar_pendulum", 2, limits=mixed)))
    assert np.all(c.cl == -1e20) and np.all(c.cu < 1e20)
