"""Names for what numpy's own stubs do not tell apart; the spacing of floats, and what is zero."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]  # of floats
NDInt = np.ndarray  # of integers
EPS = float(np.finfo(float).eps)  # relative spacing of floats, 2^-52
RANK = 1e-10  # of the largest singular value or entry: less counts as zero; ad hoc
