"""Names for what numpy's own stubs do not tell apart."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]  # of floats
NDInt = np.ndarray  # of integers
