"""Names that settings had before; zeroscd 0.3 will not know them any more."""

from __future__ import annotations

from zeroscd.renamed import warn_renamed

OLD_NAMES = {
    "pred_iou": "pred_iou_thresh",
    "stability": "stability_score_thresh",
    "box_nms": "box_nms_thresh",
    "crop_layers": "crop_n_layers",
    "min_speck_px": "min_mask_region_area",
    "least_width": "min_width",
    "least_peak": "min_peak",
}


def current_name(name: str, *, stacklevel: int = 1) -> str:
    """Return what a setting is called today, with a warning if that is not the name given.

    Args:
        name: Any name; an unknown one comes back as it is.
        stacklevel: 1 = the warning blames the caller, 2 = the caller's caller.
    """
    new = OLD_NAMES.get(name)
    if new is None:
        return name
    warn_renamed(f"setting {name}", new, stacklevel=stacklevel)
    return new
