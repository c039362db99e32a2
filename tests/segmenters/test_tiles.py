from __future__ import annotations

import numpy as np

from zeroscd.segmenters.tiles import segments_in_photo
from zeroscd.segments import Segment, Segments


def segment(left: int, top: int, width: int, height: int) -> Segment:
    mask = np.ones((height, width), dtype=bool)
    found = Segment.from_mask(mask, offset_xy=(left, top))
    assert found is not None
    return found


def test_segments_are_moved_and_those_cut_by_the_tile_are_left_out() -> None:
    inside, at_left, at_right, at_bottom = (
        segment(3, 2, 4, 5),
        segment(0, 2, 4, 5),
        segment(12, 2, 4, 5),
        segment(3, 8, 4, 4),
    )
    tile = Segments(size_hw=(12, 16), items=(inside, at_left, at_right, at_bottom))
    # The tile's left edge is the photo's own; its right and lower ones lie inside the photo.
    found = list(segments_in_photo(tile, (0, 20, 16, 12), (48, 64)))
    assert [one.bbox_xywh for one in found] == [(3, 22, 4, 5), (0, 22, 4, 5)]
    assert found[0].mask((48, 64)).sum() == 20
