"""The method, one line a stage: two photos in, what was removed and added out."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from zeroscd.alignment.align import align, blankness
from zeroscd.alignment.homography import homography_or_resize
from zeroscd.errors import ImageError
from zeroscd.evidence import EncodedPhoto, Evidence, Pair
from zeroscd.images.read import read_photo
from zeroscd.models import Models, load_models
from zeroscd.progress import Silent
from zeroscd.records import NotAligned, Transients
from zeroscd.refine.regions import alone_in_its_photo, find_regions
from zeroscd.renamed import warn_renamed
from zeroscd.result import ChangeResult
from zeroscd.settings import preset as settings_of
from zeroscd.settings import require_same_evidence
from zeroscd.steps import (
    all_segments,
    distances,
    judge,
    removed_and_added,
    segments_around,
    verified_ground_of,
)
from zeroscd.timer import StageTimer
from zeroscd.views import join, several, sights

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from zeroscd.images.read import PhotoSource
    from zeroscd.progress import Progress
    from zeroscd.records import Frame
    from zeroscd.settings import Settings

log = logging.getLogger(__name__)


def detect(
    before: PhotoSource | Sequence[PhotoSource],
    after: PhotoSource | Sequence[PhotoSource],
    *,
    preset: str = "lite",
    device: str = "auto",
    **settings: object,
) -> ChangeResult:
    """Find what changed between two photos of one place.

    Loads the models each time; for many pairs make a `Detector` once.

    Args:
        before: The t0 photo: a path, bytes, a PIL image or an (H, W, 3) uint8 RGB array; or a list
            of photos of the place, see `Detector.detect`.
        after: The t1 photo, or a list.
        preset: Name of a bundle of models and settings (`zeroscd.PRESETS`).
        device: "auto", "cpu", "cuda" or "mps".
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

    def detect(
        self,
        before: PhotoSource | Sequence[PhotoSource],
        after: PhotoSource | Sequence[PhotoSource],
        *,
        transients: bool = False,
    ) -> ChangeResult:
        """Find what changed; the photos may differ in size.

        The same as `encode`, `compare` and `decide`, one after the other.

        With several photos of the place on a side, what changed is what enough of the views agree
        on (`consensus`): what passed by, or shifts by parallax, is not in all of them. The result
        is in the frames of the first photos; a photo that cannot be aligned is named in
        `further_photos`.

        Args:
            before: The t0 photo, or a list of old photos of the place.
            after: The t1 photo, or a list of new ones.
            transients: Whether to look for what stands in one photo only, too. Each photo of a
                side that has several is compared with all others.

        Raises:
            ImageError: A photo cannot be read, or a side has none.
        """
        timer = StageTimer()
        old, new = _listed(before, "before"), _listed(after, "after")
        encoded = self.encode([*old, *new], timer=timer)
        sides = encoded[: len(old)], encoded[len(old) :]
        result = self.decide(self.compare(*sides, timer=timer))
        if not transients:
            return result
        return replace(result, transients=tuple(self._transients(*sides)))

    def detect_many(
        self, pairs: Sequence[tuple[PhotoSource, PhotoSource]], *, progress: Progress | None = None
    ) -> Iterator[ChangeResult]:
        """Compare pair after pair; `zeroscd batch` goes on after a crash, and past broken photos.

        Raises:
            ImageError: A photo cannot be read.
        """
        progress = progress or Silent()
        progress.begin(len(pairs))
        for number, (before, after) in enumerate(pairs, start=1):
            yield self.detect(before, after)
            progress.advance(str(number), reused=False)

    def encode(
        self, photos: Sequence[PhotoSource], *, timer: StageTimer | None = None
    ) -> list[EncodedPhoto]:
        """Read and encode photos; each can then be compared with any number of others.

        Args:
            photos: Paths, bytes, PIL images or arrays.
            timer: Counts the seconds, where someone wants to know.

        Raises:
            ImageError: A photo cannot be read.
        """
        timer = timer or StageTimer()
        with timer.stage("read"):
            read = [read_photo(photo) for photo in photos]
        with timer.stage("encode"):
            maps = self.models.encoder.encode([photo.pixels for photo in read])
        proposals = self.models.segmenter.proposals
        return [
            EncodedPhoto(photo, of_photo, proposals(photo.pixels, of_photo))
            for photo, of_photo in zip(read, maps, strict=True)
        ]

    def compare(
        self,
        before: EncodedPhoto | Sequence[EncodedPhoto],
        after: EncodedPhoto | Sequence[EncodedPhoto],
        *,
        timer: StageTimer | None = None,
    ) -> Evidence:
        """Align old and new photos and gather everything that no threshold decides.

        Args:
            before: The photo before, or several of the place.
            after: The photo after, or several.
            timer: Counts the seconds, where someone wants to know.
        """
        timer = timer or StageTimer()
        old = [before] if isinstance(before, EncodedPhoto) else before
        new = [after] if isinstance(after, EncodedPhoto) else after
        evidence = join(
            [[self._pair(photo_t0, photo_t1, timer) for photo_t1 in new] for photo_t0 in old]
        )
        with timer.stage("segment"):
            everything = self.settings.segment.prompting == "everything"
            segments = all_segments(evidence.pair) if everything else None
        return replace(evidence, segments=segments, seconds=timer.seconds)

    def _pair(self, photo_t0: EncodedPhoto, photo_t1: EncodedPhoto, timer: StageTimer) -> Evidence:
        sizes_hw = (photo_t0.size_hw, photo_t1.size_hw)
        with timer.stage("align"):
            alignment = blankness(photo_t0.photo, photo_t1.photo) or align(
                photo_t0.maps, photo_t1.maps, self.settings.align, sizes_hw=sizes_hw
            )
            if isinstance(alignment, NotAligned):
                log.info("compared without alignment: %s", alignment.reason)
            pair = Pair(photo_t0, photo_t1, homography_or_resize(alignment, *sizes_hw))
        with timer.stage("coarse"):
            distances_t0, distances_t1 = distances(pair, self.settings.change)
            ground = verified_ground_of(pair)
        return Evidence(
            pair=pair,
            alignment=alignment,
            distances_t0=distances_t0,
            distances_t1=distances_t1,
            ground=ground,
            segments=None,
            settings=self.settings,
            seconds={},
        )

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
        timer, pair = StageTimer(evidence.seconds), evidence.pair
        with timer.stage("coarse"):
            seen = sights(evidence, chosen, tau=self.models.encoder.tau)
            coarse = seen[0].coarse, seen[1].coarse
        with timer.stage("segment"):
            segments = evidence.segments or segments_around(pair, coarse)
        with timer.stage("refine"):
            rules = chosen.refine if not evidence.others else several(chosen.refine)
            masks = removed_and_added(pair, coarse, segments, rules)
        with timer.stage("judge"):
            judged = judge(pair, seen, masks, chosen.judge)
            unseen_t0, unseen_t1 = (one.unknown for one in coarse)
            regions = find_regions(*judged.parts, (unseen_t0, unseen_t1))
        (side_t0, side_t1), (removed, added) = pair.sides, judged.masks
        at = 0 if chosen.frame == "t0" else 1
        mask = (removed | side_t0.bring_mask(added), added | side_t1.bring_mask(removed))[at]
        return ChangeResult(
            before=pair.photo_t0.photo,
            after=pair.photo_t1.photo,
            frame=chosen.frame,
            mask=mask,
            removed=removed,
            added=added,
            unknown=judged.unknown[at] & ~mask,
            unseen=coarse[at].unknown & ~mask,
            heatmap=coarse[at].distance,
            regions=regions,
            alignment=evidence.alignment,
            settings=chosen,
            preset=self.preset,
            seconds=timer.seconds,
            further_photos=evidence.further_photos,
        )

    def _transients(
        self, old: Sequence[EncodedPhoto], new: Sequence[EncodedPhoto]
    ) -> Iterator[Transients]:
        """Take each photo as the new one: what all others lack is in it alone."""
        settings = self.settings.override({"frame": "t1"})
        sides: tuple[tuple[Sequence[EncodedPhoto], Frame], ...] = ((old, "t0"), (new, "t1"))
        for side, frame in sides:
            # The only photo of a side shows what is removed or added.
            for photo in side if len(side) > 1 else ():
                others = [one for one in (*old, *new) if one is not photo]
                found = self.decide(self.compare(others, photo), settings)
                yield Transients(
                    photo=photo.photo,
                    frame=frame,
                    regions=alone_in_its_photo(found.regions, frame),
                )

    def look(self, photos: Sequence[PhotoSource]) -> list[EncodedPhoto]:
        """Encode photos, by the old name of `encode`."""
        warn_renamed("Detector.look", "Detector.encode")
        return self.encode(photos)


def _listed(photos: PhotoSource | Sequence[PhotoSource], when: str) -> Sequence[PhotoSource]:
    if not isinstance(photos, list | tuple):
        return [cast("PhotoSource", photos)]
    if not photos:
        message = f"no photo {when}: give one photo of the place or a list of them"
        raise ImageError(message)
    return photos
