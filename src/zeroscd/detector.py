"""The method, one line a stage: two photos in, what was removed and added out."""

from __future__ import annotations

import logging
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from zeroscd.alignment.align import align, transfer
from zeroscd.alignment.homography import apply, invert
from zeroscd.alignment.warp import unseen, warp_map, warp_mask
from zeroscd.change.coarse import find_coarse_change
from zeroscd.images.contrast import is_blank
from zeroscd.images.read import read_photo
from zeroscd.models import Models, load_models
from zeroscd.records import CoarseChange
from zeroscd.refine.kinds import settle_kinds
from zeroscd.refine.regions import find_regions
from zeroscd.refine.shapes import drop_slivers, drop_specks
from zeroscd.refine.strength import keep_strong
from zeroscd.refine.verify import Verification, confirm
from zeroscd.refine.vote import unite, vote
from zeroscd.result import ChangeResult, NotAligned
from zeroscd.settings import preset as settings_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from zeroscd.arrays import Homography, Map, Mask
    from zeroscd.images.read import PhotoSource
    from zeroscd.records import FeatureMap, Segments
    from zeroscd.result import Photo
    from zeroscd.settings import RefineSettings, Settings

log = logging.getLogger(__name__)


def detect(
    before: PhotoSource,
    after: PhotoSource,
    *,
    preset: str = "lite",
    device: str = "auto",
    **settings: object,
) -> ChangeResult:
    """Find what changed between two photos of one place.

    Loads the models each time; for many pairs make a `Detector` once.

    Args:
        before: The t0 photo: a path, bytes, a PIL image or an (H, W, 3) uint8 RGB array.
        after: The t1 photo.
        preset: Name of a bundle of models and settings (`zeroscd.PRESETS`).
        device: "auto", "cpu" or "cuda".
        settings: Settings that differ from the preset's, by name: `tau=0.9`, `frame="t0"`.

    Raises:
        ImageError: A photo cannot be read.
        SettingsError: An unknown preset, setting or device.
        WeightsError: The preset's weights are missing or damaged.
    """
    detector = Detector.from_preset(preset, device=device, overrides=settings)
    return detector.detect(before, after)


class Detector:
    """Finds what changed between two photos, with models that stay loaded.

    Args:
        settings: Everything that decides the outcome.
        models: Encoder and segmenter.
        preset: The name that results carry.
    """

    def __init__(self, settings: Settings, models: Models, *, preset: str = "custom") -> None:
        self.settings = settings
        self.models = models
        self.preset = preset

    @classmethod
    def from_preset(
        cls,
        name: str,
        *,
        device: str = "auto",
        overrides: Mapping[str, object] | None = None,
    ) -> Detector:
        """Load a preset's models.

        Raises:
            SettingsError: An unknown preset, setting or device.
            WeightsError: The weights are missing or damaged.
        """
        settings = settings_of(name).override(overrides or {})
        return cls(settings, load_models(settings, device=device), preset=name)

    def detect(self, before: PhotoSource, after: PhotoSource) -> ChangeResult:
        """Find what changed; the photos may differ in size.

        Raises:
            ImageError: A photo cannot be read.
        """
        clock = Clock()
        with clock.stage("read"):
            photo_t0, photo_t1 = read_photo(before), read_photo(after)
        with clock.stage("encode"):
            maps_t0, maps_t1 = self.models.encoder.encode([photo_t0.pixels, photo_t1.pixels])
        with clock.stage("align"):
            sizes_hw = (photo_t0.size_hw, photo_t1.size_hw)
            alignment = _blankness(photo_t0, photo_t1) or align(
                maps_t0, maps_t1, self.settings.align, sizes_hw=sizes_hw
            )
            if isinstance(alignment, NotAligned):
                log.info("compared without alignment: %s", alignment.reason)
            pair = Pair(photo_t0, photo_t1, maps_t0, maps_t1, transfer(alignment, *sizes_hw))
        with clock.stage("coarse"):
            coarse_t0, coarse_t1 = self._coarse(pair)
        with clock.stage("segment"):
            segments_t0 = self._segment(photo_t0, maps_t0, coarse_t0)
            segments_t1 = self._segment(photo_t1, maps_t1, coarse_t1)
        with clock.stage("refine"):
            removed, added = self._refine(pair, (coarse_t0, coarse_t1), (segments_t0, segments_t1))
            # An outline may reach beyond what the other photo shows: no statement there.
            removed, added = removed & ~coarse_t0.unknown, added & ~coarse_t1.unknown
            regions = find_regions(removed, added, coarse_t0, coarse_t1)
        t0_is_frame = self.settings.frame == "t0"
        coarse = coarse_t0 if t0_is_frame else coarse_t1
        return ChangeResult(
            before=photo_t0,
            after=photo_t1,
            frame=self.settings.frame,
            mask=removed | pair.to_t0(added) if t0_is_frame else added | pair.to_t1(removed),
            removed=removed,
            added=added,
            unknown=coarse.unknown,
            heatmap=coarse.distance,
            regions=regions,
            alignment=alignment,
            settings=self.settings,
            preset=self.preset,
            seconds=clock.seconds,
        )

    def _coarse(self, pair: Pair) -> tuple[CoarseChange, CoarseChange]:
        settings, tau = self.settings.change, self.models.encoder.tau
        coarse_t0 = find_coarse_change(
            pair.maps_t0,
            pair.maps_t1,
            lambda points: apply(pair.t1_from_t0, points),
            settings,
            tau=tau,
            unseen=unseen(pair.size_t1_hw, pair.t0_from_t1, size_b_hw=pair.size_t0_hw),
        )
        unseen_t1 = unseen(pair.size_t0_hw, pair.t1_from_t0, size_b_hw=pair.size_t1_hw)
        if settings.coarse_frames == "t0":
            return coarse_t0, CoarseChange(
                distance=warp_map(coarse_t0.distance, pair.t1_from_t0, size_b_hw=pair.size_t1_hw),
                changed=pair.to_t1(coarse_t0.changed),
                unknown=unseen_t1,
                tau=coarse_t0.tau,
            )
        coarse_t1 = find_coarse_change(
            pair.maps_t1,
            pair.maps_t0,
            lambda points: apply(pair.t0_from_t1, points),
            settings,
            tau=tau,
            unseen=unseen_t1,
        )
        return coarse_t0, coarse_t1

    def _segment(
        self, photo: Photo, maps: tuple[FeatureMap, ...], coarse: CoarseChange
    ) -> Segments:
        everything = self.settings.segment.prompting == "everything"
        where = None if everything else coarse.changed
        return self.models.segmenter.segment(photo.pixels, maps, where=where)

    def _refine(
        self,
        pair: Pair,
        coarse: tuple[CoarseChange, CoarseChange],
        segments: tuple[Segments, Segments],
    ) -> tuple[Mask, Mask]:
        refine = self.settings.refine
        flagged_t0 = vote(segments[0], coarse[0], alpha=refine.alpha)
        flagged_t1 = vote(segments[1], coarse[1], alpha=refine.alpha)
        rule = Verification(refine.verify, refine.beta)
        kept_t0 = confirm(flagged_t0, segments, pair.to_t1, rule)
        kept_t1 = confirm(flagged_t1, segments[::-1], pair.to_t0, rule)
        removed_t0 = unite(kept_t0, pair.size_t0_hw)
        added_t1 = unite(kept_t1, pair.size_t1_hw)
        if refine.kinds == "novelty":
            removed_t0, added_t1 = settle_kinds(
                removed_t0,
                added_t1,
                novelty_t0=coarse[0].distance - pair.map_to_t0(coarse[1].distance),
                novelty_t1=coarse[1].distance - pair.map_to_t1(coarse[0].distance),
                carriers=(pair.to_t0, pair.to_t1),
            )
        return (
            _things(removed_t0, coarse[0], refine),
            _things(added_t1, coarse[1], refine),
        )


