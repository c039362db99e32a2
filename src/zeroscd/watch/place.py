"""The place that is watched: its references, and what differs from them in a frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pycocotools import mask as coco

from zeroscd.alignment.homography import homography_or_resize, invert
from zeroscd.alignment.known import refuse_for_several
from zeroscd.alignment.warp import warp_mask
from zeroscd.errors import ImageError, SettingsError
from zeroscd.evidence import whole_homography
from zeroscd.given import Given
from zeroscd.records import NotAligned
from zeroscd.segments import Segment
from zeroscd.steps import align_photos
from zeroscd.watch.tracks import Sighting

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from zeroscd.arrays import Homography, Mask, Rgb
    from zeroscd.detector import Detector
    from zeroscd.evidence import EncodedPhoto
    from zeroscd.images.read import PhotoSource
    from zeroscd.records import Region
    from zeroscd.result import ChangeResult


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What a frame says about the place, in pixels of the first reference.

    Attributes:
        sightings: Its changed regions, most certain first.
        unchanged: (H, W) judged, and unchanged.
        judged_fraction: 0..1, share of the reference's pixels that are judged.
        reference_from_frame: Carries the frame's pixels here.
    """

    sightings: tuple[Sighting, ...]
    unchanged: Mask
    judged_fraction: float
    reference_from_frame: Homography


class Place:
    """A place, by one or several reference photos, each encoded once.

    Args:
        detector: What compares. `frame` of its settings does not count here.
        references: Photos of the place as it should be; everything is reported in the pixels of
            the first one.
        given: What does not count, and the geometry, if it is known: see `Detector.detect`.
            `ignore_before` and `roi_before` are areas of the first reference.

    Raises:
        ImageError: There is no reference, or one cannot be read, or an area does not fit.
        SettingsError: The geometry cannot relate the photos, or an area is that of one frame.
    """

    def __init__(
        self, detector: Detector, references: Sequence[PhotoSource], given: Given | None = None
    ) -> None:
        self._detector, self._given = detector, given or Given()
        _check(references, self._given)
        self._settings = detector.settings.override({"frame": "t0"})
        encoded = detector.encode(references)
        # Areas belong to the references; there is no frame yet.
        self._references, _ = self._given.mark(encoded, encoded[:1])
        self._first_from = [self._to_first(one) for one in self._references]

    @property
    def reference(self) -> Rgb:
        """The first reference, (H, W, 3)."""
        return self._references[0].photo.pixels

    @property
    def apart(self) -> list[int]:
        """Positions of the references that cannot be aligned with the first one."""
        return [k for k, way in enumerate(self._first_from) if way is None]

    def compare(self, photo: PhotoSource) -> View | NotAligned:
        """Compare a frame with the references.

        Returns:
            Why not, if it cannot be aligned with any of them.

        Raises:
            ImageError: The frame cannot be read, or an area does not fit it.
        """
        frame = self._detector.encode([photo])[0].leave_out(ignore=self._given.ignore_all)
        try:
            evidence = self._detector.compare(
                self._references, frame, t1_from_t0=self._given.t1_from_t0
            )
        except ImageError as error:  # the areas of the first reference cannot be carried
            return NotAligned(reason=str(error), inliers=0, matches=0)
        if isinstance(evidence.alignment, NotAligned):
            return evidence.alignment
        first = next(k for k, one in enumerate(self._references) if one is evidence.pair.photo_t0)
        first_from_own = self._first_from[first]
        if first_from_own is None:
            reason = f"it shows reference {first + 1}, which cannot be aligned with the first one"
            return NotAligned(reason=reason, inliers=0, matches=0)
        return self._view(self._detector.decide(evidence, self._settings), first_from_own)

    def _to_first(self, photo: EncodedPhoto) -> Homography | None:
        first = self._references[0]
        if photo is first:
            return np.eye(3)
        found = align_photos(photo, first, self._settings.align, self._given.t1_from_t0)
        if isinstance(found, NotAligned):
            return None
        return whole_homography(found.t1_from_t0, photo, first)

    def _view(self, result: ChangeResult, first_from_before: Homography) -> View:
        size_hw = self._references[0].photo.size_hw
        before, after = result.before.size_hw, result.after.size_hw
        after_from_before = homography_or_resize(result.alignment, before, after)
        first_from_after = first_from_before @ invert(after_from_before)
        ways = {"t0": first_from_before, "t1": first_from_after}
        unchanged = _carried(~(result.unknown | result.mask), first_from_before, size_hw)
        changed = _carried(result.mask, first_from_before, size_hw)
        return View(
            sightings=tuple(_sightings(result.regions, ways, size_hw)),
            unchanged=unchanged,
            judged_fraction=float((unchanged | changed).mean()),
            reference_from_frame=first_from_after,
        )


def _check(references: Sequence[PhotoSource], given: Given) -> None:
    if not references:
        message = "there is no reference: give at least one photo of the place as it should be"
        raise ImageError(message)
    if given.ignore is not None or given.roi is not None:
        message = "frames have no areas of their own; give those of the first reference"
        raise SettingsError(message)
    if given.t1_from_t0 is not None and len(references) > 1:
        refuse_for_several(given.t1_from_t0)


def _sightings(
    regions: Sequence[Region], ways: dict[str, Homography], size_hw: tuple[int, int]
) -> Iterator[Sighting]:
    """Carry regions to the first reference; what it does not show is left out."""
    for region in regions:
        mask = coco.decode(dict(region.rle)).view(np.bool_)
        segment = Segment.from_mask(_carried(mask, ways[region.frame], size_hw))
        if segment is not None:
            yield Sighting(kind=region.kind, score=region.score, segment=segment)


def _carried(mask: Mask, way: Homography, size_hw: tuple[int, int]) -> Mask:
    if mask.shape == size_hw and np.array_equal(way, np.eye(3)):
        return mask
    return warp_mask(mask, way, size_b_hw=size_hw)
