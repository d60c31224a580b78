"""What ends a search from within, and the verdict that comes of it: none of it leaves the solver.

A way to a path ends where its price is paid, or where a matrix on it is singular or not finite;
then another one is tried. A search ends where its time is used up, or where refining a path that
was found meets such a matrix.
"""

from __future__ import annotations

import numpy as np

from actionopt.analysis.status import Status
from actionopt.tools.watch import OutOfTime, Spent

LEADS_NOWHERE = (Spent, np.linalg.LinAlgError)  # ends one way to a path, and not the search
SIGNALS = (OutOfTime, *LEADS_NOWHERE)
HALVINGS = 6  # of a step on the way to a path: what is left of it leads nowhere; ad hoc


def status_of(signal: Exception) -> Status:
    """Return the verdict on a path whose search was ended by a signal."""
    return Status.OUT_OF_TIME if isinstance(signal, OutOfTime) else Status.UNRESOLVED
