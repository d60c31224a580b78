"""The examples and the lessons of the course as notebooks, run, with what they print and draw.

python docs/notebooks.py FOLDER
"""

import ast
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

from actionopt.gallery.course.lessons import BY_NAME
from actionopt.gallery.course.notebook import notebook

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
WRITES_PAGES = "08_gallery"  # it draws nothing
SECONDS = 600  # of a cell
LEFT_OUT = "sys.argv", "pyplot.show()"  # a notebook has neither, and shows figures by itself


def of_example(file: Path) -> nbformat.NotebookNode:
    """Return an example as a notebook, not run: its words, what it computes, what it shows."""
    text = file.read_text(encoding="utf-8")
    lines, body = text.splitlines(), ast.parse(text).body
    title, _, rest = ast.literal_eval(ast.unparse(body[0])).partition("\n")
    *computed, shown = body[1:]
    assert isinstance(shown, ast.If)
    code = "\n".join(lines[body[0].end_lineno : computed[-1].end_lineno]).strip()
    last = []
    for statement in shown.body:
        here = lines[statement.lineno - 1 : statement.end_lineno]
        if not any(word in "\n".join(here) for word in LEFT_OUT):
            last += [line[4:] for line in here]
    words = nbformat.v4.new_markdown_cell(f"# {title}\n{rest}")
    cells = [words, *map(nbformat.v4.new_code_cell, (code, "\n".join(last)))]
    return nbformat.v4.new_notebook(cells=cells)


def books() -> dict[str, nbformat.NotebookNode]:
    """Return all notebooks by name, not run."""
    files = [file for file in sorted(EXAMPLES.glob("*.py")) if file.stem != WRITES_PAGES]
    lessons = {name: nbformat.from_dict(notebook(BY_NAME[name], True)) for name in BY_NAME}
    return {file.stem: of_example(file) for file in files} | lessons


def write(folder: Path) -> None:
    """Run all notebooks, and write them. An error in a cell is raised."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, book in books().items():
        NotebookClient(book, timeout=SECONDS, kernel_name="python3").execute()
        nbformat.write(book, folder / f"{name}.ipynb")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