@dataclass(frozen=True, slots=True)
class Pair:
    """Two photos with their features, and the way between their frames."""

    photo_t0: Photo
    photo_t1: Photo
    maps_t0: tuple[FeatureMap, ...]
    maps_t1: tuple[FeatureMap, ...]
    t1_from_t0: Homography

    @property
    def t0_from_t1(self) -> Homography:
        """The way back."""
        return invert(self.t1_from_t0)

    @property
    def size_t0_hw(self) -> tuple[int, int]:
        """Height and width of the photo before."""
        return self.photo_t0.size_hw

    @property
    def size_t1_hw(self) -> tuple[int, int]:
        """Height and width of the photo after."""
        return self.photo_t1.size_hw

    def to_t0(self, mask_t1: Mask) -> Mask:
        """Carry a mask to the photo before."""
        return warp_mask(mask_t1, self.t0_from_t1, size_b_hw=self.size_t0_hw)

    def to_t1(self, mask_t0: Mask) -> Mask:
        """Carry a mask to the photo after."""
        return warp_mask(mask_t0, self.t1_from_t0, size_b_hw=self.size_t1_hw)

    def map_to_t0(self, map_t1: Map) -> Map:
        """Carry one number a pixel to the photo before."""
        return warp_map(map_t1, self.t0_from_t1, size_b_hw=self.size_t0_hw)

    def map_to_t1(self, map_t0: Map) -> Map:
        """Carry one number a pixel to the photo after."""
        return warp_map(map_t0, self.t1_from_t0, size_b_hw=self.size_t1_hw)


class Clock:
    """Adds up the wall time of named stages."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Count what happens inside the block towards a stage."""
        start = time.perf_counter()
        yield
        self.seconds[name] = round(time.perf_counter() - start, 4)


def _things(mask: Mask, coarse: CoarseChange, refine: RefineSettings) -> Mask:
    """Leave out what is too thin, too weak or too small to be a thing."""
    wide = drop_slivers(mask, least_width=refine.least_width)
    strong = keep_strong(wide, coarse, least_peak=refine.least_peak)
    return drop_specks(strong, min_area_px=refine.min_area_px)


def _blankness(photo_t0: Photo, photo_t1: Photo) -> NotAligned | None:
    for photo, when in ((photo_t0, "before"), (photo_t1, "after")):
        if is_blank(photo.pixels):
            reason = f"the photo {when} is blank: there is nothing to align"
            return NotAligned(reason=reason, inliers=0, matches=0)
    return None
