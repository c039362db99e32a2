from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Barrier
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.errors import DatasetError, ImageError, SettingsError
from zeroscd.images.exif import Exif
from zeroscd.retrieval import Nearby, PlaceIndex
from zeroscd.retrieval import build as module
from zeroscd.retrieval.index import RECOGNISED
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from zeroscd.arrays import Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.records import FeatureMap

pytest.importorskip("lancedb")


@pytest.fixture
def index(tmp_path: Path, toy_encoder: PatchEncoder) -> PlaceIndex:
    return PlaceIndex.create(tmp_path / "places", encoder=toy_encoder)


@pytest.fixture
def reopen(tmp_path: Path) -> Callable[..., PlaceIndex]:
    def again(encoder: PatchEncoder, settings: Settings | None = None) -> PlaceIndex:
        return PlaceIndex.open(tmp_path / "places", encoder=encoder, settings=settings)

    return again


def test_a_place_seen_again_from_the_side_is_found_among_others(
    index: PlaceIndex, save_wall: Callable[..., Path]
) -> None:
    old = [save_wall(f"{seed}.png", seed) for seed in range(8)]
    index.add(old)
    found = index.query(save_wall("new.png", 5, shift_px=48), 3)
    assert found[0].path == str(old[5])
    assert found[0].score > 0.3 > RECOGNISED
    assert all(match.score < 0.1 for match in found[1:])
    assert len(found) == 3


def test_patches_put_right_what_whole_photos_get_wrong(
    index: PlaceIndex, save_wall: Callable[..., Path], place_of: Callable[..., Any]
) -> None:
    index.add([save_wall(f"{seed}.png", seed) for seed in range(4)])
    place = replace(place_of(2), vector=place_of(3).vector)  # a misleading first impression
    first = index.find(place, 1, rerank=False)
    assert first[0].path.endswith("3.png")
    assert first[0].score == 0
    (best,) = index.find(place, 1)
    assert best.path.endswith("2.png")
    assert best.score == pytest.approx(1.0)


def test_building_again_adds_only_what_is_new_or_changed(
    index: PlaceIndex, save_wall: Callable[..., Path]
) -> None:
    paths = [save_wall(f"{seed}.png", seed) for seed in range(3)]
    first = index.add(paths[:2])
    assert (first.new, first.changed, first.same) == (2, 0, 0)
    save_wall("1.png", 99)
    second = index.add(paths)
    assert (second.new, second.changed, second.same) == (1, 1, 1)
    assert len(index) == 3
    (match,) = index.query(save_wall("new.png", 99, shift_px=32), 1)
    assert match.path == str(paths[1])
    assert all(match.score < 0.1 for match in index.query(save_wall("new.png", 1), 3))


def test_a_broken_photo_is_told_and_the_others_are_added(
    index: PlaceIndex, save_wall: Callable[..., Path]
) -> None:
    good, bad = save_wall("good.png", 1), save_wall("bad.png", 2)
    bad.write_bytes(bad.read_bytes()[:100])
    missing = good.with_name("missing.png")
    done = index.add([bad, missing, good])
    assert done.new == 1
    assert set(done.failed) == {str(bad), str(missing)}
    assert "does not exist" in done.failed[str(missing)]
    assert len(index) == 1


def test_a_photo_given_twice_is_there_once(
    index: PlaceIndex, save_wall: Callable[..., Path]
) -> None:
    path = save_wall("1.png", 1)
    assert index.add([path, str(path)]).new == 1
    assert len(index) == 1


