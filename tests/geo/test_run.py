"""Two rasters to files, with a detector that errs nowhere: what is wrong is not its fault."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.errors import ImageError, OutputError
from zeroscd.geo.rasters import RasterOptions
from zeroscd.geo.run import compare_rasters

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.geo.run import GeoResult

rasterio = pytest.importorskip("rasterio")
from rasterio.transform import Affine, from_origin  # noqa: E402 - where it is installed
from rasterio.vrt import WarpedVRT  # noqa: E402

pyogrio = pytest.importorskip("pyogrio")
shapely = pytest.importorskip("shapely")

TILE_PX = 256  # three by two of them cover the rasters
HEIGHT, WIDTH = 400, 600
TOP, LEFT, BOTTOM, RIGHT = 180, 190, 230, 260  # across borders of tiles, in both directions
GRIDS = {
    "EPSG:32632": from_origin(500_000, 5_400_000, 0.5, 0.5),
    "EPSG:3857": from_origin(1_000_000, 6_200_000, 0.8, 0.8),
    "EPSG:4326": from_origin(9.0, 48.75, 7e-6, 5e-6),
}
Run = Any


@pytest.fixture
def compared(tmp_path: Path, toy_detector: Any) -> Callable[..., GeoResult]:
    def compare(before: Path, after: Path, **options: Any) -> GeoResult:
        chosen = RasterOptions(tile_px=TILE_PX, **options)
        return compare_rasters(
            before, after, tmp_path / "out", detector=toy_detector, options=chosen
        )

    return compare


def changed(pixels: np.ndarray) -> np.ndarray:
    """Return the ground with a bright thing on it."""
    other = pixels.copy()
    other[TOP:BOTTOM, LEFT:RIGHT] = 250
    return other


def read_layer(path: Path) -> tuple[Any, list[Any]]:
    meta, _, geometries, _ = pyogrio.raw.read(path)
    return meta, [shapely.from_wkb(one) for one in geometries]


def corners(transform: Any) -> tuple[float, float, float, float]:
    """Return the bounds on the map of what changed."""
    left, top = transform * (LEFT, TOP)
    right, bottom = transform * (RIGHT, BOTTOM)
    return left, bottom, right, top


@pytest.mark.parametrize("crs", GRIDS)
def test_a_change_across_tiles_is_one_polygon_where_it_is_on_the_map(
    crs: str, tmp_path: Path, write_raster: Any, ground: Any, compared: Run
) -> None:
    pixels = ground(HEIGHT, WIDTH)
    grid = {"crs": crs, "transform": GRIDS[crs]}
    before = write_raster(tmp_path / "a.tif", pixels, **grid)
    after = write_raster(tmp_path / "b.tif", changed(pixels), **grid)
    result = compared(before, after)
    for name in ("changes.gpkg", "changes.geojson"):
        meta, (shape,) = read_layer(tmp_path / "out" / name)
        assert rasterio.crs.CRS.from_user_input(meta["crs"]) == rasterio.crs.CRS.from_string(crs)
        assert shape.equals(shapely.box(*corners(GRIDS[crs])))
    with rasterio.open(tmp_path / "out" / "mask.tif") as mask:
        expected = np.zeros((HEIGHT, WIDTH), np.uint8)
        expected[TOP:BOTTOM, LEFT:RIGHT] = 1
        assert np.array_equal(mask.read(1), expected)
        assert (mask.crs, mask.transform, mask.nodata) == (crs, GRIDS[crs], 255)
    (found,) = result.polygons
    assert (found.kind, found.score, found.area_px) == ("added", 0.8, 50 * 70)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "mask.tif", "changes.gpkg", "changes.geojson", "summary.json"
    }  # fmt: skip


@pytest.mark.parametrize("crs", ["EPSG:3857", "EPSG:4326"])
def test_a_raster_after_in_another_crs_moves_nothing_by_a_pixel(
    crs: str, tmp_path: Path, write_raster: Any, ground: Any, compared: Run
) -> None:
    pixels = ground(HEIGHT, WIDTH)
    before = write_raster(tmp_path / "a.tif", pixels)
    own = write_raster(tmp_path / "own.tif", changed(pixels))
    after = tmp_path / "b.tif"
    with (
        rasterio.open(own) as source,
        WarpedVRT(source, crs=crs, add_alpha=True) as warped,
        rasterio.open(after, "w", **{**warped.profile, "driver": "GTiff"}) as raster,
    ):
        raster.write(warped.read())
    (found,) = compared(before, after).polygons
    _, (shape,) = read_layer(tmp_path / "out" / "changes.gpkg")
    expected = corners(GRIDS["EPSG:32632"])
    assert shape.bounds == pytest.approx(expected, abs=0.5)  # a pixel
    assert found.area_px == pytest.approx(50 * 70, rel=0.05)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["after"]["crs"] == crs
    assert summary["registration"]["mended"] is False


def test_a_pair_that_is_off_by_six_pixels_is_mended(
    tmp_path: Path, write_raster: Any, ground: Any, compared: Run
) -> None:
    pixels, own = ground(HEIGHT, WIDTH), GRIDS["EPSG:32632"]
    before = write_raster(tmp_path / "a.tif", pixels)
    after = write_raster(
        tmp_path / "b.tif", changed(pixels), transform=own * Affine.translation(5, -3.3)
    )
    result = compared(before, after)
    found = result.summary["registration"]
    assert found["shift_px"] == pytest.approx([5, -3.3], abs=0.1)
    assert found["shift_map"] == pytest.approx([2.5, 1.65], abs=0.05)
    assert (found["mended"], found["agreeing"]) == (True, found["sampled"])
    _, (shape,) = read_layer(tmp_path / "out" / "changes.gpkg")
    assert shape.bounds == pytest.approx(corners(own), abs=0.5)


def test_what_either_raster_does_not_show_is_unknown_and_never_changed(
    tmp_path: Path, write_raster: Any, ground: Any, compared: Run, toy_detector: Any
) -> None:
    pixels = ground(HEIGHT, WIDTH)
    hole_before, hole_after = pixels.copy(), changed(pixels)
    hole_before[:, :50] = 0
    hole_after[300:] = 0
    hole_after[TOP:BOTTOM, 200:210] = 0  # through the thing
    before = write_raster(tmp_path / "a.tif", hole_before, nodata=0)
    after = write_raster(tmp_path / "b.tif", hole_after, nodata=0)
    result = compared(before, after)
    empty = (hole_before == 0).any(axis=2) | (hole_after == 0).any(axis=2)
    with rasterio.open(tmp_path / "out" / "mask.tif") as raster:
        mask = raster.read(1)
    assert np.array_equal(mask == 255, empty)
    thing = np.zeros_like(empty)
    thing[TOP:BOTTOM, LEFT:RIGHT] = True
    assert np.array_equal(mask == 1, thing & ~empty)
    assert len(result.polygons) == 2
    assert result.summary["judged_fraction"] == pytest.approx((~empty).mean())
    assert toy_detector.compared


def test_only_what_both_cover_is_compared(
    tmp_path: Path, write_raster: Any, ground: Any, compared: Run
) -> None:
    pixels, own = ground(HEIGHT, WIDTH), GRIDS["EPSG:32632"]
    before = write_raster(tmp_path / "a.tif", pixels)
    after = write_raster(
        tmp_path / "b.tif",
        changed(pixels)[100:, 150:],
        transform=own * Affine.translation(150, 100),
    )
    result = compared(before, after)
    assert result.summary["overlap_xywh"] == [150, 100, 450, 300]
    with rasterio.open(tmp_path / "out" / "mask.tif") as raster:
        mask = raster.read(1)
    assert mask.shape == (HEIGHT, WIDTH)
    assert (mask[:100] == 255).all()
    assert (mask[:, :150] == 255).all()
    assert (mask[100:, 150:] != 255).all()
    assert (mask == 1).sum() == 50 * 70


def test_sixteen_bit_bands_are_compared_under_one_stretch(
    tmp_path: Path, write_raster: Any, ground: Any, compared: Run
) -> None:
    """Near infrared, red, green and blue; the change is in red, green and blue only."""
    bands = np.concatenate([ground(HEIGHT, WIDTH)[:, :, :1], ground(HEIGHT, WIDTH)], axis=2)
    pixels = bands.astype(np.uint16) * 40
    other = pixels.copy()
    other[TOP:BOTTOM, LEFT:RIGHT, 1:] = 10_000
    before = write_raster(tmp_path / "a.tif", pixels)
    after = write_raster(tmp_path / "b.tif", other)
    result = compared(before, after, bands=(2, 3, 4), stretch=(0.0, 12_000.0))
    (found,) = result.polygons
    assert found.area_px == 50 * 70
    assert result.summary["before"]["bands"] == [2, 3, 4]
    assert compared(before, after, bands=(1,)).polygons == ()
    ((low, high),) = compared(before, after, bands=(1,)).summary["before"]["stretch"]
    assert (low, high) == tuple(np.percentile(pixels[:, :, 0], (2, 98)))


def test_equal_rasters_cost_nothing_and_have_an_empty_mask(
    tmp_path: Path, write_raster: Any, ground: Any, compared: Run, toy_detector: Any
) -> None:
    before = write_raster(tmp_path / "a.tif", ground(HEIGHT, WIDTH))
    result = compared(before, before)
    assert toy_detector.compared == []
    assert result.polygons == ()
    assert result.summary["tiles_skipped"] == result.summary["tiles"] == 6
    assert result.summary["changed_fraction"] == 0
    assert result.summary["judged_fraction"] == 1


def test_all_tiles_have_one_threshold(
    tmp_path: Path, write_raster: Any, ground: Any, compared: Run, toy_detector: Any
) -> None:
    pixels = ground(HEIGHT, WIDTH)
    before = write_raster(tmp_path / "a.tif", pixels)
    compared(before, write_raster(tmp_path / "b.tif", changed(pixels)))
    assert toy_detector.taus == {0.6}


def test_a_mask_is_a_cog_if_wanted(
    tmp_path: Path, write_raster: Any, ground: Any, compared: Run
) -> None:
    pixels = ground(HEIGHT, WIDTH)
    before = write_raster(tmp_path / "a.tif", pixels)
    compared(before, write_raster(tmp_path / "b.tif", changed(pixels)), cog=True)
    with rasterio.open(tmp_path / "out" / "mask.tif") as raster:
        assert raster.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert (raster.read(1) == 1).sum() == 50 * 70


def test_a_run_that_fails_leaves_the_files_of_the_last_one(
    tmp_path: Path, write_raster: Any, ground: Any, compared: Run, toy_detector: Any
) -> None:
    pixels = ground(HEIGHT, WIDTH)
    before = write_raster(tmp_path / "a.tif", pixels)
    after = write_raster(tmp_path / "b.tif", changed(pixels))
    compared(before, after)
    old = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}

    def fail(*_: object) -> None:
        message = "disk broken"
        raise ImageError(message)

    toy_detector.decide = fail
    with pytest.raises(ImageError, match="disk broken"):
        compared(before, after)
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == old


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_read(
    tmp_path: Path, compared: Run
) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="is not a folder"):
        compared(tmp_path / "a.tif", tmp_path / "b.tif")
