"""What a reviewer said about events: read from an export of the report, given to the events."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

from zeroscd.errors import DatasetError
from zeroscd.survey.events.event import Review
from zeroscd.text import one_line, shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from zeroscd.survey.events import Event

REVIEWS: tuple[str, ...] = get_args(Review)
REMEDY = "give a file that the report of a survey exported"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReviewedEvent:
    """An event of an earlier run that somebody reviewed.

    Attributes:
        kind: "removed" or "added".
        regions: Pair and number of its regions.
        best: The best one of them.
        score: Of the event.
        review: What was said.
    """

    kind: str
    regions: frozenset[tuple[str, int]]
    best: tuple[str, int]
    score: float
    review: Review


class Carried(NamedTuple):
    """Events with their reviews.

    Attributes:
        events: All events, in their order.
        unmatched: Reviewed events whose review went to none of them.
    """

    events: tuple[Event, ...]
    unmatched: tuple[ReviewedEvent, ...]


def read_reviews(path: Path) -> tuple[ReviewedEvent, ...]:
    """Read the reviewed events of a GeoJSON or JSON export; those without a review are left out.

    Raises:
        DatasetError: The file cannot be read, or is no such export.
    """
    name = one_line(str(path))
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        message = f"cannot read {name}: {error.strerror or error}; {REMEDY}"
        raise DatasetError(message) from error
    except (ValueError, RecursionError) as error:
        message = f"cannot read {name}: it is no JSON; {REMEDY}"
        raise DatasetError(message) from error
    try:
        return tuple(_reviewed_event(one) for one in _values(content) if one["review"] is not None)
    except (KeyError, TypeError, ValueError) as error:
        message = f"cannot read {name}: it holds no reviewed events ({_why(error)}); {REMEDY}"
        raise DatasetError(message) from error


def carry_reviews(events: Sequence[Event], reviewed: Iterable[ReviewedEvent]) -> Carried:
    """Give each event the review of the reviewed events that it shares regions with.

    Those are of the same kind. Where they contradict each other, the event has no review. Where the
    best region is the same but its score is not, the pair was compared with other settings: then
    the region is another one, and the review does not count.

    Args:
        events: Of this run; what they were reviewed as before is forgotten.
        reviewed: Of an earlier run.
    """
    reviewed = tuple(reviewed)
    by_region: dict[tuple[str, str, int], list[ReviewedEvent]] = {}
    for one in reviewed:
        for region in one.regions:
            by_region.setdefault((one.kind, *region), []).append(one)
    carried, used = [], set()
    for event in events:
        found = {
            one
            for region in event.regions
            for one in by_region.get((event.kind, *region), ())
            if _is_same_comparison(event, one)
        }
        said = {one.review for one in found}
        review = next(iter(said)) if len(said) == 1 else None
        used |= found if review else set()
        carried.append(replace(event, review=review))
    return Carried(tuple(carried), tuple(one for one in reviewed if one not in used))


def _is_same_comparison(event: Event, reviewed: ReviewedEvent) -> bool:
    best = event.best_pair, event.best_region
    return best != reviewed.best or event.score == reviewed.score


def _values(content: Any) -> Iterable[Mapping[str, Any]]:  # noqa: ANN401 - whatever JSON holds
    if "features" in content:
        return [feature["properties"] for feature in content["features"]]
    return list(content["events"])


def _reviewed_event(values: Mapping[str, Any]) -> ReviewedEvent:
    if values["review"] not in REVIEWS:
        message = f"{shown(values['review'])} is no review"
        raise ValueError(message)
    return ReviewedEvent(
        kind=str(values["kind"]),
        regions=frozenset((str(one["pair"]), int(one["region"])) for one in values["regions"]),
        best=(str(values["best_pair"]), int(values["best_region"])),
        score=float(values["score"]),
        review=values["review"],
    )


def _why(error: Exception) -> str:
    return f"there is no {error}" if isinstance(error, KeyError) else str(error)
