"""`zeroscd geo`: what it says, and how it refuses."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.cli.main import run
from zeroscd.detector import Detector
from zeroscd.models import Models
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from pathlib import Path

rasterio = pytest.importorskip("rasterio")
pytest.importorskip("pyogrio")


@pytest.fixture(autouse=True)
def no_network(monkeypatch: pytest.MonkeyPatch, toy_encoder: Any, cut_by_size: Any) -> None:
    finds_nothing = cut_by_size(lambda *_: ())
    detector = Detector(Settings(), Models(toy_encoder, finds_nothing), preset="toy")
    monkeypatch.setattr(Detector, "from_preset", lambda *_, **__: detector)


@pytest.fixture
def rasters(tmp_path: Path) -> tuple[str, str]:
    """Two dates of 256 x 320 pixels of blocks that can be matched, in other light."""
    blocks = np.random.default_rng(1).integers(0, 200, (3, 32, 40)).astype(np.uint8)
    wall = blocks.repeat(8, axis=1).repeat(8, axis=2)
    paths = tmp_path / "2019.tif", tmp_path / "2024.tif"
    for path, pixels in zip(paths, (wall, wall + 9), strict=True):
        with rasterio.open(
            path,
            "w",
            driver="GTiff",
            count=3,
            height=256,
            width=320,
            dtype="uint8",
            crs="EPSG:32632",
            transform=rasterio.transform.from_origin(500_000, 5_400_000, 0.5, 0.5),
        ) as raster:
            raster.write(pixels)
    return str(paths[0]), str(paths[1])


def test_it_says_how_the_rasters_lie_what_changed_and_where_the_polygons_are(
    rasters: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(["geo", *rasters, "-o", str(out)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "the georeference is confirmed to a pixel (1 of 1 sampled tiles agree)",
        "0 changes, 0 m2; 100% of the raster before was judged",
        f"polygons: {out / 'changes.gpkg'}",
    ]


def test_a_program_gets_the_summary_alone(
    rasters: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(["geo", *rasters, "-o", str(out), "--json", "-q", "--cog"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    summary = json.loads(captured.out)
    assert summary == json.loads((out / "summary.json").read_text())
    assert (summary["schema"], summary["changes"], summary["tiles"]) == (1, 0, 1)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--bands", "1,2"], "bands are one or three numbers from 1"),
        (["--bands", "1,2,9"], "2019.tif has no band 9; choose from 1 to 3"),
        (["--bands-after", "4"], "2024.tif has no band 4; choose from 1 to 3"),
        (["--stretch", "much"], "a stretch is auto, none, percentile, or two rising numbers"),
        (["--tile", "10"], "--tile"),
        (["--preset", "ligth"], "did you mean lite?"),
        (["--set", "tua=1"], "did you mean tau?"),
    ],
)
def test_what_was_typed_wrong_is_one_line_and_leaves_nothing(
    options: list[str],
    line: str,
    rasters: tuple[str, str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    assert run(["geo", *rasters, "-o", str(out), *options]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert line in error
    assert not out.exists()


def test_a_photo_that_does_not_say_where_it_lies_is_refused_before_networks_are_loaded(
    rasters: tuple[str, str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delattr(Detector, "from_preset")
    photo = tmp_path / "photo.tif"
    with (
        pytest.warns(rasterio.errors.NotGeoreferencedWarning),
        rasterio.open(
            photo, "w", driver="GTiff", count=3, height=64, width=64, dtype="uint8"
        ) as raster,
    ):
        raster.write(np.zeros((3, 64, 64), np.uint8))
    assert run(["geo", rasters[0], str(photo), "-o", str(tmp_path / "out")]) == 2
    assert "photo.tif does not say where it lies" in capsys.readouterr().err


def test_without_rasterio_it_says_what_to_install(
    rasters: tuple[str, str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("zeroscd.extras.find_spec", lambda name: None)
    assert run(["geo", *rasters, "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "geo needs rasterio, pyogrio; run: pip install 'zeroscd[geo]'" in error
