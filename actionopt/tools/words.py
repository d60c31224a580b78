"""What is shown, in the reader's language: sentences in English, and tables that translate them.

A table is a file of `languages`: JSON, from English to its language, what varies in braces. What it
has not is shown in English.
"""

from __future__ import annotations

import json
import re
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import Any

from actionopt.tools.texts import read

TABLES = Path(__file__).parent / "languages"
SPOKEN = ("en", "de", "fr")
_current: ContextVar[str] = ContextVar("language", default="en")


def say(text: str, **values: Any) -> str:
    """Return a text in the current language, `values` in its braces.

    >>> with language("de"):
    ...     say("time")
    'Zeit'
    >>> say("at {t} s", t=2)
    'at 2 s'
    """
    text = table(_current.get()).get(text, text)
    return text.format(**values) if values else text


# A blank after a number or its exponent, before a unit; within one; before the number of an index.
UNPARTED = re.compile(
    r"(?:(?<=[\d$])|^) (?=(?:J|N|kg|m|s|rad|C|T|V)(?![\w'\u2019]))|(?<=\b[JN]) (?=s\b)"
    r"|(?<=\bkg) (?=m\b)| (?=&times;)|(?<=&times;) |(?<=\bindex) (?=\d)|(?<=\bIndex) (?=\d)"
    r"|(?<=\bindice) (?=\d)"
)


def together(text: str) -> str:
    r"""Return a text whose lines do not end between a number and its unit.

    >>> ascii(together("9.81 J s at index 2"))
    "'9.81\\xa0J\\xa0s at index\\xa02'"
    """
    return UNPARTED.sub("\N{NO-BREAK SPACE}", text)


def current() -> str:
    """Return the language spoken now, as HTML names it."""
    return _current.get()


@contextmanager
def language(name: str) -> Generator[None, None, None]:
    """Speak another language meanwhile: of all figures, films and pages made in a `with` block.

    "en", "de" or "fr". Raises ValueError for another.

    >>> with language("fr"):
    ...     say("start")
    'départ'
    """
    if name not in SPOKEN:
        raise ValueError(f"expected a language of {', '.join(SPOKEN)}, found {name!r}")
    token = _current.set(name)
    try:
        yield
    finally:
        _current.reset(token)


@cache
def table(name: str) -> Mapping[str, str]:
    """Return a language's table; English has none."""
    if name == "en":
        return {}
    return json.loads(read(TABLES / f"{name}.json"))
