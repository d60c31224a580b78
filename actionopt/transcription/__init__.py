"""From a continuous problem to a discrete one: numbering, the discrete action, and its solvers."""

from actionopt.transcription.action import Transcription
from actionopt.transcription.ipopt import Attempt, Principle, find
from actionopt.transcription.layout import sparsity_of
from actionopt.transcription.linear import (
    Factors,
    compressed,
    diagonal,
    negative_eigenvalues,
    product,
)

__all__ = [
    "Attempt",
    "Factors",
    "Principle",
    "Transcription",
    "compressed",
    "diagonal",
    "find",
    "negative_eigenvalues",
    "product",
    "sparsity_of",
]
