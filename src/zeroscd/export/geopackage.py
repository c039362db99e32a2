"""A layer of a map as a GeoPackage, the file that QGIS and other GIS programs open."""

from __future__ import annotations

import io
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

DATE = "OGR_CURRENT_DATE"  # GDAL's option: when a layer was changed


def is_available() -> bool:
    """Return whether pyogrio is installed."""
    return find_spec("pyogrio") is not None


def geopackage(
    layer: str,
    geometries: Sequence[bytes | None],
    columns: Mapping[str, Sequence[Any]],
    *,
    types: Mapping[str, type[np.generic]],
    kind: tuple[str, str],
) -> bytes:
    """Return a GeoPackage with one layer; equal values are equal bytes.

    Args:
        layer: Its name.
        geometries: Well-known binary of each row, or None for what has no place.
        columns: Values of each column, one a row; None is null.
        types: Of the columns that are numbers; all others are text.
        kind: Geometry type, such as "Point", and CRS, such as "EPSG:4326" or WKT.

    Source: OGC 12-128r19; ISO 13249-3 well-known binary.
    """
    import pyogrio  # noqa: PLC0415 - GDAL takes half a second

    data = [
        np.array([value or 0 for value in values], types[name])
        if name in types
        else np.array(values, dtype=object)
        for name, values in columns.items()
    ]
    file = io.BytesIO()
    with _without_date():
        pyogrio.raw.write(
            file,
            np.array(geometries, dtype=object),
            data,
            list(columns),
            field_mask=[
                np.array([value is None for value in values], dtype=bool)
                for values in columns.values()
            ],
            layer=layer,
            driver="GPKG",
            geometry_type=kind[0],
            crs=kind[1],
        )
    return file.getvalue()


@contextmanager
def _without_date() -> Iterator[None]:
    """Let GDAL note the same time in every file."""
    import pyogrio  # noqa: PLC0415 - as above

    before = pyogrio.get_gdal_config_option(DATE)
    pyogrio.set_gdal_config_options({DATE: "1970-01-01T00:00:00.000Z"})
    try:
        yield
    finally:
        pyogrio.set_gdal_config_options({DATE: before})
