from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.export import regions
from zeroscd.export.frame import to_common_frame

if TYPE_CHECKING:
    from zeroscd.result import ChangeResult


def thumbs(page: str) -> list[np.ndarray]:
    found = re.findall(r'src="data:image/jpeg;base64,([^"]+)"', page)
    return [np.asarray(Image.open(io.BytesIO(base64.b64decode(text)))) for text in found]


def test_outlines_are_carried_into_the_frame(result: ChangeResult) -> None:
    page = regions.shapes(result.regions, to_common_frame(result))
    # t0 corner (5, 10) lies at (15, 10) in t1; SVG counts from the corner of that pixel
    assert 'd="M15.5,10.5 34.5,10.5 34.5,19.5 15.5,19.5Z"' in page
    assert 'd="M50.5,30.5 57.5,30.5 57.5,37.5 50.5,37.5Z"' in page


def test_a_number_sits_on_the_top_of_its_region(result: ChangeResult) -> None:
    page = regions.chips(result.regions, to_common_frame(result))
    assert f'style="left:{100 * 50.5 / 80:.2f}%;top:{100 * 30.5 / 60:.2f}%"' in page
    assert 'aria-label="Region 1, removed"' in page


def test_a_card_tells_kind_score_and_area(result: ChangeResult) -> None:
    card = regions.cards(result, to_common_frame(result)).split("</li>")[0]
    for text in ("removed", "0.91", "4.2 % of the photo (200 px)", 'alt="Region 1, before"'):
        assert text in card


def test_a_thumbnail_shows_the_region_with_its_surroundings(result: ChangeResult) -> None:
    pixels = np.zeros_like(result.after.pixels)
    pixels[12:48, 16:64] = 255
    large = replace(result.regions[1], bbox_xywh=(16, 12, 48, 36))
    bright = replace(result, after=replace(result.after, pixels=pixels), regions=(large,))
    before, after = thumbs(regions.cards(bright, to_common_frame(bright)))
    assert before.shape == after.shape == (180, 240, 3)
    white = after[..., 0] > 127
    # It fills 1 / (1 + 2 x 0.3) of 240 x 180, up to one of the 58 source rows.
    assert white.any(axis=0).sum() == pytest.approx(240 / 1.6, abs=180 / 58)
    assert white.any(axis=1).sum() == pytest.approx(180 / 1.6, abs=180 / 58)
    assert not white[[0, -1]].any()
    assert not white[:, [0, -1]].any()


def test_a_tiny_region_is_not_blown_up_without_end(result: ChangeResult) -> None:
    pixels = np.zeros_like(result.after.pixels)
    pixels[result.added] = 255
    bright = replace(result, after=replace(result.after, pixels=pixels), regions=result.regions[1:])
    _, after = thumbs(regions.cards(bright, to_common_frame(bright)))
    # 8 px, each 10 / 1.6 px large
    assert (after[..., 0] > 127).any(axis=1).sum() == pytest.approx(50, abs=6)


def test_a_thumbnail_at_the_edge_stays_inside_the_photo(result: ChangeResult) -> None:
    edge = replace(
        result.regions[1], bbox_xywh=(72, 52, 8, 8), polygon_xy=(((72, 52), (79, 52), (79, 59)),)
    )
    pixels = np.full_like(result.after.pixels, 255)
    white = replace(result, after=replace(result.after, pixels=pixels), regions=(edge,))
    _, after = thumbs(regions.cards(white, to_common_frame(white)))
    assert after.min() > 250


def test_a_region_larger_than_the_photo_window_is_shown_whole(result: ChangeResult) -> None:
    whole = replace(result.regions[1], bbox_xywh=(0, 0, 80, 60))
    _, after = thumbs(regions.cards(replace(result, regions=(whole,)), to_common_frame(result)))
    assert (np.abs(after[:20].astype(int) - 128) <= 8).mean() > 0.9  # the margin is grey


def test_very_many_regions_are_cut_to_the_most_certain(result: ChangeResult) -> None:
    one = result.regions[1]
    many = replace(result, regions=tuple(replace(one, id=n) for n in range(1, 81)))
    view = to_common_frame(many)
    assert regions.title(many.regions) == "Regions (60 of 80, the most certain ones)"
    assert regions.cards(many, view).count("<li ") == 60
    assert regions.chips(many.regions, view).count("<a ") == 60
    assert regions.shapes(many.regions, view).count("<g ") == 80


def test_without_regions_the_list_says_so(nothing: ChangeResult) -> None:
    assert "No region changed." in regions.cards(nothing, to_common_frame(nothing))
