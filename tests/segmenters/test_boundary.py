from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch

from zeroscd.encoders.lite import load as load_encoder
from zeroscd.errors import WeightsError
from zeroscd.images.grid import PatchGrid
from zeroscd.images.resizing import resize, working_size
from zeroscd.records import FeatureMap
from zeroscd.segmenters import boundary
from zeroscd.segmenters.boundary import (
    LEVEL_STRIDES_PX,
    LEVELS,
    BoundaryHead,
    boundary_map,
    levels_of,
    load_head,
)
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from pathlib import Path

WORKING_HW = (64, 96)


def feature_map(source: str, channels: int, seed: int = 0) -> FeatureMap:
    stride = LEVEL_STRIDES_PX.get(source, 32)
    size_hw = (WORKING_HW[0] // stride, WORKING_HW[1] // stride)
    raw = np.random.default_rng(seed).normal(size=(*size_hw, channels)).astype(np.float32)
    return FeatureMap(
        descriptors=raw / np.linalg.norm(raw, axis=2, keepdims=True),
        grid=PatchGrid.covering(WORKING_HW, size_hw=size_hw),
        source=source,
    )


def feature_maps() -> tuple[FeatureMap, ...]:
    known = tuple(feature_map(source, channels) for source, channels in LEVELS.items())
    return (feature_map("lite.19", 208), *known)


def photo(level: int = 90) -> np.ndarray:
    pixels = np.full((*WORKING_HW, 3), level, dtype=np.uint8)
    pixels[:, 48:] = 200
    return pixels


def test_every_second_pixel_gets_a_probability() -> None:
    strengths = boundary_map(load_head(), photo(), feature_maps())
    assert strengths.shape == (WORKING_HW[0] // 2, WORKING_HW[1] // 2)
    assert 0 <= strengths.min() < strengths.max() <= 1


def test_the_rim_of_a_thing_is_a_likelier_border_than_its_inside() -> None:
    rows, cols = np.indices((192, 256))
    from_rim_px = np.hypot(rows - 96, cols - 128) - 50
    seen = np.where(from_rim_px[..., None] < 0, (190, 40, 40), (120, 130, 140)).astype(np.uint8)
    encoder = load_encoder(Settings(side_px=222), "cpu")
    assert working_size((192, 256), side_px=222, multiple=32) == (192, 256)
    (maps,) = encoder.encode([seen])
    strengths = boundary_map(load_head(), resize(seen, (192, 256)), maps)
    from_rim_px = from_rim_px[::2, ::2]
    rim, inside = np.abs(from_rim_px) < 2, from_rim_px < -16
    assert strengths[rim].mean() > 0.4
    assert strengths[rim].mean() > 4 * strengths[inside].mean()


@pytest.mark.parametrize("band_rows", [2, 6, 20])
def test_bands_give_what_the_whole_photo_gives(
    band_rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (*WORKING_HW, 3), dtype=np.uint8)
    monkeypatch.setattr(boundary, "BAND_ROWS", WORKING_HW[0])
    whole = boundary_map(load_head(), noise, feature_maps())
    monkeypatch.setattr(boundary, "BAND_ROWS", band_rows)
    banded = boundary_map(load_head(), noise, feature_maps())
    # Single precision; a row without its neighbours would be off by hundredths.
    np.testing.assert_allclose(banded, whole, atol=1e-6)


def test_the_depths_are_found_by_name_not_by_order() -> None:
    maps = feature_maps()
    forth, back = levels_of(maps), levels_of(maps[::-1])
    assert [level.shape[1] for level in forth] == list(LEVELS.values())
    assert all(torch.equal(a, b) for a, b in zip(forth, back, strict=True))


@pytest.mark.parametrize("doublings", [1, 2, 4])
def test_a_cell_grows_to_the_place_it_looks_at(doublings: int) -> None:
    rows, cols, factor = 3, 4, 2**doublings
    values = np.random.default_rng(0).random((1, 1, rows, cols)).astype(np.float32)
    grown = torch.from_numpy(values)
    for _ in range(doublings):
        grown = boundary.upsample(grown, (2 * grown.shape[2], 2 * grown.shape[3]))
    assert grown.shape[-2:] == (rows * factor, cols * factor)
    np.testing.assert_allclose(grown[0, 0, ::factor, ::factor].numpy(), values[0, 0], atol=1e-6)
    # Between two cells it goes straight from one to the other; beyond the last, the last.
    row = np.interp(np.arange(cols * factor) / factor, np.arange(cols), values[0, 0, 0])
    np.testing.assert_allclose(grown[0, 0, 0].numpy(), row, atol=1e-6)


def test_the_same_photo_gives_the_same_borders() -> None:
    head, maps = load_head(), feature_maps()
    np.testing.assert_array_equal(
        boundary_map(head, photo(), maps), boundary_map(head, photo(), maps)
    )


def damaged(kind: str, state: dict[str, Any]) -> dict[str, Any]:
    changed = dict(state)
    tensor = changed.pop("mix.weight")
    if kind == "renamed":
        changed["mixture.weight"] = tensor
    if kind == "reshaped":
        changed["mix.weight"] = tensor[:-1].contiguous()
    return changed


@pytest.mark.parametrize("kind", ["removed", "renamed", "reshaped"])
def test_weights_that_do_not_fit_are_refused_and_the_cause_names_the_key(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, kind: str
) -> None:
    from safetensors.torch import save_file

    save_file(damaged(kind, BoundaryHead().state_dict()), tmp_path / boundary.WEIGHTS_FILE)
    monkeypatch.setattr("importlib.resources.files", lambda package: tmp_path)
    with pytest.raises(WeightsError, match=r"force-reinstall --no-deps \.$") as refusal:
        load_head()
    assert "mix.weight" in str(refusal.value.__cause__)


@pytest.mark.parametrize("content", [b"", b"no weights", b"\x08\0\0\0\0\0\0\0{}      "])
def test_a_damaged_or_absent_file_is_one_line_that_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, content: bytes
) -> None:
    if content:
        (tmp_path / boundary.WEIGHTS_FILE).write_bytes(content)
    monkeypatch.setattr("importlib.resources.files", lambda package: tmp_path)
    with pytest.raises(WeightsError, match="pip install") as refusal:
        load_head()
    assert "\n" not in str(refusal.value)
