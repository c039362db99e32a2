"""The records that users hold: what changed, where, and how the photos were aligned."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from zeroscd.arrays import Homography, Map, Mask, Rgb
    from zeroscd.settings import Settings

Frame: TypeAlias = Literal["t0", "t1"]
Kind: TypeAlias = Literal["removed", "added"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """How to carry points of the photo before to the photo after.

    Attributes:
        t1_from_t0: 3x3 homography, in pixels of the two photos; its last entry is 1.
        inliers: Matches that agree with it.
        matches: Matches it was estimated from.
    """

    t1_from_t0: Homography
    inliers: int
    matches: int


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
class Photo:
    """A photo as it was read.

    Attributes:
        pixels: (H, W, 3) uint8 RGB, upright.
        path: Where it came from; None for bytes and arrays.
    """

    pixels: Rgb
    path: str | None = None

    @property
    def size_hw(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.pixels.shape[0], self.pixels.shape[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """One changed object or part of one.

    Attributes:
        id: 1, 2, ... in order of falling score, then position.
        kind: "removed" lives in the t0 photo, "added" in the t1 photo.
        score: 0..1, confidence that this is a change.
        frame: The photo in whose pixels the geometry is given ("t0" for removed).
        area_px: Number of pixels.
        bbox_xywh: Left, top, width, height.
        polygon_xy: Outer outlines, each a list of (x, y).
        rle: COCO run lengths, {"size": [H, W], "counts": compressed text}.
    """

    id: int
    kind: Kind
    score: float
    frame: Frame
    area_px: int
    bbox_xywh: tuple[int, int, int, int]
    polygon_xy: tuple[tuple[tuple[int, int], ...], ...]
    rle: Mapping[str, object]


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeResult:
    """What changed between two photos.

    Attributes:
        before: The t0 photo.
        after: The t1 photo.
        frame: The photo in whose pixels mask, unknown and heatmap are given.
        mask: (H, W) everything that changed, both kinds.
        removed: (H, W) in the t0 frame: was there, is gone or altered.
        added: (H, W) in the t1 frame: is there now, was not.
        unknown: (H, W) seen by one photo only: no statement.
        heatmap: (H, W) float32 descriptor distance, 0..2.
        regions: The changed objects, most certain first.
        alignment: The homography, or why there is none.
        settings: Everything that decided the outcome.
        preset: Name of the preset the settings started from.
        seconds: Wall time of each stage.
    """

    before: Photo
    after: Photo
    frame: Frame
    mask: Mask
    removed: Mask
    added: Mask
    unknown: Mask
    heatmap: Map
    regions: tuple[Region, ...]
    alignment: Alignment | NotAligned
    settings: Settings
    preset: str
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def changed_fraction(self) -> float:
        """Share of the frame's known pixels that changed, 0..1; 0 when nothing is known."""
        known = int((~self.unknown).sum())
        return float(self.mask.sum()) / known if known else 0.0

    def save(self, folder: str | Path) -> None:
        """Write the mask, the pictures, `changes.json` and the report into a folder.

        Either all files appear or none: they are written elsewhere first.

        Raises:
            OutputError: The folder cannot be written.
        """
        from zeroscd.export.folder import save_result  # noqa: PLC0415 - records do not depend on it

        save_result(self, folder)
