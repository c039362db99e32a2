"""What `benchmarks/places.py` counts, by hand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.images.exif import Exif, read_exif

pytest.importorskip("lancedb")

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType


@pytest.fixture(scope="module")
def places(load_script: Callable[[str], ModuleType], robustness: ModuleType) -> ModuleType:
    assert robustness.__name__ == "robustness"  # places.py imports it
    return load_script("places")


def matches(*paths: str, scores: tuple[float, ...] = ()) -> list[Any]:
    from zeroscd.retrieval.index import PlaceMatch

    padded = (*scores, *([0.0] * len(paths)))
    return [
        PlaceMatch(path=path, score=score, inliers=0, similarity=0.0, metres=None, exif=Exif())
        for path, score in zip(paths, padded, strict=False)
    ]


PHOTOS = [Path(f"/p/{name}.jpg") for name in ("A_1", "A_2", "A_3", "A_4", "B_1", "B_2")]
A1, A2, A3, A4, B1, B2 = map(str, PHOTOS)


def test_recall_counts_the_very_frame_and_neighbours_of_its_drive(places: ModuleType) -> None:
    found = [
        matches(A1, A2),  # right at once
        matches(B1, A2),  # right as second
        matches(A1, B1),  # two frames beside
        matches(A1, B1),  # three frames beside
        matches(A4, A3),  # next in the list, but of another drive
        matches(),
    ]
    assert places.recalls(PHOTOS, found) == {
        "recall@1": pytest.approx(1 / 6),
        "recall@5": pytest.approx(2 / 6),
        "recall@20": pytest.approx(2 / 6),
        "recall@1 within 2 frames": pytest.approx(2 / 6),
        "recall@5 within 2 frames": pytest.approx(3 / 6),
    }


def test_recognition_sets_right_photos_against_the_best_of_other_drives(
    places: ModuleType,
) -> None:
    least = places.RECOGNISED
    found = [
        matches(A1, B1, B2, scores=(2 * least, 0.5 * least, 3 * least)),
        matches(A2, A1, scores=(0.5 * least, 9 * least)),
    ]
    figures = places.recognition(PHOTOS[:2], found)
    assert figures["right photos recognised"] == 0.5
    assert figures["queries with candidates of another drive"] == 1
    assert figures["best of another drive recognised"] == 1.0
    assert figures["best of another drive, highest score"] == pytest.approx(3 * least)


def test_a_photo_seen_again_looks_other_and_is_the_same_every_time(places: ModuleType) -> None:
    photo = np.random.default_rng(0).integers(0, 256, (96, 128, 3)).astype(np.uint8)
    seen = places.reseen(photo, "elm")
    assert seen.shape == photo.shape
    assert np.abs(seen.astype(float) - photo).mean() > 20
    np.testing.assert_array_equal(seen, places.reseen(photo, "elm"))
    assert np.abs(seen.astype(float) - places.reseen(photo, "oak")).mean() > 5


def test_made_up_places_and_times_are_in_the_file(places: ModuleType, tmp_path: Path) -> None:
    photo = np.zeros((32, 32, 3), np.uint8)
    here = read_exif(places.noted(photo, tmp_path / "a.jpg", 61, 2019))
    next_one = read_exif(places.noted(photo, tmp_path / "b.jpg", 62, 2019))
    assert here.taken == "2019-05-01T10:01:01"
    assert here.gps is not None
    assert next_one.gps is not None
    metres = (next_one.gps[1] - here.gps[1]) * 111_195 * np.cos(np.radians(52.2))
    assert metres == pytest.approx(places.STEP_M, rel=1e-3)
