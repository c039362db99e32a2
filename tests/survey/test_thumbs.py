from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from zeroscd.survey.compared_pairs import ComparedPair
from zeroscd.survey.thumbs import MAX_SIDE_PX, draw_thumbs

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


def test_thumbnails_are_small_and_keep_the_shape(tmp_path: Path, pair: Callable[..., Any]) -> None:
    wide = np.zeros((300, 960, 3), np.uint8)
    wide[:, 480:] = 255
    Image.fromarray(wide).save(tmp_path / "wide.png")
    little = np.full((48, 64, 3), 77, np.uint8)
    Image.fromarray(little).save(tmp_path / "little.png")
    row = pair(before=str(tmp_path / "wide.png"), after=str(tmp_path / "little.png"))
    before, after = draw_thumbs([ComparedPair(row, ())], tmp_path)["elm"]
    assert before.size_hw == (300, 960)
    with Image.open(tmp_path / str(before.file)) as picture:
        assert picture.size == (MAX_SIDE_PX, 150)
        shown = np.asarray(picture)
        assert shown[:, :200].mean() < 10
        assert shown[:, -200:].mean() > 245
    with Image.open(tmp_path / str(after.file)) as picture:
        assert picture.size == (64, 48)


def test_a_photo_that_has_gone_since_has_no_thumbnail(
    tmp_path: Path, pair: Callable[..., Any]
) -> None:
    row = pair(before=str(tmp_path / "gone.png"), after=str(tmp_path / "gone too.png"))
    before, after = draw_thumbs([ComparedPair(row, ())], tmp_path)["elm"]
    assert before.file is None
    assert after.file is None
