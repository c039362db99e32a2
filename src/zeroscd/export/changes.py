"""`changes.json`: the result as other programs read it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from zeroscd.records import Alignment, NotAligned

if TYPE_CHECKING:
    from zeroscd.images.photo import Photo
    from zeroscd.records import Changes, FurtherPhoto, Region, Transients

SCHEMA = 1


def changes_json(result: Changes) -> bytes:
    """Write a result as JSON text; only `seconds`, the last entry, differs between runs."""
    return (json.dumps(changes(result), indent=1, allow_nan=False) + "\n").encode("ascii")


def changes(result: Changes) -> dict[str, Any]:
    """Return the content of `changes.json` as plain values."""
    return {
        "schema": SCHEMA,
        "before": _photo(result.before),
        "after": _photo(result.after),
        "frame": result.frame,
        "preset": result.preset,
        "settings": result.settings.to_dict(),
        "alignment": _alignment(result.alignment),
        "changed_fraction": float(result.changed_fraction),
        "judged_fraction": float(result.judged_fraction),
        **_ignored(result),
        "regions": [
            region_values(region) | (_views(region) if result.further_photos else {})
            for region in result.regions
        ],
        **_further_photos(result),
        **_transients(result),
        "seconds": {stage: float(value) for stage, value in result.seconds.items()},
    }


def _photo(photo: Photo) -> dict[str, Any]:
    height, width = photo.size_hw
    return {"path": photo.path, "width": width, "height": height}


def _ignored(result: Changes) -> dict[str, Any]:
    if result.ignored is None:
        return {}
    return {"ignored_fraction": float(result.ignored.mean())}


def _further_photos(result: Changes) -> dict[str, Any]:
    """Return nothing where each side has one photo: then the file is what it always was."""
    if not result.further_photos:
        return {}
    photos = [{**_photo_and_side(one), "left_out": one.left_out} for one in result.further_photos]
    return {"further_photos": photos}


def _transients(result: Changes) -> dict[str, Any]:
    if result.transients is None:
        return {}
    photos = [
        {
            **_photo_and_side(one),
            "regions": [region_values(region) | _views(region) for region in one.regions],
        }
        for one in result.transients
    ]
    return {"transients": photos}


def _photo_and_side(one: FurtherPhoto | Transients) -> dict[str, Any]:
    return {**_photo(one.photo), "side": "before" if one.frame == "t0" else "after"}


def _views(region: Region) -> dict[str, int]:
    return {"seen_by": int(region.seen_by), "agreed_by": int(region.agreed_by)}


def _alignment(alignment: Alignment | NotAligned) -> dict[str, Any]:
    return {
        "t1_from_t0": (alignment.t1_from_t0.tolist() if isinstance(alignment, Alignment) else None),
        "inliers": int(alignment.inliers),
        "matches": int(alignment.matches),
        "reason": alignment.reason if isinstance(alignment, NotAligned) else None,
        **({"given": True} if isinstance(alignment, Alignment) and alignment.given else {}),
    }


def region_values(region: Region) -> dict[str, Any]:
    """Return a region as plain values, as `changes.json` has them."""
    return {
        "id": int(region.id),
        "kind": region.kind,
        "score": float(region.score),
        "area_px": int(region.area_px),
        "bbox_xywh": [int(value) for value in region.bbox_xywh],
        "polygon_xy": [[[int(x), int(y)] for x, y in ring] for ring in region.polygon_xy],
        "rle": dict(region.rle),
        "frame": region.frame,
        "support": float(region.support),
        "at_border": bool(region.at_border),
        **label_values(region),
    }


def label_values(region: Region) -> dict[str, Any]:
    """Return what a region shows; nothing where no network says so: files are then as ever."""
    if region.label is None:
        return {}
    return {"label": region.label, "label_share": float(region.label_share)}
