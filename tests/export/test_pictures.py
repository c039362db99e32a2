from __future__ import annotations

import base64
import io

import numpy as np
from PIL import Image

from zeroscd.export.pictures import data_uri, jpeg, png


def opened(content: bytes) -> Image.Image:
    return Image.open(io.BytesIO(content))


def test_a_mask_comes_back_from_its_png() -> None:
    mask = np.arange(35).reshape(5, 7) % 3 == 0
    assert np.array_equal(np.asarray(opened(png(mask))), np.where(mask, 255, 0))


def test_colours_and_transparency_come_back_from_a_png() -> None:
    pixels = np.arange(4 * 6 * 4, dtype=np.uint8).reshape(4, 6, 4)
    assert np.array_equal(np.asarray(opened(png(pixels))), pixels)
    view = pixels[:, ::-1, :3]  # not contiguous
    assert np.array_equal(np.asarray(opened(png(view))), view)


def test_addresses_hold_the_picture_itself() -> None:
    pixels = np.full((8, 16, 3), (200, 30, 60), np.uint8)
    for address, head in (
        (data_uri(jpeg(pixels, quality=90)), "data:image/jpeg;base64,"),
        (data_uri(png(pixels)), "data:image/png;base64,"),
    ):
        assert address.startswith(head)
        back = np.asarray(opened(base64.b64decode(address.removeprefix(head))).convert("RGB"))
        # JPEG rounds colours; three grey levels is what quality 90 costs on a flat colour.
        assert np.abs(back.astype(int) - pixels).max() <= 3
