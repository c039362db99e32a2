"""Old public names work for one more minor version, and say the new one."""

from __future__ import annotations

from importlib import import_module

import pytest

from zeroscd.renamed import RenamedWarning
from zeroscd.survey import MatchRules

MOVED = {
    "zeroscd.result.Alignment": "zeroscd.records.Alignment",
    "zeroscd.result.NotAligned": "zeroscd.records.NotAligned",
    "zeroscd.result.Photo": "zeroscd.images.photo.Photo",
    "zeroscd.result.Region": "zeroscd.records.Region",
    "zeroscd.survey.Rules": "zeroscd.survey.MatchRules",
    "zeroscd.survey.Sighting": "zeroscd.survey.PhotoMatch",
    "zeroscd.survey.look": "zeroscd.survey.match_photos",
}


def named(path: str) -> object:
    module, _, name = path.rpartition(".")
    return getattr(import_module(module), name)


@pytest.mark.parametrize(("old", "new"), MOVED.items())
def test_a_name_that_moved_is_found_with_a_warning_that_blames_the_caller(
    old: str, new: str
) -> None:
    with pytest.warns(RenamedWarning, match=f"^{old} is now {new}; ") as warned:
        assert named(old) is named(new)
    assert warned[0].filename == __file__


@pytest.mark.parametrize("module", ["zeroscd.result", "zeroscd.survey"])
def test_a_name_that_never_was_is_an_attribute_error(module: str) -> None:
    with pytest.raises(AttributeError, match=f"module '{module}' has no attribute 'rgion'"):
        named(f"{module}.rgion")


def test_rules_take_their_least_score_still() -> None:
    with pytest.warns(RenamedWarning, match="least_score is now min_score"):
        assert MatchRules(least_score=0.5) == MatchRules(min_score=0.5)  # type: ignore[call-arg]
