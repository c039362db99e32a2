"""Which encoder and segmenter a setting's name stands for, and on which device they run."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from zeroscd.errors import SettingsError

if TYPE_CHECKING:
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.segmenters.port import Segmenter
    from zeroscd.settings import Settings

# name -> module with a function load(settings, device); imported only when asked for
ENCODERS: dict[str, str] = {"lite": "zeroscd.encoders.lite"}
SEGMENTERS: dict[str, str] = {"lite": "zeroscd.segmenters.lite"}


@dataclass(frozen=True, slots=True)
class Models:
    """The two networks of the method, loaded and on their device."""

    encoder: PatchEncoder
    segmenter: Segmenter


def load_models(settings: Settings, *, device: str = "auto") -> Models:
    """Load the encoder and the segmenter that the settings name.

    Raises:
        SettingsError: An unknown encoder, segmenter or device, or a device that is not there.
        WeightsError: Their weights are missing or damaged.
    """
    encoder = _module(ENCODERS, "encoder", settings.encoder)
    segmenter = _module(SEGMENTERS, "segmenter", settings.segmenter)
    target = pick_device(device)
    return Models(encoder.load(settings, target), segmenter.load(settings, target))


def pick_device(name: str) -> str:
    """Turn "auto", "cpu" or "cuda" into the device that torch shall use.

    Raises:
        SettingsError: An unknown device, or one that this machine does not have.
    """
    if name not in ("auto", "cpu", "cuda"):
        message = f"unknown device {name!r}; choose one of: auto, cpu, cuda"
        raise SettingsError(message)
    if name == "cpu":
        return name
    import torch  # noqa: PLC0415 - seconds to import, not needed to refuse a name

    if torch.cuda.is_available():
        return "cuda"
    if name == "cuda":
        message = "device cuda is not available on this machine; use --device cpu"
        raise SettingsError(message)
    return "cpu"


def _module(table: dict[str, str], kind: str, name: str) -> Any:  # noqa: ANN401 - a module
    if name not in table:
        message = f"unknown {kind} {name!r}; choose one of: {', '.join(table)}"
        raise SettingsError(message)
    return import_module(table[name])
