from __future__ import annotations

import pytest

from zeroscd.serve.shelf import Shelf


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def shelf(clock: Clock) -> Shelf[str]:
    return Shelf(max_weight=10, seconds=100, clock=clock)


def test_what_is_put_can_be_had_again(shelf: Shelf[str]) -> None:
    name = shelf.put("thing", weight=1)
    assert shelf.get(name) == "thing"
    assert shelf.get("guessed") is None


def test_names_cannot_be_guessed(shelf: Shelf[str]) -> None:
    names = {shelf.put("thing", weight=0) for _ in range(50)}
    assert len(names) == 50
    assert min(map(len, names)) >= 20


def test_use_keeps_a_thing_and_age_removes_it(shelf: Shelf[str], clock: Clock) -> None:
    used, unused = shelf.put("used", weight=1), shelf.put("unused", weight=1)
    clock.now = 60
    assert shelf.get(used) == "used"
    clock.now = 120
    assert shelf.get(used) == "used"
    assert shelf.get(unused) is None
    clock.now = 221
    shelf.tidy()
    assert len(shelf) == 0


def test_too_much_weight_pushes_out_what_was_unused_for_longest(shelf: Shelf[str]) -> None:
    first, second = shelf.put("a", weight=5), shelf.put("b", weight=5)
    assert shelf.get(first) == "a"
    shelf.put("c", weight=1)
    assert shelf.get(second) is None
    assert shelf.get(first) == "a"


def test_the_newest_thing_stays_however_heavy_it_is(shelf: Shelf[str]) -> None:
    light = shelf.put("light", weight=1)
    heavy = shelf.put("heavy", weight=99)
    assert shelf.get(heavy) == "heavy"
    assert shelf.get(light) is None


def test_a_name_given_again_replaces_the_thing(shelf: Shelf[str]) -> None:
    name = shelf.put("old", weight=8)
    shelf.put("new", weight=9, name=name)
    assert shelf.get(name) == "new"
    assert len(shelf) == 1
