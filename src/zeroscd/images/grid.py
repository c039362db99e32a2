"""The mapping between a patch grid and the pixels of a photo."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from zeroscd.arrays import PointsXy


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchGrid:
    """A regular grid of patch centres over a photo.

    Pixel centres are integers, so a photo of width W spans -0.5 .. W - 0.5.

    Attributes:
        size_hw: Number of patch rows and columns.
        stride_xy: Distance between neighbouring patch centres, in pixels of the photo.
        origin_xy: Centre of patch (0, 0), in pixels of the photo.
    """

    size_hw: tuple[int, int]
    stride_xy: tuple[float, float]
    origin_xy: tuple[float, float]

    @classmethod
    def covering(cls, photo_hw: tuple[int, int], *, size_hw: tuple[int, int]) -> PatchGrid:
        """Return the grid of patches that tile a whole photo.

        Example:
            >>> PatchGrid.covering((32, 64), size_hw=(2, 4)).origin_xy
            (7.5, 7.5)
        """
        stride_x, stride_y = photo_hw[1] / size_hw[1], photo_hw[0] / size_hw[0]
        return cls(
            size_hw=size_hw,
            stride_xy=(stride_x, stride_y),
            origin_xy=((stride_x - 1) / 2, (stride_y - 1) / 2),
        )

    def resized(self, from_hw: tuple[int, int], to_hw: tuple[int, int]) -> PatchGrid:
        """Return the grid over the same photo at another size.

        Example:
            >>> PatchGrid.covering((32, 64), size_hw=(2, 4)).resized((32, 64), (16, 32)).stride_xy
            (8.0, 8.0)
        """
        x, y = to_hw[1] / from_hw[1], to_hw[0] / from_hw[0]
        return PatchGrid(
            size_hw=self.size_hw,
            stride_xy=(self.stride_xy[0] * x, self.stride_xy[1] * y),
            origin_xy=((self.origin_xy[0] + 0.5) * x - 0.5, (self.origin_xy[1] + 0.5) * y - 0.5),
        )

    @property
    def patch_px(self) -> float:
        """Side of a patch in pixels of the photo (geometric mean of both directions)."""
        return float(np.sqrt(self.stride_xy[0] * self.stride_xy[1]))

    def to_pixels(self, cells_xy: PointsXy) -> PointsXy:
        """Map (column, row) positions, fractions allowed, to (x, y) in pixels; both (N, 2)."""
        return np.asarray(cells_xy, dtype=np.float64) * self.stride_xy + self.origin_xy

    def to_cells(self, points_xy: PointsXy) -> PointsXy:
        """Map (x, y) in pixels to fractional (column, row) positions; both (N, 2)."""
        return (np.asarray(points_xy, dtype=np.float64) - self.origin_xy) / self.stride_xy

    def centres_xy(self) -> PointsXy:
        """Return all patch centres in pixels, row by row, as (rows * cols, 2)."""
        rows, cols = np.indices(self.size_hw)
        return self.to_pixels(np.stack([cols.ravel(), rows.ravel()], axis=1))
