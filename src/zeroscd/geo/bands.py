"""Which bands of a raster are shown, and how their values become the 0..255 of a photo."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from rasterio.enums import ColorInterp
from rasterio.errors import RasterioError

from zeroscd.errors import ImageError, SettingsError
from zeroscd.text import one_line, shown

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray
    from rasterio.io import DatasetReader

    from zeroscd.arrays import Rgb

    Stretch: TypeAlias = str | tuple[float, float]

RGB = (ColorInterp.red, ColorInterp.green, ColorInterp.blue)
COLOURS = len(RGB)
PERCENT = (2, 98)  # of the valid values of a band, what viewers of satellite images take
SAMPLE_PX = 1024  # the longer side of the reduced raster whose percentiles are taken
FULL = 255
AUTO, NONE, PERCENTILE = "auto", "none", "percentile"


class Rendering(NamedTuple):
    """How a raster becomes a photo.

    Attributes:
        bands: One, shown as grey, or three, as red, green and blue; numbered from 1.
        ranges: For each, the values that become 0 and 255; None where bytes stay as they are.
    """

    bands: tuple[int, ...]
    ranges: tuple[tuple[float, float], ...] | None

    def apply(self, values: NDArray[np.generic]) -> Rgb:
        """Turn values of the bands, (bands, H, W), into a photo, (H, W, 3) uint8."""
        if self.ranges is None:
            scaled = values
        else:
            low, high = np.array(self.ranges, dtype=np.float64).T[:, :, None, None]
            share = (np.nan_to_num(values.astype(np.float64)) - low) / (high - low)
            scaled = np.rint(share.clip(0, 1) * FULL).astype(np.uint8)
        photo = np.moveaxis(scaled, 0, 2)
        colours = photo if len(self.bands) == COLOURS else np.repeat(photo, COLOURS, axis=2)
        return np.ascontiguousarray(colours, dtype=np.uint8)


def rendering(
    raster: DatasetReader, *, bands: Sequence[int] | None, stretch: Stretch, name: str
) -> Rendering:
    """Choose the bands of a raster and fit the stretch once for all of it.

    Args:
        raster: Open.
        bands: One or three; if None, those that the file calls red, green and blue, else the first
            three, else the first.
        stretch: "none" leaves bytes as they are; "percentile" brings the 2nd and the 98th
            percentile of each band to 0 and 255; two numbers are the values that become 0 and
            255; "auto" is "none" for bytes and "percentile" for all else.
        name: Of the raster, for messages.

    Raises:
        ImageError: The raster has a palette or complex numbers, or is damaged.
        SettingsError: It has no such band, or its values are no bytes and shall not be stretched.
    """
    chosen = _bands(raster, bands, name)
    kinds = {np.dtype(raster.dtypes[band - 1]) for band in chosen}
    if any(kind.kind == "c" for kind in kinds):
        message = f"{name} holds complex numbers; give a raster of their magnitudes"
        raise ImageError(message)
    is_bytes = kinds == {np.dtype(np.uint8)}
    if stretch == NONE and not is_bytes:
        message = (
            f"{name} holds {raster.dtypes[chosen[0] - 1]}, not bytes; choose another --stretch"
        )
        raise SettingsError(message)
    if stretch == NONE or (stretch == AUTO and is_bytes):
        return Rendering(chosen, None)
    if isinstance(stretch, tuple):
        return Rendering(chosen, (stretch,) * len(chosen))
    with reading(name):
        return Rendering(chosen, tuple(_percentiles(raster, band) for band in chosen))


@contextmanager
def reading(name: str) -> Iterator[None]:
    """Turn GDAL's errors while pixels are read into one line.

    Raises:
        ImageError: The file is damaged or cannot be read any more.
    """
    try:
        yield
    except RasterioError as error:
        message = f"{name} is damaged ({one_line(str(error))}); copy or download it again"
        raise ImageError(message) from error


def parse_bands(text: str | None) -> tuple[int, ...] | None:
    """Read band numbers as typed.

    Raises:
        SettingsError: They are not one or three numbers from 1.

    Example:
        >>> parse_bands("4,3,2"), parse_bands(None)
        ((4, 3, 2), None)
    """
    if text is None:
        return None
    parts = text.split(",")
    if len(parts) not in (1, COLOURS) or not all(p.strip().isdecimal() for p in parts):
        message = f"bands are one or three numbers from 1, such as 4,3,2, not {shown(text)}"
        raise SettingsError(message)
    return tuple(int(part) for part in parts)


def parse_stretch(text: str) -> Stretch:
    """Read a stretch as typed.

    Raises:
        SettingsError: It is none.

    Example:
        >>> parse_stretch("percentile"), parse_stretch("0,3000")
        ('percentile', (0.0, 3000.0))
    """
    if text in (AUTO, NONE, PERCENTILE):
        return text
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        low = high = 0.0
    if not (np.isfinite((low, high)).all() and low < high):
        message = (
            f"a stretch is auto, none, percentile, or two rising numbers such as 0,3000, "
            f"not {shown(text)}"
        )
        raise SettingsError(message)
    return low, high


def _bands(raster: DatasetReader, bands: Sequence[int] | None, name: str) -> tuple[int, ...]:
    kinds = list(raster.colorinterp)
    chosen = _default_bands(kinds) if bands is None else tuple(bands)
    for band in chosen:
        if not 1 <= band <= len(kinds):
            message = f"{name} has no band {band}; choose from 1 to {len(kinds)}"
            raise SettingsError(message)
        if kinds[band - 1] == ColorInterp.palette:
            message = f"{name} has a palette; expand it: gdal_translate -expand rgb IN.tif OUT.tif"
            raise ImageError(message)
    return chosen


def _default_bands(kinds: Sequence[ColorInterp]) -> tuple[int, ...]:
    if all(kinds.count(colour) == 1 for colour in RGB):
        return tuple(kinds.index(colour) + 1 for colour in RGB)
    shown_bands = [at for at, kind in enumerate(kinds, start=1) if kind != ColorInterp.alpha] or [1]
    return tuple(shown_bands[:COLOURS] if len(shown_bands) >= COLOURS else shown_bands[:1])


def _percentiles(raster: DatasetReader, band: int) -> tuple[float, float]:
    """Return the values of a band that become 0 and 255, of a reduced raster's valid pixels."""
    scale = min(1.0, SAMPLE_PX / max(raster.shape))
    size_hw = tuple(max(1, round(side * scale)) for side in raster.shape)
    values = raster.read(band, out_shape=size_hw)
    valid = values[(raster.dataset_mask(out_shape=size_hw) > 0) & np.isfinite(values)]
    if not valid.size:
        return 0.0, 1.0
    low, high = (float(one) for one in np.percentile(valid, PERCENT))
    return low, high if high > low else low + 1.0
