"""Refine the drawn masks of a data set: propose, decide, write, report."""

from __future__ import annotations

import base64
import math
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from zeroscd.alignment.homography import scaling
from zeroscd.annotation.mask_files import check_apart, link_rest, write_mask
from zeroscd.annotation.outcome import MaskOutcome, apply
from zeroscd.annotation.proposal import propose, views_of
from zeroscd.annotation.record import BlobProposal, PairProposals, proposal_ledger
from zeroscd.annotation.report import write_report
from zeroscd.errors import DatasetError
from zeroscd.evaluation.datasets.masks import read_truth
from zeroscd.evaluation.score_ledger import digest_files, protocol
from zeroscd.export.pictures import jpeg
from zeroscd.fingerprint import digest, digest_code, digest_values, digest_weights, versions
from zeroscd.images.areas import resize_mask
from zeroscd.images.working import enlarge_mask
from zeroscd.output import check_target
from zeroscd.progress import Silent
from zeroscd.refine.regions import connected_parts, encode_rle
from zeroscd.segments import Segment
from zeroscd.text import is_text, one_line

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from zeroscd.annotation.proposal import Views
    from zeroscd.annotation.review import Decision
    from zeroscd.arrays import Homography, Mask, Rgb
    from zeroscd.detector import Detector
    from zeroscd.evaluation.datasets.port import Dataset, PairFiles
    from zeroscd.progress import Progress
    from zeroscd.records import Frame

COPY = "dataset"  # folder with the data set's own layout
LEDGER = "proposals.jsonl"
PICTURE_PX, QUALITY = 320, 75  # longer side of a picture on the page
AROUND = 0.6  # of the square root of an area: what its picture shows beyond it


class Refinement(NamedTuple):
    """What became of a data set's masks.

    Attributes:
        masks: In the order of the data set.
        unmatched: Reviews that are about none of these proposals.
        copy: Root of the refined data set.
        page: The page to review it.
    """

    masks: tuple[MaskOutcome, ...]
    unmatched: tuple[Decision, ...]
    copy: Path
    page: Path


def refine_masks(
    dataset: Dataset,
    detector: Detector,
    out: Path,
    *,
    reviewed: Sequence[Decision] = (),
    progress: Progress | None = None,
) -> Refinement:
    """Snap the drawn masks of a data set to the things in its photos.

    Writes `dataset/` in the data set's own layout, `masks.json`, `blobs.csv` and `report.html`.
    Proposals of an earlier run with the same files, settings and code are reused.

    Args:
        dataset: One mask a pair, in its frame.
        detector: Whose segments and homographies are used.
        out: Folder for all of it.
        reviewed: What a reviewer said about proposals of an earlier run.
        progress: Hears about every finished pair.

    Raises:
        ImageError: A photo cannot be read.
        DatasetError: A mask cannot be read.
        OutputError: The folder cannot be written, or holds the drawn masks.
    """
    copy, progress = out / COPY, progress or Silent()
    check_target(copy)
    check_apart(dataset, copy)
    _check_names(dataset)
    ledger, fingerprint = proposal_ledger(out / LEDGER), _fingerprint(dataset, detector)
    said = {(one.pair, one.proposal): one.review for one in reviewed}
    progress.begin(len(dataset.pairs))
    outcomes: list[MaskOutcome] = []
    for files in dataset.pairs:
        key = digest([files.stem.encode(), digest_files(files).encode(), fingerprint.encode()])
        drawn, known = read_truth(files.mask, dataset.code), ledger.get(key)
        proposals = propose_for(files, drawn.white, dataset, detector) if known is None else known
        mask, outcome = apply(files.stem, drawn.white, proposals, said)
        write_mask(mask, files, dataset, copy, drawn=drawn)
        link_rest(files, dataset, copy)
        if known is None:
            ledger.add(key, proposals)
        outcomes.append(outcome)
        progress.advance(files.stem, reused=known is not None)
    page = write_report(dataset, detector, outcomes, out)
    found = {(blob.pair, blob.proposal.digest) for one in outcomes for blob in one.blobs}
    unmatched = tuple(one for one in reviewed if (one.pair, one.proposal) not in found)
    return Refinement(tuple(outcomes), unmatched, copy, page)


