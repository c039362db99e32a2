from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from operator import attrgetter
from threading import Barrier

import numpy as np
import pytest

from zeroscd.cache import ExpiringCache
from zeroscd.evidence import EncodedPhoto
from zeroscd.images.grid import PatchGrid
from zeroscd.images.photo import Photo
from zeroscd.records import FeatureMap
from zeroscd.segments import Segments


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@dataclass
class Growing:
    """A value that may grow after it was put in."""

    size_bytes: int = 10


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def texts(clock: Clock) -> ExpiringCache[str]:
    return ExpiringCache(10, size_of=len, max_age_s=100, keep_newest=True, clock=clock)


def growing(max_bytes: int) -> ExpiringCache[Growing]:
    return ExpiringCache(max_bytes, size_of=attrgetter("size_bytes"))


def keys_in(cache: ExpiringCache[Growing], keys: str) -> set[str]:
    return {key for key in keys if cache.get(key)}


def test_a_value_is_found_under_its_key(texts: ExpiringCache[str]) -> None:
    assert texts.get(texts.put("a")) == "a"
    assert texts.put("b", "named") == "named"
    assert texts.get("named") == "b"
    assert texts.get("guessed") is None


def test_a_value_can_be_taken_out_once(texts: ExpiringCache[str]) -> None:
    key = texts.put("a")
    assert (texts.pop(key), texts.pop(key), texts.get(key)) == ("a", None, None)


def test_keys_made_here_cannot_be_guessed() -> None:
    cache = growing(1000)
    keys = {cache.put(Growing()) for _ in range(50)}
    assert len(keys) == 50
    assert min(map(len, keys)) >= 20


def test_use_keeps_a_value_and_age_removes_it(texts: ExpiringCache[str], clock: Clock) -> None:
    used, unused = texts.put("used"), texts.put("un")
    clock.now_s = 60
    assert texts.get(used) == "used"
    clock.now_s = 120
    assert texts.get(unused) is None
    assert texts.get(used) == "used"
    clock.now_s = 221
    texts.drop_expired()
    assert len(texts) == 0


def test_without_an_age_nothing_expires(clock: Clock) -> None:
    cache = ExpiringCache(10, size_of=len, clock=clock)
    key = cache.put("kept")
    clock.now_s = 1e12
    assert cache.get(key) == "kept"


def test_the_least_recently_used_value_makes_room() -> None:
    cache = growing(39)
    for key in "abc":
        cache.put(Growing(), key)
    assert cache.get("a") is not None  # used again: b is now the oldest
    cache.put(Growing(), "d")
    assert keys_in(cache, "abcd") == {"a", "c", "d"}


def test_what_a_value_has_grown_by_counts_on_the_next_use() -> None:
    cache = growing(40)
    values = {key: Growing() for key in "abcd"}
    for key, value in values.items():
        cache.put(value, key)
    for key in "ab":
        values[key].size_bytes *= 2  # all together 60 bytes of 40
    assert keys_in(cache, "bacd") == {"b", "c", "d"}


def test_a_key_put_again_takes_its_room_once_and_has_the_new_value() -> None:
    cache = growing(20)
    newest = Growing()
    for key, value in (("a", Growing()), ("a", Growing()), ("a", newest), ("b", Growing())):
        cache.put(value, key)
    assert cache.get("a") is newest
    assert cache.get("b") is not None


def test_a_value_larger_than_the_cache_is_not_kept_and_drops_no_other() -> None:
    cache = growing(15)
    cache.put(Growing(10), "small")
    cache.put(Growing(16), "large")
    assert cache.get("small") is not None
    assert cache.get("large") is None


def test_a_cache_of_no_bytes_keeps_nothing() -> None:
    cache = growing(0)
    cache.put(Growing(), "a")
    assert cache.get("a") is None


def test_where_asked_for_the_newest_value_stays_however_large(texts: ExpiringCache[str]) -> None:
    light = texts.put("light")
    heavy = texts.put("heavy" * 9)
    assert texts.get(heavy) == "heavy" * 9
    assert texts.get(light) is None
    light = texts.put("light")
    assert texts.get(heavy) is None
    assert texts.get(light) == "light"


def test_threads_may_share_it() -> None:
    cache, start = growing(100), Barrier(4)

    def work(thread: int) -> int:
        start.wait()
        for turn in range(500):
            cache.put(Growing(), f"{thread}-{turn % 20}")
            cache.get(f"{(thread + 1) % 4}-{turn % 20}")
        return len(cache)

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(work, range(4))) == [10] * 4


def test_an_encoded_photo_is_as_large_as_all_that_it_holds_by_now() -> None:
    pixels, descriptors = 4 * 4 * 3, 2 * 2 * 5 * 4

    @dataclass
    class Proposals(Growing):
        size_bytes: int = 0

        def segments(self, roi: object) -> Segments:
            self.size_bytes = 7
            return Segments(size_hw=(4, 4), items=())

    features = FeatureMap(
        descriptors=np.zeros((2, 2, 5), np.float32),
        grid=PatchGrid.covering((4, 4), size_hw=(2, 2)),
    )
    photo = EncodedPhoto(Photo(pixels=np.zeros((4, 4, 3), np.uint8)), (features,), Proposals())
    assert photo.size_bytes == pixels + descriptors
    photo.proposals.segments(None)
    assert photo.size_bytes == pixels + descriptors + 7
