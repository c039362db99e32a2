"""Which bands are shown, and how their values become bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.errors import ImageError, SettingsError
from zeroscd.geo.bands import Rendering, parse_bands, parse_stretch, rendering

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

rasterio = pytest.importorskip("rasterio")
from rasterio.enums import ColorInterp as Colour  # noqa: E402 - where it is installed

GREYS = np.arange(64 * 64, dtype=np.uint16).reshape(64, 64)
RGBN = [Colour.blue, Colour.green, Colour.red, Colour.undefined]


def shown(path: Path, **options: Any) -> Rendering:
    with rasterio.open(path) as raster:
        chosen = {"bands": None, "stretch": "auto", "name": "a.tif", **options}
        return rendering(raster, **chosen)


@pytest.mark.parametrize(
    ("count", "colours", "bands"),
    [
        (4, RGBN, (3, 2, 1)),
        (4, [Colour.undefined] * 4, (1, 2, 3)),
        (8, [Colour.undefined] * 8, (1, 2, 3)),
        (2, [Colour.gray, Colour.alpha], (1,)),
        (2, [Colour.undefined, Colour.undefined], (1,)),
        (1, [Colour.gray], (1,)),
    ],
)
def test_the_bands_are_those_that_a_file_calls_colours_else_the_first(
    count: int, colours: list[Any], bands: tuple[int, ...], tmp_path: Path, write_raster: Any
) -> None:
    pixels = np.zeros((40, 40, count), np.uint8)
    path = write_raster(tmp_path / "a.tif", pixels, colours=colours, photometric="MINISBLACK")
    assert shown(path) == Rendering(bands, None)
    assert shown(path, bands=(1,)) == Rendering((1,), None)


def test_bytes_stay_as_they_are_and_one_band_is_grey() -> None:
    photo = Rendering((1,), None).apply(np.array([[[0, 7, 255]]], np.uint8))
    assert photo.tolist() == [[[0, 0, 0], [7, 7, 7], [255, 255, 255]]]


def test_a_range_is_stretched_linearly_and_cut_at_its_ends() -> None:
    values = np.array([[[100, 150, 200, 50, 300]]], np.int32)
    photo = Rendering((1,), ((100.0, 200.0),)).apply(values)
    assert photo[0, :, 0].tolist() == [0, 128, 255, 0, 255]


def test_each_band_has_a_range_of_its_own() -> None:
    values = np.full((3, 1, 1), 50.0, np.float32)
    photo = Rendering((1, 2, 3), ((0.0, 100.0), (50.0, 60.0), (0.0, 50.0))).apply(values)
    assert photo.tolist() == [[[128, 0, 255]]]


def test_sixteen_bits_are_stretched_between_percentiles_of_what_holds_data(
    tmp_path: Path, write_raster: Callable[..., Path]
) -> None:
    values = GREYS.copy()
    values[:32] = 65535  # no data
    path = write_raster(tmp_path / "a.tif", values, nodata=65535)
    ((low, high),) = shown(path).ranges or ()
    assert (low, high) == tuple(np.percentile(values[32:], (2, 98)))
    assert shown(path, stretch=(0.0, 9.0)).ranges == ((0.0, 9.0),)
    with pytest.raises(SettingsError, match=r"a\.tif holds uint16, not bytes; choose another"):
        shown(path, stretch="none")


def test_bytes_are_stretched_if_wanted(tmp_path: Path, write_raster: Callable[..., Path]) -> None:
    path = write_raster(tmp_path / "a.tif", GREYS.astype(np.uint8))
    assert shown(path).ranges is None
    ((low, high),) = shown(path, stretch="percentile").ranges or ()
    assert 0 < low < 10
    assert 245 < high < 255


@pytest.mark.parametrize("fill", [np.nan, 5.0])
def test_a_raster_without_data_or_contrast_is_no_division_by_zero(
    fill: float, tmp_path: Path, write_raster: Callable[..., Path]
) -> None:
    path = write_raster(tmp_path / "a.tif", np.full((40, 40), fill, np.float32))
    photo = shown(path).apply(np.full((1, 2, 2), fill, np.float32))
    assert photo.shape == (2, 2, 3)


def test_a_band_that_is_not_there_a_palette_and_complex_numbers_are_refused(
    tmp_path: Path, write_raster: Callable[..., Path]
) -> None:
    path = write_raster(tmp_path / "a.tif", np.zeros((40, 40), np.uint8))
    with pytest.raises(SettingsError, match=r"a\.tif has no band 4; choose from 1 to 1"):
        shown(path, bands=(4, 3, 2))
    path = write_raster(tmp_path / "b.tif", np.zeros((40, 40), np.complex64))
    with pytest.raises(ImageError, match="complex numbers"):
        shown(path)
    path = write_raster(tmp_path / "c.tif", np.zeros((40, 40), np.uint8), photometric="PALETTE")
    with pytest.raises(ImageError, match="has a palette; expand it"):
        shown(path)


@pytest.mark.parametrize("text", ["", "1,2", "0.5", "-1", "1,2,3,4", "red"])
def test_bands_are_one_or_three_numbers(text: str) -> None:
    with pytest.raises(SettingsError, match="one or three numbers from 1"):
        parse_bands(text)


@pytest.mark.parametrize("text", ["", "max", "5", "3,3", "9,1", "0,inf", "nan,1", "1,2,3"])
def test_a_stretch_is_a_word_or_two_rising_numbers(text: str) -> None:
    with pytest.raises(SettingsError, match="two rising numbers such as 0,3000"):
        parse_stretch(text)
