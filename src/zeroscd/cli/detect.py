"""`zeroscd detect`: what changed between two photos."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from zeroscd.cli.console import answer, busy, say, set_audience, warn
from zeroscd.cli.options import (
    Align,
    AsJson,
    Device,
    IgnoreAll,
    IgnoreClasses,
    Labels,
    OutFolder,
    Overrides,
    Preset,
    Quiet,
    labelling,
    parse_files,
    parse_overrides,
)
from zeroscd.output import check_target

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from zeroscd.result import ChangeResult

WRITE_HELP = "Further files, separated by commas: csv, geojson, coco, label-studio; or all."


def detect(
    before: Annotated[Path, typer.Argument(metavar="BEFORE", help="The earlier photo (t0).")],
    after: Annotated[
        Path, typer.Argument(metavar="AFTER", help="The later photo (t1) of the same place.")
    ],
    out: OutFolder,
    also_before: Annotated[
        list[Path] | None,
        typer.Option(metavar="PATH", help="Another earlier photo of the place; may be repeated."),
    ] = None,
    also_after: Annotated[
        list[Path] | None,
        typer.Option(metavar="PATH", help="Another later photo of the place; may be repeated."),
    ] = None,
    transients: Annotated[
        bool,
        typer.Option(
            "--transients", help="Also list what stands in one photo only, of three or more."
        ),
    ] = False,
    ignore: Annotated[
        Path | None,
        typer.Option(
            metavar="AREA", help="Leave this out of the photo after: a mask, or polygons."
        ),
    ] = None,
    ignore_before: Annotated[
        Path | None, typer.Option(metavar="AREA", help="The same in the photo before.")
    ] = None,
    roi: Annotated[
        Path | None,
        typer.Option(
            metavar="AREA", help="Look only here in the photo after: a mask, or polygons."
        ),
    ] = None,
    roi_before: Annotated[
        Path | None, typer.Option(metavar="AREA", help="The same in the photo before.")
    ] = None,
    ignore_all: IgnoreAll = None,
    align: Align = None,
    ignore_classes: IgnoreClasses = None,
    labels: Labels = False,
    preset: Preset = "lite",
    frame: Annotated[
        Literal["t0", "t1"] | None,
        typer.Option(help="The photo the mask is drawn in; the preset's own if not given."),
    ] = None,
    write: Annotated[str, typer.Option(help=WRITE_HELP)] = "none",
    settings: Overrides = None,
    device: Device = "auto",
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Find what changed between two photos of the same place.

    Writes masks, an overlay, changes.json and report.html into OUT. With more photos of the place,
    what changed is what nearly all that see it agree on: not what passed by, or shifts by parallax.

    Example: zeroscd detect before.jpg after.jpg -o changes --also-before earlier.jpg
    """
    set_audience(quiet=quiet, as_json=as_json)
    overrides: dict[str, object] = {**parse_overrides(settings)}
    if frame is not None:
        overrides["frame"] = frame
    check_request(preset, overrides, out=out)
    also = parse_files(write)
    sides = [before, *(also_before or ())], [after, *(also_after or ())]
    from zeroscd.alignment.known import read_geometry

    given = {
        "ignore": ignore,
        "ignore_before": ignore_before,
        "roi": roi,
        "roi_before": roi_before,
        "ignore_all": ignore_all,
        "t1_from_t0": None if align is None else read_geometry(align),
    }
    result = compare(
        *sides,
        preset=preset,
        device=device,
        overrides=overrides,
        transients=transients,
        given={name: value for name, value in given.items() if value is not None},
        labelling=labelling(ignore_classes, labels=labels),
    )
    save_and_tell(result, out, also=also)
    if as_json:
        answer(result.to_dict())


def check_request(preset: str, overrides: Mapping[str, object], *, out: Path) -> None:
    """Refuse what cannot work before anything slow is imported or read.

    Raises:
        SettingsError: The preset or a setting is not known.
        OutputError: The folder can never be written.
    """
    from zeroscd.settings import preset as named

    named(preset).override(overrides)
    check_target(out)


def compare(
    before: Sequence[Path],
    after: Sequence[Path],
    *,
    preset: str,
    device: str,
    overrides: Mapping[str, object],
    transients: bool = False,
    given: Mapping[str, Any] | None = None,
    labelling: Mapping[str, Any] | None = None,
) -> ChangeResult:
    """Read the photos, load the networks and find the changes.

    Args:
        before: The earlier photo, and others of the place.
        after: The later photo, and others.
        preset: Named settings to start from.
        device: Where the networks run.
        overrides: Settings that differ from the preset's.
        transients: Whether to list what stands in one photo only.
        given: Areas and geometry, as `Detector.detect` takes them.
        labelling: About classes, as `Detector.from_preset` takes it.

    Raises:
        ImageError: A photo or an area cannot be read.
    """
    from zeroscd.given import Given
    from zeroscd.images.read import read_photo

    known = given or {}
    with busy("reading the photos"):
        # Read twice, but a photo that is no good is refused before the networks are loaded.
        sizes = [read_photo(path).size_hw for path in (*before, *after)]
        Given(**known).check(sizes[: len(before)], sizes[len(before) :])
    with busy("loading the networks"):
        from zeroscd.detector import Detector

        detector = Detector.from_preset(
            preset, device=device, overrides=overrides, **(labelling or {})
        )
    with busy("comparing"):
        return detector.detect(before, after, transients=transients, **known)


def save_and_tell(result: ChangeResult, out: Path, *, also: Sequence[str] = ()) -> None:
    """Write the result and print what was found and where it lies.

    Args:
        result: What changed.
        out: Folder for it.
        also: Files to write beside those that always are.

    Raises:
        OutputError: The folder cannot be written.
    """
    with busy("writing"):
        result.save(out, also=also)
    from zeroscd.export import summary
    from zeroscd.export.files import REPORT

    for text in summary.warnings(result):
        warn(text)
    say(summary.summary(result))
    if further := summary.further_photos_sentence(result):
        say(further)
    if passing := summary.transients_sentence(result):
        say(passing)
    say(f"report: {out / REPORT}")
    if "geojson" in also and not _is_placed(result):
        warn("neither photo says where it was taken: what changes.geojson holds has no position")


def _is_placed(result: ChangeResult) -> bool:
    from zeroscd.images.exif import read_exif

    return any(read_exif(str(photo.path)).gps for photo in (result.before, result.after))
