from __future__ import annotations

import pytest

from zeroscd.errors import SettingsError
from zeroscd.labels.classes import GROUPS, ID, NAMES, class_ids


def test_the_classes_are_in_the_order_of_the_benchmark() -> None:
    # Places that ADE20K's own list of 150 numbers (from 1 there).
    known = {1: "wall", 3: "sky", 13: "person", 21: "car", 73: "palm", 128: "bicycle", 150: "flag"}
    assert len(NAMES) == len(set(NAMES)) == 150
    assert {number: NAMES[number - 1] for number in known} == known


def test_a_group_is_all_of_its_classes() -> None:
    assert class_ids(["vehicle", "person"]) == {ID[name] for name in (*GROUPS["vehicle"], "person")}
    assert class_ids([]) == frozenset()


def test_an_unknown_class_is_answered_with_the_nearest() -> None:
    with pytest.raises(SettingsError, match="unknown class 'vehicles'; did you mean vehicle"):
        class_ids(["person", "vehicles"])
