"""A data set refined from end to end, with drawn streets in place of real ones."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.annotation import Decision, refine_masks
from zeroscd.annotation.outcome import apply
from zeroscd.annotation.refine import propose_for
from zeroscd.annotation.report import totals
from zeroscd.detector import Detector
from zeroscd.evaluation.datasets.catalogue import open_dataset
from zeroscd.evaluation.datasets.masks import read_mask
from zeroscd.models import Models

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.arrays import Mask


def refined_mask(out: Path, pair: str = "corner") -> Mask:
    return read_mask(out / "dataset" / "mask" / f"{pair}.png", "white")


def test_coarse_masks_come_close_to_the_exact_ones(
    street: Any, street_root: Path, tmp_path: Path, iou: Callable[[Mask, Mask], float]
) -> None:
    refined = refine_masks(open_dataset("folder", street_root), street.detector, tmp_path)
    assert iou(street.coarse, street.exact) < 0.8
    assert iou(refined_mask(tmp_path), street.exact) > 0.97
    assert not refined_mask(tmp_path, "still").any()
    copied = open_dataset("folder", refined.copy)
    assert [files.stem for files in copied.pairs] == ["corner", "still"]


def test_the_report_says_how_much_each_mask_changed(
    street: Any, street_root: Path, tmp_path: Path, iou: Callable[[Mask, Mask], float]
) -> None:
    refine_masks(open_dataset("folder", street_root), street.detector, tmp_path)
    report = json.loads((tmp_path / "masks.json").read_text())
    corner, still = report["masks"]
    mask = refined_mask(tmp_path)
    assert (corner["pair"], corner["blobs"], corner["snapped"]) == ("corner", 2, 2)
    assert corner["area_drawn_px"] == street.coarse.sum()
    assert corner["area_px"] == mask.sum()
    assert corner["iou"] == pytest.approx(iou(mask, street.coarse), abs=1e-4)
    assert (still["blobs"], still["iou"], still["min_confidence"]) == (0, 1.0, None)
    assert (report["empty"], report["snapped"], report["kept"]) == (1, 2, 0)
    with (tmp_path / "blobs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["photo"] for row in rows] == ["t0", "t1"]
    assert all(float(row["confidence"]) > 0.7 for row in rows)
    assert sum(int(row["area_proposed_px"]) for row in rows) == mask.sum()


def test_what_was_rejected_stays_as_it_was_drawn(
    street: Any, street_root: Path, tmp_path: Path
) -> None:
    dataset = open_dataset("folder", street_root)
    first = refine_masks(dataset, street.detector, tmp_path).masks[0].blobs
    said = [
        Decision("corner", first[0].proposal.digest, "rejected"),
        Decision("corner", "an older proposal", "rejected"),
    ]
    refined = refine_masks(dataset, street.detector, tmp_path, reviewed=said)
    columns = np.arange(street.coarse.shape[1])
    left = columns < street.coarse.shape[1] // 2
    mask = refined_mask(tmp_path)
    assert np.array_equal(mask[:, left], street.coarse[:, left])
    assert not np.array_equal(mask[:, ~left], street.coarse[:, ~left])
    assert refined.unmatched == (said[1],)
    assert totals(refined.masks)["rejected"] == 1


def test_where_nothing_is_to_be_seen_what_was_drawn_stays_until_somebody_accepts(
    street: Any, street_root: Path, tmp_path: Path
) -> None:
    """Both photos are of the wall alone: no edge lies near what was drawn."""
    for part in ("t0", "t1"):
        Image.fromarray(np.full_like(street.before, 90)).save(street_root / part / "corner.png")
    grey = np.full_like(street.before, 90)
    street.detector.models.segmenter.script[grey.tobytes()] = ()
    dataset = open_dataset("folder", street_root)
    refined = refine_masks(dataset, street.detector, tmp_path)
    assert totals(refined.masks)["kept"] == 2
    assert np.array_equal(refined_mask(tmp_path), street.coarse)
    said = [Decision("corner", blob.proposal.digest, "accepted") for blob in refined.masks[0].blobs]
    refined = refine_masks(dataset, street.detector, tmp_path, reviewed=said)
    assert totals(refined.masks)["snapped"] == 2


class Unwilling:
    """Fails where a photo is encoded again."""

    name, tau = "toy", 0.65

    def encode(self, photos: Any) -> Any:
        raise AssertionError


def test_a_second_run_computes_nothing_and_writes_the_same(
    street: Any, street_root: Path, tmp_path: Path
) -> None:
    dataset = open_dataset("folder", street_root)
    refine_masks(dataset, street.detector, tmp_path)
    files = [path for path in tmp_path.rglob("*") if path.is_file() and path.suffix != ".jsonl"]
    before = {path: path.read_bytes() for path in files}
    segmenter = street.detector.models.segmenter
    street.detector.models = Models(encoder=Unwilling(), segmenter=segmenter)
    refine_masks(dataset, street.detector, tmp_path)
    assert {path: path.read_bytes() for path in files} == before


def test_masks_of_another_size_than_their_photo_keep_it(
    street: Any, street_root: Path, tmp_path: Path, iou: Callable[[Mask, Mask], float]
) -> None:
    path = street_root / "mask" / "corner.png"
    height, width = street.coarse.shape
    Image.open(path).resize((2 * width, 2 * height), Image.Resampling.NEAREST).save(path)
    refine_masks(open_dataset("folder", street_root), street.detector, tmp_path)
    mask = refined_mask(tmp_path)
    assert mask.shape == (2 * height, 2 * width)
    assert iou(mask, street.exact.repeat(2, axis=0).repeat(2, axis=1)) > 0.96


@pytest.mark.data
@pytest.mark.slow
def test_lite_brings_a_mask_of_a_real_street_closer_to_the_exact_one(
    shared_data: Path, grow: Callable[[Mask, int], Mask], iou: Callable[[Mask, Mask], float]
) -> None:
    dataset = open_dataset("folder", shared_data / "street-composite-dev")
    files = dataset.pairs[1]
    exact = read_mask(files.mask, dataset.code)
    drawn = grow(exact, 4)
    proposals = propose_for(files, drawn, dataset, Detector.from_preset("lite"))
    mask, _ = apply(files.stem, drawn, proposals, {})
    assert iou(mask, exact) > iou(drawn, exact) + 0.05
