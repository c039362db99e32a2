"""Position embeddings on other grids than the trained one, as each publisher computes them.

A transformer learns one embedding for each patch of one grid. Photos of other sizes have other
grids; how the embeddings are resized is part of the model: descriptors change with it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch.nn import functional

if TYPE_CHECKING:
    from torch import Tensor

DINOV2_OFFSET = 0.1  # added to the number of patches before the scale is computed (DINOv2's code)


def bicubic_positions(trained: Tensor, grid_hw: tuple[int, int]) -> Tensor:
    """Resize positions to a grid by bicubic interpolation, without antialiasing.

    Args:
        trained: (h, w, d) embeddings of the trained grid.
        grid_hw: Rows and columns.

    Returns:
        (rows, cols, d).
    """
    resized = functional.interpolate(_channels_first(trained), size=grid_hw, mode="bicubic")
    return _channels_last(resized)


def r2former_positions(trained: Tensor, grid_hw: tuple[int, int]) -> Tensor:
    """Fit positions to a grid as R2Former does.

    They are made for a square with the grid's longer side, of which the middle is taken. A square
    that fits into the trained grid is cut from its centre. A larger one is interpolated; then all
    positions are moved away from the one in the centre, so that half a trained height above it is
    as far away as before.

    Args:
        trained: (h, w, d) embeddings of the trained grid.
        grid_hw: Rows and columns.

    Returns:
        (rows, cols, d).

    Source: the code of R2Former (arXiv 2304.03410).
    """
    side = max(grid_hw)
    if side <= min(trained.shape[:2]):
        square = _centre(trained, (side, side))
    else:
        square = _spread(bicubic_positions(trained, (side, side)), trained)
    return _centre(square, grid_hw)


def dinov2_positions(trained: Tensor, grid_hw: tuple[int, int]) -> Tensor:
    """Resize positions to a grid as Meta's DINOv2 without registers does.

    Bicubic, with a scale that takes the grid for a tenth of a patch larger than it is.

    Args:
        trained: (h, w, d) embeddings of the trained grid.
        grid_hw: Rows and columns.

    Returns:
        (rows, cols, d).

    Source: the code of DINOv2 (arXiv 2304.07193).
    """
    scale = [
        (count + DINOV2_OFFSET) / before
        for count, before in zip(grid_hw, trained.shape[:2], strict=True)
    ]
    resized = functional.interpolate(_channels_first(trained), scale_factor=scale, mode="bicubic")
    return _channels_last(resized)


def _spread(square: Tensor, trained: Tensor) -> Tensor:
    """Scale the offsets from the centre so that half a trained height is as far as in training."""
    rows, cols, _ = trained.shape
    middle = square.shape[0] // 2
    centre = square[middle, middle]
    before = torch.linalg.vector_norm(trained[0, cols // 2] - trained[rows // 2, cols // 2])
    after = torch.linalg.vector_norm(square[middle - rows // 2, middle] - centre)
    spread: Tensor = centre + (square - centre) * (before / after)
    return spread


def _centre(positions: Tensor, size_hw: tuple[int, int]) -> Tensor:
    (rows, cols), (height, width) = positions.shape[:2], size_hw
    top, left = rows // 2 - height // 2, cols // 2 - width // 2
    return positions[top : top + height, left : left + width]


def _channels_first(positions: Tensor) -> Tensor:
    return positions.permute(2, 0, 1)[None]


def _channels_last(positions: Tensor) -> Tensor:
    return positions[0].permute(1, 2, 0)
