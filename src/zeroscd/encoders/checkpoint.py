"""Read a place-recognition ViT from any of the layouts in which such checkpoints come."""

from __future__ import annotations

from math import isqrt
from typing import TYPE_CHECKING

import torch

from zeroscd.encoders.positions import bicubic_positions
from zeroscd.encoders.vit import VisionTransformer, VitShape
from zeroscd.errors import WeightsError
from zeroscd.weights.strict import load_strictly

if TYPE_CHECKING:
    from collections.abc import Mapping

    from torch import Tensor

    from zeroscd.encoders.vit import FitPositions

# Longest first, so that "module.backbone." is not mistaken for "module.".
PREFIXES = ("module.backbone.", "module.", "backbone.", "model.", "encoder.", "")

# R2Former's re-ranker, which change detection does not use.
UNUSED = ("local_head.", "Reranker.")

ASPECT_HW = (3, 4)  # of the street photos that R2Former is trained on: 480 x 640


def read_vit(
    tensors: Mapping[str, Tensor],
    *,
    source: str,
    fit_positions: FitPositions = bicubic_positions,
) -> VisionTransformer:
    """Build a ViT-S/16 from a checkpoint's tensors.

    Args:
        tensors: With any of the usual prefixes; with or without a distillation token; position
            embeddings of a square or 3:4 grid; with or without retrieval heads. R2Former's
            re-ranker is ignored.
        source: What to call the file in messages.
        fit_positions: Fits the position embedding to other grids than the trained one.

    Raises:
        WeightsError: Tensors are missing, left over or misshapen; each one is named.
    """
    stripped = without_prefix(tensors)
    with torch.device("meta"):  # skips initialisation, which takes a second
        network = VisionTransformer(_shape_of(stripped, source), fit_positions=fit_positions)
    load_strictly(network, stripped, source=source)
    return network.eval()


def without_prefix(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Strip the prefix and drop the re-ranker.

    The prefix is the first known one under which there are blocks.

    Example:
        >>> list(without_prefix({"module.backbone.blocks.0.x": 1, "module.local_head.bias": 2}))
        ['blocks.0.x']
    """
    prefix = next(
        (known for known in PREFIXES if any(key.startswith(f"{known}blocks.") for key in tensors)),
        "",
    )
    return {key.removeprefix(prefix): tensors[key] for key in tensors if not _unused(key)}


def _unused(key: str) -> bool:
    return key.removeprefix("module.").startswith(UNUSED)


def _shape_of(tensors: Mapping[str, Tensor], source: str) -> VitShape:
    if "pos_embed" not in tensors:
        message = f"{source} does not fit the network: missing: pos_embed"
        raise WeightsError(message)
    positions = tensors["pos_embed"].shape[1]
    distilled = any("dist" in key for key in tensors) or _grid(positions - 1) is None
    grid = _grid(positions - (2 if distilled else 1))
    if grid is None:
        message = f"{source} has {positions} position embeddings, which make no 1:1 or 3:4 grid"
        raise WeightsError(message)
    return VitShape(grid_hw=grid, distilled=distilled, head_dim=_head_dim(tensors))


def _grid(patches: int) -> tuple[int, int] | None:
    """Infer rows and columns from the number of patches.

    Example:
        >>> _grid(196), _grid(1200), _grid(1201)
        ((14, 14), (30, 40), None)
    """
    if isqrt(patches) ** 2 == patches:
        return isqrt(patches), isqrt(patches)
    high, wide = ASPECT_HW
    side = isqrt(patches // (high * wide))
    return (high * side, wide * side) if high * wide * side**2 == patches else None


def _head_dim(tensors: Mapping[str, Tensor]) -> int | None:
    heads = [value for key, value in tensors.items() if key.startswith(("head.", "head_dist."))]
    return heads[0].shape[0] if heads else None
