"""Which networks can be written as ONNX files, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from zeroscd.encoders import dino
from zeroscd.errors import SettingsError
from zeroscd.onnx import lite, transformer
from zeroscd.onnx import sam as halves
from zeroscd.segmenters import sam
from zeroscd.settings import Settings
from zeroscd.text import unknown

if TYPE_CHECKING:
    from zeroscd.onnx.network import OnnxNetwork
    from zeroscd.segmenters.sam_network import Network

LITE = "lite"
ENCODERS = tuple(name for name in dino.FORMS if name.startswith("dinov2"))
# One file holds 2 GB at most; ViT-H's encoder is 2.5.
SEGMENTERS = tuple(name for name in sam.FORMS if name != "sam-vit-h")
ENCODER_HALF, DECODER_HALF = "-encoder", "-decoder"
NAMES = (
    LITE,
    *ENCODERS,
    *(f"{name}{half}" for name in SEGMENTERS for half in (ENCODER_HALF, DECODER_HALF)),
)
TRAINED_SIZE_HW = (518, 518)  # of DINOv2


def check_name(name: str, *, size_hw: tuple[int, int] | None) -> None:
    """Check what was asked for, before anything is loaded.

    Raises:
        SettingsError: An unknown name, or a size for a network that takes any or just one.
    """
    if name not in NAMES:
        raise SettingsError(unknown("network", name, NAMES))
    if size_hw is not None and name not in ENCODERS:
        takes = "any size" if name == LITE else "its own size only"
        message = f"{name} takes {takes}; leave out --size"
        raise SettingsError(message)


def load(name: str, *, size_hw: tuple[int, int] | None = None) -> OnnxNetwork:
    """Load a network with its weights.

    Args:
        name: One of `NAMES`.
        size_hw: Height and width of the photos for DINOv2; None = as trained.

    Raises:
        SettingsError: As `check_name`; or transformers is missing, or the size does not fit.
        WeightsError: The weights are missing or damaged.
    """
    check_name(name, size_hw=size_hw)
    if name == LITE:
        return lite.build()
    if name in ENCODERS:
        encoder = dino.load(Settings(encoder=name), "cpu")
        return transformer.build(encoder, size_hw=size_hw or TRAINED_SIZE_HW)
    segmenter, _, half = name.rpartition("-")
    network = cast("Network", sam.load(Settings(segmenter=segmenter), "cpu").network)
    return halves.build_encoder(network) if half == "encoder" else halves.build_decoder(network)
