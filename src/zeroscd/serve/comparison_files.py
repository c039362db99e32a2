"""Pictures and downloads of a result, by file name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from zeroscd.export import files as export
from zeroscd.export.viewer import LAYERS

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.serve.comparison import CachedResult

MEDIA_TYPES = {
    "jpg": "image/jpeg",
    "png": "image/png",
    "html": "text/html",
    "json": "application/json",
}
# What each layer of the viewer is called here.
PICTURES = {
    "before": "before.jpg",
    "after": "after.jpg",
    "heat": "heat.jpg",
    "unknown": "hatch.png",
}


@dataclass(frozen=True, slots=True)
class ResultFile:
    """A file that is made on request.

    Attributes:
        media_type: Of its content.
        content: Makes it.
        is_download: Whether a browser saves it rather than shows it.
    """

    media_type: str
    content: Callable[[CachedResult], bytes]
    is_download: bool


def _picture(layer: str, file: str) -> ResultFile:
    draw = LAYERS[layer]
    return ResultFile(_media_type(file), lambda found: draw(found.frame), is_download=False)


def _download(file: str, render: Callable[..., bytes]) -> ResultFile:
    return ResultFile(_media_type(file), lambda found: render(found.result), is_download=True)


def _media_type(file: str) -> str:
    return MEDIA_TYPES[file.rpartition(".")[2]]


FILES: dict[str, ResultFile] = {
    **{file: _picture(layer, file) for layer, file in PICTURES.items()},
    **{file: _download(file, render) for file, render in export.FILES.values()},
}
