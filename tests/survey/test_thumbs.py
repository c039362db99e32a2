from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.survey.compared_pairs import ComparedPair
from zeroscd.survey.thumbs import (
    CLOSE_SIDE_PX,
    MAX_SIDE_PX,
    Closeup,
    close_box,
    draw_thumbs,
)

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


def test_a_close_up_is_that_part_of_the_photo(tmp_path: Path, pair: Callable[..., Any]) -> None:
    pixels = np.zeros((1000, 1600, 3), np.uint8)
    pixels[300:400, 800:1000] = 255
    Image.fromarray(pixels).save(tmp_path / "wide.png")
    row = pair(before=str(tmp_path / "wide.png"), after=str(tmp_path / "wide.png"))
    ring = np.array([[800.0, 300], [1000, 300], [1000, 400], [800, 400]])
    outlines = {("elm", "after"): {7: [ring]}}
    before, after = draw_thumbs([ComparedPair(row, ())], tmp_path, outlines)["elm"]
    assert before.closeups == {}
    closeup = after.closeups[7]
    assert closeup == Closeup("thumbs/elm-after-7.jpg", (700, 150, 400, 400))
    with Image.open(tmp_path / closeup.file) as picture:
        shown = np.asarray(picture)
    assert shown.shape == (CLOSE_SIDE_PX, CLOSE_SIDE_PX, 3)
    assert shown[125:195, 85:235].min() > 235  # where the ring is, at 320 pixels to 400
    assert shown[:110].max() < 20


@pytest.mark.parametrize(
    ("ring", "box"),
    [
        ([[100, 50], [110, 50], [110, 60]], (81, 31, 48, 48)),
        ([[0, 0], [40, 0], [40, 20]], (0, 0, 80, 80)),
        ([[260, 180], [300, 180], [300, 200]], (220, 120, 80, 80)),
        ([[100, 50], [161, 50], [161, 60]], None),  # twice 61 is more than 120
        ([[-60, 50], [10, 50], [10, 60]], None),
        ([[100, 190], [130, 190], [130, 220]], None),
    ],
)
def test_a_close_up_lies_in_the_photo_or_is_none(
    ring: list[list[int]], box: tuple[int, ...] | None
) -> None:
    assert close_box([np.array(ring, float)], (200, 300)) == box
    assert close_box([], (200, 300)) is None
