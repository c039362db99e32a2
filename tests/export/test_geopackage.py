"""A GeoPackage as GDAL reads it."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.export.geopackage import geopackage

if TYPE_CHECKING:
    from pathlib import Path

pyogrio = pytest.importorskip("pyogrio")

POINT = struct.pack("<BIdd", 1, 1, 9.5, 48.25)


def test_a_layer_has_its_name_crs_types_and_nulls_and_is_the_same_each_time(
    tmp_path: Path,
) -> None:
    columns: dict[str, list[Any]] = {"id": [1, None], "share": [0.5, None], "name": ["ä", None]}

    def write() -> bytes:
        return geopackage(
            "things",
            [POINT, None],
            columns,
            types={"id": np.int32, "share": np.float64},
            kind=("Point", "EPSG:4326"),
        )

    assert write() == write()
    path = tmp_path / "things.gpkg"
    path.write_bytes(write())
    assert pyogrio.list_layers(path).tolist() == [["things", "Point"]]
    meta, _, geometries, _ = pyogrio.raw.read(path)
    assert meta["crs"] == "EPSG:4326"
    assert geometries.tolist() == [POINT, None]
    info = pyogrio.read_info(path)
    assert list(info["fields"]) == ["id", "share", "name"]
    assert list(info["dtypes"]) == ["int32", "float64", "object"]
    nothing = pyogrio.raw.read(path, where="id is null and share is null and name is null")
    assert len(nothing[2]) == 1
