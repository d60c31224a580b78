"""Texts of the package, as files and as a wheel has packed them."""

import json
import lzma

import pytest

from actionopt.tools import texts
from actionopt.tools.words import TABLES


@pytest.fixture
def wheel(tmp_path, monkeypatch):
    """A package with its texts packed, and without the files."""
    monkeypatch.setattr(texts, "PACKED", tmp_path / "data.xz")
    texts.unpack.cache_clear()
    packed = {"tools/languages/de.json": '{"time": "Zeit"}\n'}
    texts.PACKED.write_bytes(lzma.compress(json.dumps(packed).encode()))
    yield
    texts.unpack.cache_clear()


def test_texts_are_read_from_their_files():
    assert texts.read(TABLES / "de.json") == (TABLES / "de.json").read_text(encoding="utf-8")


def test_packed_texts_are_read(wheel):
    assert texts.read(TABLES / "de.json") == '{"time": "Zeit"}\n'
    with pytest.raises(KeyError):
        texts.read(TABLES / "nl.json")
