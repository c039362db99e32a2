"""What a user knows of a pair beside its pixels: areas that do not count, and the geometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.alignment.known import FIXED, geometry_in
from zeroscd.errors import ImageError, SettingsError
from zeroscd.images.areas import read_area

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from zeroscd.alignment.known import KnownGeometry
    from zeroscd.evidence import EncodedPhoto, Pair
    from zeroscd.images.areas import AreaSource

AREAS = ("ignore", "ignore_before", "roi", "roi_before")  # each for one photo
ALIGN = "align"  # what files call the geometry
GIVEN = (*AREAS, ALIGN)


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """Areas and geometry of a pair; see `zeroscd.Detector.detect`.

    Attributes:
        ignore: What does not count in the first photo after.
        ignore_before: What does not count in the first photo before.
        roi: Where to look only, in the first photo after.
        roi_before: Where to look only, in the first photo before.
        ignore_all: What does not count in any photo.
        t1_from_t0: Known geometry.
    """

    ignore: AreaSource | None = None
    ignore_before: AreaSource | None = None
    roi: AreaSource | None = None
    roi_before: AreaSource | None = None
    ignore_all: AreaSource | None = None
    t1_from_t0: KnownGeometry | None = None

    @classmethod
    def from_files(
        cls,
        files: Mapping[str, bytes],
        *,
        ignore_all: bytes | None = None,
        t1_from_t0: KnownGeometry | None = None,
    ) -> Given:
        """Make one of files' bytes.

        Args:
            files: By the names of `AREAS`, and `ALIGN` for the geometry.
            ignore_all: What does not count in any photo.
            t1_from_t0: The geometry, where no file says it.

        Raises:
            SettingsError: The geometry's file holds something else.
        """
        if ALIGN in files:
            t1_from_t0 = geometry_in(files[ALIGN], name="the field align")
        areas = {name: files.get(name) for name in AREAS}
        return cls(**areas, ignore_all=ignore_all, t1_from_t0=t1_from_t0)

    def refuse_for_transients(self) -> None:
        """Refuse areas of one photo where what stands in one photo only is asked for.

        Raises:
            SettingsError: One is given; it could not be carried to all photos.
        """
        if any(getattr(self, name) is not None for name in AREAS):
            message = (
                "transients cannot be listed where an area of one photo is left out; leave it out "
                "of all photos (ignore_all)"
            )
            raise SettingsError(message)

    def mark(
        self, before: Sequence[EncodedPhoto], after: Sequence[EncodedPhoto]
    ) -> tuple[list[EncodedPhoto], list[EncodedPhoto]]:
        """Return the photos before and after with what does not count in them.

        Raises:
            ImageError: An area cannot be read or does not fit its photo.
        """
        old, new = (
            [photo.leave_out(ignore=self.ignore_all) for photo in side] for side in (before, after)
        )
        for side, (ignore, roi) in zip((old, new), self._of_first_photos(), strict=True):
            side[0] = side[0].leave_out(ignore=ignore, roi=roi)
        return old, new

    def check(
        self, sizes_before: Sequence[tuple[int, int]], sizes_after: Sequence[tuple[int, int]]
    ) -> None:
        """Read every area once, to refuse those that do not fit before anything slow begins.

        Args:
            sizes_before: Height and width of the photos before.
            sizes_after: The same of the photos after.

        Raises:
            ImageError: One cannot be read or does not fit its photo.
        """
        sides = zip((sizes_before, sizes_after), self._of_first_photos(), strict=True)
        for sizes, areas in sides:
            wanted = [(area, sizes[0]) for area in areas]
            for area, size_hw in [*wanted, *((self.ignore_all, size_hw) for size_hw in sizes)]:
                if area is not None:
                    read_area(area, size_hw=size_hw)

    def _of_first_photos(self) -> tuple[tuple[AreaSource | None, AreaSource | None], ...]:
        """Return what is ignored and what is wanted in the first photo before, and after."""
        return (self.ignore_before, self.roi_before), (self.ignore, self.roi)


def is_fixed(name: str, value: str) -> bool:
    """Tell whether a column says that the camera did not move, and is no address.

    Example:
        >>> is_fixed("align", "none"), is_fixed("ignore", "none")
        (True, False)
    """
    return (name, value) == (ALIGN, FIXED)


def check_areas(pair: Pair, photo_t0: EncodedPhoto, photo_t1: EncodedPhoto) -> None:
    """Check that what is left out of the first photos is left out of the pair that is answered.

    Where the first photo of a side cannot be aligned, another one takes its place.

    Raises:
        ImageError: An area belongs to a photo that says nothing.
    """
    sides = (photo_t0, pair.photo_t0, "before"), (photo_t1, pair.photo_t1, "after")
    for first, chosen, when in sides:
        if first is not chosen and (first.wanted is not None or _leaves_more(first, chosen)):
            message = (
                f"the first photo {when} cannot be aligned, so that its area cannot be carried; "
                "leave out that photo, or the area"
            )
            raise ImageError(message)


def _leaves_more(first: EncodedPhoto, chosen: EncodedPhoto) -> bool:
    """Tell whether a photo has an area beyond that of all photos."""
    if first.ignored is None:
        return False
    same_size = chosen.ignored is not None and chosen.ignored.shape == first.ignored.shape
    return not same_size or bool((first.ignored & ~np.asarray(chosen.ignored)).any())
