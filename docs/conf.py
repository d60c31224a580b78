"""How Sphinx makes the documentation; `python docs/build.py` runs it.

Nothing is fetched: formulas are MathML, and the search is a script of the site's own.
"""

import re
from pathlib import Path

import latex2mathml.converter

import actionopt

project, author, copyright = "actionopt", "The actionopt developers", "The actionopt developers"
release = version = actionopt.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc"]
html_theme, html_title, html_show_sourcelink = "furo", f"actionopt {release}", False
html_copy_source = False
html_show_search_summary = False  # it would be fetched, which a page without a server may not
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
templates_path = ["templates"]
html_static_path = ["static"]
default_role = "code"  # what docstrings have between single backticks
autosummary_generate = True
autodoc_preserve_defaults = True  # `NO_UNITS` is shorter than what it is
autodoc_typehints = "none"  # numpydoc shows what the docstring says
numpydoc_show_class_members = False
nitpicky = False
html_math_renderer = "mathml"

NAMES = (Path(__file__).parent / "names.md").read_text(encoding="utf-8")
EXAMPLES = {  # by the full name of what they show
    f"{room}.{name}": code.splitlines()
    for room, part in re.findall(r"\n## (.+)\n((?:.|\n)*?)(?=\n## |\Z)", NAMES)
    for name, code in re.findall(r"### (\w+)\n\n```python\n((?:.|\n)*?)```", part)
}
WORD = r"`+[^`]*`+"  # between backticks nothing is markup


def escape(app, what, name, obj, options, lines):
    """Keep |q| and trailing underscores of docstrings from being markup of reStructuredText."""
    for k, line in enumerate(lines):
        if line.strip() == "Examples":
            break
        parts = re.split(f"({WORD})", line)
        parts[::2] = [re.sub(r"([|*])|(?<=\w)(_)(?=\W|$)", r"\\\1\2", part) for part in parts[::2]]
        lines[k] = "".join(parts)


def example(app, what, name, obj, options, lines):
    """Add the example of a public name to its page."""
    if name in EXAMPLES:
        lines += ["", ".. rubric:: In use", "", ":doc:`From the page of all names <../names>`:", ""]
        lines += [".. code-block:: python", "", *("   " + line for line in EXAMPLES[name]), ""]


def visit_inline(self, node):
    """Write a formula in a line as MathML."""
    from docutils import nodes

    self.body.append(latex2mathml.converter.convert(node.astext()))
    raise nodes.SkipNode


def visit_block(self, node):
    """Write a formula on a line of its own as MathML."""
    from docutils import nodes

    found = latex2mathml.converter.convert(node.astext(), display="block")
    self.body.append(f'<div class="formula" style="overflow-x: auto">{found}</div>')
    raise nodes.SkipNode


def setup(app):
    """Add the formulas, and docstrings as the package writes them."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    app.connect("autodoc-process-docstring", escape, priority=100)  # before numpydoc
    app.connect("autodoc-process-docstring", example, priority=900)  # after it
