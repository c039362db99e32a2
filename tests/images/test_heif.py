"""HEIC photos with and without pillow-heif, which the extra `zeroscd[heic]` installs."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.images import heif
from zeroscd.images.read import read_photo

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


def test_with_the_plugin_a_photo_is_read_upright() -> None:
    plugin: Any = pytest.importorskip(
        "pillow_heif", reason="the extra zeroscd[heic] is not installed"
    )
    assert heif.is_available()
    pixels = np.zeros((64, 96, 3), np.uint8)
    pixels[:32] = 250  # light above
    file = io.BytesIO()
    plugin.from_pillow(Image.fromarray(pixels)).save(file, quality=100)
    read = read_photo(file.getvalue()).pixels
    assert read.shape == (64, 96, 3)
    assert read[:28].mean() > 200
    assert read[36:].mean() < 50
    with pytest.raises(ImageError, match="damaged or cut short"):
        read_photo(file.getvalue()[:200])
