"""HEIC photos with and without pillow-heif, which the extra `zeroscd[heic]` installs."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.batch import open_folders
from zeroscd.errors import ImageError
from zeroscd.evaluation.datasets.catalogue import open_dataset
from zeroscd.images import heif
from zeroscd.images.exif import Exif, read_exif
from zeroscd.images.folder import list_photos
from zeroscd.images.read import PhotoLimits, read_photo

HEADER = b"\0\0\0\x18ftypheic\0\0\0\0mif1heic" + bytes(400)


@pytest.mark.parametrize("brand", [b"heic", b"heix", b"mif1"])
def test_without_the_plugin_one_learns_what_to_install(
    brand: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(heif, "is_available", lambda: False)
    content = HEADER.replace(b"ftypheic", b"ftyp" + brand)
    with pytest.raises(ImageError, match=r"^a\.heic is a HEIC photo; .*zeroscd\[heic\]'.* JPEG$"):
        read_photo(content, name="a.heic")


def test_other_files_of_its_container_are_not_called_heic() -> None:
    with pytest.raises(ImageError, match="is not a photo that can be read here"):
        read_photo(HEADER.replace(b"ftypheic", b"ftypisom"))


@pytest.fixture
def plugin() -> Any:
    """pillow-heif; tests that need it are skipped without the extra."""
    return pytest.importorskip("pillow_heif", reason="the extra zeroscd[heic] is not installed")


def photo(plugin: Any, exif: Image.Exif | None = None) -> bytes:
    """A HEIC photo of 96 x 64 pixels, light above, as a phone writes it."""
    pixels = np.zeros((64, 96, 3), np.uint8)
    pixels[:32] = 250
    file = io.BytesIO()
    notes = {} if exif is None else {"exif": exif.tobytes()}
    plugin.from_pillow(Image.fromarray(pixels)).save(file, quality=100, **notes)
    return file.getvalue()


def test_with_the_plugin_a_photo_is_read(plugin: Any) -> None:
    assert heif.is_available()
    content = photo(plugin)
    read = read_photo(content).pixels
    assert read.shape == (64, 96, 3)
    assert read[:28].mean() > 200
    assert read[36:].mean() < 50
    with pytest.raises(ImageError, match="damaged or cut short"):
        read_photo(content[: len(content) - 100])


@pytest.mark.parametrize(
    ("orientation", "light"),
    [
        (1, np.s_[:28]),
        (3, np.s_[-28:]),
        (6, np.s_[:, -28:]),
        (8, np.s_[:, :28]),
    ],
)
def test_a_turned_photo_is_upright(plugin: Any, orientation: int, light: Any) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    read = read_photo(photo(plugin, exif)).pixels
    assert read.shape == ((64, 96, 3) if orientation in (1, 3) else (96, 64, 3))
    assert read[light].mean() > 200
    assert read.mean() == pytest.approx(125, abs=5)


def test_place_and_time_are_read(plugin: Any) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x9003: "2024:05:04 12:30:11", 0x9011: "+02:00"})
    exif.get_ifd(0x8825).update({1: "S", 2: (52.0, 30.0, 0.0), 3: "W", 4: (4.0, 15.0, 0.0)})
    found = read_exif(photo(plugin, exif))
    assert found == Exif(gps=(-52.5, -4.25), taken="2024-05-04T12:30:11+02:00")


def test_a_photo_beyond_the_limits_is_refused(plugin: Any) -> None:
    with pytest.raises(ImageError, match="has 96 x 64 pixels; make it smaller"):
        read_photo(photo(plugin), limits=PhotoLimits(max_pixels=6000))


def test_folders_of_heic_and_jpeg_are_pairs(plugin: Any, tmp_path: Path) -> None:
    content = photo(plugin)
    for part in ("t0", "t1", "mask"):
        (tmp_path / part).mkdir()
        Image.fromarray(np.zeros((64, 96), np.uint8)).save(tmp_path / part / "a.png")
    (tmp_path / "t0" / "b.heic").write_bytes(content)
    (tmp_path / "t1" / "b.HEIC").write_bytes(content)
    Image.fromarray(np.zeros((64, 96), np.uint8)).save(tmp_path / "mask" / "b.png")
    assert [Path(p).name for p in list_photos(tmp_path / "t0").photos] == ["a.png", "b.heic"]
    pairs = list(open_folders(tmp_path / "t0", tmp_path / "t1").rows())
    assert [(row.id, row.error) for row in pairs] == [("a", None), ("b", None)]
    dataset = open_dataset("folder", tmp_path)
    assert [pair.stem for pair in dataset.pairs] == ["a", "b"]
    assert dataset.notes == ()
