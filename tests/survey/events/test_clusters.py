"""Events grow from bonds, and never hold two things of one photo."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from zeroscd.survey.events.clusters import Bond, cluster


def test_a_chain_of_photos_is_one_event() -> None:
    assert cluster(["a", "b", "c", "d"], [Bond(0, 1, 1.0), Bond(1, 2, 1.0)]) == [[0, 1, 2], [3]]


def test_the_stronger_bond_decides_between_two_things_of_one_photo() -> None:
    pairs = ["a", "b", "b"]
    assert cluster(pairs, [Bond(0, 1, 0.8), Bond(0, 2, 0.9)]) == [[0, 2], [1]]
    # Also where the two meet by way of another photo.
    chain = [Bond(0, 1, 0.9), Bond(1, 2, 0.8), Bond(0, 3, 0.7)]
    assert cluster(["a", "b", "c", "c"], chain) == [[0, 1, 2], [3]]


def test_two_parts_of_one_thing_join_it() -> None:
    pairs = ["a", "b", "b", "c"]
    parts = [Bond(0, 1, 0.9, part=1), Bond(0, 2, 0.9, part=2), Bond(0, 3, 0.9)]
    assert cluster(pairs, parts) == [[0, 1, 2, 3]]
    # Each is a part of something, but not of the same.
    elsewhere = [Bond(0, 1, 0.9, part=1), Bond(2, 3, 0.9, part=2), Bond(0, 3, 0.5)]
    assert cluster(pairs, elsewhere) == [[0, 1, 3], [2]]


@given(st.data())
def test_every_sighting_is_in_one_event_and_no_pair_twice(data: st.DataObject) -> None:
    pairs = data.draw(st.lists(st.sampled_from("abcd"), min_size=1, max_size=8))
    position = st.integers(0, len(pairs) - 1)
    drawn = st.builds(Bond, position, position, st.floats(0, 2))
    bonds = [bond for bond in data.draw(st.lists(drawn, max_size=12)) if bond.a != bond.b]
    groups = cluster(pairs, bonds)
    assert sorted(k for group in groups for k in group) == list(range(len(pairs)))
    assert groups == sorted(groups)
    for group in groups:
        own = [pairs[k] for k in group]
        assert len(set(own)) == len(own)
    assert cluster(pairs, bonds[::-1]) == groups
