"""Place-recognition ViT-S/16: PlaceFormer, and R2Former, whose weights are public."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.encoders.checkpoint import read_vit
from zeroscd.encoders.positions import bicubic_positions, r2former_positions
from zeroscd.encoders.taus import TAUS
from zeroscd.encoders.transformer import TransformerEncoder, checked_layer
from zeroscd.weights.safe import read_tensors
from zeroscd.weights.store import require

if TYPE_CHECKING:
    from torch import Tensor

    from zeroscd.encoders.vit import VisionTransformer
    from zeroscd.settings import Settings

# Which block's patch tokens are compared. PlaceFormer pools those after the last one (arXiv
# 2401.13082); R2Former matches those before it (arXiv 2304.03410, model/network.py).
LAYERS = {"placeformer": 12, "r2former": 11}
# PlaceFormer's code is not public: its positions are interpolated plainly.
FIT_POSITIONS = {"placeformer": bicubic_positions, "r2former": r2former_positions}


def load(settings: Settings, device: str) -> TransformerEncoder:
    """Load the encoder that the settings name.

    Raises:
        WeightsError: The weights are missing, damaged or of another network.
        SettingsError: The network has no such layer.
    """
    path = require([settings.encoder])[settings.encoder]
    fit_positions = FIT_POSITIONS[settings.encoder]
    network = read_vit(read_tensors(path), source=str(path), fit_positions=fit_positions)
    return wrap(network, settings, device=device)


def wrap(network: VisionTransformer, settings: Settings, *, device: str) -> TransformerEncoder:
    """Wrap a network in an encoder.

    Raises:
        SettingsError: The network has no such layer.
    """
    layer = checked_layer(settings.layer or LAYERS[settings.encoder], depth=network.shape.depth)

    def patches(pixels: Tensor) -> Tensor:
        return network.tokens(pixels, layer=layer)[1]

    network.to(device)
    return TransformerEncoder(
        name=settings.encoder,
        tau=TAUS[settings.encoder].value,
        patch_px=network.shape.patch_px,
        side_px=settings.side_px,
        network=patches,
        global_head=None if network.shape.head_dim is None else network.global_descriptor,
        device=device,
        bf16=settings.precision == "bf16",
    )
