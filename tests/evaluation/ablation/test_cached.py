"""What networks gave is given again, exactly, without asking them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from zeroscd.evaluation.ablation.cached import CachedEncoder, CachedSegmenter
from zeroscd.records import Segments

if TYPE_CHECKING:
    from zeroscd.evaluation.ablation.store import ArrayStore

PHOTO = np.arange(40 * 80 * 3, dtype=np.uint8).reshape(40, 80, 3)
PHOTOS = [PHOTO, PHOTO[::2]]


def test_features_are_computed_once_and_come_back_as_they_were(
    store: ArrayStore, encoder: Any
) -> None:
    cached, restarted = (CachedEncoder(encoder, store, identity="same") for _ in range(2))
    assert (cached.name, cached.tau) == ("counting", 0.7)
    first, second = cached.encode(PHOTOS), restarted.encode(PHOTOS)
    assert encoder.asked == 1
    assert [len(maps) for maps in second] == [2, 2]
    for one, other in zip(sum(first, ()), sum(second, ()), strict=True):
        assert one.grid == other.grid
        assert one.source == other.source
        assert one.descriptors.dtype == other.descriptors.dtype
        assert np.array_equal(one.descriptors, other.descriptors)


def test_other_photos_or_settings_are_not_mixed_up(store: ArrayStore, encoder: Any) -> None:
    cached = CachedEncoder(encoder, store, identity="same")
    cached.encode(PHOTOS)
    swapped = cached.encode(PHOTOS[::-1])
    assert swapped[0][0].grid.stride_xy == (20.0, 10.0)  # 20 rows in 2, 80 columns in 4
    CachedEncoder(encoder, store, identity="other").encode(PHOTOS)
    assert encoder.asked == 3


def test_outlines_are_computed_once_and_come_back_as_they_were(
    store: ArrayStore, encoder: Any, segmenter: Any
) -> None:
    features = encoder.encode([PHOTO])[0]
    cached, restarted = (
        CachedSegmenter(segmenter, store, identity="same", reads_features=True) for _ in range(2)
    )
    first = cached.proposals(PHOTO, features).segments(None)
    second = restarted.proposals(PHOTO, features).segments(None)
    assert segmenter.asked == 1
    assert second.size_hw == first.size_hw
    for one, other in zip(first, second, strict=True):
        assert (one.bbox_xywh, one.area_px) == (other.bbox_xywh, other.area_px)
        assert np.array_equal(one.mask(first.size_hw), other.mask(first.size_hw))
    cached.proposals(PHOTO, features).segments(np.ones((40, 80), bool))
    assert segmenter.asked == 2


def test_a_segmenter_that_only_looks_at_the_photo_is_shared_by_all_encoders(
    store: ArrayStore, encoder: Any, segmenter: Any
) -> None:
    features = encoder.encode([PHOTO])[0]
    others = tuple(replace(one, descriptors=one.descriptors + 1) for one in features)
    blind = CachedSegmenter(segmenter, store, identity="same", reads_features=False)
    blind.proposals(PHOTO, features).segments(None)
    blind.proposals(PHOTO, others).segments(None)
    assert segmenter.asked == 1
    seeing = CachedSegmenter(segmenter, store, identity="same", reads_features=True)
    seeing.proposals(PHOTO, features).segments(None)
    seeing.proposals(PHOTO, others).segments(None)
    assert segmenter.asked == 3


def test_a_photo_without_any_outline_is_remembered_too(store: ArrayStore) -> None:
    asked = []

    class Nothing:
        name, size_bytes = "nothing", 0

        def proposals(self, photo: Any, features: Any) -> Nothing:
            return self

        def segments(self, where: Any) -> Segments:
            asked.append(where)
            return Segments(size_hw=(40, 80), items=())

    for _ in range(2):
        cached = CachedSegmenter(Nothing(), store, identity="", reads_features=True)
        assert len(cached.proposals(PHOTO, ()).segments(None)) == 0
    assert len(asked) == 1
