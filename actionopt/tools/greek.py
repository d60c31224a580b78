"""Names in the code as books write them: Greek letters, and digits as an index."""

import re

ALPHABET = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi omicron pi rho "
    "- sigma tau upsilon phi chi psi omega"  # - for the sigma that ends a word
).split()
GREEK = {name: chr(0x3B1 + k) for k, name in enumerate(ALPHABET)}


def split(name: str) -> tuple[str, str]:
    """Return a name without its index, and the index.

    >>> split("theta1"), split("x_12"), split("speed")
    (('theta', '1'), ('x', '12'), ('speed', ''))
    """
    word, index = re.fullmatch(r"(.*?)_?(\d*)", name, re.DOTALL).groups()  # type: ignore[union-attr]
    return word, index


def letter(name: str) -> str:
    """Return the name of a coordinate as text, Greek letters and indices as such.

    >>> letter("theta1"), letter("x")
    ('θ₁', 'x')
    """
    word, index = split(name)
    return GREEK.get(word, word) + "".join(chr(0x2080 + int(digit)) for digit in index)
