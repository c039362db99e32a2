from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.batch.views import Views
from zeroscd.evidence import EncodedPhoto
from zeroscd.images.grid import PatchGrid
from zeroscd.images.photo import Photo
from zeroscd.records import FeatureMap, Segments

if TYPE_CHECKING:
    from collections.abc import Callable

PIXELS = 4 * 4 * 3  # bytes
DESCRIPTORS = 2 * 2 * 5 * 4


@dataclass
class Growing:
    """A proposals that holds more once it was asked."""

    size_bytes: int = 0

    def segments(self, where: object) -> Segments:
        self.size_bytes = PIXELS + DESCRIPTORS
        return Segments(size_hw=(4, 4), items=())


@pytest.fixture
def view() -> Callable[[], EncodedPhoto]:
    def make() -> EncodedPhoto:
        features = FeatureMap(
            descriptors=np.zeros((2, 2, 5), np.float32),
            grid=PatchGrid.covering((4, 4), size_hw=(2, 2)),
        )
        return EncodedPhoto(Photo(pixels=np.zeros((4, 4, 3), np.uint8)), (features,), Growing())

    return make


def test_a_view_is_as_large_as_all_that_it_holds_by_now(view: Callable[[], EncodedPhoto]) -> None:
    one = view()
    assert one.size_bytes == PIXELS + DESCRIPTORS
    one.proposals.segments(None)
    assert one.size_bytes == 2 * (PIXELS + DESCRIPTORS)


def test_the_view_not_used_for_longest_makes_room(view: Callable[[], EncodedPhoto]) -> None:
    views = Views(3 * view().size_bytes + 1)
    for name in "abc":
        views.put(name, view())
    assert views.get("a") is not None  # used again: b is now the oldest
    views.put("d", view())
    assert {name for name in "abcd" if views.get(name)} == {"a", "c", "d"}


def test_what_a_view_has_grown_by_counts(view: Callable[[], EncodedPhoto]) -> None:
    views = Views(3 * view().size_bytes)
    for name in "ab":
        views.put(name, view())
        held = views.get(name)
        assert held is not None
        held.proposals.segments(None)  # each is twice as large now: four of three
    views.put("c", view())
    assert {name for name in "abc" if views.get(name)} == {"b", "c"}


def test_views_that_grow_while_nothing_new_comes_make_room_too(
    view: Callable[[], EncodedPhoto],
) -> None:
    views = Views(4 * view().size_bytes)
    for name in "abcd":
        views.put(name, view())
    for name in "abcd":
        held = views.get(name)
        if held is not None:
            held.proposals.segments(None)  # twice as large now; all together would be eight of four
    assert {name for name in "abcd" if views.get(name)} == {"b", "d"}


def test_putting_one_twice_takes_its_room_once(view: Callable[[], EncodedPhoto]) -> None:
    views = Views(2 * view().size_bytes)
    for name in ("a", "a", "a", "b"):
        views.put(name, view())
    assert views.get("a") is not None
    assert views.get("b") is not None


def test_a_view_larger_than_the_cache_throws_nothing_out(view: Callable[[], EncodedPhoto]) -> None:
    small = view()
    large = EncodedPhoto(Photo(pixels=np.zeros((40, 40, 3), np.uint8)), (), Growing())
    views = Views(small.size_bytes)
    views.put("small", small)
    views.put("large", large)
    assert views.get("small") is small
    assert views.get("large") is None
    assert Views(0).get("small") is None
