"""How the tests are run: in processes of one thread each, several where there is much to do."""

import gc
import os
import sys

import browser
import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: the matrices are small
os.environ["MPLBACKEND"] = "Agg"  # before matplotlib: no window opens
if "PYTEST_XDIST_WORKER" in os.environ:
    # To rewrite all that is asserted takes each process six seconds, and workers know of no
    # `--assert=plain`. The values of what fails are shown where its file is run alone.
    sys.meta_path[:] = [x for x in sys.meta_path if type(x).__name__ != "AssertionRewritingHook"]


# First words of the names of the test files that are not on how a path is found and judged. All
# others are on the rooms from mechanics to families: their numbers hang on linear algebra.
BESIDE = """
    architecture blas chapter claims cli cluster course docstrings examples explore files gallery
    guide journal live memory motion notebook pages phasors pickling plot relaxation scenes store
    stress suite threads watch words work
""".split()


def of_files(names):
    """Return whether the command names files of tests, and nothing else."""
    return all(".py" in name for name in names)


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config):
    """Share the tests out where pytest-xdist is installed, unless the command says otherwise.

    Files that are asked for by name are run with what others stand for elsewhere.
    """
    if of_files(config.args) and config.option.markexpr == "not slow and not long":
        config.option.markexpr = "not slow"
    shares = config.pluginmanager.hasplugin("xdist") and not hasattr(config, "workerinput")
    if shares and config.option.numprocesses is None:
        config.option.numprocesses = "auto"
        config.option.maxprocesses = 2  # each reads all the tests before it runs any
        config.option.dist = "loadfile"  # what one file solves for many tests is solved once


def pytest_collection_modifyitems(config, items):
    """Mark what kernels of linear algebra may change, and the variants others stand for."""
    lost = {}
    for item in items:
        test, word = (item.path.stem + "_").split("_")[:2]
        if test == "test" and word not in BESIDE:
            item.add_marker("numerics")
        if {"one_browser", "computed"} & set(item.fixturenames):  # a browser, or Node
            item.add_marker("long")
        if quick := item.get_closest_marker("quick"):
            lost.setdefault((item.path, item.originalname), set(quick.args)).discard(
                item.callspec.id
            )
            if item.callspec.id not in quick.args:
                item.add_marker("long")
    if any(lost.values()) and not any("::" in name for name in config.args):
        raise pytest.UsageError(f"expected variants that are there, found {lost}")


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Look for no garbage among the tests and modules: it takes 0.1 to 0.3 s each time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(optionalhook=True)  # it is of pytest-xdist
def pytest_xdist_auto_num_workers(config):
    """Return no workers for files asked for by name: starting them takes longer than most."""
    return 0 if of_files(config.args) else None


@pytest.fixture(autouse=True)
def no_figure_left():
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(scope="session")
def one_browser():
    if browser.found() is None:
        pytest.skip("no Chromium found")
    page = browser.Browser()
    yield page
    page.close()


@pytest.fixture(scope="module")
def browser_of_file(one_browser):
    yield one_browser
    one_browser.load("about:blank")  # a page that is left open goes on moving, at half a core


@pytest.fixture
def chromium(browser_of_file):
    """A page of the browser that has seen nothing yet."""
    browser_of_file.errors.clear()
    browser_of_file.requests.clear()
    return browser_of_file
