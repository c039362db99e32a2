from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.export.overlay import (
    ADDED_RGB,
    REMOVED_RGB,
    TINT,
    UNKNOWN_RGB,
    draw_overlay,
    hatching,
)

if TYPE_CHECKING:
    from zeroscd.result import ChangeResult


def expected_tint(pixel: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    return (pixel * (1 - TINT) + np.array(colour) * TINT).round()


def test_the_inside_of_a_change_is_tinted_and_the_rest_is_the_photo(result: ChangeResult) -> None:
    removed, added = np.zeros((2, 60, 80), bool)
    removed[5:25, 5:25] = True  # 15..34 in the t1 frame
    added[30:50, 50:70] = True
    overlay = draw_overlay(replace(result, removed=removed, added=added))
    photo = result.after.pixels
    for inside, colour in (((40, 60), ADDED_RGB), ((15, 25), REMOVED_RGB)):
        assert np.array_equal(overlay[inside], expected_tint(photo[inside], colour))
    assert np.array_equal(overlay[45:60, 15:40], photo[45:60, 15:40])


def test_outlines_are_drawn_in_full_colour_between_white_lines(result: ChangeResult) -> None:
    # At 1200 px the coloured line is 3 px wide, so that its middle is not blended with anything.
    size = (900, 1200)
    dark, none, added = np.zeros((*size, 3), np.uint8), np.zeros(size, bool), np.zeros(size, bool)
    added[300:600, 400:800] = True
    large = replace(
        result,
        before=replace(result.before, pixels=dark),
        after=replace(result.after, pixels=dark),
        removed=none,
        added=added,
        unknown=none,
        distance=np.zeros(size, np.float32),
    )
    overlay = draw_overlay(large)
    assert overlay[300, 600].tolist() == list(ADDED_RGB)
    assert overlay[450, 400].tolist() == list(ADDED_RGB)
    assert overlay[297, 600].min() > 180
    assert overlay[303, 600].min() > 180


def test_what_only_one_photo_shows_is_hatched(result: ChangeResult) -> None:
    overlay = draw_overlay(result)
    lines = hatching(result.unknown)
    assert 0 < lines.sum() < result.unknown.sum() / 2
    assert (overlay[:60][lines] == UNKNOWN_RGB).all()


def test_the_legend_lies_below_the_photo(result: ChangeResult) -> None:
    overlay = draw_overlay(result)
    assert overlay.shape[0] > 60
    assert overlay.shape[1:] == (80, 3)
    colours = {tuple(pixel) for pixel in overlay[60:].reshape(-1, 3).tolist()}
    assert {REMOVED_RGB, ADDED_RGB} <= colours


def test_in_the_t0_frame_the_photo_before_is_drawn_on(result: ChangeResult) -> None:
    overlay = draw_overlay(replace(result, frame="t0"))
    assert np.array_equal(overlay[45:60, 20:40], result.before.pixels[45:60, 20:40])


def test_the_result_itself_stays_as_it_is(result: ChangeResult) -> None:
    before = result.after.pixels.copy()
    draw_overlay(result)
    assert np.array_equal(result.after.pixels, before)
