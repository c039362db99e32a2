"""Evaluate detectors on a data set; reading and scoring overlap with detecting."""

from __future__ import annotations

import os
import time
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import cv2
import numpy as np

from zeroscd.errors import DatasetError, SettingsError
from zeroscd.evaluation.score_ledger import ScoreLedger, digest_files, digest_scoring, protocol
from zeroscd.evaluation.scores import Scores
from zeroscd.evaluation.scoring import (
    PairScore,
    agreement,
    count_in_view,
    count_kinds,
    count_pair,
    distance_histogram,
    predicted_mask,
    why_not_aligned,
)
from zeroscd.evaluation.truth import LoadedPair, load_pair
from zeroscd.fingerprint import digest, digest_values, digest_weights, versions
from zeroscd.output import check_target, write_json, write_whole
from zeroscd.progress import Silent
from zeroscd.text import is_text, one_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.evaluation.datasets.port import Dataset, PairFiles
    from zeroscd.progress import Progress
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings

AHEAD = 2  # pairs read before they are needed, for each core


class PairDetector(Protocol):
    """Finds what changed; :class:`zeroscd.Detector` is one."""

    @property
    def settings(self) -> Settings:
        """Everything that decides the outcome."""
        ...

    @property
    def preset(self) -> str:
        """Name of the preset the settings started from."""
        ...

    def detect(self, before: Rgb, after: Rgb) -> ChangeResult:
        """Compare two (H, W, 3) uint8 RGB photos."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One detector to evaluate.

    Attributes:
        detector: Its frame must be the data set's.
        out: Folder for the ledger, the masks and `scores.json`.
        swapped: The same detector for the swapped photos, set to the other frame, so that its
            mask lies in the same photo; given when temporal consistency is wanted.
    """

    detector: PairDetector
    out: Path
    swapped: PairDetector | None = None


def evaluate(dataset: Dataset, run: Run, *, progress: Progress | None = None) -> Scores:
    """Score a detector on every pair of a data set and write `scores.json`.

    Scores of an earlier run with the same files, settings and code are reused.

    Raises:
        SettingsError: The detector draws its mask in another frame than the data set.
        ImageError: A photo cannot be read.
        DatasetError: A mask cannot be read.
        OutputError: The folder cannot be written.
    """
    return evaluate_all(dataset, [run], progress=progress)[0]


def evaluate_all(
    dataset: Dataset, runs: Sequence[Run], *, progress: Progress | None = None
) -> list[Scores]:
    """Score several detectors in one pass over a data set; like `evaluate` for each."""
    scorers = [_PairScorer(dataset, run) for run in runs]
    found = _score_pairs(dataset, scorers, progress or Silent())
    results = []
    for scorer, pairs in zip(scorers, found, strict=True):
        detector = scorer.run.detector
        scores = Scores(
            dataset=dataset,
            settings=detector.settings,
            preset=detector.preset,
            pairs=tuple(pairs),
        )
        write_json(scores.to_dict(), scorer.run.out / "scores.json")
        results.append(scores)
    return results


class _PairScorer:
    """Looks up, detects and scores the pairs of one run."""

    def __init__(self, dataset: Dataset, run: Run) -> None:
        if run.detector.settings.frame != dataset.frame:
            message = (
                f"{dataset.name} draws its masks in the {dataset.frame} frame; "
                f"leave out the setting frame={run.detector.settings.frame}"
            )
            raise SettingsError(message)
        for files in dataset.pairs:
            if not is_text(files.stem):
                message = f"{one_line(files.stem)} in {dataset.name} is not a UTF-8 name; rename it"
                raise DatasetError(message)
        self.run = run
        self._dataset = dataset
        check_target(run.out / "masks")  # made with the first score: the data set may be unreadable
        self._ledger = ScoreLedger(run.out / "pairs.jsonl")
        self._fingerprint = digest_values(
            {
                "settings": run.detector.settings.to_dict(),
                "preset": run.detector.preset,
                "swapped": run.swapped is not None,
                "protocol": protocol(dataset),
                "versions": versions(),
                "code": digest_scoring(),
                "weights": digest_weights(run.detector.settings),
            }
        )

    def key(self, files: PairFiles, content: str) -> str:
        return digest([files.stem.encode(), content.encode(), self._fingerprint.encode()])

    def known(self, files: PairFiles, content: str) -> PairScore | None:
        score = self._ledger.get(self.key(files, content))
        return score if score and self._mask_path(files).exists() else None

    def detect(self, pair: LoadedPair) -> _Detected:
        began = time.perf_counter()
        result = self.run.detector.detect(pair.before, pair.after)
        seconds = time.perf_counter() - began
        swapped = self.run.swapped
        back = None if swapped is None else swapped.detect(pair.after, pair.before).mask
        return _Detected(result=result, seconds=seconds, swapped_mask=back)

    def score(
        self, files: PairFiles, content: str, pair: LoadedPair, detected: _Detected
    ) -> PairScore:
        result = detected.result
        found = predicted_mask(result, self._dataset.counted)
        counts, false_regions = count_pair(found, pair.truth)
        score = PairScore(
            stem=files.stem,
            counts=counts,
            seconds=detected.seconds,
            stages=dict(result.seconds),
            false_regions=false_regions,
            in_view_px=count_in_view(found, result.unseen, pair.truth),
            histogram=distance_histogram(result.heatmap, pair.truth),
            kinds=count_kinds(result, pair.truth),
            consistency=(
                None
                if detected.swapped_mask is None
                else agreement(result.mask, detected.swapped_mask)
            ),
            not_aligned=why_not_aligned(result),
            resized=found.shape != pair.truth.changed.shape,
            mask_note=pair.truth.note,
        )
        write_whole(self._mask_path(files), _png(found))
        self._ledger.add(self.key(files, content), score)
        return score

    def _mask_path(self, files: PairFiles) -> Path:
        return self.run.out / "masks" / f"{files.stem}.png"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Detected:
    result: ChangeResult
    seconds: float
    swapped_mask: Mask | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Prepared:
    """A pair whose files are digested, and read unless every scorer knows it already."""

    files: PairFiles
    content: str
    known: tuple[PairScore | None, ...]
    pair: LoadedPair | None


