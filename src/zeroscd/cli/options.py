"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from zeroscd import device
from zeroscd.errors import SettingsError
from zeroscd.settings.names import current_name

Preset = Annotated[str, typer.Option(help="Named settings to start from.")]
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
