"""Figures in a notebook, whatever its first cell is."""

import pytest

nbformat = pytest.importorskip("nbformat")
client = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

DRAWN = (
    "actionopt.plot.paths(solution)",
    "actionopt.plot.energies(solution)",
    "from matplotlib import pyplot; pyplot.plot([1, 2])",
)
SOLVED = """import actionopt, actionopt.plot
from actionopt import scenes
solution = actionopt.solve(scenes.get("oscillator").problem)"""

FIGURE = "from matplotlib import pyplot; pyplot.figure()"


OTHERS = ["import matplotlib.pyplot", "%matplotlib inline", FIGURE]


@pytest.mark.slow  # a kernel is started each time
@pytest.mark.parametrize("first", ["", *OTHERS])
def test_every_cell_shows_its_figure(first, monkeypatch):
    monkeypatch.delenv("MPLBACKEND")
    cells = [nbformat.v4.new_code_cell(source) for source in (first, SOLVED, *DRAWN)]
    book = nbformat.v4.new_notebook(cells=cells)
    client.NotebookClient(book, timeout=120, kernel_name="python3").execute()
    shown = [
        any("image/png" in output.get("data", {}) for output in cell.outputs) for cell in cells[2:]
    ]
    assert all(shown), shown


@pytest.mark.slow
def test_explore_shows_the_live_page_where_figures_are_pictures(monkeypatch):
    monkeypatch.delenv("MPLBACKEND")
    source = f"%matplotlib inline\n{SOLVED}\nactionopt.plot.explore(solution.problem)"
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source)])
    client.NotebookClient(book, timeout=120, kernel_name="python3").execute()
    (shown,) = [output["data"] for output in book.cells[0].outputs]
    assert "<iframe srcdoc=" in shown["text/html"] and "image/png" not in shown
