"""A survey of drawn streets from files to report, with the toy models."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from pycocotools import mask as coco_mask

from zeroscd.batch.journal import SURVEY_FILES
from zeroscd.detector import Detector
from zeroscd.errors import DatasetError, OutputError
from zeroscd.export.geojson import geojson
from zeroscd.export.geopackage import is_available
from zeroscd.survey import MatchRules, compare, match_photos, read_reviews, survey
from zeroscd.survey.events import read_events
from zeroscd.survey.events.files import GEOPACKAGE, event_feature

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from typing import Protocol

    from zeroscd.arrays import Rgb
    from zeroscd.batch import Options
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.records import FeatureMap
    from zeroscd.retrieval import PlaceIndex

    class Town(Protocol):
        def photo(
            self,
            when: str,
            seed: int,
            *,
            changed: bool = False,
            gps: tuple[float, float] | None = None,
            name: str | None = None,
            taken: str | None = None,
        ) -> Path: ...


# Walls of random blocks agree by chance more often than streets do.
RULES = MatchRules(min_score=0.1)


@pytest.fixture
def photos(town: Town, index: PlaceIndex) -> list[Path]:
    """Three streets: one changed, one did not, one is new."""
    index.add([town.photo("old", seed, gps=(52.0, 4.0 + seed / 1e4)) for seed in range(4)])
    return [
        town.photo("new", 1, changed=True, gps=(52.0, 4.0001)),
        town.photo("new", 2, gps=(52.0, 4.0002)),
        town.photo("new", 9, gps=(52.0, 4.0009)),
    ]


def test_a_survey_finds_compares_and_reports(
    photos: list[Path], index: PlaceIndex, options: Options, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    summary = survey(photos, index, out, rules=RULES, options=options)
    assert summary.matched == 2
    pairs = pq.read_table(out / "pairs.parquet").to_pylist()
    assert [pair["status"] for pair in pairs] == ["ok", "ok", "error"]
    assert [pair["before"] for pair in pairs[:2]] == ["../old/street 1.png", "../old/street 2.png"]
    assert [pair["after"] for pair in pairs] == [f"../new/{path.name}" for path in photos]
    assert pairs[2]["error"].startswith("no old photo shows this place")
    changes = pq.read_table(out / "changes.parquet").to_pylist()
    assert {change["pair"] for change in changes} == {"street 1"}

    features = json.loads((out / "changes.geojson").read_text())["features"]
    assert len(features) == len(changes) == summary.batch.regions
    assert features[0]["geometry"]["coordinates"] == pytest.approx([4.0001, 52.0])
    assert features[0]["properties"]["report"] == "street 1/report.html"
    assert (out / "street 1" / "report.html").exists()
    assert features[0]["properties"]["before"] == "../old/street 1.png"
    assert features[0]["properties"]["after"] == "../new/street 1.png"

    labels = json.loads((out / "coco.json").read_text())
    assert {image["file_name"] for image in labels["images"]} <= {
        "../old/street 1.png",
        "../new/street 1.png",
    }
    drawn = coco_mask.decode(labels["annotations"][0]["segmentation"]).astype(bool)
    truth = np.zeros((192, 256), bool)
    truth[32:80, 48:96] = True
    assert (drawn & truth).sum() / (drawn | truth).sum() > 0.6

    page = (out / "report.html").read_text()
    assert f'<span id="shown">{len(summary.events)}</span> of {len(summary.events)} event' in page
    assert "3 new photos, 2 compared" in page
    assert 'href="street%201/report.html"' in page
    assert 'src="thumbs/street%201-before.jpg"' in page
    assert (out / "thumbs" / "street 1-before.jpg").exists()
    assert str(tmp_path) not in page


def test_no_new_photo_is_called_like_a_file_of_the_survey(
    town: Town, index: PlaceIndex, options: Options, tmp_path: Path
) -> None:
    index.add([town.photo("old", 1)])
    out = tmp_path / "out"
    new = town.photo("new", 1, changed=True)
    survey([new], index, out, rules=RULES, options=options)
    own = {path.name for path in out.iterdir()} - {"street 1"}
    own |= set() if is_available() else {GEOPACKAGE}
    assert own == {*SURVEY_FILES, "pairs.parquet", "changes.parquet", "journal.sqlite"}
    names = [new.with_name(f"{name}.png") for name in SURVEY_FILES]
    for path in names:
        path.write_bytes(new.read_bytes())
    survey(names, index, out, rules=RULES, options=options)
    pairs = pq.read_table(out / "pairs.parquet").column("pair").to_pylist()
    assert pairs == [f"{name}-2" for name in SURVEY_FILES]
    assert (out / "report.html").is_file()


@pytest.mark.parametrize("name", ["thumbs", "matches.jsonl", "coco.json"])
def test_a_link_in_place_of_a_file_of_the_survey_is_refused(
    photos: list[Path], index: PlaceIndex, options: Options, tmp_path: Path, name: str
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "mine").mkdir()
    (tmp_path / "out" / name).symlink_to(tmp_path / "mine")
    with pytest.raises(OutputError, match=rf"{name}: it is a link to .*mine; remove the link"):
        survey(photos, index, tmp_path / "out", rules=RULES, options=options)
    assert list((tmp_path / "mine").iterdir()) == []


def test_a_survey_again_computes_nothing_and_writes_the_same(
    photos: list[Path], index: PlaceIndex, options: Options, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    survey(photos, index, out, rules=RULES, options=options)
    names = [name for name in SURVEY_FILES if (out / name).is_file()]
    before = {name: (out / name).read_bytes() for name in names}
    heard: list[tuple[str, bool]] = []

    class Ear:
        def begin(self, total: int) -> None:
            assert total == 3

        def advance(self, stem: str, *, reused: bool) -> None:
            heard.append((stem, reused))

    matches = match_photos(photos, index, out, rules=RULES, progress=Ear())
    assert [reused for _, reused in heard] == [True] * 3
    summary = compare(matches, out, options=options)
    assert summary.batch.reused == 2
    assert {name: (out / name).read_bytes() for name in names} == before


def test_reviews_of_an_earlier_run_come_back_and_change_nothing_else(
    photos: list[Path], index: PlaceIndex, options: Options, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    matches = match_photos(photos, index, out, rules=RULES)
    found = compare(matches, out, options=options).events
    assert {event.review for event in found} == {None}
    said = replace(found[0], review="rejected")
    gone = replace(found[0], kind="removed", regions=(("nowhere", 1),), review="accepted")
    export = tmp_path / "reviewed.geojson"
    export.write_text(json.dumps(geojson(map(event_feature, [said, gone]))))
    reviewed = read_reviews(export)
    summary = compare(matches, out, options=options, reviewed=reviewed)
    assert summary.events == (said, *found[1:])
    assert summary.unmatched_reviews == reviewed[1:]
    assert read_events(out) == [said, *found[1:]]
    assert '<span data-figure="rejected">1</span>' in (out / "report.html").read_text()
    compare(matches, out, options=options)
    assert read_events(out) == list(found)


def test_another_index_or_rule_is_looked_up_anew(
    photos: list[Path], index: PlaceIndex, town: Town, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert match_photos(photos, index, out, rules=RULES)[2].old is None
    index.add([town.photo("old", 9)])
    assert match_photos(photos, index, out, rules=RULES)[2].old == str(
        tmp_path / "old" / "street 9.png"
    )
    near = match_photos(photos, index, out, rules=replace(RULES, within_m=5.0))
    assert near[2].reason == "there is no old photo within 5 m"
    assert near[0].old is not None
    assert near[0].metres == pytest.approx(0.0, abs=0.1)


def test_an_empty_index_is_refused_before_anything_is_written(
    index: PlaceIndex, tmp_path: Path
) -> None:
    with pytest.raises(DatasetError, match="the place index is empty; add old photos"):
        survey(["new.jpg"], index, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_broken_new_photos_are_rows_with_the_reason(
    photos: list[Path], index: PlaceIndex, options: Options, tmp_path: Path
) -> None:
    photos[0].write_bytes(b"")
    summary = survey(
        [*photos, tmp_path / "none.png"], index, tmp_path / "out", rules=RULES, options=options
    )
    pairs = pq.read_table(tmp_path / "out" / "pairs.parquet").to_pylist()
    assert [pair["status"] for pair in pairs] == ["error", "ok", "error", "error"]
    assert "is empty" in pairs[0]["error"]
    assert "does not exist" in pairs[3]["error"]
    assert summary.matched == 1


class CountingEncoder:
    """Counts the photos that another encoder encodes."""

    def __init__(self, encoder: PatchEncoder) -> None:
        self.name, self.tau = encoder.name, encoder.tau
        self.encode_with = encoder.encode
        self.encoded = 0

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        self.encoded += len(photos)
        return self.encode_with(photos)


@pytest.fixture
def years(town: Town, index: PlaceIndex) -> list[Path]:
    """Two streets, each with old photos of four years and two new ones."""

    def taken(seed: int, year: int, second: int = 0) -> dict[str, Any]:
        name = f"{seed} in {year} {second}"
        return {"name": name, "taken": f"{year}:05:01 10:00:0{second}"}

    streets, days = range(2), range(2016, 2020)
    index.add([town.photo("old", seed, **taken(seed, year)) for seed in streets for year in days])
    return [
        town.photo("new", seed, changed=True, **taken(seed, 2026, second))
        for seed in streets
        for second in range(2)
    ]


VIEWS = replace(RULES, views=3)


def test_each_photo_is_encoded_once_although_several_pairs_use_it(
    years: list[Path],
    index: PlaceIndex,
    options: Options,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Finding events encodes photos of changes for itself, which is not what is counted here.
    monkeypatch.setattr("zeroscd.survey.run.find_events", lambda *_: [])
    detector = options.detector()
    counting = CountingEncoder(detector.models.encoder)
    models = replace(detector.models, encoder=counting)
    counted = replace(options, detector=lambda: Detector(detector.settings, models, preset="toy"))
    summary = survey(years, index, tmp_path / "out", rules=VIEWS, options=counted)
    used = {path for match in summary.matches for path in (match.old, *match.also_old)}
    assert [len(match.also_old) for match in summary.matches] == [2] * len(years)
    assert counting.encoded == summary.batch.encoded == len(used) + len(years)
    assert summary.batch.cache_hits == 3 * len(years) - len(used)


def test_every_old_photo_of_a_place_has_a_say_and_a_survey_again_writes_the_same(
    years: list[Path], index: PlaceIndex, options: Options, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    survey(years, index, out, rules=VIEWS, options=options)
    for pair in pq.read_table(out / "pairs.parquet").to_pylist():
        old = {pair["before"], *pair["also_before"]}
        street = pair["pair"].split()[0]
        assert len(old) == 3
        assert all(path.startswith(f"../old/{street} in ") for path in old)
    changes = pq.read_table(out / "changes.parquet").to_pylist()
    assert {(change["seen_by"], change["agreed_by"]) for change in changes} == {(3, 3)}
    assert {change["pair"] for change in changes} == {path.stem for path in years}

    names = [name for name in SURVEY_FILES if (out / name).is_file()]
    before = {name: (out / name).read_bytes() for name in names}
    summary = survey(years, index, out, rules=VIEWS, options=options)
    assert summary.batch.reused == len(years)
    assert {name: (out / name).read_bytes() for name in names} == before
    fewer = survey(years, index, out, rules=replace(VIEWS, views=2), options=options)
    assert fewer.batch.reused == 0
