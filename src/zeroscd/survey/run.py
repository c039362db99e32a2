"""A whole survey: find the old photo of each new one, compare, report."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from zeroscd import batch
from zeroscd.batch.names import stem
from zeroscd.batch.task import Row
from zeroscd.errors import DatasetError, ImageError
from zeroscd.export.folder import check_target, make_folder
from zeroscd.fingerprint import digest, digest_values
from zeroscd.images.read import read_file
from zeroscd.progress import Silent
from zeroscd.survey.book import Book
from zeroscd.survey.reports import write_reports
from zeroscd.survey.sighting import Rules, Sighting, sight

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.batch.job import Engine
    from zeroscd.progress import Progress
    from zeroscd.retrieval.index import PlaceIndex


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What a survey did.

    Attributes:
        sightings: What was found for each new photo, in their order.
        batch: What the comparison did.
        report: The page to read first.
    """

    sightings: tuple[Sighting, ...] = field(repr=False)
    batch: batch.Summary
    report: Path

    @property
    def matched(self) -> int:
        """New photos with an old one of the same place."""
        return sum(one.old is not None for one in self.sightings)


def survey(
    photos: Sequence[str | Path],
    index: PlaceIndex,
    out: str | Path,
    *,
    rules: Rules | None = None,
    options: batch.Options | None = None,
) -> Summary:
    """Find the old photo of each new one, compare both, and write tables, maps and a report.

    The same as `look` and `compare`. A survey that was stopped, in whatever way, continues when
    it is started again with the same folder. A photo without an old one is a row with the reason.

    Args:
        photos: Paths of the new photos.
        index: The old ones.
        out: Folder for the results, on a disk of this machine.
        rules: When an old photo counts as one of the same place.
        options: How pairs are compared, and which files are kept of each.

    Raises:
        DatasetError: The index is empty.
        OutputError: The folder cannot be written.
        ZeroscdError: The detector cannot be made.
    """
    return compare(look(photos, index, out, rules=rules), out, options=options)


def look(
    photos: Sequence[str | Path],
    index: PlaceIndex,
    out: str | Path,
    *,
    rules: Rules | None = None,
    progress: Progress | None = None,
) -> list[Sighting]:
    """Look for every new photo's place, unless an earlier run found it in the same index.

    Args:
        photos: Paths of the new photos.
        index: The old ones.
        out: Folder for what was found, on a disk of this machine.
        rules: When an old photo counts as one of the same place.
        progress: Hears about every photo.

    Raises:
        DatasetError: The index is empty.
        OutputError: The folder cannot be written.
    """
    if not len(index):
        message = "the place index is empty; add old photos: zeroscd index build PHOTOS -o PLACES"
        raise DatasetError(message)
    chosen, listener, folder = rules or Rules(), progress or Silent(), Path(out)
    check_target(folder)
    make_folder(folder)
    book, found = Book(folder), []
    state = digest_values({"index": index.state(), "rules": repr(chosen)})
    listener.begin(len(photos))
    for path in map(str, photos):
        key = _key(path, state)
        known = book.get(key) if key else None
        sighting = known or sight(path, index, chosen)
        if key and known is None:
            book.add(key, sighting)
        found.append(sighting)
        listener.advance(Path(path).name, reused=known is not None)
    return found


def compare(
    sightings: Sequence[Sighting],
    out: str | Path,
    *,
    options: batch.Options | None = None,
    engine: Engine | None = None,
    progress: Progress | None = None,
) -> Summary:
    """Compare every new photo with its old one, and write tables, maps and the report.

    Args:
        sightings: As `look` returns them.
        out: Folder for the results, on a disk of this machine.
        options: How pairs are compared, and which files are kept of each.
        engine: Where they are compared; this process if not given.
        progress: Hears about every pair.

    Raises:
        OutputError: The folder cannot be written.
        ZeroscdError: The detector cannot be made.
    """
    manifest = batch.Manifest(base=".", rows=lambda: (_row(one) for one in sightings))
    done = batch.run(manifest, out, options=options, engine=engine, progress=progress)
    report = write_reports(Path(out), sightings)
    return Summary(sightings=tuple(sightings), batch=done, report=report)


def _key(path: str, state: str) -> str | None:
    try:
        return digest([state.encode(), path.encode("utf-8", "surrogatepass"), read_file(path)])
    except ImageError:
        return None  # whoever looks at it will say why


def _row(one: Sighting) -> Row:
    return Row(before=one.old, after=one.new, id=stem(one.new), error=one.reason)
