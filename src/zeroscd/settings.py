"""Every number of the method, with its meaning, unit and source; presets by name."""

from __future__ import annotations

import dataclasses
import math
import types
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Union, get_args, get_origin, get_type_hints

from zeroscd.errors import SettingsError
from zeroscd.text import shown

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignSettings:
    """From correspondences to a homography (paper, steps 2 and 3)."""

    matching: Literal["argmax", "mutual"] = "mutual"  # every row's best, or pairs that agree
    inlier_patches: float = 1.25  # RANSAC tolerance in patch sides (paper)
    min_inliers: int = 12  # fewer agreeing matches are no evidence
    min_inlier_ratio: float = 0.08  # of the matches that RANSAC saw
    refine_radius: int = 3  # cells searched on each finer feature map to sharpen the homography
    seed: int = 0  # of RANSAC


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeSettings:
    """From aligned descriptors to a coarse change map (paper, step 4)."""

    tau: float | None = None  # distance above which a patch changed; none = as threshold says
    threshold: Literal["encoder", "pair"] = "encoder"  # its own tau, or fitted to the pair
    background_quantile: float = 0.3  # of a pair's distances: what its unchanged part looks like
    tau_share: float = 0.65  # where tau lies between the background and unrelated things
    sampling: Literal["nearest", "bilinear"] = "bilinear"  # of descriptors between patches
    search_radius: int = 1  # patches; the smallest distance in the neighbourhood counts
    coarse_frames: Literal["t0", "both"] = "both"  # one map carried over, or one for each photo


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentSettings:
    """How photos are cut into outlines (paper, step 5)."""

    points_per_side: int = 32  # SAM's prompt grid (SAM's published default)
    prompting: Literal["everything", "coarse"] = "coarse"  # prompt all, or only coarse change
    points_per_batch: int = 64  # prompts that SAM answers at once; memory grows with it
    pred_iou_thresh: float | None = None  # SAM's own score must exceed this; none = as published
    stability_score_thresh: float = 0.95  # overlap of a mask cut a little higher and lower (SAM)
    box_nms_thresh: float = 0.7  # boxes that overlap more are one outline (SAM)
    crop_n_layers: int = 0  # SAM looks again at 4, 16, ... crops of the photo
    min_mask_region_area: int = 0  # holes and islands of a mask below this many pixels are removed


@dataclass(frozen=True, slots=True, kw_only=True)
class RefineSettings:
    """From outlines that vote to confirmed changes (paper, step 5)."""

    alpha: float = 0.8  # share of coarse change above which an outline is flagged (paper)
    verify: Literal["overlap", "iou", "off"] = "iou"  # second check against the other photo
    beta: float = 0.5  # overlap at which the other photo's outline refutes the change
    gap_width: float = 0.0  # of the photo's shorter side; narrower gaps and holes are filled
    min_width: float = 0.0  # of the square root of a part's area; what is thinner is dropped
    min_peak: float = 0.0  # parts weaker than this share of the strongest change are dropped
    kinds: Literal["frame", "novelty"] = "frame"  # kept where flagged, or settled by novelty
    min_area_px: int = 0  # smaller regions are dropped, in pixels of their photo


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The whole method's settings: one frozen tree, every leaf with a name of its own."""

    encoder: str = "lite"
    segmenter: str = "lite"
    side_px: int = 672  # lite looks at photos resized to about this squared
    layer: int | None = None  # block of a transformer encoder to compare; none = its own choice
    precision: Literal["auto", "fp32", "bf16"] = "auto"  # of transformers; auto = by device
    frame: Literal["t0", "t1"] = "t1"  # the photo whose pixels the final mask is drawn in
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
                changed = _replace_leaf(changed, name, value)
        return changed


# Lowest and highest value of the settings that are numbers; both may be taken.
RANGES: dict[str, tuple[float, float]] = {
    "side_px": (64, 8192),  # at 32 the lite encoder sees one cell, which has no spread
    "layer": (1, 1000),
    "inlier_patches": (0.01, 100),
    "min_inliers": (4, 1_000_000),
    "min_inlier_ratio": (0, 1),
    "refine_radius": (0, 32),
    "seed": (0, 2**31 - 1),
    "tau": (0, 2),
    "background_quantile": (0, 1),
    "tau_share": (0, 1),
    "search_radius": (0, 32),
    "points_per_side": (1, 512),
    "points_per_batch": (1, 65_536),
    "pred_iou_thresh": (0, 1),
    "stability_score_thresh": (0, 1),
    "box_nms_thresh": (0, 1),
    "crop_n_layers": (0, 4),
    "min_mask_region_area": (0, 1_000_000_000),
    "alpha": (0, 1),
    "beta": (0, 1),
    "min_peak": (0, 1),
    "gap_width": (0, 0.5),
    "min_width": (0, 1),
    "min_area_px": (0, 1_000_000_000),
}

# The literal reading of every point that the paper leaves open (docs/method.md).
PAPER_RULES: dict[str, object] = {
    "matching": "argmax",
    "threshold": "encoder",
    "sampling": "nearest",
    "search_radius": 0,
    "coarse_frames": "t0",
    "verify": "overlap",
    "beta": 0.5,
    "alpha": 0.8,
    "min_peak": 0.0,
    "gap_width": 0.0,
    "min_width": 0.0,
    "kinds": "frame",
    "min_area_px": 0,
    "prompting": "everything",
}

