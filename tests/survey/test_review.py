from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.errors import DatasetError
from zeroscd.export.geojson import geojson
from zeroscd.survey.events.files import event_feature
from zeroscd.survey.review import carry_reviews, read_reviews

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from zeroscd.survey.events import Event


@pytest.fixture
def export(tmp_path: Path) -> Callable[..., Path]:
    """Write events as the report exports them."""

    def write(events: Sequence[Event], kind: str = "geojson") -> Path:
        content: dict[str, Any] = geojson(map(event_feature, events))
        if kind == "json":
            content = {"events": [one["properties"] for one in content["features"]]}
        path = tmp_path / f"reviewed.{kind}"
        path.write_text(json.dumps(content))
        return path

    return write


@pytest.fixture
def events(event: Callable[..., Event]) -> list[Event]:
    """Three things: of two regions, of one, of one."""
    return [
        event(1, score=0.9, regions=(("elm", 1), ("oak", 2)), sightings=2),
        event(2, score=0.7, best_region=2, regions=(("elm", 2),)),
        event(3, score=0.1 + 0.2, kind="removed", best_region=3, regions=(("elm", 3),)),
    ]


def reviews(events: Sequence[Event]) -> list[str | None]:
    return [one.review for one in events]


@pytest.mark.parametrize("kind", ["geojson", "json"])
def test_an_export_gives_the_same_events_their_reviews_again(
    events: list[Event], export: Callable[..., Path], kind: str
) -> None:
    said = [replace(events[0], review="rejected"), events[1], replace(events[2], review="unsure")]
    carried = carry_reviews(events, read_reviews(export(said, kind)))
    assert carried.events == tuple(said)
    assert carried.unmatched == ()


def test_an_event_that_grew_or_got_another_number_keeps_its_review(
    events: list[Event], export: Callable[..., Path]
) -> None:
    said = [replace(events[0], review="accepted")]
    grown = replace(
        events[0],
        id=9,
        score=0.95,
        best_pair="fir",
        best_region=1,
        regions=(*events[0].regions, ("fir", 1)),
    )
    assert reviews(carry_reviews([grown], read_reviews(export(said))).events) == ["accepted"]


def test_a_review_goes_to_no_event_of_another_kind_or_region(
    events: list[Event], export: Callable[..., Path]
) -> None:
    said = read_reviews(export([replace(events[1], review="rejected")]))
    other_kind = replace(events[1], kind="removed")
    carried = carry_reviews([other_kind, events[0]], said)
    assert reviews(carried.events) == [None, None]
    assert carried.unmatched == said


def test_a_pair_compared_with_other_settings_numbers_its_regions_anew(
    events: list[Event], export: Callable[..., Path]
) -> None:
    said = read_reviews(export([replace(events[1], review="rejected")]))
    carried = carry_reviews([replace(events[1], score=0.71)], said)
    assert reviews(carried.events) == [None]
    assert carried.unmatched == said


def test_two_reviews_of_what_is_now_one_event_count_if_they_agree(
    events: list[Event], export: Callable[..., Path]
) -> None:
    joined = replace(events[0], regions=(*events[0].regions, *events[1].regions))

    def carried(*said: Any) -> tuple[list[str | None], int]:
        apart = [replace(one, review=r) for one, r in zip(events, said, strict=False)]
        found = carry_reviews([joined], read_reviews(export(apart)))
        return reviews(found.events), len(found.unmatched)

    assert carried("accepted", "accepted") == (["accepted"], 0)
    assert carried("accepted", "rejected") == ([None], 2)


def test_what_was_said_before_counts_no_more(events: list[Event]) -> None:
    said = [replace(one, review="accepted") for one in events]
    assert reviews(carry_reviews(said, ()).events) == [None] * 3


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ("", "it is no JSON"),
        ("[" * 100_000, "it is no JSON"),
        ("\x80", "it is no JSON"),
        ("{}", "there is no 'events'"),
        ("3", "it holds no reviewed events"),
        ('{"features": [{"properties": null}]}', "it holds no reviewed events"),
        ('{"events": [{}]}', "there is no 'review'"),
        ('{"events": [{"review": "fine"}]}', "'fine' is no review"),
        ('{"events": [{"review": "accepted"}]}', "there is no "),
        ('{"events": [{"review": ["accepted"]}]}', "is no review"),
    ],
)
def test_what_is_no_export_is_refused_in_one_line(tmp_path: Path, content: str, why: str) -> None:
    path = tmp_path / "reviewed.json"
    path.write_bytes(content.encode("latin-1"))
    with pytest.raises(DatasetError) as caught:
        read_reviews(path)
    message = str(caught.value)
    assert message.startswith(f"cannot read {path}: ")
    assert why in message
    assert message.endswith("; give a file that the report of a survey exported")
    assert "\n" not in message


def test_a_missing_file_and_a_folder_are_refused_too(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="No such file"):
        read_reviews(tmp_path / "none.json")
    with pytest.raises(DatasetError, match="directory"):
        read_reviews(tmp_path)
