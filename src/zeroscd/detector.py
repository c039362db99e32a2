"""The method, one line a stage: two photos in, what was removed and added out."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from zeroscd.alignment.align import align, transfer
from zeroscd.alignment.homography import apply
from zeroscd.alignment.warp import unseen
from zeroscd.change.coarse import find_coarse_change, fuse_depths, measure_distances
from zeroscd.clock import Clock
from zeroscd.evidence import Evidence, Pair, View
from zeroscd.images.contrast import is_blank
from zeroscd.images.read import read_photo
from zeroscd.models import Models, load_models
from zeroscd.records import CoarseChange
from zeroscd.refine.kinds import settle_kinds
from zeroscd.refine.regions import find_regions
from zeroscd.refine.shapes import close_gaps, drop_specks, drop_thin
from zeroscd.refine.strength import keep_strong
from zeroscd.refine.verify import Verification, confirm
from zeroscd.refine.vote import unite, vote
from zeroscd.result import ChangeResult, NotAligned
from zeroscd.settings import preset as settings_of
from zeroscd.settings import require_same_evidence

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from zeroscd.arrays import Mask
    from zeroscd.change.coarse import DepthDistances
    from zeroscd.images.read import PhotoSource
    from zeroscd.records import Segments
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

        The same as `look`, `compare` and `decide`, one after the other.

        Raises:
            ImageError: A photo cannot be read.
        """
        clock = Clock()
        view_t0, view_t1 = self._look([before, after], clock)
        return self.decide(self._compare(view_t0, view_t1, clock))

    def look(self, photos: Sequence[PhotoSource]) -> list[View]:
        """Read and encode photos; what comes back can be compared with any number of others.

        Raises:
            ImageError: A photo cannot be read.
        """
        return self._look(photos, Clock())

    def compare(self, view_t0: View, view_t1: View) -> Evidence:
        """Gather everything about two views that no threshold decides."""
        return self._compare(view_t0, view_t1, Clock())

    def decide(self, evidence: Evidence, settings: Settings | None = None) -> ChangeResult:
        """Turn evidence into a result.

        Args:
            evidence: As this detector gathered it.
            settings: Other thresholds than the detector's own: anything in
                `zeroscd.settings.THRESHOLDS` may differ.

        Raises:
            SettingsError: The settings differ in what the evidence was gathered under.
        """
        chosen = settings or self.settings
        require_same_evidence(chosen, evidence.settings)
        clock, pair = Clock(evidence.seconds), evidence.pair
        with clock.stage("coarse"):
            coarse = self._coarse(evidence, chosen)
        with clock.stage("segment"):
            segments = evidence.segments or _outlines_around(pair, coarse, chosen)
        with clock.stage("refine"):
            removed, added = _refine(pair, coarse, segments, chosen.refine)
            # An outline may reach beyond what the other photo shows: no statement there.
            removed, added = removed & ~coarse[0].unknown, added & ~coarse[1].unknown
            regions = find_regions(removed, added, *coarse)
        t0_is_frame = chosen.frame == "t0"
        shown = coarse[0] if t0_is_frame else coarse[1]
        return ChangeResult(
            before=pair.view_t0.photo,
            after=pair.view_t1.photo,
            frame=chosen.frame,
            mask=removed | pair.to_t0(added) if t0_is_frame else added | pair.to_t1(removed),
            removed=removed,
            added=added,
            unknown=shown.unknown,
            heatmap=shown.distance,
            regions=regions,
            alignment=evidence.alignment,
            settings=chosen,
            preset=self.preset,
            seconds=clock.seconds,
        )

    def _look(self, sources: Sequence[PhotoSource], clock: Clock) -> list[View]:
        with clock.stage("read"):
            photos = [read_photo(source) for source in sources]
        with clock.stage("encode"):
            maps = self.models.encoder.encode([photo.pixels for photo in photos])
        study = self.models.segmenter.study
        return [
            View(photo, of_photo, study(photo.pixels, of_photo))
            for photo, of_photo in zip(photos, maps, strict=True)
        ]

    def _compare(self, view_t0: View, view_t1: View, clock: Clock) -> Evidence:
        sizes_hw = (view_t0.size_hw, view_t1.size_hw)
        with clock.stage("align"):
            alignment = _blankness(view_t0.photo, view_t1.photo) or align(
                view_t0.maps, view_t1.maps, self.settings.align, sizes_hw=sizes_hw
            )
            if isinstance(alignment, NotAligned):
                log.info("compared without alignment: %s", alignment.reason)
            pair = Pair(view_t0, view_t1, transfer(alignment, *sizes_hw))
        with clock.stage("coarse"):
            distances_t0, distances_t1 = self._distances(pair)
        with clock.stage("segment"):
            everything = self.settings.segment.prompting == "everything"
            segments = _outlines(pair, (None, None)) if everything else None
        return Evidence(
            pair=pair,
            alignment=alignment,
            distances_t0=distances_t0,
            distances_t1=distances_t1,
            segments=segments,
            settings=self.settings,
            seconds=clock.seconds,
        )

    def _distances(self, pair: Pair) -> tuple[DepthDistances, DepthDistances | None]:
        settings, here, there = self.settings.change, pair.view_t0, pair.view_t1
        distances_t0 = measure_distances(
            here.maps,
            there.maps,
            lambda points: apply(pair.t1_from_t0, points),
            settings,
            unseen=unseen(there.size_hw, pair.t0_from_t1, size_b_hw=here.size_hw),
        )
        if settings.coarse_frames == "t0":
            return distances_t0, None
        distances_t1 = measure_distances(
            there.maps,
            here.maps,
            lambda points: apply(pair.t0_from_t1, points),
            settings,
            unseen=unseen(here.size_hw, pair.t1_from_t0, size_b_hw=there.size_hw),
        )
        return distances_t0, distances_t1

    def _coarse(self, evidence: Evidence, settings: Settings) -> tuple[CoarseChange, CoarseChange]:
        pair, seen_t0, seen_t1 = evidence.pair, evidence.distances_t0, evidence.distances_t1
        seen = [seen_t0] if seen_t1 is None else [seen_t0, seen_t1]
        fusion = fuse_depths(seen, settings.change, tau=self.models.encoder.tau)
        coarse_t0 = find_coarse_change(seen_t0, fusion)
        if seen_t1 is not None:
            return coarse_t0, find_coarse_change(seen_t1, fusion)
        size_t0_hw, size_t1_hw = pair.view_t0.size_hw, pair.view_t1.size_hw
        return coarse_t0, CoarseChange(
            distance=pair.map_to_t1(coarse_t0.distance),
            changed=pair.to_t1(coarse_t0.changed),
            unknown=unseen(size_t0_hw, pair.t1_from_t0, size_b_hw=size_t1_hw),
            tau=coarse_t0.tau,
        )


