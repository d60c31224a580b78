"""What Newton's method and refinement see of a question: a residual and its derivative."""

from __future__ import annotations

from typing import Protocol

from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.matrices.layout import BorderedLayout, Layout
from actionopt.tools.types import Array


class Equations(Protocol):
    """The equations r(z) = 0 of a path on a mesh, and of what is to be found beside it.

    The first of the unknowns z (size,) are those of the path, in units of its coordinates' lengths.
    A `Transcription` has no others; a `Bordered` has durations, multipliers of surfaces and forces.
    """

    @property
    def layout(self) -> Layout | BorderedLayout:
        """Numbering of the unknowns, and storage of the matrix."""
        ...

    @property
    def magnitudes(self) -> Array:
        """Sizes of the unknowns in their units, (size,)."""
        ...

    def at(self, z: Array, /) -> Transcription:
        """Return the discrete action of the path over the times that belong to z."""
        ...

    def residual(self, z: Array, /) -> Array:
        """Return r(z), (size,)."""
        ...

    def kkt(self, z: Array, /) -> Array:
        """Return the nonzeros of dr/dz, stored as `layout` says."""
        ...

    def relative_step(self, step: Array, /) -> float:
        """Return the largest change of a coordinate by a step in z, in units of its own size."""
        ...

    def quadrature_defect(self, z: Array, /, *, followed: bool = True) -> tuple[Array, float]:
        """Return what another quadrature adds to r(z), (size,), and how far that moves a body."""
        ...

    def misread(self, z: Array, /) -> Array:
        """Return the change of r(z), (size,), if numbers are read as the floats next to them."""
        ...
