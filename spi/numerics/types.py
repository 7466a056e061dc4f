"""Type of arrays in annotations."""

import numpy as np

Array = np.ndarray