def _outlines_around(
    pair: Pair, coarse: tuple[CoarseChange, CoarseChange], settings: Settings
) -> tuple[Segments, Segments]:
    """Ask for outlines around coarse change only.

    The second look compares a flagged outline with the other photo's outlines of the same
    place, so these are asked for as well.
    """
    changed_t0, changed_t1 = coarse[0].changed, coarse[1].changed
    if settings.refine.verify != "off":
        changed_t0, changed_t1 = (
            changed_t0 | pair.to_t0(changed_t1),
            changed_t1 | pair.to_t1(changed_t0),
        )
    return _outlines(pair, (changed_t0, changed_t1))


def _outlines(pair: Pair, where: tuple[Mask | None, Mask | None]) -> tuple[Segments, Segments]:
    return pair.view_t0.study.outlines(where[0]), pair.view_t1.study.outlines(where[1])


def _refine(
    pair: Pair,
    coarse: tuple[CoarseChange, CoarseChange],
    segments: tuple[Segments, Segments],
    refine: RefineSettings,
) -> tuple[Mask, Mask]:
    """Let outlines vote, look a second time, and settle the kinds; removed (t0), added (t1)."""
    flagged_t0 = vote(segments[0], coarse[0], alpha=refine.alpha)
    flagged_t1 = vote(segments[1], coarse[1], alpha=refine.alpha)
    rule = Verification(refine.verify, refine.beta)
    kept_t0 = confirm(flagged_t0, segments, pair.to_t1, rule)
    kept_t1 = confirm(flagged_t1, segments[::-1], pair.to_t0, rule)
    removed_t0 = unite(kept_t0, pair.view_t0.size_hw)
    added_t1 = unite(kept_t1, pair.view_t1.size_hw)
    if refine.kinds == "novelty":
        removed_t0, added_t1 = settle_kinds(
            removed_t0,
            added_t1,
            novelty_t0=coarse[0].distance - pair.map_to_t0(coarse[1].distance),
            novelty_t1=coarse[1].distance - pair.map_to_t1(coarse[0].distance),
            carriers=(pair.to_t0, pair.to_t1),
        )
    return _things(removed_t0, coarse[0], refine), _things(added_t1, coarse[1], refine)


def _things(mask: Mask, coarse: CoarseChange, refine: RefineSettings) -> Mask:
    """Make whole what has gaps; leave out what is too thin, too weak or too small to be a thing."""
    whole = close_gaps(mask, gap_width=refine.gap_width)
    wide = drop_thin(whole, least_width=refine.least_width)
    strong = keep_strong(wide, coarse, least_peak=refine.least_peak)
    return drop_specks(strong, min_area_px=refine.min_area_px)


def _blankness(photo_t0: Photo, photo_t1: Photo) -> NotAligned | None:
    for photo, when in ((photo_t0, "before"), (photo_t1, "after")):
        if is_blank(photo.pixels):
            reason = f"the photo {when} is blank: there is nothing to align"
            return NotAligned(reason=reason, inliers=0, matches=0)
    return None
