"""How the tests are run: in processes of one thread each, several where there is much to do."""

import gc
import os
import sys

import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: the matrices are small
os.environ["MPLBACKEND"] = "Agg"  # before matplotlib: no window opens


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Look for no garbage among the tests and modules: it takes 0.1 to 0.3 s each time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_xdist_auto_num_workers(config):
    """Return no workers for files asked for by name: starting them takes longer than most."""
    return 0 if all(".py" in name for name in config.args) else None


@pytest.fixture(autouse=True)
def no_figure_left():
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