def _score_pairs(
    dataset: Dataset, scorers: Sequence[_PairScorer], progress: Progress
) -> list[list[PairScore]]:
    progress.begin(len(dataset.pairs))
    pending: list[list[PairScore | Future[PairScore]]] = [[] for _ in scorers]
    cores = os.cpu_count() or 1
    # Leaving the block waits for the scores of finished detections, also after Ctrl-C.
    with ThreadPoolExecutor(cores, thread_name_prefix="score") as pool:
        for ready in _prepare_ahead(dataset, scorers, cores):
            for scores, score in zip(pending, _score_by_all(scorers, ready, pool), strict=True):
                scores.append(score)
            progress.advance(ready.files.stem, reused=ready.pair is None)
            _raise_early(pending)
    return [[_value_of(score) for score in scores] for scores in pending]


def _score_by_all(
    scorers: Sequence[_PairScorer], ready: _Prepared, pool: ThreadPoolExecutor
) -> list[PairScore | Future[PairScore]]:
    """Return the pair's score by every scorer: known already, or being counted."""
    pair = ready.pair
    if pair is None:
        return [score for score in ready.known if score is not None]
    asked = [scorer for scorer, known in zip(scorers, ready.known, strict=True) if known is None]
    # In an ablation the first one encodes the pair; the others share the result.
    detected = [asked[0].detect(pair), *pool.map(lambda scorer: scorer.detect(pair), asked[1:])]
    found = {
        id(scorer): pool.submit(scorer.score, ready.files, ready.content, pair, one)
        for scorer, one in zip(asked, detected, strict=True)
    }
    return [known or found[id(scorer)] for scorer, known in zip(scorers, ready.known, strict=True)]


def _prepare_ahead(
    dataset: Dataset, scorers: Sequence[_PairScorer], cores: int
) -> Iterator[_Prepared]:
    """Yield the pairs in order while the next ones are being read."""
    readers = ThreadPoolExecutor(cores, thread_name_prefix="read")
    waiting: deque[Future[_Prepared]] = deque()
    try:
        for files in dataset.pairs:
            waiting.append(readers.submit(_prepare, files, dataset, scorers))
            if len(waiting) > AHEAD * cores:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        readers.shutdown(cancel_futures=True)


def _prepare(files: PairFiles, dataset: Dataset, scorers: Sequence[_PairScorer]) -> _Prepared:
    content = digest_files(files)
    known = tuple(scorer.known(files, content) for scorer in scorers)
    pair = None if all(known) else load_pair(files, dataset)
    return _Prepared(files=files, content=content, known=known, pair=pair)


def _raise_early(pending: Sequence[Sequence[PairScore | Future[PairScore]]]) -> None:
    """Stop at a failed score (a full disk) instead of computing the rest for nothing."""
    for scores in pending:
        for score in scores[-AHEAD:]:
            if isinstance(score, Future) and score.done():
                score.result()


def _value_of(score: PairScore | Future[PairScore]) -> PairScore:
    return score.result() if isinstance(score, Future) else score


def _png(mask: Mask) -> bytes:
    done, encoded = cv2.imencode(".png", mask.astype(np.uint8) * 255)
    assert done  # noqa: S101 - an 8-bit picture in memory can be encoded
    return encoded.tobytes()
