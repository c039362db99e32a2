"""What flows between the stages of the method, frozen so that no stage edits another's work."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

from zeroscd.images.working import enlarge_map
from zeroscd.renamed import moved_names

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.arrays import Descriptors, Homography, Map, Mask
    from zeroscd.images.grid import PatchGrid
    from zeroscd.images.photo import Photo
    from zeroscd.settings import Settings

UNRELATED = math.sqrt(2.0)  # expected distance of two unit descriptors that have nothing in common

Frame: TypeAlias = Literal["t0", "t1"]
Kind: TypeAlias = Literal["removed", "added", "transient"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureMap:
    """Patch descriptors of one photo at one depth of an encoder.

    Attributes:
        descriptors: (rows, cols, d) float32, unit length along d.
        grid: Where the patch centres lie, in pixels of the photo.
        source: Encoder and depth, for stages that were trained on them.
    """

    descriptors: Descriptors
    grid: PatchGrid
    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseChange:
    """Where descriptors differ, before segments are asked; one photo's frame, its full size.

    Attributes:
        distance: (H, W) Euclidean distance of unit descriptors, 0..2.
        changed: (H, W) the distance is above tau.
        unknown: (H, W) the other photo does not show this place.
        tau: The threshold that was applied.
    """

    distance: Map
    changed: Mask
    unknown: Mask
    tau: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """How to carry points of the photo before to the photo after.

    Attributes:
        t1_from_t0: 3x3 homography, in pixels of the two photos; its last entry is 1.
        inliers: Matches that agree with it.
        matches: Matches it was estimated from.
        given: The user knew it; nothing was matched.
    """

    t1_from_t0: Homography
    inliers: int
    matches: int
    given: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class NotAligned:
    """Why no trustworthy homography was found; the photos are then compared as they lie.

    Attributes:
        reason: One plain sentence.
        inliers: Matches that agreed with the best rejected estimate.
        matches: Matches that were tried.
    """

    reason: str
    inliers: int
    matches: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FurtherPhoto:
    """A photo beyond the first one of its side.

    Attributes:
        photo: The photo.
        frame: The side it was given on: "t0" for an old photo, "t1" for a new one.
        left_out: Why it says nothing about the place; None where it was used.
    """

    photo: Photo
    frame: Frame
    left_out: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """One changed object or part of one.

    Attributes:
        id: 1, 2, ... in order of falling score, then position; regions at the border come last.
        kind: "removed" lives in the t0 photo, "added" in the t1 photo, "transient" in one photo of
            several, see `Transients`.
        score: 0..1, share of development regions with such support that truly changed.
        frame: The photo in whose pixels the geometry is given ("t0" for removed).
        area_px: Number of pixels.
        bbox_xywh: Left, top, width, height.
        polygon_xy: Outer outlines, holes filled, each a valid polygon of (x, y); whole numbers are
            corners of pixels, as in `bbox_xywh`.
        rle: COCO run lengths, {"size": [H, W], "counts": compressed text}.
        support: 0..1, how well the change is supported by its surroundings; `judge` decides how
            much is needed.
        at_border: It lies mostly along what the other photo does not show.
        seen_by: Views that show its place; a view is one old photo compared with one new one.
        agreed_by: Of them, those that see the change.
        label: What it shows, a class of `zeroscd.labels.classes`; None where no network says so.
        label_share: 0..1, share of its pixels of that class.
    """

    id: int
    kind: Kind
    score: float
    frame: Frame
    area_px: int
    bbox_xywh: tuple[int, int, int, int]
    polygon_xy: tuple[tuple[tuple[int, int], ...], ...]
    rle: Mapping[str, object]
    support: float = 1.0
    at_border: bool = False
    seen_by: int = 1
    agreed_by: int = 1
    label: str | None = None
    label_share: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Transients:
    """What stands in one photo of a place and in no other, old or new: cars, people, bins.

    Attributes:
        photo: The photo.
        frame: The side it was given on: "t0" for an old photo, "t1" for a new one.
        regions: In its pixels, of kind "transient", most certain first.
    """

    photo: Photo
    frame: Frame
    regions: tuple[Region, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Changes:
    """What changed between two photos: the data of a `ChangeResult`.

    Attributes:
        before: The t0 photo.
        after: The t1 photo.
        frame: The photo in whose pixels mask, unknown, unseen and heatmap are given.
        mask: (H, W) everything that changed, both kinds.
        removed: (H, W) in the t0 frame: was there, is gone or altered.
        added: (H, W) in the t1 frame: is there now, was not.
        unknown: (H, W) not judged: neither changed nor unchanged, because it is not in view of
            both photos, or its surroundings are not verified (parallax, or too different in light).
        unseen: (H, W) the part of it that is not in view of both photos.
        ignored: (H, W) the part of it that the user left out; None where nothing was.
        distance: (h, w) float32 descriptor distance, 0..2, at the size the photos were compared at.
        regions: The changed objects, most certain first.
        alignment: The homography, or why there is none.
        settings: Everything that decided the outcome.
        preset: Name of the preset the settings started from.
        seconds: Wall time of each stage.
        further_photos: Further photos of the place, beyond `before` and `after`.
        transients: What stands in one photo only, for each photo of a side that has several; no
            change, and in no mask. None where it was not asked for.
    """

    before: Photo
    after: Photo
    frame: Frame
    mask: Mask
    removed: Mask
    added: Mask
    unknown: Mask
    unseen: Mask
    distance: Map
    regions: tuple[Region, ...]
    alignment: Alignment | NotAligned
    settings: Settings
    preset: str
    seconds: Mapping[str, float] = field(default_factory=dict)
    further_photos: tuple[FurtherPhoto, ...] = ()
    transients: tuple[Transients, ...] | None = None
    ignored: Mask | None = None

    @property
    def heatmap(self) -> Map:
        """Descriptor distance at the photo's size: (H, W) float32, 0..2."""
        return enlarge_map(self.distance, self.mask.shape)

    @property
    def changed_fraction(self) -> float:
        """Share of the judged pixels that changed, 0..1; 0 when nothing was judged."""
        judged = int((~self.unknown).sum())
        return float(self.mask.sum()) / judged if judged else 0.0

    @property
    def judged_fraction(self) -> float:
        """Share of the frame's pixels that are either changed or unchanged, 0..1."""
        return 1.0 - float(self.unknown.mean())


if not TYPE_CHECKING:  # or mypy would believe that every name exists
    __getattr__ = moved_names(
        __name__,
        {
            "Segment": "zeroscd.segments.Segment",
            "Segments": "zeroscd.segments.Segments",
        },
    )
