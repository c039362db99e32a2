from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.export.table import changes_schema, pairs_schema, write_parquet
from zeroscd.survey.cards import MAX_SIGHTINGS, make_cards
from zeroscd.survey.thumbs import Closeup

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.survey.events import Event

SQUARE = np.array([[10.0, 10.0], [20, 10], [20, 20], [10, 20]])
SHIFT = [[1.0, 0, 30], [0, 1, 5], [0, 0, 1]]


@pytest.fixture
def folder(tmp_path: Path, pair: Callable[..., Any], change: Callable[..., Any]) -> Path:
    """Eight pairs, each with a removed region 1 and an added region 2; one is aligned."""
    Image.fromarray(np.full((100, 200, 3), 90, np.uint8)).save(tmp_path / "photo.png")
    names = [f"p{number}" for number in range(8)]
    pairs = [
        pair(pair=name, row=row, before="photo.png", after="photo.png")
        for row, name in enumerate(names, 1)
    ]
    changes = [
        change(pair=name, region=region, kind=kind, frame=frame)
        for name in names
        for region, kind, frame in ((1, "removed", "t0"), (2, "added", "t1"))
    ]
    write_parquet(tmp_path / "pairs.parquet", pairs, pairs_schema())
    write_parquet(tmp_path / "changes.parquet", changes, changes_schema())
    (tmp_path / "p1").mkdir()
    (tmp_path / "p1" / "changes.json").write_text(json.dumps({"alignment": {"t1_from_t0": SHIFT}}))
    (tmp_path / "p1" / "report.html").touch()
    return tmp_path


def test_both_photos_have_the_outline_carried_by_the_homography(
    folder: Path, event: Callable[..., Event]
) -> None:
    added = event(kind="added", best_pair="p1", best_region=2)
    removed = event(2, kind="removed", best_pair="p1", best_region=1)
    cards = make_cards([added, removed], folder)
    (before, after), (removed_before, removed_after) = (card.pairs[0].photos for card in cards)
    assert (before.carried, after.carried) == (True, False)
    assert after.rings_xy[0] == pytest.approx(SQUARE)
    assert before.rings_xy[0] == pytest.approx(SQUARE - [30, 5])
    assert (removed_before.carried, removed_after.carried) == (False, True)
    assert removed_before.rings_xy[0] == pytest.approx(SQUARE)
    assert removed_after.rings_xy[0] == pytest.approx(SQUARE + np.array([30, 5]))
    assert cards[0].pairs[0].report == "p1/report.html"


def test_the_best_pair_has_close_ups_of_the_same_place_in_both_photos(
    folder: Path, event: Callable[..., Event]
) -> None:
    regions = (("p0", 1), ("p1", 1))
    seen = event(kind="removed", best_pair="p1", best_region=1, regions=regions, sightings=2)
    (card,) = make_cards([seen], folder)
    best, other = card.pairs
    assert [photo.closeup for photo in best.photos] == [
        Closeup("thumbs/p1-before-1.jpg", (0, 0, 48, 48)),
        Closeup("thumbs/p1-after-1.jpg", (21, 0, 48, 48)),  # around 45, 20
    ]
    assert (folder / "thumbs" / "p1-after-1.jpg").exists()
    assert [photo.closeup for photo in other.photos] == [None, None]


def test_there_is_no_close_up_of_one_photo_alone(folder: Path, event: Callable[..., Event]) -> None:
    added = event(best_pair="p1", best_region=2)  # carried to the left of the photo before
    not_aligned = event(2, best_pair="p0", best_region=2)
    for card in make_cards([added, not_aligned], folder):
        assert [photo.closeup for photo in card.pairs[0].photos] == [None, None]


def test_without_a_homography_only_the_photo_that_shows_it_has_the_outline(
    folder: Path, event: Callable[..., Event]
) -> None:
    (card,) = make_cards([event(best_pair="p0", best_region=2)], folder)
    before, after = card.pairs[0].photos
    assert before.rings_xy == []
    assert after.rings_xy[0] == pytest.approx(SQUARE)
    assert card.pairs[0].report is None


def test_the_best_pair_comes_first_and_a_card_holds_only_so_many(
    folder: Path, event: Callable[..., Event]
) -> None:
    regions = tuple((f"p{number}", 2) for number in range(8))
    seen = event(best_pair="p3", best_region=2, regions=regions, sightings=8)
    (card,) = make_cards([seen], folder)
    names = [one.pair["pair"] for one in card.pairs]
    assert names == ["p3", "p0", "p1", "p2", "p4", "p5"]
    assert len(names) == MAX_SIGHTINGS
    drawn = {path.name for path in (folder / "thumbs").iterdir()}
    assert drawn == {f"{name}-{when}.jpg" for name in names for when in ("before", "after")}


def test_two_regions_of_one_pair_are_both_outlined(
    folder: Path, event: Callable[..., Event]
) -> None:
    parts = event(best_pair="p1", best_region=2, regions=(("p1", 1), ("p1", 2)))
    (card,) = make_cards([parts], folder)
    assert len(card.pairs) == 1
    assert [len(photo.rings_xy) for photo in card.pairs[0].photos] == [2, 2]
