"""Pictures in fewer letters: what matplotlib writes as SVG, in a third of the room, seen the same.

Lines are steps from point to point, rounded to a tenth of a point where they are, so that roundings
do not add up; looks are classes and names are short. So each picture has to be a file of its own:
of two in one document the names would be the same.
"""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from itertools import count, product
from string import ascii_lowercase

UNSEEN_IN_SVG = re.compile(
    r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL
)
DATA_IN_SVG = re.compile(r'(<path[^>]*? d=")(M [^"]*)"', re.DOTALL)
LETTERS_IN_SVG = re.compile(
    r'(<path id="[^"]*" d=")([^"]*)" transform="scale\(0.015625\)"', re.DOTALL
)
COARSE_LETTERS = 1 / 16  # of the steps of letters: of 11 points they are a thirtieth of one then
STEPS_IN_SVG = re.compile(r"([MLQCz])([^MLQCz]*)")
STYLE_IN_SVG = re.compile(r' style="([^"]*)"')
SHIFT_IN_SVG = re.compile(r' transform="translate\(([-\d.e]+) ([-\d.e]+)\)"')
PLACE_IN_SVG = re.compile(r'( (?:x|y)="|translate\()([-\d.e]+)(?:( )([-\d.e]+))?')
TAGS_IN_SVG = re.compile(r"<g>|<g [^>]*>|</g>")
NAMES_IN_SVG = re.compile(r"""(?:href="|url\()#([^")]*)""")
NAMED_IN_SVG = re.compile(r""" id="([^"]*)"|(href="|url\()#([^")]*)""")


def compact(svg: str) -> str:
    """Return an SVG of matplotlib's that looks the same and is shorter."""
    svg = UNSEEN_IN_SVG.sub("", svg).replace("xlink:href", "href")
    svg = svg.replace(' xmlns:xlink="http://www.w3.org/1999/xlink"', "")
    svg = re.sub(r">\s+<", "><", svg.strip())
    svg = LETTERS_IN_SVG.sub(_letter, svg)
    svg = DATA_IN_SVG.sub(lambda m: f'{m[1]}{_steps(m[2], 1)}"', svg)
    svg = SHIFT_IN_SVG.sub(r' x="\1" y="\2"', svg)
    svg = PLACE_IN_SVG.sub(_place, svg).replace(' y="0"', "")
    return _ungroup(_classes(_short_names(svg)))


def _short(x: float, places: int) -> str:
    """Return a number with so many decimals at most, and no zero before its point.

    >>> _short(-0.50, 1), _short(12.04, 1), _short(-0.01, 1)
    ('-.5', '12', '0')
    """
    text = f"{x:.{places}f}"
    text = text.rstrip("0").rstrip(".") if places else text
    return "0" if text in ("-0", "") else re.sub(r"^(-?)0\.", r"\1.", text)


def _letter(found: re.Match[str]) -> str:
    return f'{found[1]}{_outline(found[2])}" transform="scale(.25)"'


@cache  # one font's letters, the same in all pictures
def _outline(data: str) -> str:
    return _steps(data, 0, COARSE_LETTERS)


def _place(found: re.Match[str]) -> str:
    rest = found[3] + _short(float(found[4]), 1) if found[3] else ""
    return found[1] + _short(float(found[2]), 1) + rest


def _steps(data: str, places: int, scale: float = 1.0) -> str:
    """Return the data of a path, scaled, as steps from point to point.

    >>> _steps("M 1 2 L 3 4.06 L 3 0 z", 1)
    'M1 2l2 2.1 0-4.1z'
    """
    at, unit, last, done = (0, 0), 10**places, "", []
    for command, rest in STEPS_IN_SVG.findall(data):
        numbers = [round(float(x) * scale * unit) for x in rest.split()]
        letter = command if command in "Mz" else command.lower()
        origin = (0, 0) if command == "M" else at
        steps = [_short((x - origin[k % 2]) / unit, places) for k, x in enumerate(numbers)]
        text = " ".join(steps).replace(" -", "-")
        if letter != last or letter == "M":
            text = letter + text
        elif not text.startswith("-"):
            text = " " + text
        done.append(text)
        at, last = tuple(numbers[-2:]) or at, letter
    return "".join(done)


def _short_names(svg: str) -> str:
    """Return an SVG with names of few letters, for what is referred to alone."""
    letters = ("".join(x) for size in count(1) for x in product(ascii_lowercase, repeat=size))
    short = dict(zip(dict.fromkeys(NAMES_IN_SVG.findall(svg)), letters, strict=False))

    def rename(found: re.Match[str]) -> str:
        if found[1] is None:
            return f"{found[2]}#{short[found[3]]}"
        return f' id="{short[found[1]]}"' if found[1] in short else ""

    return NAMED_IN_SVG.sub(rename, svg)


def _classes(svg: str) -> str:
    """Return an SVG whose looks that occur more than once are classes."""
    looks = Counter(STYLE_IN_SVG.findall(svg))
    short = {look: f"s{k}" for k, look in enumerate(x for x, n in looks.items() if n > 1)}
    rules = "".join(f".{name}{{{look}}}" for look, name in short.items())
    svg = STYLE_IN_SVG.sub(lambda m: f' class="{short[m[1]]}"' if m[1] in short else m[0], svg)
    return svg.replace("</style>", f"{rules}</style>".replace(": ", ":").replace("; ", ";"), 1)


def _ungroup(svg: str) -> str:
    """Return an SVG without the groups that have no attribute."""
    inside: list[bool] = []

    def keep(tag: re.Match[str]) -> str:
        if tag[0] == "</g>":
            return "</g>" if inside.pop() else ""
        inside.append(tag[0] != "<g>")
        return tag[0] if inside[-1] else ""

    return TAGS_IN_SVG.sub(keep, svg)
