"""Pictures and downloads of a result, made on request, by file name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.export import files as export
from zeroscd.export.viewer import LAYERS

if TYPE_CHECKING:
    from zeroscd.serve.comparison import CachedResult

# What each layer of the viewer is called here.
PICTURES = {
    "before": "before.jpg",
    "after": "after.jpg",
    "heat": "heat.jpg",
    "unknown": "hatch.png",
}
DOWNLOADS = dict(export.FILES.values())  # what draws a result, by file name
FILES = (*PICTURES.values(), *DOWNLOADS)
_LAYER_OF = {file: LAYERS[layer] for layer, file in PICTURES.items()}


def render(file: str, found: CachedResult) -> bytes:
    """Make one of `FILES`."""
    if file in DOWNLOADS:
        return DOWNLOADS[file](found.result)
    return _LAYER_OF[file](found.frame)
