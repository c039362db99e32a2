"""Areas of a photo that a user names: a mask, or polygons in pixels."""

from __future__ import annotations

import json
from codecs import BOM_UTF8
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import cv2
import numpy as np
from PIL import Image
from pycocotools import mask as coco

from zeroscd.errors import ImageError
from zeroscd.images.masks import ALPHA_NOTE, HALF_WHITE, decode_mask, read_white
from zeroscd.images.read import read_file
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from zeroscd.arrays import Mask

    AreaSource: TypeAlias = (
        str | Path | bytes | Image.Image | NDArray[Any] | Mapping[str, Any] | Sequence[Any]
    )

Ring: TypeAlias = "NDArray[np.float64]"  # (N, 2) as (x, y)

POINTS = 3  # the fewest of a polygon
MAX_RINGS = 1000  # outlines and holes
MAX_ROUNDS = 200  # length of all outlines, in those of the photo's own
MAX_PHOTOS = 20  # area of the boxes of all outlines, in photos
ASPECT_TOLERANCE = 0.01  # of width over height, for a mask of another size than its photo
FORMATS_TEXT = "white on black, or polygons as JSON or GeoJSON in pixels"


def read_area(source: AreaSource, *, size_hw: tuple[int, int], name: str = "the area") -> Mask:
    """Read an area of a photo: white pixels of a mask, or what polygons enclose.

    Args:
        source: A path, or a file's bytes, of a picture or of JSON; a Pillow picture; an array
            (H, W) of bool, or of numbers as in 8-bit grey; a list of polygons, each a list of
            (x, y); or a GeoJSON object, whose coordinates are pixels too. Whole numbers are corners
            of pixels, as in the polygons of regions.
        size_hw: Of the photo. A mask of another size is enlarged or reduced to it, if its shape is
            the same.
        name: What messages call it, where it has no path.

    Returns:
        (H, W), of the photo's size.

    Raises:
        ImageError: It cannot be read, is neither of these, or does not fit the photo.

    Example:
        >>> read_area([[(1, 0), (3, 0), (3, 1), (1, 1)]], size_hw=(2, 4)).astype(int)
        array([[0, 1, 1, 0],
               [0, 0, 0, 0]])
    """
    if isinstance(source, str | Path):
        return read_area(read_file(source), size_hw=size_hw, name=one_line(str(source)))
    if isinstance(source, bytes):
        if looks_like_json(source):
            return _filled(_json(source, name), size_hw, name)
        return _fit(_white(decode_mask(source, name=name), name), size_hw, name)
    if isinstance(source, Image.Image):
        return _fit(_white(source, name), size_hw, name)
    if isinstance(source, np.ndarray):
        return _fit(_from_array(source, name), size_hw, name)
    return _filled(source, size_hw, name)


def looks_like_json(content: bytes) -> bool:
    """Tell whether a file's bytes are polygons, and no picture."""
    return content.removeprefix(BOM_UTF8).lstrip()[:1] in (b"[", b"{")


def resize_mask(mask: Mask, size_hw: tuple[int, ...] | None) -> Mask:
    """Bring a mask to a size by its nearest pixels; None leaves it as it is."""
    if size_hw is None or mask.shape == size_hw:
        return mask
    width_height = (size_hw[1], size_hw[0])
    resized = cv2.resize(mask.astype(np.uint8), width_height, interpolation=cv2.INTER_NEAREST_EXACT)
    return resized.astype(bool)


def _white(image: Image.Image, name: str) -> Mask:
    reading = read_white(image, name=name)
    if reading.note not in (None, ALPHA_NOTE):
        message = f"{name} is {reading.note.partition(',')[0]}; give {FORMATS_TEXT}"
        raise ImageError(message)
    return reading.white


def _from_array(array: NDArray[Any], name: str) -> Mask:
    if array.ndim != 2 or array.dtype.kind not in "buif":  # noqa: PLR2004 - rows and columns
        message = f"{name} is an array of shape {array.shape}, {array.dtype}; give (H, W) bool"
        raise ImageError(message)
    return array if array.dtype == np.bool_ else np.asarray(array > _middle(array))


def _middle(array: NDArray[Any]) -> float:
    """Return the level above which an array of numbers is white; some hold 0 to 1 only."""
    return 0.5 if array.max(initial=0) <= 1 else HALF_WHITE


def _fit(mask: Mask, size_hw: tuple[int, int], name: str) -> Mask:
    (height, width), (photo_height, photo_width) = mask.shape, size_hw
    ratio = (width / max(height, 1)) / (photo_width / photo_height)
    if abs(ratio - 1) > ASPECT_TOLERANCE:
        message = (
            f"{name} has {width} x {height} pixels and its photo {photo_width} x {photo_height}; "
            "give a mask of the photo's size"
        )
        raise ImageError(message)
    return resize_mask(mask, size_hw)


