"""Read photos from any source to upright RGB arrays, or say in one line what is wrong."""

from __future__ import annotations

import io
import stat
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.images import heif
from zeroscd.images.colours import rgb_from_array, rgb_from_picture
from zeroscd.images.guard import guarded, libtiff_muted
from zeroscd.images.headers import check_header
from zeroscd.images.photo import Photo
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any, TypeAlias

    from numpy.typing import NDArray

    from zeroscd.arrays import Rgb

    PhotoSource: TypeAlias = str | Path | bytes | Image.Image | NDArray[Any]

# Pillow reads forty more, even PostScript, for which it runs another program.
FORMATS = ("JPEG", "PNG", "WEBP", "TIFF", "BMP", "GIF", "PPM")  # JPEG includes MPO
# Of files of these formats (`images.folder` knows those of other kinds).
SUFFIXES = frozenset(
    {
        *(".jpg", ".jpeg", ".jpe", ".jfif", ".mpo", ".png", ".webp", ".tif", ".tiff"),
        *(".bmp", ".dib", ".gif", ".ppm", ".pgm", ".pbm", ".pnm"),
    }
)

MEGA = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoLimits:
    """Largest and smallest photo; checked before pixels are decoded."""

    max_pixels: int = 89_478_485  # a quarter gigabyte of RGB; Pillow's own warning starts here
    max_file_bytes: int = 2**28  # a quarter gigabyte: the same number of pixels, uncompressed
    min_side_px: int = 32  # one patch of the coarsest stride that an encoder here has


DEFAULT_LIMITS = PhotoLimits()


def read_photo(
    source: PhotoSource, *, limits: PhotoLimits = DEFAULT_LIMITS, name: str | None = None
) -> Photo:
    """Read a photo as a viewer would show it: upright, RGB, transparency on white.

    Args:
        source: A path; a file's bytes; a Pillow picture; or an array of shape (H, W), (H, W, 3) or
            (H, W, 4), uint8 or uint16. Of an animation the first frame is read.
        limits: Sizes beyond which the photo is refused.
        name: Path of the file that bytes came from, which becomes the photo's path.

    Raises:
        ImageError: The source is missing, unreadable, damaged, cut short, too large or too small.

    Example:
        >>> read_photo(np.full((32, 48), 65535, dtype=np.uint16)).pixels[0, 0]
        array([255, 255, 255], dtype=uint8)
    """
    if isinstance(source, str | Path):
        return read_photo(read_file(source, limits=limits), limits=limits, name=str(source))
    if isinstance(source, bytes):
        label = "the photo given as bytes" if name is None else one_line(name)
        return Photo(pixels=_decode(source, label, limits), path=name)
    if isinstance(source, Image.Image):
        with guarded("the picture given"):
            return Photo(pixels=_pixels(source, "the picture given", limits))
    if isinstance(source, np.ndarray):
        pixels = rgb_from_array(source, name="the array given")
        _check_size((pixels.shape[1], pixels.shape[0]), "the array given", limits)
        return Photo(pixels=pixels)
    message = f"cannot read a photo from {type(source).__name__}; give a path, bytes or an array"
    raise ImageError(message)


def listed(photos: PhotoSource | Sequence[PhotoSource], when: str) -> Sequence[PhotoSource]:
    """Return the photos of one side, of which there may be one alone or a list.

    Args:
        photos: One photo or a list.
        when: Which side, for the message.

    Raises:
        ImageError: The list is empty.
    """
    if not isinstance(photos, list | tuple):
        return [cast("PhotoSource", photos)]
    if not photos:
        message = f"no photo {when}: give one photo of the place or a list of them"
        raise ImageError(message)
    return photos


def read_file(path: str | Path, *, limits: PhotoLimits = DEFAULT_LIMITS) -> bytes:
    """Return the bytes of a photo's file; one byte more than the limit of a larger file.

    Raises:
        ImageError: It is missing, unreadable, a folder, a pipe or a device.
    """
    path, name = Path(path), one_line(str(path))
    try:
        mode = path.stat().st_mode
        if stat.S_ISREG(mode):
            with path.open("rb") as file:
                return file.read(limits.max_file_bytes + 1)
    except FileNotFoundError:
        message = f"{name} does not exist; check the path"
        raise ImageError(message) from None
    except PermissionError as error:
        message = f"{name} may not be read; change its permissions"
        raise ImageError(message) from error
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        reason = getattr(error, "strerror", None) or error
        message = f"{name} cannot be read ({reason}); check the path and the disk"
        raise ImageError(message) from error
    kind = "a folder" if stat.S_ISDIR(mode) else "a pipe or a device"
    message = f"{name} is {kind}; give the file of a photo"
    raise ImageError(message)


def _decode(data: bytes, name: str, limits: PhotoLimits) -> Rgb:
    if not data:
        message = f"{name} is empty (0 bytes); copy or download it again"
        raise ImageError(message)
    if len(data) > limits.max_file_bytes:
        most = limits.max_file_bytes / MEGA
        message = f"{name} is larger than {most:.0f} megabytes; save it as JPEG or make it smaller"
        raise ImageError(message)
    if heif.is_heif(data) and not heif.is_available():
        message = f"{name} is a HEIC photo; {heif.HINT}, or convert it to JPEG"
        raise ImageError(message)
    check_header(data, name)
    with guarded(name), Image.open(io.BytesIO(data), formats=formats()) as picture:
        return _pixels(picture, name, limits)


def formats() -> tuple[str, ...]:
    """Return Pillow's names of the formats that are read here."""
    return (*FORMATS, heif.FORMAT) if heif.is_available() else FORMATS


def _pixels(picture: Image.Image, name: str, limits: PhotoLimits) -> Rgb:
    _check_size(picture.size, name, limits)
    with libtiff_muted() if picture.format == "TIFF" else nullcontext():
        return rgb_from_picture(picture, name=name)


def _check_size(size_wh: tuple[int, int], name: str, limits: PhotoLimits) -> None:
    width, height = size_wh
    if width * height > limits.max_pixels:
        most = limits.max_pixels / MEGA
        message = (
            f"{name} has {width} x {height} pixels; make it smaller than {most:.0f} megapixels"
        )
        raise ImageError(message)
    if min(size_wh) < limits.min_side_px:
        least = limits.min_side_px
        message = (
            f"{name} has {width} x {height} pixels; give a photo of at least {least} x {least}"
        )
        raise ImageError(message)