def propose_for(
    files: PairFiles, drawn: Mask, dataset: Dataset, detector: Detector
) -> PairProposals:
    """Propose an outline for every connected part of a pair's mask.

    Args:
        files: Of the pair.
        drawn: (H, W) the mask, at its file's own size.
        dataset: Says which photo it is drawn in.
        detector: Whose segments and homographies are used.

    Raises:
        ImageError: A photo cannot be read.
    """
    if not drawn.any():
        return PairProposals(())
    before, after = detector.encode([files.before, files.after])
    photo = before if dataset.frame == "t0" else after
    views = views_of(
        (before, after), resize_mask(drawn, photo.size_hw), dataset.frame, detector.settings
    )
    return PairProposals(tuple(_propose(views, part, drawn) for part in connected_parts(drawn)))


def _propose(views: Views, part: Segment, drawn: Mask) -> BlobProposal:
    size_hw = drawn.shape[0], drawn.shape[1]
    area = resize_mask(part.mask(size_hw), views.own.here.size_hw)
    found = propose(views, area)
    outline = Segment.from_mask(enlarge_mask(found.mask, size_hw))
    window_xywh = _around(part, size_hw)
    return BlobProposal(
        rle=encode_rle(outline or part, size_hw),
        photo=found.photo,
        coverage=found.coverage,
        confidence=found.confidence if outline else 0.0,
        window_xywh=window_xywh,
        picture=_picture(views, found.photo, window_xywh, size_hw),
    )


def _around(part: Segment, size_hw: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return a square around a part, as far as the mask reaches: x, y, width, height."""
    x, y, *sides = part.bbox_xywh
    wanted = max(sides) + 2 * round(AROUND * math.sqrt(part.area_px)) + 2
    width, height = min(wanted, size_hw[1]), min(wanted, size_hw[0])
    left = min(max(0, x + (sides[0] - width) // 2), size_hw[1] - width)
    top = min(max(0, y + (sides[1] - height) // 2), size_hw[0] - height)
    return left, top, width, height


def _picture(
    views: Views, photo: Frame, window_xywh: tuple[int, int, int, int], size_hw: tuple[int, int]
) -> str:
    """Show a part of the photo, the other one brought into the frame, as JPEG in base64."""
    x, y, width, height = window_xywh
    scale = PICTURE_PX / max(width, height)
    picture_hw = max(1, round(height * scale)), max(1, round(width * scale))
    window_from_mask = np.array([[1.0, 0, -x], [0, 1, -y], [0, 0, 1]])
    way: Homography = (
        scaling((height, width), picture_hw)
        @ window_from_mask
        @ scaling(views.own.here.size_hw, size_hw)
    )
    pixels: Rgb = views.own.here.working.pixels
    if photo != views.frames[0]:
        way, pixels = way @ views.own.here_from_there, views.own.there.working.pixels
    shown = cv2.warpPerspective(pixels, way, picture_hw[::-1], borderMode=cv2.BORDER_REPLICATE)
    content = jpeg(np.asarray(shown, np.uint8), quality=QUALITY)
    return base64.b64encode(content).decode("ascii")


def _check_names(dataset: Dataset) -> None:
    for files in dataset.pairs:
        if not is_text(files.stem):
            message = f"{one_line(files.stem)} in {dataset.name} is not a UTF-8 name; rename it"
            raise DatasetError(message)


def _fingerprint(dataset: Dataset, detector: Detector) -> str:
    return digest_values(
        {
            "settings": detector.settings.to_dict(),
            "protocol": protocol(dataset),
            "versions": versions(),
            "code": digest_code(also=("annotation", "evaluation/datasets")),
            "weights": digest_weights(detector.settings),
        }
    )
