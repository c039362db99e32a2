from __future__ import annotations

import base64
import io
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from zeroscd.export import regions
from zeroscd.export.frame import to_common_frame
from zeroscd.export.shapes import to_shapes

if TYPE_CHECKING:
    from zeroscd.export.frame import CommonFrame
    from zeroscd.export.regions import Card
    from zeroscd.result import ChangeResult


def region_cards(result: ChangeResult, view: CommonFrame) -> list[Card]:
    return regions.region_cards(result, view, to_shapes(result, view))


def thumbs(cards: list[Card]) -> list[np.ndarray]:
    """Before and after of the only card."""
    (card,) = cards
    starts = "data:image/jpeg;base64,"
    files = [base64.b64decode(uri.removeprefix(starts)) for uri in card.thumbs.values()]
    return [np.asarray(Image.open(io.BytesIO(file))) for file in files]


def test_a_card_tells_region_and_share(result: ChangeResult) -> None:
    card = region_cards(result, to_common_frame(result))[0]
    assert card.region == result.regions[0]
    assert card.share == "4.2 %"  # 200 of 80 x 60 px
    assert list(card.thumbs) == ["before", "after"]


def test_a_thumbnail_shows_the_region_with_its_surroundings(result: ChangeResult) -> None:
    pixels = np.zeros_like(result.after.pixels)
    pixels[12:48, 16:64] = 255
    large = replace(result.regions[1], bbox_xywh=(16, 12, 48, 36))
    bright = replace(
        result,
        after=replace(result.after, pixels=pixels),
        regions=(large,),
        unseen=np.zeros_like(result.unseen),
    )
    before, after = thumbs(region_cards(bright, to_common_frame(bright)))
    assert before.shape == after.shape == (181, 240, 3)  # of 77 x 58 px of the view
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
    _, after = thumbs(region_cards(bright, to_common_frame(bright)))
    # 8 px, each 10 / 1.6 px large
    assert (after[..., 0] > 127).any(axis=1).sum() == pytest.approx(50, abs=6)


def test_a_thumbnail_at_the_edge_stays_inside_the_photo(result: ChangeResult) -> None:
    edge = replace(
        result.regions[1], bbox_xywh=(72, 52, 8, 8), polygon_xy=(((72, 52), (79, 52), (79, 59)),)
    )
    pixels = np.full_like(result.after.pixels, 255)
    white = replace(result, after=replace(result.after, pixels=pixels), regions=(edge,))
    _, after = thumbs(region_cards(white, to_common_frame(white)))
    assert after.min() > 250


@pytest.mark.parametrize("xywh", [(0, 0, 80, 60), (0, 20, 80, 8), (30, 0, 8, 60)])
def test_a_thumbnail_holds_its_region_and_nothing_beyond_the_photo(
    result: ChangeResult, xywh: tuple[int, int, int, int]
) -> None:
    whole = replace(result.regions[1], bbox_xywh=xywh)
    (card,) = region_cards(replace(result, regions=(whole,)), to_common_frame(result))
    x, y, width, height = card.window_xywh
    assert x <= xywh[0]
    assert y <= xywh[1]
    assert xywh[0] + xywh[2] <= x + width <= 80
    assert xywh[1] + xywh[3] <= y + height <= 60
    _, after = thumbs([card])
    assert after.shape[1] / after.shape[0] == pytest.approx(width / height, rel=0.01)
    assert max(after.shape[1] / 240, after.shape[0] / 320) == 1


def test_a_thumbnail_turns_away_from_what_only_one_photo_shows(result: ChangeResult) -> None:
    """Around its middle the window would begin at 4; the first 10 columns are grey."""
    near = replace(result.regions[1], bbox_xywh=(19, 25, 8, 8))
    cards = region_cards(replace(result, regions=(near,)), to_common_frame(result))
    x, y, width, height = cards[0].window_xywh
    assert (width, height) == (38, 29)
    assert (x, y) == (10, 14)  # no further than it must


def test_very_many_regions_are_cut_to_the_most_certain(result: ChangeResult) -> None:
    one = result.regions[1]
    many = replace(result, regions=tuple(replace(one, id=n) for n in range(1, 81)))
    cards = region_cards(many, to_common_frame(many))
    assert [card.region.id for card in cards] == list(range(1, 61))
