"""Every setting of the method by stage: one declaration holds all that is known about it.

To add one, declare it here. The command line, `zeroscd settings`, `help`, `changes.json` and
`scores.json` follow; `scripts/write_settings_tables.py` brings docs/method.md up to date.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal

from zeroscd.errors import SettingsError
from zeroscd.renamed import renamed_fields
from zeroscd.settings.declaration import OPEN, Range, described, leaves_of, setting
from zeroscd.settings.names import OLD_NAMES, current_name
from zeroscd.settings.parsing import parse
from zeroscd.text import nearest, shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.settings.declaration import Leaf

Share = Annotated[float, Range(0, 1)]
Distance = Annotated[float, Range(0, 2)]  # between descriptors of unit length
Patches = Annotated[int, Range(0, 32, "patches")]
Area = Annotated[int, Range(0, 1_000_000_000, "px")]


@described
@dataclass(frozen=True, slots=True, kw_only=True)
class AlignSettings:
    """From correspondences to a homography (paper, steps 2 and 3)."""

    matching: Literal["argmax", "mutual"] = setting(
        "mutual", "every patch's best match, or only pairs that are each other's", paper="argmax"
    )
    estimator: Literal["ransac", "magsac"] = setting(
        "magsac", "OpenCV's plain RANSAC, or MAGSAC++", paper="ransac"
    )
    inlier_patches: Annotated[float, Range(0.01, 100, "patch sides")] = setting(
        1.25, "reprojection error up to which RANSAC counts an inlier (paper)"
    )
    min_inliers: Annotated[int, Range(4, 1_000_000)] = setting(
        12, "a homography with fewer inliers is refused"
    )
    min_inlier_ratio: Share = setting(
        0.08, "a homography with a smaller share of inliers is refused"
    )
    refine_radius: Patches = setting(
        3, "search window on each finer feature map, to sharpen the homography; 0 = off", paper=0
    )
    seed: Annotated[int, Range(0, 2**31 - 1)] = setting(0, "random seed of RANSAC")


@described
@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeSettings:
    """From aligned descriptors to a coarse change map (paper, step 4)."""

    tau: Distance | None = setting(
        None, "distance above which a patch changed; none = as `threshold` says", threshold=True
    )
    threshold: Literal["encoder", "pair"] = setting(
        "encoder", "the encoder's own tau, or fitted to the pair", threshold=True
    )
    background_quantile: Share = setting(
        0.3, "quantile of a pair's distances that stands for its unchanged part", threshold=True
    )
    tau_share: Share = setting(
        0.65,
        "where a fitted tau lies between the background (0) and unrelated things (1)",
        paper=0.55,
        threshold=True,
    )
    sampling: Literal["nearest", "bilinear"] = setting(
        "bilinear", "how descriptors are read between patch centres", paper="nearest"
    )
    search_radius: Patches = setting(1, "the smallest distance within this radius counts", paper=0)
    coarse_raster: Literal["patch", "bilinear"] = setting(
        "bilinear",
        "mark the whole cell of a changed patch, or interpolate distances to pixels",
        paper="patch",
        threshold=True,
    )
    coarse_frames: Literal["t0", "both"] = setting(
        "both", "one map, of t0, carried over to t1; or one map for each photo", paper="t0"
    )
    max_tiles: Annotated[int, Range(0, 4)] = setting(
        0, "tiles of a pair, of four, that are encoded again, larger; 0 = off", paper=0
    )


@renamed_fields(OLD_NAMES)
@described
@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentSettings:
    """How photos are cut into segments (paper, step 5); SAM's names and defaults."""

    points_per_side: Annotated[int, Range(1, 512)] = setting(32, "prompt grid, along each side")
    prompting: Literal["everything", "coarse"] = setting(
        "coarse", "prompt the whole grid, or only around coarse change", paper="everything"
    )
    points_per_batch: Annotated[int, Range(1, 65_536)] = setting(
        64, "points prompted at once; memory grows with it"
    )
    pred_iou_thresh: Share | None = setting(
        None, "predicted IoU that a mask must exceed; none = as published: 0.88, SAM 2.1 0.8"
    )
    stability_score_thresh: Share = setting(
        0.95, "IoU that a mask cut one logit higher and lower must reach"
    )
    box_nms_thresh: Share = setting(
        0.7, "masks whose boxes overlap more are one: the better one stays"
    )
    crop_n_layers: Annotated[int, Range(0, 4)] = setting(
        0, "look again at 4, 16, ... crops, for small things"
    )
    min_mask_region_area: Area = setting(
        0, "smaller holes of a mask are filled, smaller islands removed"
    )


