"""Old public names work for one more minor version, and say the new one."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from zeroscd import batch
from zeroscd.models import Models
from zeroscd.renamed import RenamedWarning
from zeroscd.survey import MatchRules, Summary

MOVED = {
    "zeroscd.records.Segment": "zeroscd.segments.Segment",
    "zeroscd.records.Segments": "zeroscd.segments.Segments",
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


def test_a_segmenter_with_the_old_names_of_its_methods_works() -> None:
    class Study:
        size_bytes = 7

        def outlines(self, where: object) -> object:
            return ["outlines around", where]

    class Scissors:
        name = "scissors"

        def study(self, photo: object, features: object) -> object:
            self.seen = photo, features
            return Study()

    own: Any = Scissors()
    with pytest.warns(RenamedWarning, match="Segmenter.study is now Segmenter.proposals") as warned:
        segmenter: Any = Models(encoder=own, segmenter=own).segmenter
    assert warned[0].filename == __file__
    proposals = segmenter.proposals("photo", "features")
    assert own.seen == ("photo", "features")
    assert segmenter.name == "scissors"
    assert proposals.size_bytes == 7
    assert proposals.segments("here") == ["outlines around", "here"]


def test_a_segmenter_with_todays_names_is_left_as_it_is() -> None:
    class Today:
        def proposals(self) -> None: ...

    own: Any = Today()
    assert Models(encoder=own, segmenter=own).segmenter is own


def test_a_summary_shows_its_matches_by_the_old_name() -> None:
    done: Any = Summary(matches=(), batch=batch.Summary(), report=Path())
    with pytest.warns(RenamedWarning, match="sightings is now matches"):
        assert done.sightings == ()


def test_rules_take_their_least_score_still() -> None:
    with pytest.warns(RenamedWarning, match="least_score is now min_score"):
        assert MatchRules(least_score=0.5) == MatchRules(min_score=0.5)  # type: ignore[call-arg]
