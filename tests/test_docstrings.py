"""The examples in docstrings do what they say."""

import ast
import doctest
import importlib

import pytest
from test_architecture import rooms

EXAMPLES = [m for m, file in rooms.FILES.items() if ">>>" in file.read_text(encoding="utf-8")]
DOCUMENTED = ast.Module, ast.ClassDef, ast.FunctionDef


@pytest.mark.parametrize("module", EXAMPLES)
def test_examples(module):
    names, file = vars(importlib.import_module(module)), rooms.FILES[module]
    runner, parser = doctest.DocTestRunner(), doctest.DocTestParser()
    for node in (rooms.parsed(file), *rooms.statements(file)):
        if isinstance(node, DOCUMENTED) and (text := ast.get_docstring(node)):
            runner.run(parser.get_doctest(text, {**names}, module, str(file), 0))
    assert runner.tries and not runner.failures
