"""From a continuous problem to a discrete one: numbering, the discrete action, and its solvers."""

from actionopt.transcription.action import Transcription
from actionopt.transcription.ipopt import Attempt, Principle, find
from actionopt.transcription.layout import sparsity_of
from actionopt.transcription.linear import Factors, definite, negative_eigenvalues

__all__ = [
    "Attempt",
    "Factors",
    "Principle",
    "Transcription",
    "definite",
    "find",
    "negative_eigenvalues",
    "sparsity_of",
]