# What only weighs evidence that is there already; all other leaves need the photos again.
THRESHOLDS: frozenset[str] = frozenset(
    {"frame", "tau", "threshold", "background_quantile", "tau_share"}
    | {leaf.name for leaf in dataclasses.fields(RefineSettings)}
)


def evidence_settings(settings: Settings) -> Settings:
    """Return a copy with all thresholds at their defaults; equal copies need equal evidence."""
    plain = _leaf_values(Settings())
    return settings.override({name: plain[name] for name in sorted(THRESHOLDS)})


def require_same_evidence(wanted: Settings, gathered: Settings) -> None:
    """Check that two settings differ in thresholds at most.

    Raises:
        SettingsError: They differ in something that decides what is seen.
    """
    here, there = (_leaf_values(evidence_settings(one)) for one in (wanted, gathered))
    differing = next((name for name in here if here[name] != there[name]), None)
    if differing is not None:
        message = (
            f"setting {differing} changes the evidence, not its weight; "
            "compare the photos again with a detector of these settings"
        )
        raise SettingsError(message)


def preset(name: str) -> Settings:
    """Return the settings of a preset.

    Raises:
        SettingsError: No preset has this name.
    """
    try:
        return PRESETS[name]
    except KeyError:
        message = f"unknown preset {name!r}; choose one of: {', '.join(PRESETS)}"
        raise SettingsError(message) from None


def leaf_names() -> tuple[str, ...]:
    """Return the names that `override` accepts, in the order of the method."""
    return ("rules", *_LEAVES)


def _rules(name: object) -> Mapping[str, object]:
    if name == "paper":
        return PAPER_RULES
    message = f"unknown rules {shown(name)}; choose: paper (the literal reading of the paper)"
    raise SettingsError(message)


def _walk(kind: type) -> dict[str, tuple[str | None, Any]]:
    leaves: dict[str, tuple[str | None, Any]] = {}
    for name, hint in get_type_hints(kind).items():
        if dataclasses.is_dataclass(hint):
            for leaf, leaf_hint in get_type_hints(hint).items():
                leaves[leaf] = (name, leaf_hint)
        else:
            leaves[name] = (None, hint)
    return leaves


_LEAVES = _walk(Settings)


def _leaf_values(settings: Settings) -> dict[str, object]:
    return {
        name: getattr(settings if branch is None else getattr(settings, branch), name)
        for name, (branch, _) in _LEAVES.items()
    }


def _literally(encoder: str, *, side_px: int) -> Settings:
    """Combine an encoder with SAM ViT-H and the paper's rules."""
    models = Settings(encoder=encoder, segmenter="sam-vit-h", side_px=side_px)
    return models.override(PAPER_RULES)


def _replace_leaf(settings: Settings, name: str, value: object) -> Settings:
    if name not in _LEAVES:
        message = f"unknown setting {name!r}; known: {', '.join(leaf_names())}"
        raise SettingsError(message)
    branch, hint = _LEAVES[name]
    change: dict[str, Any] = {name: _parse(name, value, hint)}
    if branch is not None:
        change = {branch: dataclasses.replace(getattr(settings, branch), **change)}
    return dataclasses.replace(settings, **change)


def _parse(name: str, value: object, hint: Any) -> object:  # noqa: ANN401 - a type annotation
    if get_origin(hint) is Literal:
        options = get_args(hint)
        if value in options:
            return value
        message = f"setting {name} cannot be {shown(value)}; choose one of: {', '.join(options)}"
        raise SettingsError(message)
    if get_origin(hint) in (types.UnionType, Union):
        if value is None or (isinstance(value, str) and value.lower() == "none"):
            return None
        hint = next(part for part in get_args(hint) if part is not type(None))
    number = _convert(value, hint)
    if number is None or (isinstance(number, float) and not math.isfinite(number)):
        message = f"setting {name} needs a {hint.__name__}, not {shown(value)}"
        raise SettingsError(message)
    lowest, highest = RANGES.get(name, (None, None))
    if lowest is not None and not lowest <= number <= highest:
        message = f"setting {name} must lie between {lowest} and {highest}, not at {shown(value)}"
        raise SettingsError(message)
    return number


def _convert(value: object, hint: Any) -> Any:  # noqa: ANN401 - a type annotation, a value of it
    """Turn a value into what a setting holds; None where that cannot be without a loss."""
    if hint is int and isinstance(value, float) and not value.is_integer():
        return None
    try:
        return hint(value)
    except (TypeError, ValueError, OverflowError):
        return None


PRESETS: dict[str, Settings] = {
    "lite": Settings(
        change=ChangeSettings(threshold="pair", tau_share=0.475, search_radius=2),
        refine=RefineSettings(
            alpha=0.75,
            verify="off",
            gap_width=0.04,
            min_width=0.3,
            min_peak=0.8,
            kinds="novelty",
            min_area_px=150,
        ),
    ),
    # The paper's literal reading; VL-CMU-CD at its own size, DINOv2 as it is trained.
    "paper": _literally("placeformer", side_px=512),
    "dinov2-s": _literally("dinov2-s", side_px=518),
    "dinov2-b": _literally("dinov2-b", side_px=518),
    "robust": Settings(encoder="dinov2-b", segmenter="sam2.1-base", side_px=518),
}
