"""The method, one line a stage: two photos in, what was removed and added out."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING

from zeroscd.alignment.known import refuse_for_several
from zeroscd.evidence import EncodedPhoto, Evidence, encoded_photo
from zeroscd.full_size import at_full_size, not_judged
from zeroscd.given import Given, check_areas
from zeroscd.images.read import listed, read_photo
from zeroscd.images.working import enlarge_mask
from zeroscd.judging import changed_in, judge, leave_out
from zeroscd.labelling import label_parts
from zeroscd.labels.classes import class_ids
from zeroscd.models import Models, load_models
from zeroscd.progress import Silent
from zeroscd.records import Transients
from zeroscd.refine.regions import alone_in_its_photo, find_regions
from zeroscd.renamed import warn_renamed
from zeroscd.result import ChangeResult
from zeroscd.settings import preset as settings_of
from zeroscd.settings import require_same_evidence
from zeroscd.steps import compare_photos, removed_and_added
from zeroscd.tiles import look_closer
from zeroscd.timer import StageTimer
from zeroscd.views import join, several, sights
from zeroscd.voting import all_segments, segments_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from zeroscd.alignment.known import KnownGeometry
    from zeroscd.images.areas import AreaSource
    from zeroscd.images.read import PhotoSource
    from zeroscd.progress import Progress
    from zeroscd.records import Frame
    from zeroscd.settings import Settings


class Detector:
    """Finds what changed between two photos, with models that stay loaded.

    Args:
        settings: Everything that decides the outcome.
        models: Encoder and segmenter.
        preset: The name that results carry.
        ignore_classes: Things that do not count, classes or groups of `zeroscd.labels.classes`; the
            models must have a labeller.
    """

    def __init__(
        self,
        settings: Settings,
        models: Models,
        *,
        preset: str = "custom",
        ignore_classes: Iterable[str] = (),
    ) -> None:
        self.settings = settings
        self.models = models
        self.preset = preset
        self.ignored_classes = class_ids(ignore_classes)

    @classmethod
    def from_preset(
        cls,
        name: str,
        *,
        device: str = "auto",
        overrides: Mapping[str, object] | None = None,
        labels: bool = False,
        ignore_classes: Sequence[str] = (),
    ) -> Detector:
        """Load a preset's models.

        Args:
            name: Of the preset.
            device: "auto", "cpu", "cuda" or "mps".
            overrides: Settings that differ from the preset's, by name.
            labels: Whether a further network says what each region shows (`Region.label`).
            ignore_classes: What does not count, such as "person", "vehicle", "sky", "vegetation":
                classes or groups of `zeroscd.labels.classes`. It needs the same network.

        Raises:
            SettingsError: An unknown preset, setting, class or device, or missing packages.
            WeightsError: The weights are missing or damaged.
        """
        settings = settings_of(name).override(overrides or {})
        labels = labels or bool(class_ids(ignore_classes))
        models = load_models(settings, device=device, labels=labels)
        return cls(settings, models, preset=name, ignore_classes=ignore_classes)

    def detect(  # noqa: PLR0913 - as above
        self,
        before: PhotoSource | Sequence[PhotoSource],
        after: PhotoSource | Sequence[PhotoSource],
        *,
        transients: bool = False,
        ignore: AreaSource | None = None,
        ignore_before: AreaSource | None = None,
        roi: AreaSource | None = None,
        roi_before: AreaSource | None = None,
        ignore_all: AreaSource | None = None,
        t1_from_t0: KnownGeometry | None = None,
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
            ignore: What does not count in the (first) photo after: a mask, white = leave out, as a
                path, bytes, a picture or an array; or polygons in its pixels, as a list, JSON or
                GeoJSON. It is carried to the photo before. What is left out is neither changed nor
                unchanged; elsewhere the result is what it would be without.
            ignore_before: What does not count in the (first) photo before.
            roi: Where to look only, in the (first) photo after; what lies elsewhere is left out.
            roi_before: Where to look only, in the (first) photo before.
            ignore_all: What does not count in any photo, such as the hood or the time stamp of a
                camera.
            t1_from_t0: Known geometry: a (3, 3) homography in pixels, or "none" for a camera that
                did not move. It is estimated from the photos if not given.

        Raises:
            ImageError: A photo or an area cannot be read, or a side has no photo.
            SettingsError: The geometry cannot relate the photos, or is a homography where a side
                has several photos.
        """
        timer = StageTimer()
        old, new = listed(before, "before"), listed(after, "after")
        encoded = self.encode([*old, *new], timer=timer)
        given = Given(
            ignore=ignore,
            ignore_before=ignore_before,
            roi=roi,
            roi_before=roi_before,
            ignore_all=ignore_all,
        )
        if transients:
            given.refuse_for_transients()
        sides = given.mark(encoded[: len(old)], encoded[len(old) :])
        result = self.decide(self.compare(*sides, t1_from_t0=t1_from_t0, timer=timer))
        if not transients:
            return result
        return replace(result, transients=tuple(self._transients(sides, t1_from_t0)))

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
        segmenter, labeller = self.models.segmenter, self.models.labeller
        encoded = [encoded_photo(*each, segmenter) for each in zip(read, maps, strict=True)]
        if labeller is None:
            return encoded
        with timer.stage("label"):
            return [replace(one, classes=labeller.label(one.working.pixels)) for one in encoded]

    def compare(
        self,
        before: EncodedPhoto | Sequence[EncodedPhoto],
        after: EncodedPhoto | Sequence[EncodedPhoto],
        *,
        t1_from_t0: KnownGeometry | None = None,
        timer: StageTimer | None = None,
    ) -> Evidence:
        """Align old and new photos and gather everything that no threshold decides.

        Args:
            before: The photo before, or several of the place.
            after: The photo after, or several.
            t1_from_t0: Known geometry, see `detect`.
            timer: Counts the seconds, where someone wants to know.

        Raises:
            SettingsError: The geometry cannot relate the photos.
        """
        timer = timer or StageTimer()
        old = [before] if isinstance(before, EncodedPhoto) else before
        new = [after] if isinstance(after, EncodedPhoto) else after
        if t1_from_t0 is not None and len(old) * len(new) > 1:
            refuse_for_several(t1_from_t0)
        both = partial(compare_photos, settings=self.settings, known=t1_from_t0, timer=timer)
        closer = partial(look_closer, models=self.models, timer=timer)
        evidence = join(
            [[closer(both(photo_t0, photo_t1)) for photo_t1 in new] for photo_t0 in old]
        )
        check_areas(evidence.pair, old[0], new[0])
        with timer.stage("segment"):
            everything = self.settings.segment.prompting == "everything"
            segments = all_segments(evidence.pair) if everything else None
        return replace(evidence, segments=segments, seconds=timer.seconds)

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
            segments = segments_of(evidence, coarse)
        with timer.stage("refine"):
            rules = chosen.refine if not evidence.others else several(chosen.refine)
            masks = removed_and_added(pair, seen, segments, rules)
        with timer.stage("judge"):
            judged = judge(pair, seen, masks, chosen.judge)
            judged = leave_out(judged, pair, min_area_px=rules.min_area_px)
            judged = label_parts(judged, pair, ignored=self.ignored_classes, settings=chosen)
            pair, judged = at_full_size(pair, judged, min_area_px=rules.min_area_px)
            regions = find_regions(
                *judged.parts, (coarse[0].unknown, coarse[1].unknown), sizes_hw=pair.sizes_hw
            )
        at = 0 if chosen.frame == "t0" else 1
        mask = changed_in(chosen.frame, judged, pair)
        return ChangeResult(
            before=pair.photo_t0.photo,
            after=pair.photo_t1.photo,
            frame=chosen.frame,
            mask=mask,
            removed=judged.masks[0],
            added=judged.masks[1],
            unknown=not_judged(judged, chosen.frame, mask),
            unseen=enlarge_mask(coarse[at].unknown, mask.shape) & ~mask,
            distance=coarse[at].distance,
            regions=regions,
            alignment=evidence.whole_alignment(),
            settings=chosen,
            preset=self.preset,
            seconds=timer.seconds,
            further_photos=evidence.further_photos,
            ignored=judged.ignored[at],
        )

    def _transients(
        self, sides: tuple[list[EncodedPhoto], list[EncodedPhoto]], known: KnownGeometry | None
    ) -> Iterator[Transients]:
        """Take each photo as the new one: what all others lack is in it alone."""
        settings = self.settings.override({"frame": "t1"})
        frames: tuple[Frame, Frame] = ("t0", "t1")
        for side, frame in zip(sides, frames, strict=True):
            # The only photo of a side shows what is removed or added.
            for photo in side if len(side) > 1 else ():
                others = [one for one in chain(*sides) if one is not photo]
                found = self.decide(self.compare(others, photo, t1_from_t0=known), settings)
                regions = alone_in_its_photo(found.regions, frame)
                yield Transients(photo=photo.photo, frame=frame, regions=regions)

    def look(self, photos: Sequence[PhotoSource]) -> list[EncodedPhoto]:
        """Encode photos, by the old name of `encode`."""
        warn_renamed("Detector.look", "Detector.encode")
        return self.encode(photos)
