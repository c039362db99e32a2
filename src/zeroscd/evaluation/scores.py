"""The scores of one evaluation, as other programs read them in `scores.json`."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from zeroscd.evaluation.bootstrap import intervals
from zeroscd.evaluation.datasets.tree import shorten
from zeroscd.evaluation.metrics import Summary, false_positive_rate, pool, summarise
from zeroscd.evaluation.score_ledger import protocol
from zeroscd.fingerprint import versions

if TYPE_CHECKING:
    from zeroscd.evaluation.datasets.port import Dataset
    from zeroscd.evaluation.scoring import PairScore
    from zeroscd.settings import Settings

# Of the change class, as tables of aerial data sets give them; unchanged pairs count as well.
POOLED = ("precision", "recall", "f1", "iou", "overall_accuracy")


@dataclass(frozen=True, slots=True, kw_only=True)
class FalseAlarms:
    """What was flagged where nothing changed.

    Attributes:
        pairs: Pairs without true change.
        false_positive_rate: Mean share of their counted pixels that was flagged; 0 without pairs.
        flagged_fraction: The same of their pixels in view of both photos.
        pairs_with_false_alarm: Share of them with a flagged region of 100 px or more, 0..1.
        false_regions_per_pair: Mean number of such regions.
    """

    pairs: int
    false_positive_rate: float
    flagged_fraction: float | None
    pairs_with_false_alarm: float | None
    false_regions_per_pair: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scores:
    """How well a detector did on a data set.

    Attributes:
        dataset: What it was measured on.
        settings: What decided the masks.
        preset: The preset that the settings started from.
        pairs: Every pair's score, in the data set's order.
    """

    dataset: Dataset
    settings: Settings
    preset: str
    pairs: tuple[PairScore, ...]

    @property
    def summary(self) -> Summary:
        """The means over the pairs with change."""
        return summarise([pair.counts for pair in self.pairs])

    @property
    def false_alarms(self) -> FalseAlarms:
        """What was flagged in the pairs without change."""
        unchanged = [pair for pair in self.pairs if not pair.counts.has_change]
        regions = [pair.false_regions for pair in unchanged]
        total = len(unchanged)
        return FalseAlarms(
            pairs=total,
            false_positive_rate=false_positive_rate([pair.counts for pair in unchanged]),
            flagged_fraction=(
                sum(pair.flagged_fraction for pair in unchanged) / total if total else None
            ),
            pairs_with_false_alarm=sum(map(bool, regions)) / total if total else None,
            false_regions_per_pair=sum(regions) / total if total else None,
        )

    @property
    def kind_accuracy(self) -> float | None:
        """Of the regions that hit a true change, the share with the right kind, 0..1."""
        kinds = [pair.kinds for pair in self.pairs if pair.kinds is not None]
        hit = sum(pair.hit for pair in kinds)
        return sum(pair.right for pair in kinds) / hit if hit else None

    @property
    def temporal_consistency(self) -> float | None:
        """Mean IoU of each mask with the one found after swapping the photos, 0..1."""
        found = [pair.consistency for pair in self.pairs if pair.consistency is not None]
        return sum(found) / len(found) if found else None

    @property
    def by_fold(self) -> dict[str, float | None]:
        """Mean F1 over each fold of a published cross-validation; empty where there is none."""
        folds = {files.stem: files.fold for files in self.dataset.pairs}
        numbers = sorted({fold for fold in folds.values() if fold is not None})
        return {
            str(number): summarise(
                [pair.counts for pair in self.pairs if folds[pair.stem] == number]
            ).f1_macro
            for number in numbers
        }

    @property
    def pooled(self) -> dict[str, float]:
        """Scores of the pixels of all pairs together; empty where no published table has them."""
        if not self.dataset.pools_pixels:
            return {}
        counts = pool([pair.counts for pair in self.pairs])
        return {name: getattr(counts, name) for name in POOLED}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What puts the scores in doubt, a sentence each; the data set's notes say the rest.

        Where a protocol brings photos and masks to one size, masks of any size are in order.
        """
        found = []
        for note in sorted({pair.mask_note for pair in self.pairs if pair.mask_note}):
            stems = [pair.stem for pair in self.pairs if pair.mask_note == note]
            found.append(f"{note}: masks of {shorten(stems)}")
        resized = [pair.stem for pair in self.pairs if pair.resized]
        if resized:
            found.append(
                f"not as large as their {self.dataset.frame} photo: masks of {shorten(resized)}; "
                "what was found is scaled to them, so they must show the whole of that photo"
            )
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `scores.json`: fractions 0..1, None where no pair counts."""
        counts = [pair.counts for pair in self.pairs]
        return {
            "pairs": len(self.pairs),
            **asdict(self.summary),
            "no_change": asdict(self.false_alarms),
            "per_pair": [_row(pair) for pair in self.pairs],
            "settings": self.settings.to_dict(),
            "versions": versions(),
            "preset": self.preset,
            "protocol": {**protocol(self.dataset), "notes": [*self.dataset.notes, *self.warnings]},
            "intervals_95": {name: list(ends) for name, ends in intervals(counts).items()},
            "empty_pairs_as_zero": asdict(summarise(counts, empty="zero")),
            "empty_pairs_as_one": asdict(summarise(counts, empty="one")),
            "pixels": asdict(pool(counts)),
            **({"pooled": self.pooled} if self.pooled else {}),
            "kind_accuracy": self.kind_accuracy,
            "temporal_consistency": self.temporal_consistency,
            "f1_macro_by_fold": self.by_fold,
            "not_aligned": [pair.stem for pair in self.pairs if pair.not_aligned],
        }


def _row(pair: PairScore) -> dict[str, object]:
    changed = pair.counts.has_change
    return {
        "stem": pair.stem,
        "f1": pair.counts.f1 if changed else None,
        "precision": pair.counts.precision if changed else None,
        "recall": pair.counts.recall if changed else None,
        "seconds": pair.seconds,
        "iou": pair.counts.iou if changed else None,
        "flagged": pair.counts.flagged,
        "flagged_fraction": pair.flagged_fraction,
        "in_view_px": pair.in_view_px,
        "false_regions": pair.false_regions,
        "not_aligned": pair.not_aligned,
    }
