from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd import extras
from zeroscd.errors import DatasetError, OutputError, SettingsError
from zeroscd.images.exif import Exif
from zeroscd.retrieval import store as module
from zeroscd.retrieval.candidates import HEADING, Candidates, DateSpan
from zeroscd.retrieval.database import is_index
from zeroscd.retrieval.describe import Place
from zeroscd.retrieval.gps import Nearby, metres
from zeroscd.retrieval.local_descriptors import CODE_BITS, LocalDescriptors
from zeroscd.retrieval.rows import Entry, schema_of, to_rows
from zeroscd.retrieval.store import Store

if TYPE_CHECKING:
    import pyarrow as pa

pytest.importorskip("lancedb")

LENGTH = 32
ABOUT = {"format": 1, "words": ["any", "plain", "values"]}


def entry(
    number: int,
    *,
    gps: tuple[float, float] | None = None,
    path: str | None = None,
    exif: Exif | None = None,
) -> Entry:
    rng = np.random.default_rng(number)
    vector = rng.normal(size=LENGTH).astype(np.float32)
    patches = LocalDescriptors(
        codes=rng.integers(0, 256, (3, CODE_BITS // 8)).astype(np.uint8),
        centres_xy=rng.integers(0, 500, (3, 2)).astype(np.uint16),
        patch_px=16.0,
    )
    place = Place(
        vector=vector / np.linalg.norm(vector),
        patches=(patches,),
        size_hw=(480, 640),
        exif=exif or Exif(gps=gps, taken="2019-05-01T10:00:00" if number % 2 else None),
    )
    return Entry(path or f"/photos/{number:04}.jpg", f"digest {number}", place)


@pytest.fixture
def address(tmp_path: Path) -> str:
    return str(tmp_path / "places")


@pytest.fixture
def store(address: str) -> Store:
    return Store.create(address, ABOUT, entry(0).place)


def test_what_went_in_comes_out(store: Store, address: str) -> None:
    before = entry(7, exif=Exif(gps=(48.5, 2.25), taken="2019-05-01", heading_deg=271.5))
    store.put([entry(1), before])
    again = Store.open(address)
    ((found, cosine),) = again.nearest(before.place.vector, 1)
    assert (found.path, found.digest) == (before.path, before.digest)
    assert found.place.exif == before.place.exif
    assert found.place.size_hw == (480, 640)
    np.testing.assert_allclose(found.place.vector, before.place.vector, atol=1e-3)
    np.testing.assert_array_equal(found.place.patches[0].codes, before.place.patches[0].codes)
    assert cosine == pytest.approx(1.0, abs=1e-3)
    assert again.about == ABOUT
    np.testing.assert_allclose(again.reference.vector, entry(0).place.vector, atol=1e-3)


def test_a_small_index_is_searched_exactly(store: Store) -> None:
    entries = [entry(number) for number in range(1, 200)]
    store.put(entries)
    store.tidy()
    assert not store.approximate
    query = entry(1000).place.vector
    cosines = np.array([one.place.vector @ query for one in entries])
    best = np.argsort(-cosines)[:10]
    found = store.nearest(query, 10)
    assert [one.path for one, _ in found] == [entries[number].path for number in best]
    np.testing.assert_allclose([cosine for _, cosine in found], cosines[best], atol=2e-3)


def test_within_a_radius_every_place_is_compared(store: Store) -> None:
    rng = np.random.default_rng(3)
    centre = (52.0, 179.999)  # at the date line
    entries = [
        entry(number, gps=(52.0 + north, (180 + 179.999 + east) % 360 - 180))
        for number, (north, east) in enumerate(rng.normal(0, 0.002, (150, 2)), 1)
    ]
    store.put([*entries, entry(500)])  # one of unknown place
    query = entry(1000).place.vector
    for radius_m in (50.0, 150.0, 400.0):
        inside = [
            one for one in entries if metres(one.place.exif.gps or (0, 0), centre) <= radius_m
        ]
        inside.sort(key=lambda one: -float(one.place.vector @ query))
        found = store.nearest(query, 8, among=Candidates(nearby=Nearby(centre, radius_m)))
        assert [one.path for one, _ in found] == [one.path for one in inside[:8]]
    everywhere = Candidates(nearby=Nearby(centre, 1e6))
    assert len(store.nearest(query, 1000, among=everywhere)) == len(entries)


def found_among(store: Store, among: Candidates) -> set[int]:
    found = store.nearest(entry(0).place.vector, 99, among=among)
    return {int(one.path[-8:-4]) for one, _ in found}


def test_a_span_of_days_includes_both_and_leaves_out_photos_without_a_time(store: Store) -> None:
    times = (
        "2019-04-30T23:59:59",
        "2019-05-01T00:00:00+02:00",
        "2019-05-31T23:59:59.500000",
        "2019-06-01T00:00:00",
        None,
    )
    store.put([entry(n, exif=Exif(taken=taken)) for n, taken in enumerate(times, 1)])
    may = DateSpan(date(2019, 5, 1), date(2019, 5, 31))
    assert found_among(store, Candidates(dates=may)) == {2, 3}
    assert found_among(store, Candidates(dates=DateSpan(first=date(2019, 5, 31)))) == {3, 4}
    assert found_among(store, Candidates(dates=DateSpan(last=date(2019, 4, 30)))) == {1}
    assert found_among(store, Candidates(dates=DateSpan(last=date.max))) == {1, 2, 3, 4}
    assert store.undated() == 1


@pytest.mark.parametrize(
    ("heading_deg", "expected"),
    [(10.0, {1, 2, 5, 6}), (350.0, {1, 5, 6}), (120.0, {2, 3, 6}), (180.0, {3, 6})],
)
def test_photos_that_look_another_way_are_no_candidates(
    store: Store, heading_deg: float, expected: set[int]
) -> None:
    headings = (0.0, 65.0, 180.0, 250.0, 310.0, None)
    store.put([entry(n, exif=Exif(heading_deg=one)) for n, one in enumerate(headings, 1)])
    assert found_among(store, Candidates(heading_deg=heading_deg)) == expected
    assert found_among(store, Candidates()) == {1, 2, 3, 4, 5, 6}


def test_place_time_and_heading_are_asked_for_together(store: Store) -> None:
    near, far, day = (52.0, 4.0), (52.1, 4.0), "2019-05-01T10:00:00"
    notes = (
        Exif(gps=near, taken=day, heading_deg=5.0),
        Exif(gps=far, taken=day, heading_deg=5.0),
        Exif(gps=near, taken="2020-05-01T10:00:00", heading_deg=5.0),
        Exif(gps=near, taken=day, heading_deg=185.0),
    )
    store.put([entry(number, exif=exif) for number, exif in enumerate(notes, 1)])
    among = Candidates(
        nearby=Nearby(near, 50.0), dates=DateSpan(last=date(2019, 12, 31)), heading_deg=0.0
    )
    assert found_among(store, among) == {1}


def test_an_index_of_an_older_version_opens_and_grows_without_headings(
    address: str, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = [entry(1, exif=Exif(heading_deg=90.0)), entry(2, exif=Exif(heading_deg=270.0))]
    store.put(old)

    def former(length: int, about: dict[str, object]) -> pa.Schema:
        whole = schema_of(length, about)
        return whole.remove(whole.get_field_index(HEADING))

    monkeypatch.setattr(module, "schema_of", former)
    elsewhere = str(tmp_path / "former")
    Store.create(elsewhere, ABOUT, entry(0).place).put(old[:1])
    monkeypatch.undo()
    again = Store.open(elsewhere)
    again.put(old[1:])
    assert found_among(again, Candidates(heading_deg=90.0)) == {1, 2}
    assert found_among(store, Candidates(heading_deg=90.0)) == {1}
    assert again.reference.exif.heading_deg is None
    # What was matched without headings is not taken for what is matched with them.
    assert again.known() == store.known()
    assert again.state() != store.state() == Store.open(address).state()


def test_photos_are_taken_out_by_path_whatever_it_is_called(store: Store) -> None:
    odd = "/photos/it's; DROP TABLE places.jpg"
    store.put([entry(1), entry(2, path=odd), entry(3)])
    store.remove([odd, "/photos/not there.jpg"])
    assert set(store.known()) == {entry(1).path, entry(3).path}
    store.remove([])
    assert len(store) == 2


def test_folders_are_taken_out_with_all_below(store: Store) -> None:
    paths = ["/a/b/1.jpg", "/a/b/c/2.jpg", "/a/bc/3.jpg", "/a/4.jpg"]
    store.put([entry(number, path=path) for number, path in enumerate(paths)])
    assert store.remove_below(["/a/b", "/nowhere"]) == 2
    assert set(store.known()) == {"/a/bc/3.jpg", "/a/4.jpg"}


def test_past_a_size_searches_are_approximate_and_still_find(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "APPROXIMATE_FROM", 300)
    entries = [entry(number, gps=(1.0, number / 1000)) for number in range(1, 401)]
    store.put(entries[:290])
    store.tidy()
    assert not store.approximate
    store.put(entries[290:])
    store.tidy()
    assert store.approximate
    store.put([entry(401, gps=(1.0, 0.401))])  # added later: not in the approximate index yet
    hits = [
        store.nearest(one.place.vector, 1)[0][0].path == one.path
        for one in (*entries[::20], entry(401))
    ]
    assert np.mean(hits) > 0.9
    nearby = Candidates(nearby=Nearby((1.0, 0.401), 500.0))
    assert {one.path for one, _ in store.nearest(entries[0].place.vector, 99, among=nearby)} == {
        entry(number).path for number in range(397, 402)
    }


def test_a_rebuild_removes_what_is_there_twice(store: Store, tmp_path: Path) -> None:
    there = tmp_path / "there.jpg"
    there.touch()
    first, second = entry(1), entry(2)
    for double in (
        [first, second],
        [replace(first, path=str(there))],  # the same bytes, where they lie now
        [replace(second, digest="another")],  # the same path
    ):
        # As two processes of an older version wrote, which did not lock.
        store._table.add(to_rows(double, store._table.schema))
    assert len(store) == 4
    assert store.heal() == {str(there): first.digest, second.path: second.digest}
    assert len(store) == 2
    assert store.known() == store.heal()


def read_all(address: str) -> None:
    again = Store.open(address)
    assert again.reference
    again.nearest(entry(1).place.vector, 1)


@pytest.mark.parametrize("table", ["places", "reference"])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_damaged_index_is_one_line(store: Store, address: str, table: str, share: float) -> None:
    store.put([entry(1)])
    for path in (Path(address) / f"{table}.lance" / "data").iterdir():
        content = path.read_bytes()
        path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(
        DatasetError, match=r"^cannot read the place index .*; build it again in another folder$"
    ) as caught:
        read_all(address)
    assert "\n" not in str(caught.value)


def test_an_empty_index_finds_nothing(store: Store) -> None:
    assert store.nearest(entry(1).place.vector, 5) == []
    assert store.known() == {}
    store.tidy()
    assert len(store) == 0


def test_a_folder_without_index_is_refused_and_left_alone(tmp_path: Path) -> None:
    assert not is_index(str(tmp_path / "none"))
    with pytest.raises(DatasetError, match="none is no place index; make one: zeroscd index build"):
        Store.open(str(tmp_path / "none"))
    assert list(tmp_path.iterdir()) == []


def test_an_index_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(
        OutputError, match=r"^cannot write the place index .*file/places: "
    ) as caught:
        Store.create(str(tmp_path / "file" / "places"), ABOUT, entry(0).place)
    assert "\n" not in str(caught.value)


def test_without_lancedb_one_learns_what_to_install(
    address: str, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda _: None)
    with pytest.raises(SettingsError, match=r"pip install 'zeroscd\[places\]'"):
        Store.open(address)


def test_a_creation_that_was_cut_short_is_made_again(address: str, store: Store) -> None:
    (Path(address) / "places.lance").rename(Path(address).parent / "gone")
    assert not is_index(address)
    again = Store.create(address, {"format": 2}, entry(3).place)
    assert again.about == {"format": 2}
    np.testing.assert_allclose(again.reference.vector, entry(3).place.vector, atol=1e-3)


def test_making_an_index_says_nothing_on_the_terminal(
    address: str, capfd: pytest.CaptureFixture[str]
) -> None:
    made = Store.create(address, ABOUT, entry(0).place)
    made.put([entry(1)])
    made.tidy()
    made.nearest(entry(1).place.vector, 1)
    assert capfd.readouterr() == ("", "")


def test_a_failure_deep_in_the_index_is_told_without_the_place_in_lancedbs_source(
    store: Store, address: str
) -> None:
    (Path(address) / "places.lance" / "data").write_text("in the way")
    with pytest.raises(OutputError, match=r"^cannot write the place index .*places: ") as caught:
        store.put([entry(1)])
    assert ".rs" not in str(caught.value)
