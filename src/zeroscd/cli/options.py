"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from zeroscd import device
from zeroscd.errors import SettingsError
from zeroscd.settings.names import current_name


def complete_presets(incomplete: str) -> list[str]:
    """Return the presets that begin so, for the shell."""
    from zeroscd.settings import PRESETS

    return [name for name in PRESETS if name.startswith(incomplete)]


Preset = Annotated[
    str, typer.Option(help="Named settings to start from.", autocompletion=complete_presets)
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change one of `zeroscd settings`; may be repeated."
    ),
]
Device = Annotated[
    device.Device, typer.Option(help="Where the networks run; mps (Apple) has not been tried yet.")
]
OutFolder = Annotated[
    Path, typer.Option("--out", "-o", metavar="OUT", help="Folder for the results.")
]

Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print nothing but warnings and errors.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for programs.")]

Places = Annotated[
    str, typer.Option("--places", metavar="PLACES", help="Folder or address of the place index.")
]
Within = Annotated[
    float | None,
    typer.Option(
        min=0.1,
        max=20_100_000,  # half way around the Earth
        metavar="METRES",
        help="Only photos taken within this distance.",
    ),
]
FailOnError = Annotated[
    bool, typer.Option("--fail-on-error", help="Exit with 2 if any pair could not be compared.")
]
AbsolutePaths = Annotated[
    bool,
    typer.Option(
        "--absolute-paths", help="Write paths of photos from the root, not relative to OUT."
    ),
]

IgnoreAll = Annotated[
    Path | None,
    typer.Option(
        metavar="AREA",
        help="Leave this out of every photo: a hood, a time stamp. A mask, white = leave out, or "
        "polygons in pixels (JSON, GeoJSON).",
    ),
]
Align = Annotated[
    str | None,
    typer.Option(
        metavar="none|FILE",
        help="Known geometry: none = the camera did not move; or a file with 3 x 3 numbers, t1 "
        "from t0. Estimated if not given.",
    ),
]

Labels = Annotated[
    bool,
    typer.Option("--labels", help="Say what each region shows; needs the weights eomt-l."),
]
IgnoreClasses = Annotated[
    str | None,
    typer.Option(
        metavar="NAMES",
        help="Leave out what shows these, such as person,vehicle,sky,vegetation; needs the weights "
        "eomt-l.",
    ),
]


def labelling(ignore_classes: str | None, *, labels: bool) -> dict[str, Any]:
    """Return what `Detector.from_preset` is told about classes; nothing where nobody asks.

    Args:
        ignore_classes: Names separated by commas.
        labels: Whether regions are labelled.

    Raises:
        SettingsError: A name is no class.
    """
    names = tuple(filter(None, map(str.strip, (ignore_classes or "").split(","))))
    if ignore_classes is not None and not names:
        message = "--ignore-classes names nothing; give classes separated by commas, such as person"
        raise SettingsError(message)
    if not labels and not names:
        return {}
    from zeroscd.labels.classes import class_ids

    class_ids(names)
    return {"labels": labels, "ignore_classes": names}


def read_area_file(path: Path | None) -> bytes | None:
    """Return the bytes of an area's file; None where none was given.

    Raises:
        ImageError: It cannot be read.
    """
    from zeroscd.images.read import read_file

    return None if path is None else read_file(path)


def parse_overrides(pairs: list[str] | None) -> dict[str, str]:
    """Split every KEY=VALUE of the command line.

    Raises:
        SettingsError: There is no "=" in it.

    Example:
        >>> parse_overrides(["alpha=0.6", "verify = off"])
        {'alpha': '0.6', 'verify': 'off'}
    """
    found: dict[str, str] = {}
    for pair in pairs or []:
        name, equals, value = pair.partition("=")
        if not equals:
            message = f"--set needs KEY=VALUE, for example --set alpha=0.6, not {pair!r}"
            raise SettingsError(message)
        found[current_name(name.strip())] = value.strip()
    return found


def parse_files(text: str) -> tuple[str, ...]:
    """Split a list of files to write; "all" and "none" are such lists, too.

    Raises:
        SettingsError: A name stands for no file.

    Example:
        >>> parse_files("mask, json"), parse_files("none")
        (('mask', 'json'), ())
    """
    wanted = tuple(name.strip() for name in text.split(",") if name.strip() not in ("", "none"))
    if not wanted:
        return ()
    from zeroscd.export.files import NAMES, check_wanted

    if wanted == ("all",):
        return NAMES
    check_wanted(wanted)
    return wanted
