"""How much each mask changed: JSON, CSV, and the page to review it."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from zeroscd.annotation.outcome import MIN_CONFIDENCE
from zeroscd.evaluation.score_ledger import protocol
from zeroscd.export.csv_table import csv_lines
from zeroscd.fingerprint import versions
from zeroscd.output import write_json, write_whole
from zeroscd.pages import render
from zeroscd.refine.polygons import outer_polygons

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from zeroscd.annotation.outcome import BlobOutcome, MaskOutcome
    from zeroscd.arrays import Mask
    from zeroscd.detector import Detector
    from zeroscd.evaluation.datasets.port import Dataset
    from zeroscd.pages import Ring

PAGE, MASKS, BLOBS = "report.html", "masks.json", "blobs.csv"
MAX_CARDS = 1000  # outlines on the page, the least certain first; all are in the tables
COLUMNS = (
    *("pair", "blob", "outcome", "confidence", "coverage", "photo"),
    *("area_drawn_px", "area_proposed_px", "iou", "review", "proposal"),
)


def write_report(
    dataset: Dataset, detector: Detector, masks: Sequence[MaskOutcome], out: Path
) -> Path:
    """Write the tables and the page; return the page's path.

    Raises:
        OutputError: The folder cannot be written.
    """
    blobs = [blob for mask in masks for blob in mask.blobs]
    rows = [blob.row() for blob in blobs]
    write_json(
        {
            **totals(masks),
            "min_confidence": MIN_CONFIDENCE,
            "preset": detector.preset,
            "settings": detector.settings.to_dict(),
            "versions": versions(),
            "protocol": {**protocol(dataset), "notes": list(dataset.notes)},
            "masks": [mask.row() for mask in masks],
        },
        out / MASKS,
    )
    write_whole(out / BLOBS, b"".join(csv_lines(rows, COLUMNS)))
    write_whole(out / PAGE, _page(dataset, blobs, rows).encode())
    return out / PAGE


def totals(masks: Sequence[MaskOutcome]) -> dict[str, Any]:
    """Count masks and areas, and say how much the changed masks differ from what was drawn."""
    blobs = [blob for mask in masks for blob in mask.blobs]
    reviews = Counter(blob.review or "open" for blob in blobs)
    snapped = sum(blob.snapped for blob in blobs)
    drawn = [mask for mask in masks if mask.blobs]
    return {
        "pairs": len(masks),
        "empty": len(masks) - len(drawn),
        "blobs": len(blobs),
        "snapped": snapped,
        "kept": len(blobs) - snapped,
        **{name: reviews[name] for name in ("accepted", "rejected", "open")},
        "mean_iou_with_drawn": (
            round(sum(mask.iou for mask in drawn) / len(drawn), 4) if drawn else None
        ),
        "area_drawn_px": sum(mask.area_drawn_px for mask in masks),
        "area_px": sum(mask.area_px for mask in masks),
    }


def _page(dataset: Dataset, blobs: Sequence[BlobOutcome], rows: Sequence[dict[str, Any]]) -> str:
    certain = sorted(zip(blobs, rows, strict=True), key=lambda one: one[0].proposal.confidence)
    shown = certain[:MAX_CARDS]
    return render(
        "refine_masks.html",
        dataset=dataset,
        cards=[_card(number, *one) for number, one in enumerate(shown, start=1)],
        blobs=[row for _, row in shown],
        everything=len(blobs),
        snapped=sum(blob.snapped for blob in blobs),
        min_confidence=MIN_CONFIDENCE,
    )


def _card(number: int, blob: BlobOutcome, row: dict[str, Any]) -> dict[str, Any]:
    proposed = blob.proposal.mask()
    drawn = blob.drawn.mask((proposed.shape[0], proposed.shape[1]))
    return {
        **row,
        "id": number,
        "picture": blob.proposal.picture,
        "window": blob.proposal.window_xywh,
        "drawn": _rings(drawn),
        "proposed": _rings(proposed),
    }


def _rings(mask: Mask) -> list[Ring]:
    """Return the outlines of a mask, without the corners that a small picture cannot show."""
    rings = (np.asarray(ring, np.float32) for ring in outer_polygons(mask))
    return [cv2.approxPolyDP(ring, 0.5, closed=True).reshape(-1, 2).tolist() for ring in rings]