def _json(content: bytes, name: str) -> Any:  # noqa: ANN401 - whatever JSON holds
    try:
        return json.loads(content)
    except (ValueError, RecursionError) as error:
        message = f"{name} is broken JSON ({one_line(str(error))}); give {FORMATS_TEXT}"
        raise ImageError(message) from error


def _filled(value: object, size_hw: tuple[int, int], name: str) -> Mask:
    """Fill polygons; holes of GeoJSON's stay empty."""
    try:
        polygons = list(_polygons(value))
    except (TypeError, ValueError, LookupError, AttributeError, OverflowError) as error:
        why = f" ({one_line(str(error))})" if isinstance(error, ValueError) else ""
        message = f"{name} holds no polygons{why}; give {FORMATS_TEXT}"
        raise ImageError(message) from error
    _check_effort(polygons, size_hw, name)
    filled = np.zeros(size_hw, dtype=bool)
    for rings in polygons:
        _fill(filled, rings)
    if not filled.any():
        height, width = size_hw
        message = f"{name} encloses nothing of its photo, {width} x {height}; give pixels (x, y)"
        raise ImageError(message)
    return filled


def _polygons(value: Any) -> Iterator[list[Ring]]:  # noqa: ANN401 - checked here
    """Yield polygons, each as its outer ring and its holes."""
    if isinstance(value, Mapping):
        yield from _from_geojson(value)
    elif _is_point(value[0]):
        yield [_ring(value)]
    else:
        yield from ([_ring(ring)] for ring in value)


def _from_geojson(value: Mapping[str, Any]) -> Iterator[list[Ring]]:
    kind = value["type"]
    if kind == "FeatureCollection":
        yield from chain.from_iterable(map(_from_geojson, value["features"]))
    elif kind == "Feature":
        if value["geometry"] is not None:  # a feature without a place, RFC 7946
            yield from _from_geojson(value["geometry"])
    elif kind in ("Polygon", "MultiPolygon"):
        polygons = [value["coordinates"]] if kind == "Polygon" else value["coordinates"]
        yield from ([_ring(ring) for ring in rings] for rings in polygons)
    else:
        message = f"a {one_line(str(kind))} is no polygon"
        raise ValueError(message)


def _is_point(value: object) -> bool:
    members = value if isinstance(value, Sequence | np.ndarray) else ()
    return len(members) > 0 and all(isinstance(one, int | float | np.number) for one in members)


def _ring(points: Any) -> Ring:  # noqa: ANN401 - checked here
    ring = np.array([[float(x), float(y)] for x, y, *_ in points])
    if len(ring) < POINTS:
        message = f"a polygon of {len(ring)} points"
        raise ValueError(message)
    return ring


def _check_effort(polygons: list[list[Ring]], size_hw: tuple[int, int], name: str) -> None:
    """Refuse what nobody draws: filling takes memory by length and time by area and number."""
    rings = [ring for polygon in polygons for ring in polygon]
    length = sum(np.abs(ring - np.roll(ring, 1, axis=0)).sum() for ring in rings)
    drawn = len(rings) <= MAX_RINGS and length <= MAX_ROUNDS * 2 * sum(size_hw)  # False of NaN
    if not drawn or _filled_px(rings, size_hw) > MAX_PHOTOS * size_hw[0] * size_hw[1]:
        message = f"{name} has more outlines, or larger ones, than anyone draws; draw fewer"
        raise ImageError(message)


def _filled_px(rings: list[Ring], size_hw: tuple[int, int]) -> int:
    boxes = (_box(ring, size_hw) for ring in rings)
    return sum((bottom - top) * (right - left) for top, bottom, left, right in boxes)


def _fill(filled: Mask, rings: list[Ring]) -> None:
    """Fill a polygon but for its holes, each inside its own box."""
    outer, *holes = rings
    top, bottom, left, right = _box(outer, filled.shape)
    inside = np.zeros((bottom - top, right - left), dtype=bool)
    if not inside.size:
        return
    inside |= _inside(outer - (left, top), inside.shape)
    for hole in holes:
        moved = hole - (left, top)
        y0, y1, x0, x1 = _box(moved, inside.shape)
        if y0 < y1 and x0 < x1:
            inside[y0:y1, x0:x1] &= ~_inside(moved - (x0, y0), (y1 - y0, x1 - x0))
    filled[top:bottom, left:right] |= inside


def _box(ring: Ring, size_hw: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Return top, bottom, left and right of what a ring may cover of a photo; ends are excluded."""
    height, width = size_hw
    left, top = np.clip(np.floor(ring.min(axis=0)), 0, (width, height)).astype(int)
    right, bottom = np.clip(np.ceil(ring.max(axis=0)), 0, (width, height)).astype(int)
    return int(top), int(bottom), int(left), int(right)


def _inside(ring: Ring, size_hw: tuple[int, ...]) -> Mask:
    height, width = size_hw
    (lengths,) = coco.frPyObjects([ring.ravel().tolist()], height, width)
    return np.asarray(coco.decode(lengths), dtype=bool)
