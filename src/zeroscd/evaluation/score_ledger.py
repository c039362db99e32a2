"""Scores on disk, so that a killed evaluation loses nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.errors import DatasetError
from zeroscd.evaluation.scoring import PairScore
from zeroscd.fingerprint import digest, digest_code
from zeroscd.ledger import Ledger

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.evaluation.datasets.port import Dataset, PairFiles

# Of this folder, what may change a score; the rest only presents them.
SCORING = tuple(
    f"evaluation/{name}" for name in ("metrics.py", "scoring.py", "truth.py", "datasets")
)


class ScoreLedger(Ledger[PairScore]):
    """Pair scores under the content they were computed from; a line is written at once."""

    def __init__(self, path: Path) -> None:
        super().__init__(
            path,
            pack=lambda score: {"score": score.to_json()},
            unpack=lambda values: PairScore.from_json(values["score"]),
        )


def digest_files(files: PairFiles) -> str:
    """Return the sha256 of everything that a pair's files hold.

    Raises:
        DatasetError: A file cannot be read.
    """
    paths = (
        *(files.before, files.after, files.mask),
        *(files.removed, files.added, files.ignore),
    )
    return digest([b"" if path is None else _bytes(path) for path in paths])


def protocol(dataset: Dataset) -> dict[str, object]:
    """Return how the data set's masks are read and compared, as plain values."""
    return {
        "dataset": dataset.name,
        "layout": dataset.layout,
        "mask_frame": dataset.frame,
        "mask_code": dataset.code,
        "size_hw": dataset.size_hw,
        "black_is_void": dataset.black_is_void,
        "counted": dataset.counted or "removed and added",
    }


def digest_scoring() -> str:
    """Return the sha256 of the package's own files as far as they decide a score."""
    return digest_code(also=SCORING)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        message = f"cannot read {path}: {error.strerror}"
        raise DatasetError(message) from error