@renamed_fields(OLD_NAMES)
@described
@dataclass(frozen=True, slots=True, kw_only=True)
class RefineSettings:
    """From segments that vote to confirmed changes (paper, step 5)."""

    alpha: Share = setting(
        0.8, "share of coarse change above which a segment is flagged", paper=0.8, threshold=True
    )
    verify: Literal["overlap", "iou", "off"] = setting(
        "iou",
        "second check, with the other photo's flagged segments",
        paper="overlap",
        threshold=True,
    )
    beta: Share = setting(
        0.7, "overlap from which the other photo refutes a change", paper=0.7, threshold=True
    )
    partial_segments: Literal["whole", "visible"] = setting(
        "visible",
        "of a segment partly outside the other photo, all counts, or only what both show",
        paper="whole",
        threshold=True,
    )
    gap_width: Annotated[float, Range(0, 0.5, "of the photo's shorter side")] = setting(
        0.0, "narrower gaps and holes are filled", paper=0.0, threshold=True
    )
    min_width: Annotated[float, Range(0, 1, "of the square root of its part's area")] = setting(
        0.0, "what is thinner is dropped", paper=0.0, threshold=True
    )
    min_peak: Annotated[float, Range(0, 1, "of the pair's strongest change")] = setting(
        0.0, "weaker parts are dropped", paper=0.0, threshold=True
    )
    kinds: Literal["frame", "novelty"] = setting(
        "frame", "removed or added by where it is flagged, or novel", paper="frame", threshold=True
    )
    min_area_px: Area = setting(0, "smaller regions are dropped", paper=0, threshold=True)


@described
@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The whole method's settings: one frozen tree, every leaf with a name of its own."""

    encoder: str = setting("lite", "network that describes patches")
    segmenter: str = setting("lite", "network that proposes segments")
    side_px: Annotated[int, Range(64, 8192, "px")] = setting(
        672, "photos are resized to about this squared for the encoder"
    )
    layer: Annotated[int, Range(1, 1000)] | None = setting(
        None, "block of a transformer encoder to compare; none = the encoder's choice"
    )
    precision: Literal["auto", "fp32", "bf16"] = setting(
        "auto", "number format of transformer encoders and SAM; auto = by device"
    )
    frame: Literal["t0", "t1"] = setting(
        "t1", "the photo in whose pixels the mask is drawn", threshold=True
    )
    judge: Literal["all", "likely", "sure"] = setting(
        "all", "which changes are kept, by their support", paper="all", threshold=True
    )
    vegetation: Literal["report", "ignore"] = setting(
        "report", "trees and hedges are reported, or left out", paper="report", threshold=True
    )
    consensus: Share = setting(
        0.8,
        "with several photos of a place: share of the views of a pixel that must see it changed",
        threshold=True,
    )
    align: AlignSettings = field(default_factory=AlignSettings)
    change: ChangeSettings = field(default_factory=ChangeSettings)
    segment: SegmentSettings = field(default_factory=SegmentSettings)
    refine: RefineSettings = field(default_factory=RefineSettings)

    def to_dict(self) -> dict[str, Any]:
        """Return plain nested dictionaries, ready for JSON."""
        return dataclasses.asdict(self)

    def override(self, values: Mapping[str, object]) -> Settings:
        """Return a copy with some leaves replaced, by leaf name.

        Values may be text as typed on a command line. The name `rules` is a shorthand:
        `rules=paper` sets every open point of the paper to its literal reading.

        Raises:
            SettingsError: An unknown name, or a value that the setting cannot take.

        Example:
            >>> Settings().override({"tau": "0.6", "verify": "off"}).change.tau
            0.6
        """
        changed = self
        for name, value in values.items():
            if name == "rules":
                changed = changed.override(_rules(value))
            else:
                changed = _replace_leaf(changed, current_name(name, stacklevel=2), value)
        return changed


# Every setting by name, in the order of the method.
LEAVES: dict[str, Leaf] = {leaf.name: leaf for leaf in leaves_of(Settings)}

# Lowest and highest value of the settings that are numbers; both may be taken.
RANGES: dict[str, tuple[float, float]] = {
    name: (leaf.within.low, leaf.within.high)
    for name, leaf in LEAVES.items()
    if leaf.within is not None
}

# The literal reading of every point that the paper leaves open (docs/method.md).
PAPER_RULES: dict[str, object] = {
    name: leaf.declared.paper for name, leaf in LEAVES.items() if leaf.declared.paper is not OPEN
}


def leaf_names() -> tuple[str, ...]:
    """Return the names that `override` accepts, in the order of the method."""
    return ("rules", *LEAVES)


def leaf_values(settings: Settings) -> dict[str, object]:
    """Return the value of every setting by name, in the order of the method."""
    return {
        name: getattr(settings if leaf.branch is None else getattr(settings, leaf.branch), name)
        for name, leaf in LEAVES.items()
    }


def _rules(name: object) -> Mapping[str, object]:
    if name == "paper":
        return PAPER_RULES
    message = f"unknown rules {shown(name)}; choose: paper (the literal reading of the paper)"
    raise SettingsError(message)


def _replace_leaf(settings: Settings, name: str, value: object) -> Settings:
    if name not in LEAVES:
        near = nearest(name, leaf_names())
        meant = f"did you mean {near}? (`zeroscd settings` lists them all)"
        rest = meant if near else "`zeroscd settings` lists them all"
        message = f"unknown setting {shown(name)}; {rest}"
        raise SettingsError(message)
    leaf = LEAVES[name]
    change: dict[str, Any] = {name: parse(leaf, value)}
    if leaf.branch is not None:
        change = {leaf.branch: dataclasses.replace(getattr(settings, leaf.branch), **change)}
    return dataclasses.replace(settings, **change)
