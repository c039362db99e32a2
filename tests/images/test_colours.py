"""Every colour mode, through real files where a format holds it: known pixels in, known out."""

import io
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.images.read import read_photo

SIZE_WH = (48, 40)


def plain(mode: str, value: Any) -> Image.Image:
    return Image.new(mode, SIZE_WH, value)


def file_of(image: Image.Image, kind: str, **options: Any) -> bytes:
    file = io.BytesIO()
    image.save(file, kind, **options)
    return file.getvalue()


def only_colour(source: Any) -> list[int]:
    """Return the colour of a photo that has one."""
    pixels = read_photo(source).pixels
    assert pixels.shape == (SIZE_WH[1], SIZE_WH[0], 3)
    assert (pixels == pixels[0, 0]).all()
    colour: list[int] = pixels[0, 0].tolist()
    return colour


@pytest.mark.parametrize(
    ("mode", "value", "kind", "expected"),
    [
        ("RGB", (10, 20, 30), "PNG", [10, 20, 30]),
        ("RGB", (10, 20, 30), "PPM", [10, 20, 30]),
        ("RGB", (10, 20, 30), "BMP", [10, 20, 30]),
        ("L", 77, "PNG", [77, 77, 77]),
        ("L", 77, "JPEG", [77, 77, 77]),
        ("1", 1, "PNG", [255, 255, 255]),
        ("1", 0, "TIFF", [0, 0, 0]),
        ("P", 0, "GIF", [0, 0, 0]),
        ("CMYK", (0, 255, 255, 0), "TIFF", [255, 0, 0]),
        ("CMYK", (0, 0, 0, 255), "TIFF", [0, 0, 0]),
        ("I;16", 0, "PNG", [0, 0, 0]),
        ("I;16", 65535, "PNG", [255, 255, 255]),
        ("I;16", 25828, "PNG", [100, 100, 100]),  # 100.498 of 255
        ("I;16", 25829, "TIFF", [101, 101, 101]),  # 100.502 of 255
        ("I;16B", 25829, "TIFF", [101, 101, 101]),
        ("LA", (0, 128), "PNG", [127, 127, 127]),  # 127/255 of the white shines through
        ("RGBA", (200, 0, 100, 51), "PNG", [244, 204, 224]),  # a fifth ink, four fifths white
        ("RGBA", (200, 0, 100, 0), "TIFF", [255, 255, 255]),
    ],
)
def test_a_file_in_any_colour_mode_reads_as_the_colour_it_shows(
    mode: str, value: Any, kind: str, expected: list[int]
) -> None:
    assert only_colour(file_of(plain(mode, value), kind)) == expected


@pytest.mark.parametrize(
    ("mode", "value", "expected"),
    [
        ("La", (0, 128), [127, 127, 127]),
        ("RGBa", (40, 0, 20, 51), [244, 204, 224]),  # colours already multiplied by a fifth
        ("RGBX", (10, 20, 30, 40), [10, 20, 30]),
        ("YCbCr", (90, 128, 128), [90, 90, 90]),
        ("HSV", (0, 255, 200), [200, 0, 0]),
        ("I", 25829, [101, 101, 101]),
    ],
)
def test_a_pillow_picture_in_any_colour_mode_is_read(
    mode: str, value: Any, expected: list[int]
) -> None:
    assert only_colour(plain(mode, value)) == expected


def test_cmyk_in_a_jpeg_is_not_inverted() -> None:
    red = only_colour(file_of(plain("CMYK", (0, 255, 255, 0)), "JPEG", quality=95))
    assert red == pytest.approx([255, 0, 0], abs=3)  # JPEG rounds


def test_a_palette_is_looked_up_and_its_transparent_entry_is_white() -> None:
    image = plain("P", 1)
    image.putpalette([9, 9, 9, 10, 20, 30, 40, 50, 60])
    assert only_colour(file_of(image, "PNG")) == [10, 20, 30]
    assert only_colour(file_of(image, "PNG", transparency=2)) == [10, 20, 30]
    assert only_colour(file_of(image, "PNG", transparency=1)) == [255, 255, 255]
    assert only_colour(file_of(image, "GIF", transparency=1)) == [255, 255, 255]
    half = bytes([255, 51, 255])  # opacity of each palette entry
    assert only_colour(file_of(image, "PNG", transparency=half)) == [206, 208, 210]


def test_a_colour_named_transparent_in_a_png_is_white() -> None:
    image = plain("RGB", (10, 20, 30))
    assert only_colour(file_of(image, "PNG", transparency=(10, 20, 30))) == [255, 255, 255]
    assert only_colour(file_of(image, "PNG", transparency=(10, 20, 31))) == [10, 20, 30]


def test_sixteen_bits_a_colour_are_scaled_and_not_clipped() -> None:
    blue_green_red = np.full((SIZE_WH[1], SIZE_WH[0], 3), [257 * 30, 257 * 20, 65535], np.uint16)
    done, data = cv2.imencode(".png", blue_green_red)
    assert done
    assert only_colour(data.tobytes()) == [255, 20, 30]


@pytest.mark.parametrize("kind", ["GIF", "PNG", "WEBP", "TIFF", "MPO"])
def test_the_first_frame_of_several_is_the_photo(kind: str) -> None:
    frames = {"save_all": True, "append_images": [plain("RGB", (0, 0, 255))]}
    exact = {"lossless": True} if kind == "WEBP" else {}
    data = file_of(plain("RGB", (255, 0, 0)), kind, **frames, **exact)
    assert only_colour(data) == pytest.approx([255, 0, 0], abs=3)  # the JPEGs in an MPO round


