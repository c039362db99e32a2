"""zeroscd: what changed between two photos of the same street?

>>> import zeroscd
>>> zeroscd.Settings().override({"tau": 0.7}).change.tau
0.7
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from zeroscd.detector import Detector
    from zeroscd.errors import (
        DatasetError,
        ImageError,
        OutputError,
        SettingsError,
        WeightsError,
        ZeroscdError,
    )
    from zeroscd.images.photo import Photo
    from zeroscd.one_call import detect
    from zeroscd.records import Alignment, NotAligned, Region
    from zeroscd.result import ChangeResult
    from zeroscd.saved import SavedResult, load
    from zeroscd.settings import PRESETS, Settings

__version__ = "0.2.0"

_HOME = {
    "Alignment": "records",
    "ChangeResult": "result",
    "DatasetError": "errors",
    "Detector": "detector",
    "ImageError": "errors",
    "NotAligned": "records",
    "OutputError": "errors",
    "PRESETS": "settings",
    "Photo": "images.photo",
    "Region": "records",
    "SavedResult": "saved",
    "Settings": "settings",
    "SettingsError": "errors",
    "WeightsError": "errors",
    "ZeroscdError": "errors",
    "detect": "one_call",
    "load": "saved",
}

__all__ = [
    "PRESETS",
    "Alignment",
    "ChangeResult",
    "DatasetError",
    "Detector",
    "ImageError",
    "NotAligned",
    "OutputError",
    "Photo",
    "Region",
    "SavedResult",
    "Settings",
    "SettingsError",
    "WeightsError",
    "ZeroscdError",
    "detect",
    "load",
]


def __getattr__(name: str) -> object:
    """Import a public name when it is first asked for, so that `import zeroscd` is cheap."""
    if name in _HOME:
        return getattr(import_module(f"zeroscd.{_HOME[name]}"), name)
    message = f"module 'zeroscd' has no attribute {name!r}"
    raise AttributeError(message)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
