"""How networks whose training began on ImageNet want their pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

if TYPE_CHECKING:
    from torch import Tensor

# Mean and standard deviation of ImageNet's red, green and blue, in 0..1.
MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)


def normalise(pixels: Tensor) -> Tensor:
    """Normalise RGB by ImageNet's statistics.

    Args:
        pixels: (3, H, W) float, 0..1.

    Example:
        >>> normalise(torch.tensor(MEAN)[:, None, None]).flatten().tolist()
        [0.0, 0.0, 0.0]
    """
    return (pixels - torch.tensor(MEAN)[:, None, None]) / torch.tensor(STD)[:, None, None]
