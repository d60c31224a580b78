"""Names for what numpy's own stubs do not tell apart, and the spacing of floats."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]  # of floats
NDInt = np.ndarray  # of integers
EPS = float(np.finfo(float).eps)  # relative spacing of floats, 2^-52
