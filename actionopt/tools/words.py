"""What is shown, in the reader's language: sentences in English, and tables that translate them.

A table is a file of `languages`: JSON, from English to its language, what varies in braces. What it
has not is shown in English.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import Any

from actionopt.tools.checks import among
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

    The blank before a value that is empty, as the unit of a pure number is, is left out:

    >>> say("{x} {unit}, the same", x=2, unit="")
    '2, the same'
    """
    text = table(_current.get()).get(text, text)
    for name in (key for key, value in values.items() if value == ""):
        text = text.replace(f" {{{name}}}", "")
    return text.format(**values) if values else text


# A blank after a number or its exponent, before a unit; within one; before the number of an index;
# beside the sign between two terms.
UNPARTED = re.compile(
    r"(?:(?<=[\d$])|^) (?=(?:J|N|kg|m|s|rad|C|T|V)(?![\w'\u2019]))|(?<=\b[JN]) (?=s\b)"
    r"|(?<=\bkg) (?=m\b)| (?=&times;)|(?<=&times;) |(?<=\bindex) (?=\d)|(?<=\bIndex) (?=\d)"
    r"|(?<=\bindice) (?=\d)| (?=[=/+\u2212] )|(?<= [=/+\u2212]) "
)


def together(text: str) -> str:
    r"""Return a text whose lines do not end between a number and its unit, nor at an operator.

    >>> ascii(together("9.81 J s at index 2"))
    "'9.81\\xa0J\\xa0s at index\\xa02'"
    >>> ascii(together("with c = 6"))
    "'with c\\xa0=\\xa06'"
    """
    return UNPARTED.sub("\N{NO-BREAK SPACE}", text)


# The point of a number, of which parts of versions have more than one; its power of ten.
POINT = re.compile(r"(?<![\w.])(\d+)\.(\d+)(?!\d*\.\d)")
POWER = re.compile(r"(?<=\d)e([-+\u2212])0*(\d+)\b")
SUPERSCRIPTS = str.maketrans(
    "-\u22120123456789",
    "\u207b\u207b\u2070\u00b9\u00b2\u00b3" + "\u2074\u2075\u2076\u2077\u2078\u2079",
)


def number(value: float, digits: int = 6) -> str:
    r"""Return a number as it is read: a true minus, powers of ten, the language's decimal mark.

    >>> number(9.6481), ascii(number(-1.25e-10))[1:-1], ascii(number(1.5e13))[1:-1]
    ('9.6481', '\\u22121.25\\xd710\\u207b\\xb9\\u2070', '1.5\\xd710\\xb9\\xb3')
    """
    if not math.isfinite(value):
        return "\N{EM DASH}"
    return numerals(f"{value + 0.0:.{digits}g}".replace("-", "\N{MINUS SIGN}"))


def numerals(text: str) -> str:
    """Return a text with its numbers as they are read: powers of ten, and the decimal mark.

    Formulas between dollars are for matplotlib, which puts a blank after a comma.

    >>> with language("de"):
    ...     numerals("9.81 m, $0.5$, version 0.1.0")
    '9,81 m, $0{,}5$, version 0.1.0'
    """
    text = POWER.sub(_power, text)
    if _current.get() == "en":
        return text
    parts = text.split("$")
    for k, part in enumerate(parts):
        formula = k % 2 and len(parts) % 2  # a dollar alone is none
        parts[k] = POINT.sub(r"\1{,}\2" if formula else r"\1,\2", part)
    return "$".join(parts)


def _power(found: re.Match[str]) -> str:
    return "\u00d710" + (found[1].strip("+") + found[2]).translate(SUPERSCRIPTS)


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
    if not among(name, SPOKEN):
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
