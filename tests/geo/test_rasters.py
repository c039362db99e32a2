"""Two rasters in the pixels of the first, whatever the second looks like."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.errors import ImageError
from zeroscd.geo.rasters import RasterOptions, filled, open_pair
from zeroscd.geo.tiling import Box

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.arrays import Mask, Rgb

rasterio = pytest.importorskip("rasterio")
from rasterio.enums import ColorInterp as Colour  # noqa: E402 - where it is installed
from rasterio.errors import NotGeoreferencedWarning  # noqa: E402
from rasterio.transform import Affine, from_origin  # noqa: E402

OWN = from_origin(500_000, 5_400_000, 0.5, 0.5)


def read(before: Path, after: Path, **options: Any) -> tuple[Box, list[tuple[Rgb, Mask]]]:
    """Return the area of a pair and both photos of all of the raster before."""
    with open_pair(before, after, RasterOptions(**options)) as pair, pair.reading() as readers:
        height, width = pair.grid.size_hw
        return pair.area, [reader.read(Box(0, 0, width, height)) for reader in readers]


def texture(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(0).integers(1, 255, (height, width, 3)).astype(np.uint8)


def test_pixels_of_one_grid_keep_their_values(tmp_path: Path, write_raster: Any) -> None:
    """The raster after begins 20 columns to the right and 5 rows below."""
    pixels = texture(100, 120)
    before = write_raster(tmp_path / "a.tif", pixels)
    after = write_raster(
        tmp_path / "b.tif", pixels[5:, 20:], transform=OWN * Affine.translation(20, 5)
    )
    area, ((one, valid_t0), (other, valid_t1)) = read(before, after)
    assert area == Box(20, 5, 120, 100)
    assert np.array_equal(one, pixels)
    assert valid_t0.all()
    assert np.array_equal(other[5:, 20:], pixels[5:, 20:])
    assert valid_t1[5:, 20:].all()
    assert valid_t1.sum() == 95 * 100


def gradient(transform: Any, size_hw: tuple[int, int], scale: float) -> np.ndarray:
    """Paint map coordinates: red grows to the east and green to the north."""
    rows, cols = np.mgrid[: size_hw[0], : size_hw[1]] + 0.5
    x, y = transform * (cols, rows)
    red, green = (x - OWN.c) * scale, (y - OWN.f) * scale
    return np.stack([120 + red, 240 + green, np.full(size_hw, 9)], axis=2).clip(0, 255)


@pytest.mark.parametrize(
    "transform",
    [
        OWN * Affine.scale(2),
        OWN * Affine.scale(0.4),
        OWN * Affine.translation(20, -20) * Affine.rotation(30),
        OWN * Affine.translation(3.5, 0.25),
    ],
    ids=["coarser", "finer", "rotated", "half a pixel off"],
)
def test_a_raster_on_another_grid_is_read_where_the_map_says(
    transform: Any, tmp_path: Path, write_raster: Any
) -> None:
    """A gradient over the map looks the same on any grid, but for rounding to bytes."""
    size_hw = (300, 300)
    before = write_raster(tmp_path / "a.tif", gradient(OWN, (200, 200), 0.9).astype(np.uint8))
    pixels = gradient(transform, size_hw, 0.9).astype(np.uint8)
    after = write_raster(tmp_path / "b.tif", pixels, transform=transform)
    _, ((one, _), (other, valid)) = read(before, after)
    inner = np.zeros_like(valid)
    inner[20:100, 60:100] = True
    inner &= valid
    assert inner.sum() > 1000
    assert np.abs(one[inner].astype(int) - other[inner]).max() <= 2


def test_a_rotated_grid_of_the_raster_before_is_kept(tmp_path: Path, write_raster: Any) -> None:
    rotated = OWN * Affine.rotation(-25)
    before = write_raster(
        tmp_path / "a.tif", gradient(rotated, (120, 120), 1.5).astype(np.uint8), transform=rotated
    )
    after = write_raster(tmp_path / "b.tif", gradient(OWN, (200, 300), 1.5).astype(np.uint8))
    area, ((one, _), (other, valid)) = read(before, after)
    assert area == Box(0, 0, 120, 120)
    rim = 2
    both = valid[rim:-rim, rim:-rim]
    assert 3000 < both.sum() < both.size
    off = np.abs(one.astype(int) - other)[rim:-rim, rim:-rim][both]
    assert np.quantile(off, 0.99) <= 2


def test_a_raster_in_another_crs_is_read_where_the_map_says(
    tmp_path: Path, write_raster: Any
) -> None:
    before = write_raster(tmp_path / "a.tif", gradient(OWN, (200, 200), 0.9).astype(np.uint8))
    target = tmp_path / "b.tif"
    with (
        rasterio.open(before) as source,
        rasterio.vrt.WarpedVRT(source, crs="EPSG:3857", add_alpha=True) as warped,
        rasterio.open(target, "w", **{**warped.profile, "driver": "GTiff"}) as raster,
    ):
        raster.write(warped.read())
    area, ((one, _), (other, valid)) = read(before, target)
    assert area == Box(0, 0, 200, 200)
    assert valid[3:-3, 3:-3].all()
    off = np.abs(one[3:-3, 3:-3].astype(int) - other[3:-3, 3:-3])
    assert off.max() <= 2  # a level is a pixel here: nearest pixels, twice


@pytest.mark.parametrize("way", ["nodata", "alpha", "nan", "mask"])
def test_what_holds_no_data_is_said_whatever_the_file_says_it_with(
    way: str, tmp_path: Path, write_raster: Any
) -> None:
    pixels: np.ndarray = texture(60, 80)
    profile: dict[str, Any] = {}
    if way == "nodata":
        pixels[:10], profile = 0, {"nodata": 0}
    if way == "nan":
        pixels = pixels.astype(np.float32)
        pixels[:10], profile = np.nan, {"nodata": np.nan}
    if way == "alpha":
        alpha = np.full((60, 80, 1), 255, np.uint8)
        alpha[:10] = 0
        pixels = np.concatenate([pixels, alpha], axis=2)
        colours = [Colour.red, Colour.green, Colour.blue, Colour.alpha]
        profile = {"photometric": "RGB", "colours": colours}
    after = write_raster(tmp_path / "b.tif", pixels, **profile)
    if way == "mask":
        with rasterio.open(after, "r+") as raster:
            raster.write_mask(np.repeat(np.array([0] * 10 + [255] * 50, np.uint8)[:, None], 80, 1))
    before = write_raster(tmp_path / "a.tif", texture(60, 80))
    for pair, at in ((before, after), 1), ((after, before), 0):
        _, sides = read(*pair)
        valid = sides[at][1]
        assert not valid[:10].any()
        assert valid[10:].all()
        assert sides[1 - at][1].all()


def test_what_one_does_not_show_is_filled_with_the_other() -> None:
    photos = np.full((1, 4, 3), 10, np.uint8), np.full((1, 4, 3), 20, np.uint8)
    valid = np.array([[True, True, False, False]]), np.array([[True, False, True, False]])
    one, other = (photo[0, :, 0].tolist() for photo in filled(photos, valid))
    assert one == [10, 10, 20, 128]
    assert other == [20, 10, 20, 128]


def test_blocks_stay_in_a_cache_of_a_bounded_size(tmp_path: Path, write_raster: Any) -> None:
    """In bytes: 128 of them hold no block, and then every row is decoded anew."""
    path = write_raster(tmp_path / "a.tif", texture(60, 80))
    with open_pair(path, path, RasterOptions()):
        assert 2**25 < rasterio.env.getenv()["GDAL_CACHEMAX"] < 2**28


@pytest.mark.parametrize("stretch", ["auto", (0.0, 255.0)])
def test_a_file_that_was_cut_short_is_named(
    stretch: Any, tmp_path: Path, write_raster: Any
) -> None:
    whole = write_raster(tmp_path / "a.tif", texture(300, 300).astype(np.uint16))
    short = write_raster(
        tmp_path / "b.tif", texture(300, 300).astype(np.uint16), tiled=True, compress="deflate"
    )
    short.write_bytes(short.read_bytes()[: short.stat().st_size // 2])
    with pytest.raises(ImageError, match=r"b\.tif is damaged .*; copy or download it again"):
        read(whole, short, stretch=stretch)


def refused(tmp_path: Path, before: Path, after: Path | None = None) -> str:
    with (
        pytest.raises(ImageError) as caught,
        open_pair(before, after or before, RasterOptions()),
    ):
        pass
    message = str(caught.value)
    assert "\n" not in message
    return message.replace(f"{tmp_path}/", "")


def test_what_is_no_georeferenced_raster_is_refused_in_one_line(
    tmp_path: Path, write_raster: Any
) -> None:
    pixels = texture(60, 80)
    good = write_raster(tmp_path / "good.tif", pixels)
    assert refused(tmp_path, tmp_path / "no.tif").startswith("no.tif does not exist")
    assert refused(tmp_path, tmp_path) != ""
    (tmp_path / "text.tif").write_text("not a raster")
    assert "text.tif cannot be read as a raster" in refused(tmp_path, good, tmp_path / "text.tif")
    nowhere = write_raster(tmp_path / "nowhere.tif", pixels, crs=None)
    assert "nowhere.tif does not say where it lies; add its CRS" in refused(tmp_path, nowhere)
    with pytest.warns(NotGeoreferencedWarning):
        plain = write_raster(tmp_path / "plain.tif", pixels, transform=Affine.identity())
    assert "plain.tif does not say where it lies" in refused(tmp_path, plain)
    small = write_raster(tmp_path / "small.tif", pixels[:20])
    assert "small.tif is narrower than 32 pixels" in refused(tmp_path, good, small)


@pytest.mark.parametrize("crs", ["EPSG:32632", "EPSG:4326"])
def test_rasters_of_two_places_are_refused(crs: str, tmp_path: Path, write_raster: Any) -> None:
    before = write_raster(tmp_path / "a.tif", texture(60, 80))
    corner = (10.5, 48.9) if crs == "EPSG:4326" else (500_000, 5_399_980)  # 10 m: 20 rows
    step = 1e-5 if crs == "EPSG:4326" else 0.5
    after = write_raster(
        tmp_path / "b.tif", texture(60, 80), crs=crs, transform=from_origin(*corner, step, step)
    )
    assert "b.tif overlaps the raster before by less than 32 pixels" in refused(
        tmp_path, before, after
    )
