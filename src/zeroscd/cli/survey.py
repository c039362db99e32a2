"""`zeroscd survey`: new photos of a city against an index of old ones."""

from __future__ import annotations

from collections import Counter
from datetime import datetime  # noqa: TC003 - typer reads the annotations
from functools import partial
from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import TYPE_CHECKING, Annotated

import typer

from zeroscd.cli.batch import check_compared, pair_options, warn_unread
from zeroscd.cli.console import answer, busy, say, set_audience, warn
from zeroscd.cli.options import (
    AbsolutePaths,
    AsJson,
    Device,
    FailOnError,
    IgnoreAll,
    IgnoreClasses,
    Labels,
    OutFolder,
    Overrides,
    Places,
    Preset,
    Quiet,
    Within,
    labelling,
    parse_overrides,
)
from zeroscd.renamed import warn_renamed
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.batch import Options
    from zeroscd.retrieval import DateSpan, PlaceIndex
    from zeroscd.survey import MatchRules, Summary
    from zeroscd.survey.review import ReviewedEvent

DAY = "%Y-%m-%d"
WRITE_HELP = "Files for each pair, separated by commas; none; or all."


def survey(
    photos: Annotated[
        list[Path], typer.Argument(metavar="NEW_PHOTOS", help="Folders or photos of today.")
    ],
    places: Places,
    out: OutFolder,
    within: Within = None,
    min_score: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=1,
            help="Lowest score of an old photo that counts as of the same place.",
        ),
    ] = None,
    views: Annotated[
        int,
        typer.Option(
            min=1,
            metavar="K",
            help="Old photos of a place at most; what changed is what nearly all of them say.",
        ),
    ] = 3,
    old_from: Annotated[
        datetime | None,
        typer.Option(formats=[DAY], metavar="DATE", help="Only old photos taken on or after it."),
    ] = None,
    old_until: Annotated[
        datetime | None,
        typer.Option(formats=[DAY], metavar="DATE", help="Only old photos taken on or before it."),
    ] = None,
    least_score: Annotated[float | None, typer.Option(min=0, max=1, hidden=True)] = None,
    reviewed: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="What the report of an earlier run exported."),
    ] = None,
    write: Annotated[str, typer.Option(help=WRITE_HELP)] = "json,report",
    preset: Preset = "lite",
    settings: Overrides = None,
    device: Device = "auto",
    workers: Annotated[
        int | None, typer.Option(min=1, help="Pairs compared at once; chosen if not given.")
    ] = None,
    cache_mb: Annotated[
        int, typer.Option(min=0, help="Memory for old photos that match several new ones.")
    ] = 256,
    ignore_all: IgnoreAll = None,
    ignore_classes: IgnoreClasses = None,
    labels: Labels = False,
    absolute_paths: AbsolutePaths = False,
    fail_on_error: FailOnError = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Find the old photos of each new one, compare them, and report the changes.

    Writes OUT/report.html, events and changes as tables and GeoJSON, and coco.json. A survey that
    was stopped or killed continues when the same command is given again.

    Example: zeroscd survey today/ --places places -o changes --within 50
    """
    set_audience(quiet=quiet, as_json=as_json)
    overrides, dates = parse_overrides(settings), span_of(old_from, old_until)
    from zeroscd.cli.detect import check_request
    from zeroscd.detector import Detector
    from zeroscd.images.folder import PhotoFiles, list_photos
    from zeroscd.retrieval import PlaceIndex
    from zeroscd.survey import MatchRules, read_reviews

    check_request(preset, overrides, out=out)
    score = _min_score(min_score, least_score)
    rules = MatchRules(within_m=within, min_score=score, views=views, dates=dates)
    of_classes = labelling(ignore_classes, labels=labels)
    options = pair_options(
        partial(Detector.from_preset, preset, device=device, overrides=overrides, **of_classes),
        write=write,
        cache_mb=cache_mb,
        absolute_paths=absolute_paths,
        ignore_all=ignore_all,
    )
    reviews = read_reviews(reviewed) if reviewed else ()
    files = sum(map(list_photos, photos), PhotoFiles())
    warn_unread(files.unread)
    with busy("opening the place index"):
        index = PlaceIndex.open(places, device=device)
    try:
        summary = match_and_compare(files.photos, index, out, rules, options, workers, reviews)
    except KeyboardInterrupt:
        warn(f"stopped; give the same command again to continue in {out}")
        raise
    tell(summary)
    if as_json:
        answer(as_values(summary))
    check_compared(summary.batch, fail_on_error=fail_on_error)


def match_and_compare(
    photos: Sequence[str],
    index: PlaceIndex,
    out: Path,
    rules: MatchRules,
    options: Options,
    workers: int | None,
    reviews: Sequence[ReviewedEvent],
) -> Summary:
    """Run both steps of a survey, each with its bar."""
    from zeroscd.batch import Local
    from zeroscd.cli.progress import Bar
    from zeroscd.survey import compare, match_photos

    with Bar("matching") as bar:
        matches = match_photos(photos, index, out, rules=rules, progress=bar)
    with Bar("comparing") as bar:
        engine = Local(workers=workers)
        return compare(matches, out, options=options, engine=engine, progress=bar, reviewed=reviews)


def span_of(first: datetime | None, last: datetime | None) -> DateSpan | None:
    """Return the days from the first to the last; None where neither is given.

    Raises:
        SettingsError: The last day is before the first.
    """
    from zeroscd.retrieval import DateSpan

    if first is None and last is None:
        return None
    return DateSpan(first and first.date(), last and last.date())


def _min_score(given: float | None, by_old_name: float | None) -> float:
    from zeroscd.retrieval.index import RECOGNISED

    if by_old_name is not None:
        warn_renamed("--least-score", "--min-score")
    return next((one for one in (given, by_old_name) if one is not None), RECOGNISED)


def tell(summary: Summary) -> None:
    """Print a summary and the report's path."""
    from zeroscd.export.geopackage import is_available
    from zeroscd.survey.events.geopackage import HINT

    photos = len(summary.matches)
    unmatched = photos - summary.matched
    broken = summary.batch.failed - unmatched
    say(f"{summary.matched} of {photos} new photos have an old one of the same place")
    if unmatched:
        first = next(match for match in summary.matches if match.old is None)
        warn(f"{unmatched} new photos were not compared; the first: {first.new}: {first.reason}")
    if broken:
        warn(f"{broken} pairs could not be compared; see the column error of pairs.parquet")
    say(f"{summary.batch.regions} changed regions")
    sightings = sum(event.sightings for event in summary.events)
    say(f"{len(summary.events)} events ({sightings} sightings)")
    _tell_reviews(summary)
    if not is_available():
        warn(f"events.gpkg is left out: it needs pyogrio; {HINT}")
    say(f"report: {summary.report}")


def as_values(summary: Summary) -> dict[str, object]:
    """Return what `tell` says as plain values."""
    return {
        "photos": len(summary.matches),
        "matched": summary.matched,
        "failed": summary.batch.failed,
        "regions": summary.batch.regions,
        "events": len(summary.events),
        "sightings": sum(event.sightings for event in summary.events),
        "report": str(summary.report),
    }


def _tell_reviews(summary: Summary) -> None:
    counts = Counter(event.review for event in summary.events if event.review)
    if counts:
        told = ", ".join(f"{counts[review]} {review}" for review in sorted(counts))
        say(f"reviewed: {told}")
    lost = summary.unmatched_reviews
    if lost:
        pair, region = lost[0].best
        warn(
            f"{len(lost)} reviewed events are not among these events; the first: "
            f"{lost[0].kind}, region {region} of {one_line(pair)}"
        )
