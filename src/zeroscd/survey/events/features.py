"""Photos encoded once for all their neighbours, and aligned with each other."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from zeroscd.alignment.align import align
from zeroscd.alignment.homography import invert
from zeroscd.cache import ExpiringCache
from zeroscd.detector import Detector
from zeroscd.errors import ImageError
from zeroscd.evidence import whole_homography
from zeroscd.images.read import read_photo
from zeroscd.records import Alignment

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.arrays import Homography
    from zeroscd.batch.comparer import Options
    from zeroscd.evidence import EncodedPhoto


class PhotoFeatures:
    """Encodes photos with a survey's own detector, which is made when first needed.

    Args:
        options: How the survey compares: its detector and memory for encoded photos.
        fetch: Returns a photo's bytes, or raises ImageError.
    """

    def __init__(self, options: Options, fetch: Callable[[str], bytes]) -> None:
        self._make_detector = options.detector
        self._ignore_all = options.ignore_all
        self._detector: Detector | None = None
        self._fetch = fetch
        self._unreadable: set[str] = set()
        self._aligned: dict[tuple[str, str], Homography | None] = {}
        self._encoded: ExpiringCache[EncodedPhoto] = ExpiringCache(
            options.cache_bytes, size_of=lambda photo: photo.size_bytes, keep_newest=True
        )

    def encode(self, photo: str) -> EncodedPhoto | None:
        """Encode a photo; None if it can no longer be read."""
        if photo in self._unreadable:
            return None
        known = self._encoded.get(photo)
        if known is None:
            try:
                decoded = read_photo(self._fetch(photo))
                (encoded,) = self._loaded().encode([decoded.pixels])
                known = encoded.leave_out(ignore=self._ignore_all)
            except ImageError:
                self._unreadable.add(photo)
                return None
            self._encoded.put(known, photo)
        return known

    def align(self, photo_a: str, photo_b: str) -> Homography | None:
        """Return b_from_a; None where the photos cannot be aligned or one can no longer be read."""
        if (photo_b, photo_a) in self._aligned:
            a_from_b = self._aligned[photo_b, photo_a]
            return None if a_from_b is None else invert(a_from_b)
        if (photo_a, photo_b) not in self._aligned:
            self._aligned[photo_a, photo_b] = self._align(photo_a, photo_b)
        return self._aligned[photo_a, photo_b]

    def _align(self, photo_a: str, photo_b: str) -> Homography | None:
        encoded_a, encoded_b = self.encode(photo_a), self.encode(photo_b)
        if encoded_a is None or encoded_b is None:
            return None
        found = align(
            encoded_a.maps,
            encoded_b.maps,
            self._loaded().settings.align,
            sizes_hw=(encoded_a.size_hw, encoded_b.size_hw),
            ignored=(encoded_a.ignored, encoded_b.ignored),
        )
        if not isinstance(found, Alignment):
            return None
        return whole_homography(found.t1_from_t0, encoded_a, encoded_b)

    def _loaded(self) -> Detector:
        if self._detector is None:
            made = self._make_detector()
            models = replace(made.models, labeller=None)  # regions have their labels
            self._detector = Detector(made.settings, models)
        return self._detector
