"""`zeroscd index`: an index of old photos by place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from zeroscd.cli.batch import warn_unread
from zeroscd.cli.console import busy, say, set_audience, warn
from zeroscd.cli.options import (
    AsJson,
    Device,
    Overrides,
    Places,
    Quiet,
    Within,
    parse_overrides,
)
from zeroscd.errors import DatasetError, SettingsError
from zeroscd.output import check_target

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.retrieval import Nearby, PlaceIndex, PlaceMatch
    from zeroscd.retrieval.describe import Place
    from zeroscd.settings import Settings

MAX_WARNINGS = 5  # photos named one by one
MAX_LATITUDE, MAX_LONGITUDE = 90.0, 180.0  # degrees

app = typer.Typer(help="Find the old photos of a place.")


@app.command()
def build(
    photos: Annotated[list[Path], typer.Argument(metavar="PHOTOS", help="Folders or photos.")],
    out: Annotated[
        str, typer.Option("--out", "-o", metavar="PLACES", help="Folder or address of the index.")
    ],
    preset: Annotated[
        str | None,
        typer.Option(help="Preset whose encoder describes the photos; lite if not given."),
    ] = None,
    settings: Overrides = None,
    device: Device = "auto",
    quiet: Quiet = False,
) -> None:
    """Make a place index, or add new and changed photos to one.

    Photos that have not changed are not described again. A build that was stopped continues when
    the same command is given again.

    Example: zeroscd index build old/ -o places
    """
    set_audience(quiet=quiet)
    wanted = wanted_settings(preset, settings)
    from zeroscd.cli.progress import Bar
    from zeroscd.images.folder import PhotoFiles, list_photos

    files = sum(map(list_photos, photos), PhotoFiles())
    with busy("loading the encoder"):
        index = open_or_create(out, wanted, device=device)
    try:
        with Bar("describing") as bar:
            done = index.add(files.photos, progress=bar)
    except KeyboardInterrupt:
        warn(f"stopped; give the same command again to continue in {out}")
        raise
    warn_of_failures(done.failed)
    warn_unread(files.unread)
    say(
        f"{done.new} photos added, {done.changed} replaced, {done.same} there already, "
        f"{f'{done.moved} moved, ' if done.moved else ''}"
        f"{len(done.failed) + len(files.unread)} unreadable"
    )
    say(f"places: {out} ({len(index)} photos)")


@app.command()
def query(
    photo: Annotated[Path, typer.Argument(metavar="PHOTO", help="A new photo.")],
    places: Places,
    count: Annotated[int, typer.Option("-k", min=1, help="How many old photos at most.")] = 5,
    within: Within = None,
    at: Annotated[
        str | None,
        typer.Option(metavar="LAT,LON", help="Where it was taken, if its file has no position."),
    ] = None,
    as_json: AsJson = False,
    preset: Annotated[
        str | None, typer.Option(help="Fail unless the index has this preset's encoder.")
    ] = None,
    settings: Overrides = None,
    device: Device = "auto",
) -> None:
    """Find the old photos that show the place of a new one, best first.

    Example: zeroscd index query new/elm.jpg --places places -k 3 --within 50
    """
    position = parse_position(at)
    wanted = wanted_settings(preset, settings)
    from zeroscd.images.exif import Exif
    from zeroscd.retrieval import PlaceIndex

    with busy("loading the encoder"):
        index = PlaceIndex.open(places, settings=wanted, device=device)
    with busy("searching"):
        place = index.describe(photo, exif=Exif(gps=position) if position else None)
        matches = index.find(place, count, nearby=around(place, within, name=str(photo)))
    if as_json:
        typer.echo(json.dumps([as_values(match) for match in matches], indent=1))
        return
    for rank, match in enumerate(matches, 1):
        say(f"{rank}. {sentence(match)}")
    if not matches:
        warn("no old photo within this distance" if within else "the place index is empty")


@app.command()
def delete(
    photos: Annotated[
        list[Path], typer.Argument(metavar="PHOTOS", help="Photos, or folders with all below.")
    ],
    places: Places,
) -> None:
    """Remove photos from a place index; their files stay."""
    from zeroscd.retrieval.store import Store

    store = Store.open(places)
    removed = store.remove_below(photos)
    say(f"removed: {removed}; left: {len(store)}")


@app.command()
def info(places: Places, as_json: AsJson = False) -> None:
    """Show what a place index holds and how it was made."""
    from zeroscd.retrieval.store import Store

    store = Store.open(places)
    if as_json:
        typer.echo(json.dumps(store.info(), indent=1))
        return
    for key, value in store.info().items():
        shown = (
            ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, dict) else value
        )
        say(f"{key}: {shown}")


def open_or_create(address: str, wanted: Settings | None, *, device: str) -> PlaceIndex:
    """Open a place index, or make it if there is none.

    Raises:
        SettingsError: It was made with other settings than those wanted.
        OutputError: Its folder cannot be written.
    """
    if "://" not in address:
        check_target(Path(address))
    from zeroscd.retrieval import PlaceIndex
    from zeroscd.retrieval.database import is_index

    if not is_index(address):
        try:
            return PlaceIndex.create(address, settings=wanted, device=device)
        except DatasetError:  # another process has made it meanwhile
            pass
    return PlaceIndex.open(address, settings=wanted, device=device)


def wanted_settings(preset: str | None, overrides: list[str] | None) -> Settings | None:
    """Return the settings given on the command line; None if none are.

    The preset lite has fewer pixels for places than for changes.

    Raises:
        SettingsError: An unknown preset or setting.
    """
    from zeroscd.retrieval.index import DEFAULT
    from zeroscd.settings import preset as named

    if preset is None and not overrides:
        return None
    start = DEFAULT if preset in (None, "lite") else named(preset)
    return start.override(parse_overrides(overrides))


def parse_position(text: str | None) -> tuple[float, float] | None:
    """Read LAT,LON in degrees.

    Raises:
        SettingsError: It is something else.

    Example:
        >>> parse_position("48.8584, 2.2945")
        (48.8584, 2.2945)
    """
    if text is None:
        return None
    try:
        latitude, longitude = (float(part) for part in text.split(","))
    except ValueError:
        latitude = longitude = float("nan")
    if not (abs(latitude) <= MAX_LATITUDE and abs(longitude) <= MAX_LONGITUDE):
        message = f"--at needs latitude and longitude in degrees, as in --at 48.8584,2.2945: {text}"
        raise SettingsError(message)
    return latitude, longitude


def around(place: Place, within: float | None, *, name: str) -> Nearby | None:
    """Return the circle to search; None = everywhere.

    Raises:
        SettingsError: A radius is given, but the photo has no position.
    """
    from zeroscd.retrieval import Nearby

    if within is None:
        return None
    if place.exif.gps is None:
        message = f"{name} does not say where it was taken; give --at LAT,LON or omit --within"
        raise SettingsError(message)
    return Nearby(place.exif.gps, within)


def sentence(match: PlaceMatch) -> str:
    """Describe a match in one line."""
    parts = [f"score {match.score:.3f}", f"{match.inliers} patches agree"]
    if match.metres is not None:
        parts.append(f"{match.metres:.0f} m away")
    if match.exif.taken is not None:
        parts.append(f"taken {match.exif.taken}")
    return f"{match.path} ({', '.join(parts)})"


def as_values(match: PlaceMatch) -> dict[str, object]:
    """Return a match as plain values."""
    return {
        "path": match.path,
        "score": match.score,
        "inliers": match.inliers,
        "similarity": match.similarity,
        "metres": match.metres,
        "gps": match.exif.gps,
        "taken": match.exif.taken,
    }


def warn_of_failures(failed: Mapping[str, str]) -> None:
    """Warn of the first photos that cannot be read, and count the others."""
    for reason in list(failed.values())[:MAX_WARNINGS]:
        warn(reason)
    if len(failed) > MAX_WARNINGS:
        warn(f"and {len(failed) - MAX_WARNINGS} more photos cannot be read")
