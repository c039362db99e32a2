"""Run a survey: find the old photo of each new one, compare both, report."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from zeroscd import batch
from zeroscd.batch.journal import SURVEY_FILES
from zeroscd.batch.names import stem
from zeroscd.batch.task import Row
from zeroscd.errors import DatasetError, ImageError
from zeroscd.fingerprint import digest, digest_values
from zeroscd.images.read import read_file
from zeroscd.output import check_target, make_folder, refuse_link
from zeroscd.progress import Silent
from zeroscd.renamed import renamed_fields
from zeroscd.survey.events import find_events, write_events
from zeroscd.survey.match_ledger import MatchLedger
from zeroscd.survey.matching import MatchRules, PhotoMatch, match_photo
from zeroscd.survey.reports import write_reports
from zeroscd.survey.review import ReviewedEvent, carry_reviews

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.batch.job import Engine
    from zeroscd.progress import Progress
    from zeroscd.retrieval.index import PlaceIndex
    from zeroscd.survey.events import Event


@renamed_fields({"sightings": "matches"})
@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What a survey did.

    Attributes:
        matches: One for each new photo, in their order.
        batch: Summary of the comparison.
        events: What was added or removed, each thing once, the most certain first.
        unmatched_reviews: Reviewed events of an earlier run that are none of these.
        report: Path of the page.
    """

    matches: tuple[PhotoMatch, ...] = field(repr=False)
    batch: batch.Summary
    events: tuple[Event, ...] = field(default=(), repr=False)
    unmatched_reviews: tuple[ReviewedEvent, ...] = field(default=(), repr=False)
    report: Path

    @property
    def matched(self) -> int:
        """New photos with an old one of the same place."""
        return sum(match.old is not None for match in self.matches)


def survey(
    photos: Sequence[str | Path],
    index: PlaceIndex,
    out: str | Path,
    *,
    rules: MatchRules | None = None,
    options: batch.Options | None = None,
) -> Summary:
    """Find the old photo of each new one, compare both, and write tables, maps and a report.

    The same as `match_photos`, then `compare`. A survey that was stopped or killed continues when
    it is started again with the same folder. A photo without an old one is a row with the reason.

    Args:
        photos: Paths of the new photos.
        index: The old photos.
        out: Folder for the results, on a disk of this machine.
        rules: Which old photos count as of the same place.
        options: How pairs are compared, and which files are written for each.

    Raises:
        DatasetError: The index is empty.
        OutputError: The folder cannot be written.
        ZeroscdError: The detector cannot be made.
    """
    return compare(match_photos(photos, index, out, rules=rules), out, options=options)


def match_photos(
    photos: Sequence[str | Path],
    index: PlaceIndex,
    out: str | Path,
    *,
    rules: MatchRules | None = None,
    progress: Progress | None = None,
) -> list[PhotoMatch]:
    """Find the old photo of each new one, unless an earlier run did so in the same index.

    Args:
        photos: Paths of the new photos.
        index: The old photos.
        out: Folder for the matches, on a disk of this machine.
        rules: Which old photos count as of the same place.
        progress: Told of every photo.

    Raises:
        DatasetError: The index is empty.
        OutputError: The folder cannot be written.
    """
    if not len(index):
        message = "the place index is empty; add old photos: zeroscd index build PHOTOS -o PLACES"
        raise DatasetError(message)
    chosen, listener, folder = rules or MatchRules(), progress or Silent(), Path(out)
    check_target(folder)
    make_folder(folder)
    for name in SURVEY_FILES:
        refuse_link(folder / name)
    ledger, matches = MatchLedger(folder), []
    state = digest_values({"index": index.state(), "rules": repr(chosen)})
    listener.begin(len(photos))
    for path in map(str, photos):
        key = _key(path, state)
        known = ledger.get(key) if key else None
        match = known or match_photo(path, index, chosen)
        if key and known is None:
            ledger.add(key, match)
        matches.append(match)
        listener.advance(Path(path).name, reused=known is not None)
    return matches


def compare(  # noqa: PLR0913 - what a survey is made of, each by its name
    matches: Sequence[PhotoMatch],
    out: str | Path,
    *,
    options: batch.Options | None = None,
    engine: Engine | None = None,
    progress: Progress | None = None,
    reviewed: Sequence[ReviewedEvent] = (),
) -> Summary:
    """Compare every new photo with its old one, and write tables, events, maps and the report.

    Args:
        matches: As `match_photos` returns them.
        out: Folder for the results, on a disk of this machine.
        options: How pairs are compared, and which files are written for each.
        engine: Where they are compared; this process if not given.
        progress: Told of every pair.
        reviewed: Events of an earlier run that were reviewed (`read_reviews`).

    Raises:
        OutputError: The folder cannot be written.
        ZeroscdError: The detector cannot be made.
    """
    manifest = batch.Manifest(base=".", rows=lambda: (_row(match) for match in matches))
    summary = batch.run(manifest, out, options=options, engine=engine, progress=progress)
    found = find_events(Path(out), options or batch.Options())
    events, unmatched = carry_reviews(found, reviewed)
    write_events(Path(out), events)
    report = write_reports(Path(out), matches, events)
    return Summary(
        matches=tuple(matches),
        batch=summary,
        events=events,
        unmatched_reviews=unmatched,
        report=report,
    )


def _key(path: str, state: str) -> str | None:
    try:
        return digest([state.encode(), path.encode("utf-8", "surrogatepass"), read_file(path)])
    except ImageError:
        return None  # `match_photo` will say why


def _row(match: PhotoMatch) -> Row:
    return Row(
        before=match.old,
        after=match.new,
        id=stem(match.new),
        error=match.reason,
        also_before=match.also_old,
    )
