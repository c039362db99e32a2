"""Areas that users draw: masks and polygons become the pixels that they mean."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from zeroscd.errors import ImageError
from zeroscd.images.areas import read_area, resize_mask
from zeroscd.refine.polygons import outer_polygons

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.arrays import Mask

SIZE = (6, 9)
BOX = [(2, 1), (7, 1), (7, 4), (2, 4)]


def boxed() -> Mask:
    mask = np.zeros(SIZE, bool)
    mask[1:4, 2:7] = True
    return mask


def png_of(array: Any) -> bytes:
    file = io.BytesIO()
    Image.fromarray(array).save(file, "PNG")
    return file.getvalue()


def geojson(kind: str) -> dict[str, Any]:
    polygon: dict[str, Any] = {"type": "Polygon", "coordinates": [[*BOX, BOX[0]]]}
    feature = {"type": "Feature", "geometry": polygon, "properties": {}}
    kinds: dict[str, dict[str, Any]] = {
        "Polygon": polygon,
        "MultiPolygon": {"type": "MultiPolygon", "coordinates": [polygon["coordinates"]]},
        "Feature": feature,
        "FeatureCollection": {"type": "FeatureCollection", "features": [feature]},
    }
    return kinds[kind]


SOURCES = {
    "bool": boxed(),
    "numbers": boxed().astype(np.uint8) * 255,
    "ones": boxed().astype(np.float32),
    "picture": Image.fromarray(boxed()),
    "bytes": png_of(boxed().astype(np.uint8) * 255),
    "a polygon": BOX,
    "polygons": [BOX],
    "two polygons": [[(2, 1), (5, 1), (5, 4), (2, 4)], [(4, 1), (7, 1), (7, 4), (4, 4)]],
    "JSON": json.dumps([BOX]).encode(),
    "JSON of Windows": b"\xef\xbb\xbf" + json.dumps([BOX]).encode(),
    "a feature without a place": {
        "type": "FeatureCollection",
        "features": [{"type": "Feature", "geometry": None}, geojson("Feature")],
    },
    **{kind: geojson(kind) for kind in ("Polygon", "MultiPolygon", "Feature")},
    "GeoJSON": json.dumps(geojson("FeatureCollection")).encode(),
}


@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES.keys())
def test_every_way_to_name_an_area_means_the_same_pixels(source: Any) -> None:
    assert read_area(source, size_hw=SIZE).tolist() == boxed().tolist()


@pytest.mark.parametrize("name", ["hood.png", "hood.json", "hood.geojson"])
def test_a_path_is_read_by_what_its_file_holds(tmp_path: Path, name: str) -> None:
    content = {
        "hood.png": png_of(boxed()),
        "hood.json": b" [[[2,1],[7,1],[7,4],[2,4]]]",
        "hood.geojson": json.dumps(geojson("Feature")).encode(),
    }[name]
    (tmp_path / name).write_bytes(content)
    assert read_area(tmp_path / name, size_hw=SIZE).tolist() == boxed().tolist()


def test_a_hole_of_geojson_stays_empty() -> None:
    hole = [[3, 2], [5, 2], [5, 3], [3, 3]]
    found = read_area({"type": "Polygon", "coordinates": [BOX, hole]}, size_hw=SIZE)
    expected = boxed()
    expected[2, 3:5] = False
    assert found.tolist() == expected.tolist()


@given(hnp.arrays(bool, st.tuples(st.integers(2, 12), st.integers(2, 12))))
def test_the_polygons_of_regions_come_back_as_their_pixels(mask: Mask) -> None:
    rings = outer_polygons(mask)
    if rings:
        again = read_area([list(ring) for ring in rings], size_hw=mask.shape)
        assert outer_polygons(again) == rings


def test_a_mask_of_the_same_shape_is_brought_to_the_photo() -> None:
    small = np.array([[True, False, False]])
    found = read_area(small, size_hw=(10, 30))
    assert found[:, :10].all()
    assert not found[:, 10:].any()


WRONG = {
    "another shape": (np.zeros((6, 6), bool), r"hood has 6 x 6 pixels and its photo 9 x 6"),
    "colours": (np.zeros((6, 9, 3), np.uint8), r"array of shape \(6, 9, 3\)"),
    "a photo": (
        png_of(np.arange(6 * 9 * 3, dtype=np.uint8).reshape(6, 9, 3) * 7),
        "hood is .*give white on black, or polygons",
    ),
    "broken JSON": (b"[[[2, 1], ", "broken JSON"),
    "other JSON": (b'{"hood": [1, 2]}', "holds no polygons"),
    "a line": ({"type": "LineString", "coordinates": BOX}, "a LineString is no polygon"),
    "two points": ([[(1, 1), (2, 2)]], "a polygon of 2 points"),
    "no numbers": ([[(1, 1), (2, float("nan")), (3, 3)]], "more outlines, or larger ones"),
    "nothing": ([], "holds no polygons"),
    "far too long": ([[(0, 0), (1e9, 1e9), (0, 1e9)]], "more outlines, or larger ones"),
    "too many": ([BOX] * 1001, "more outlines, or larger ones"),
    "endless numbers": (b"[[[1" + b"0" * 400 + b", 1], [2, 2], [1, 2]]]", "holds no polygons"),
    "elsewhere": ([[(90, 90), (99, 90), (99, 99)]], "encloses nothing of its photo, 9 x 6"),
    "no picture": (b"hood", "hood"),
    "a number": (7, "holds no polygons"),
}


@pytest.mark.parametrize(("source", "message"), WRONG.values(), ids=WRONG.keys())
def test_what_is_no_area_of_the_photo_is_refused(source: Any, message: str) -> None:
    with pytest.raises(ImageError, match=message) as caught:
        read_area(source, size_hw=SIZE, name="hood")
    assert "\n" not in str(caught.value)


def test_masks_are_resized_by_their_nearest_pixels() -> None:
    mask = np.zeros((4, 6), bool)
    mask[:, 2:4] = True
    assert resize_mask(mask, (2, 3)).tolist() == [[False, True, False]] * 2
    assert np.array_equal(resize_mask(resize_mask(mask, (8, 12)), (4, 6)), mask)
    assert resize_mask(mask, None) is mask
