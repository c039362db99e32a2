"""Matches on disk, so that a killed survey does not look them up again."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from zeroscd.ledger import Ledger
from zeroscd.survey.matching import PhotoMatch

if TYPE_CHECKING:
    from pathlib import Path

FILE = "matches.jsonl"


class MatchLedger(Ledger[PhotoMatch]):
    """A file of matches, each under a digest of all that it was computed from.

    Args:
        folder: Where the file lies; it must exist.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder / FILE, pack=_pack, unpack=_unpack)


def _pack(match: PhotoMatch) -> dict[str, Any]:
    """Return plain values; with one old photo the same as older versions wrote."""
    values = asdict(match)
    if not match.also_old:
        del values["also_old"]
    return values


def _unpack(values: dict[str, Any]) -> PhotoMatch:
    match = PhotoMatch(**{**values, "also_old": tuple(values.get("also_old", ()))})
    texts = (match.new, match.old or "", match.reason or "", *match.also_old)
    numbers = (match.score, match.inliers, match.metres or 0.0)
    if not (
        all(isinstance(t, str) for t in texts) and all(isinstance(n, float | int) for n in numbers)
    ):
        raise TypeError
    if (match.old is None) == (match.reason is None):
        raise ValueError
    return match