def test_a_folder_that_moved_keeps_its_descriptors(
    index: PlaceIndex, save_wall: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    old = [save_wall(f"{seed}.png", seed) for seed in range(3)]
    index.add(old)
    moved = old[0].parent.rename(old[0].parent.with_name("moved"))
    monkeypatch.setattr("zeroscd.retrieval.index.describe", None)  # nothing is described again
    done = index.add(sorted(moved.iterdir()))
    assert (done.new, done.changed, done.moved, done.same) == (0, 0, 3, 0)
    assert len(index) == 3
    monkeypatch.undo()
    found = index.query(moved / "1.png", 3)
    assert {Path(match.path).parent for match in found} == {moved}
    assert found[0].path == str(moved / "1.png")
    assert found[0].score == pytest.approx(1.0)
    done = index.add(sorted(moved.iterdir()))
    assert (done.moved, done.same) == (0, 3)


def test_a_copy_of_a_photo_is_the_same_photo(
    index: PlaceIndex, save_wall: Callable[..., Path]
) -> None:
    original = save_wall("a.png", 1)
    copy = original.with_name("0 copy.png")
    copy.write_bytes(original.read_bytes())
    done = index.add([original, copy])
    assert (done.new, done.same) == (1, 1)
    save_wall("a.png", 2)  # the bytes that the index has are now the copy's alone
    done = index.add([copy, original])
    assert (done.new, done.changed) == (1, 1)
    assert [match.path for match in index.query(copy, 2)] == [str(copy), str(original)]


def test_two_processes_do_not_store_a_photo_twice(
    index: PlaceIndex,
    save_wall: Callable[..., Path],
    toy_encoder: PatchEncoder,
    reopen: Callable[..., PlaceIndex],
) -> None:
    paths = [save_wall(f"{seed}.png", seed) for seed in range(3)]
    other = reopen(toy_encoder)

    class Meanwhile:
        """Another process adds everything when the first photo has been described."""

        def begin(self, total: int) -> None:
            assert total == 3

        def advance(self, stem: str, *, reused: bool) -> None:
            if stem == "0.png":
                assert not reused
                assert other.add(paths).new == 3

    done = index.add(paths, progress=Meanwhile())
    assert (done.new, done.same) == (0, 3)
    assert len(index) == len(reopen(toy_encoder)) == 3


def test_writers_at_the_same_time_store_every_photo_once(
    index: PlaceIndex,
    save_wall: Callable[..., Path],
    toy_encoder: PatchEncoder,
    reopen: Callable[..., PlaceIndex],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "BATCH", 2)
    paths = [save_wall(f"{seed}.png", seed) for seed in range(7)]
    start, writers = Barrier(3), [reopen(toy_encoder) for _ in range(3)]

    def add(writer: PlaceIndex) -> int:
        start.wait()
        return writer.add(paths).new

    with ThreadPoolExecutor(3) as pool:
        assert sum(pool.map(add, writers)) == 7
    assert len(reopen(toy_encoder)) == 7


def test_a_stopped_build_keeps_what_was_written(
    index: PlaceIndex, save_wall: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "BATCH", 2)
    paths = [save_wall(f"{seed}.png", seed) for seed in range(5)]

    class Impatient:
        def begin(self, total: int) -> None:
            assert total == 5

        def advance(self, stem: str, *, reused: bool) -> None:
            if stem == "4.png":
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        index.add(paths, progress=Impatient())
    assert len(index) == 4
    assert index.add(paths).same == 4
    assert len(index) == 5


def test_a_radius_excludes_the_same_view_elsewhere(
    index: PlaceIndex, save_wall: Callable[..., Path]
) -> None:
    near = save_wall("near.png", 1, shift_px=64, gps=(52.0, 0.0))
    far = save_wall("far.png", 1, gps=(53.0, 0.0))
    index.add([near, far, save_wall("unknown.png", 1)])
    new = save_wall("new.png", 1, gps=(52.0, 0.0))
    assert {match.path for match in index.query(new)} >= {str(far)}
    (match,) = index.query(new, nearby=Nearby((52.0, 0.0), 30.0))
    assert match.path == str(near)
    assert match.metres == pytest.approx(0.0)
    assert match.exif.gps == (52.0, 0.0)


def test_a_position_given_by_hand_replaces_that_of_the_file(
    index: PlaceIndex, save_wall: Callable[..., Path]
) -> None:
    path = save_wall("new.png", 1, gps=(52.0, 0.0))
    assert index.describe(path).exif.gps == (52.0, 0.0)
    assert index.describe(path, exif=Exif(gps=(1.0, 2.0))).exif.gps == (1.0, 2.0)


def test_an_unreadable_query_is_an_image_error(index: PlaceIndex, tmp_path: Path) -> None:
    with pytest.raises(ImageError, match="does not exist"):
        index.query(tmp_path / "none.jpg")


def test_an_index_remembers_how_it_was_made(
    tmp_path: Path, toy_encoder: PatchEncoder, reopen: Callable[..., PlaceIndex]
) -> None:
    settings = Settings(encoder="lite", side_px=320)
    PlaceIndex.create(tmp_path / "places", encoder=toy_encoder, settings=settings)
    again = reopen(toy_encoder)
    assert again.settings == settings
    info = again.info()
    assert info["photos"] == 0
    assert info["search"] == "exact"
    assert info["settings"] == {
        "encoder": "lite", "side_px": 320, "layer": None, "precision": "auto"
    }  # fmt: skip
    assert "torch" in info["versions"]
    with pytest.raises(SettingsError, match="built with side_px 320, not 672; ask with --set"):
        reopen(toy_encoder, Settings())
    with pytest.raises(SettingsError, match="built with encoder lite, not dinov2-b"):
        reopen(toy_encoder, Settings(encoder="dinov2-b", side_px=320))
    other = settings.override({"tau": 0.5, "segmenter": "sam-vit-b"})  # of no concern to places
    assert len(reopen(toy_encoder, other)) == 0


def test_an_index_is_not_made_twice(
    index: PlaceIndex, tmp_path: Path, toy_encoder: PatchEncoder
) -> None:
    with pytest.raises(DatasetError, match="is a place index already"):
        PlaceIndex.create(tmp_path / "places", encoder=toy_encoder)


@dataclass(frozen=True)
class Drifted:
    """The toy encoder after a change of code: descriptors rotated in their space, or replaced."""

    inner: PatchEncoder
    seed: int
    name: str = "toy"
    tau: float = 0.65

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        return [
            tuple(replace(one, descriptors=self._turned(one.descriptors)) for one in maps)
            for maps in self.inner.encode(photos)
        ]

    def _turned(self, descriptors: np.ndarray) -> np.ndarray:
        rng = np.random.default_rng(self.seed)
        basis, _ = np.linalg.qr(rng.normal(size=(descriptors.shape[-1],) * 2))
        return np.asarray(descriptors @ basis, dtype=np.float32)


def test_code_that_describes_photos_in_another_way_is_refused(
    index: PlaceIndex, toy_encoder: PatchEncoder, reopen: Callable[..., PlaceIndex]
) -> None:
    with pytest.raises(SettingsError, match="describes photos in another way than this one's"):
        reopen(Drifted(toy_encoder, seed=1))
    assert len(reopen(toy_encoder)) == 0


def test_an_index_of_another_format_is_refused(
    index: PlaceIndex,
    toy_encoder: PatchEncoder,
    reopen: Callable[..., PlaceIndex],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("zeroscd.retrieval.compatibility.FORMAT", 2)
    with pytest.raises(SettingsError, match="has format 1, this version reads 2"):
        reopen(toy_encoder)


@dataclass(frozen=True)
class Trained:
    """An encoder whose checkpoint has a head for places."""

    inner: PatchEncoder
    vector: np.ndarray | None
    name: str = "toy"
    tau: float = 0.65

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        return self.inner.encode(photos)

    def places(self, photos: Sequence[Rgb]) -> np.ndarray | None:
        return None if self.vector is None else np.tile(self.vector, (len(photos), 1))


def test_a_head_trained_for_places_is_preferred_to_pooling(
    tmp_path: Path, toy_encoder: PatchEncoder, wall: Callable[..., Rgb]
) -> None:
    vector = np.array([0.6, 0.8, 0.0], np.float32)
    trained = PlaceIndex.create(tmp_path / "a", encoder=Trained(toy_encoder, vector))
    np.testing.assert_array_equal(trained.describe(wall(1)).vector, vector)
    headless = PlaceIndex.create(tmp_path / "b", encoder=Trained(toy_encoder, None))
    plain = PlaceIndex.create(tmp_path / "c", encoder=toy_encoder)
    np.testing.assert_array_equal(headless.describe(wall(1)).vector, plain.describe(wall(1)).vector)


def test_a_photo_that_looks_the_other_way_is_no_candidate(
    index: PlaceIndex, save_wall: Callable[..., Path]
) -> None:
    index.add([save_wall("there.png", 5, heading_deg=200.0), save_wall("back.png", 6)])
    new = save_wall("new.png", 5, shift_px=16, heading_deg=20.0)
    assert [Path(match.path).name for match in index.query(new)] == ["back.png"]
    along = save_wall("along.png", 5, shift_px=16, heading_deg=230.0)
    assert Path(index.query(along)[0].path).name == "there.png"
    assert index.query(along)[0].exif.heading_deg == 200.0


def test_a_match_says_where_the_corners_of_the_new_photo_lie(
    index: PlaceIndex, save_wall: Callable[..., Path]
) -> None:
    index.add([save_wall("old.png", 5)])
    (match,) = index.query(save_wall("new.png", 5, shift_px=64))  # a quarter of the width
    corners = [(0.25, 0.0), (1.25, 0.0), (1.25, 1.0), (0.25, 1.0)]
    assert match.corners is not None
    np.testing.assert_allclose(np.array(match.corners), np.array(corners), atol=0.01)
