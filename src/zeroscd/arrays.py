"""The array types that flow between the stages, by name."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Rgb: TypeAlias = NDArray[np.uint8]  # (H, W, 3), sRGB, 0..255
Mask: TypeAlias = NDArray[np.bool_]  # (H, W), True = the thing the name says
Map: TypeAlias = NDArray[np.float32]  # (H, W), one number a pixel or patch
Descriptors: TypeAlias = NDArray[np.float32]  # (rows, cols, d), unit length along d
PointsXy: TypeAlias = NDArray[np.float64]  # (N, 2) as (x, y); pixel centres are whole numbers
Classes: TypeAlias = NDArray[np.uint8]  # (H, W), one class id a pixel
Homography: TypeAlias = NDArray[np.float64]  # (3, 3); b_from_a @ (x_a, y_a, 1) ~ (x_b, y_b, 1)
