"""The paper's panels: both photos, the truth, ours, and where they differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.errors import SettingsError
from zeroscd.evaluation.datasets.masks import read_mask
from zeroscd.evaluation.truth import load_pair
from zeroscd.images.areas import resize_mask

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.evaluation.datasets.port import Dataset, PairFiles
    from zeroscd.evaluation.scores import Scores
    from zeroscd.evaluation.truth import Truth

# Okabe and Ito's palette: hue and brightness both differ, so any colour vision tells them apart.
FOUND_RGB, MISSED_RGB, FALSE_RGB = (0, 114, 178), (240, 228, 66), (213, 94, 0)
VOID_RGB = (0, 0, 0)
KEYS = {
    "found": FOUND_RGB,
    "missed": MISSED_RGB,
    "falsely flagged": FALSE_RGB,
    "does not count": VOID_RGB,
}
DIMMED = 0.45  # of the photo's brightness under the colours
SHOWN = 3  # best, worst and random pairs
RANDOM_SEED = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """The pictures of one pair.

    Attributes:
        stem: The pair's name.
        why: Why it is shown: "best", "worst", "random" or "chosen".
        f1: 0..1; None for a pair without change.
        pictures: title -> (H, W, 3) uint8 RGB, in the paper's order.
    """

    stem: str
    why: str
    f1: float | None
    pictures: dict[str, Rgb]

    @property
    def score(self) -> str:
        """Its F1 in words."""
        return "no change" if self.f1 is None else f"F1 {self.f1:.3f}"


def check_chosen(dataset: Dataset, chosen: Sequence[str]) -> None:
    """Refuse before a long run what could not be shown after it.

    Raises:
        SettingsError: A chosen pair is not in the data set.
    """
    known = {pair.stem for pair in dataset.pairs}
    for stem in chosen:
        if stem not in known:
            message = f"no pair {stem!r} to show in {dataset.root}; pairs are named by their files"
            raise SettingsError(message)


def choose_pairs(scores: Scores, chosen: Sequence[str] = ()) -> dict[str, str]:
    """Return stem -> why it is shown: the chosen, then the best, the worst and random others."""
    ranked = sorted(
        (pair for pair in scores.pairs if pair.counts.has_change),
        key=lambda pair: (-pair.counts.f1, pair.stem),
    )
    found = dict.fromkeys(chosen, "chosen")
    for why, pairs in (("best", ranked), ("worst", ranked[::-1])):
        unseen = [pair.stem for pair in pairs if pair.stem not in found]
        found |= dict.fromkeys(unseen[:SHOWN], why)
    others = [pair.stem for pair in scores.pairs if pair.stem not in found]
    rng = np.random.default_rng(RANDOM_SEED)
    drawn = rng.permutation(len(others))[:SHOWN]
    return found | {others[at]: "random" for at in sorted(drawn)}


def draw_panels(scores: Scores, out: Path, chosen: Sequence[str] = ()) -> list[Panel]:
    """Draw the panels of the pairs worth seeing, from the masks that the evaluation has kept."""
    files = {pair.stem: pair for pair in scores.dataset.pairs}
    f1 = {pair.stem: pair.counts.f1 for pair in scores.pairs if pair.counts.has_change}
    return [
        Panel(
            stem=stem,
            why=why,
            f1=f1.get(stem),
            pictures=_draw(files[stem], scores.dataset, out / "masks" / f"{stem}.png"),
        )
        for stem, why in choose_pairs(scores, chosen).items()
    ]


def error_map(photo: Rgb, predicted: Mask, truth: Truth) -> Rgb:
    """Colour what was found, missed and falsely flagged over the dimmed photo.

    Args:
        photo: (H, W, 3).
        predicted: (H, W).
        truth: Of the same size; what does not count turns black.
    """
    grey = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY)
    drawn = np.repeat((grey[..., None] * DIMMED).astype(np.uint8), 3, axis=2)
    for area, colour in (
        (predicted & truth.changed, FOUND_RGB),
        (~predicted & truth.changed, MISSED_RGB),
        (predicted & ~truth.changed, FALSE_RGB),
        (~truth.valid, VOID_RGB),
    ):
        drawn[area] = colour
    return drawn


def _draw(files: PairFiles, dataset: Dataset, mask_path: Path) -> dict[str, Rgb]:
    pair = load_pair(files, dataset)
    size_hw = pair.truth.changed.shape
    predicted = resize_mask(read_mask(mask_path, "white"), size_hw)
    photo = pair.before if dataset.frame == "t0" else pair.after
    under = np.asarray(cv2.resize(photo, (size_hw[1], size_hw[0])), dtype=np.uint8)
    return {
        "t0 (before)": pair.before,
        "t1 (after)": pair.after,
        "truth": _paint(pair.truth.changed),
        "ours": _paint(predicted),
        "errors": error_map(under, predicted, pair.truth),
    }


def _paint(mask: Mask) -> Rgb:
    return np.repeat(mask[..., None].astype(np.uint8) * 255, 3, axis=2)