@pytest.mark.parametrize(("mode", "value"), [("F", 0.5), ("I", 65536), ("I", -1)])
def test_values_without_a_known_white_are_refused(mode: str, value: float) -> None:
    with pytest.raises(ImageError, match=r"32-bit.*save it with 8 or 16 bits"):
        read_photo(file_of(plain(mode, value), "TIFF"))


# What a file holds for each EXIF orientation when the photo, upright, is 123 over 456.
STORED = {
    1: [[1, 2, 3], [4, 5, 6]],
    2: [[3, 2, 1], [6, 5, 4]],
    3: [[6, 5, 4], [3, 2, 1]],
    4: [[4, 5, 6], [1, 2, 3]],
    5: [[1, 4], [2, 5], [3, 6]],
    6: [[3, 6], [2, 5], [1, 4]],
    7: [[6, 3], [5, 2], [4, 1]],
    8: [[4, 1], [5, 2], [6, 3]],
}
FIELD_PX = 32  # each number is drawn as a square of this side, so that JPEG keeps it apart


def drawn(numbers: list[list[int]]) -> Image.Image:
    greys = np.kron(40 * np.array(numbers), np.ones((FIELD_PX, FIELD_PX)))
    return Image.fromarray(greys.astype(np.uint8)).convert("RGB")


def numbers_of(source: Any) -> list[list[int]]:
    middles = read_photo(source).pixels[FIELD_PX // 2 :: FIELD_PX, FIELD_PX // 2 :: FIELD_PX, 0]
    numbers: list[list[int]] = np.round(middles / 40).astype(int).tolist()
    return numbers


@pytest.mark.parametrize("orientation", STORED)
@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP", "TIFF"])
def test_a_photo_comes_upright_whatever_its_exif_orientation(kind: str, orientation: int) -> None:
    exif = Image.Exif()
    exif[0x112] = orientation
    data = file_of(drawn(STORED[orientation]), kind, exif=exif)
    assert numbers_of(data) == STORED[1]
    assert numbers_of(Image.open(io.BytesIO(data))) == STORED[1]


@pytest.mark.parametrize("nonsense", [0, 9, 1000])
def test_an_orientation_that_does_not_exist_turns_nothing(nonsense: int) -> None:
    exif = Image.Exif()
    exif[0x112] = nonsense
    assert numbers_of(file_of(drawn(STORED[1]), "JPEG", exif=exif)) == STORED[1]


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
def test_damaged_exif_data_do_not_cost_the_photo(kind: str) -> None:
    data = file_of(drawn(STORED[1]), kind, exif=b"Exif\0\0nonsense, not a TIFF header")
    assert numbers_of(data) == STORED[1]


def test_arrays_are_read_by_their_channels() -> None:
    grey = np.full((40, 48), 7, np.uint8)
    alpha = np.full((40, 48, 4), [200, 0, 100, 51], np.uint8)
    assert only_colour(grey) == [7, 7, 7]
    assert only_colour(grey[:, :, None]) == [7, 7, 7]
    assert only_colour(np.full((40, 48, 3), [1, 2, 3], np.uint8)) == [1, 2, 3]
    assert only_colour(alpha) == [244, 204, 224]


@pytest.mark.parametrize("order", ["<", ">"])
def test_sixteen_bit_arrays_are_scaled_in_either_byte_order(order: str) -> None:
    colours = np.full((40, 48, 3), [0, 25829, 65535], order + "u2")
    assert only_colour(colours) == [0, 101, 255]
    faint = np.full((40, 48, 4), [257 * 200, 0, 257 * 100, 257 * 51], order + "u2")
    assert only_colour(faint) == [244, 204, 224]


def test_an_array_is_copied_and_left_alone() -> None:
    given = np.random.default_rng(1).integers(0, 256, (40, 48, 3)).astype(np.uint8)[::-1]
    before = given.copy()
    pixels = read_photo(given).pixels
    assert np.array_equal(pixels, before)
    assert pixels.flags.c_contiguous
    pixels[:] = 0
    assert np.array_equal(given, before)


@pytest.mark.parametrize(
    ("array", "remedy"),
    [
        (np.zeros((40, 40, 3)), r"float64.*astype\('uint8'\)"),
        (np.zeros((40, 40), bool), r"bool.*astype\('uint8'\)"),
        (np.zeros((40, 40, 3), np.int16), r"int16.*astype\('uint8'\)"),
        (np.zeros((40, 40, 3), np.uint32), r"uint32.*astype\('uint8'\)"),
        (np.zeros((3, 40, 40), np.uint8), r"\(3, 40, 40\).*channels last"),
        (np.zeros((40, 40, 2), np.uint8), r"\(40, 40, 2\).*channels last"),
        (np.zeros((1, 40, 40, 3), np.uint8), r"\(1, 40, 40, 3\).*channels last"),
        (np.zeros(40, np.uint8), r"\(40,\).*channels last"),
        (np.zeros((0, 0, 3), np.uint8), "0 x 0 pixels.*at least 32 x 32"),
    ],
)
def test_other_arrays_are_refused_with_the_remedy(array: NDArray[Any], remedy: str) -> None:
    with pytest.raises(ImageError, match=remedy):
        read_photo(array)
