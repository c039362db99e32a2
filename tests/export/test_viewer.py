from __future__ import annotations

import io
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from zeroscd.export.frame import to_common_frame
from zeroscd.export.viewer import LAYERS, to_viewer

if TYPE_CHECKING:
    from zeroscd.pages import Viewer
    from zeroscd.result import ChangeResult

URIS = {name: f"{name}.jpg" for name in LAYERS}


def shown(result: ChangeResult) -> Viewer:
    return to_viewer(result, to_common_frame(result), URIS)


def test_the_photo_that_was_warped_says_so(result: ChangeResult) -> None:
    viewer = shown(result)
    assert viewer.alts["before"] == "Photo before: old street.jpg, warped onto the photo after"
    assert viewer.alts["after"] == "Photo after: new.jpg"
    viewer = shown(replace(result, frame="t0"))
    assert viewer.alts["before"] == "Photo before: old street.jpg"
    assert viewer.alts["after"] == "Photo after: new.jpg, warped onto the photo before"


def test_photos_that_could_not_be_aligned_are_not_called_warped(not_aligned: ChangeResult) -> None:
    assert shown(not_aligned).alts["before"] == "Photo before: old street.jpg"


def test_every_layer_is_a_picture_of_the_view(result: ChangeResult) -> None:
    view = to_common_frame(result)
    pictures = {name: Image.open(io.BytesIO(draw(view))) for name, draw in LAYERS.items()}
    assert {picture.size for picture in pictures.values()} == {(80, 60)}
    assert np.asarray(pictures["unknown"])[:, 10:, 3].max() == 0  # clear where both photos see
