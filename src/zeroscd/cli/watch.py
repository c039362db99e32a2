"""`zeroscd watch`: what changed and stayed in front of a camera, each change once."""

from __future__ import annotations

import os
from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import TYPE_CHECKING, Annotated, Any

import typer

from zeroscd.cli.console import answer_line, busy, say, set_audience, warn
from zeroscd.cli.options import (
    Align,
    Device,
    IgnoreAll,
    IgnoreClasses,
    Overrides,
    Preset,
    Quiet,
    labelling,
    parse_overrides,
)
from zeroscd.errors import OutputError, SettingsError, ZeroscdError
from zeroscd.output import check_target, write_together

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from zeroscd.given import Given
    from zeroscd.watch import Change, Frame, Place, Summary, Unused, Watcher


def watch(
    frames: Annotated[
        Path, typer.Argument(metavar="DIR_OR_VIDEO", help="A folder of photos, or a video.")
    ],
    reference: Annotated[
        list[Path],
        typer.Option(metavar="PHOTO", help="The place as it should be; may be repeated."),
    ],
    min_frames: Annotated[
        int,
        typer.Option(
            "--frames", min=1, metavar="N", help="A change counts when N frames in a row show it."
        ),
    ] = 3,
    every: Annotated[
        str | None,
        typer.Option(
            metavar="N|Ns",
            help="Compare each N-th frame only, or of a video one each N seconds (2s); if not "
            "given, every photo, and each second of a video.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="OUT", help="Folder for pictures of each change."),
    ] = None,
    ignore: Annotated[
        Path | None,
        typer.Option(
            metavar="AREA", help="Leave this out of the first reference: a mask, or polygons."
        ),
    ] = None,
    roi: Annotated[
        Path | None,
        typer.Option(metavar="AREA", help="Look only here in the first reference."),
    ] = None,
    ignore_all: IgnoreAll = None,
    align: Align = None,
    ignore_classes: IgnoreClasses = None,
    preset: Preset = "lite",
    settings: Overrides = None,
    device: Device = "auto",
    quiet: Quiet = False,
) -> None:
    """Watch a place: report what was added or removed and stayed, once, as JSON lines.

    Photos of a folder come in the order of their names. Everything is in the pixels of the first
    reference. Frames that cannot be used are named; the last line is a summary, also after Ctrl+C.

    Example: zeroscd watch frames --reference monday.jpg -o changes
    """
    set_audience(quiet=quiet, as_json=True)
    overrides = parse_overrides(settings)
    check_request(preset, overrides, out=out)
    opened = open_quietly(frames, every)
    from zeroscd.alignment.known import read_geometry
    from zeroscd.given import Given

    given = Given(
        ignore_before=ignore,
        roi_before=roi,
        ignore_all=ignore_all,
        t1_from_t0=None if align is None else read_geometry(align),
    )
    of_classes = labelling(ignore_classes, labels=False)
    model = {"name": preset, "device": device, "overrides": overrides, **of_classes}
    place = load_place(reference, given, model)
    from zeroscd.watch import Watcher

    watcher = Watcher(place, min_frames=min_frames, keep_pictures=out is not None)
    try:
        follow(watcher, opened, out)
    except (KeyboardInterrupt, ZeroscdError):
        finish(watcher.summary())
        raise
    summary = watcher.summary()
    finish(summary)
    if not summary.compared:
        message = f"none of {summary.frames} frames could be compared; the lines above say why"
        raise ZeroscdError(message)


def check_request(preset: str, overrides: Mapping[str, object], *, out: Path | None) -> None:
    """Refuse what cannot work before anything slow is imported or read.

    Raises:
        SettingsError: The preset or a setting is not known, or `frame` is set.
        OutputError: The folder can never be written, or holds changes of an earlier run.
    """
    from zeroscd.settings import preset as named

    named(preset).override(overrides)
    if "frame" in overrides:
        message = "watch reports in the pixels of the first reference; leave out --set frame"
        raise SettingsError(message)
    if out is None:
        return
    check_target(out)
    if out.is_dir() and any(one.name.isdigit() for one in out.iterdir()):
        message = f"{out} holds changes of an earlier run; choose another folder with -o"
        raise OutputError(message)


def open_quietly(source: Path, every: str | None) -> Iterable[Frame]:
    """Open the frames, without OpenCV's own lines on stderr about files that are no videos.

    Raises:
        SettingsError: `every` cannot be understood.
        ZeroscdError: There is nothing to read.
    """
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # av_log's "quiet"; read once
    import cv2

    from zeroscd.watch import Every, open_frames

    wanted = None if every is None else Every.parse(every)
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        return open_frames(source, wanted)
    finally:
        cv2.utils.logging.setLogLevel(level)


def load_place(references: Sequence[Path], given: Given, model: Mapping[str, Any]) -> Place:
    """Read the references, load the networks and encode the place.

    Raises:
        ImageError: A reference or an area cannot be read.
    """
    from zeroscd.images.read import read_photo

    with busy("reading the references"):
        # Read twice, but a photo that is no good is refused before the networks are loaded.
        sizes = [read_photo(path).size_hw for path in references]
        given.check(sizes, sizes[:1])
    with busy("loading the networks"):
        from zeroscd.detector import Detector
        from zeroscd.watch import Place

        place = Place(Detector.from_preset(**model), references, given)
    for k in place.apart:
        warn(f"{references[k]} cannot be aligned with {references[0]}; it hardly helps")
    return place


def follow(watcher: Watcher, frames: Iterable[Frame], out: Path | None) -> None:
    """Compare every frame and print its events, at once.

    Raises:
        OutputError: The pictures of a change cannot be written.
    """
    from zeroscd.watch import Change, Unused, as_values

    for frame in frames:
        for event in watcher.see(frame):
            if isinstance(event, Change) and out is not None:
                save(event, watcher.place, out)
            answer_line(as_values(event))
            if isinstance(event, Unused):
                warn(f"not used: {reason_with_name(event)}")


def reason_with_name(unused: Unused) -> str:
    """Return why a frame was not used, with its name, which what is said of files begins with."""
    name, reason = str(unused.frame), unused.reason
    return reason if reason.startswith(name) else f"{name}: {reason}"


def save(change: Change, place: Place, out: Path) -> None:
    """Write the pictures of a change and its line into a folder of its own, all or none.

    Raises:
        OutputError: It cannot be written.
    """
    import json

    from zeroscd.watch import as_values
    from zeroscd.watch.pictures import picture_files

    files = picture_files(place.reference, change.first, change.bbox_xywh)
    line = json.dumps(as_values(change), allow_nan=False) + "\n"
    write_together(out / f"{change.id:04d}", {**files, "change.json": line.encode()})


def finish(summary: Summary) -> None:
    """Print the last line, and a sentence for people."""
    from zeroscd.watch import as_values

    answer_line(as_values(summary))
    unused = "".join(
        f", {count} {why.replace('_', ' ')}" for why, count in summary.unused.items() if count
    )
    changes = "1 change" if summary.changes == 1 else f"{summary.changes} changes"
    say(
        f"{changes} that stayed; {summary.compared} of {summary.frames} frames "
        f"compared, {summary.skipped} left out{unused}"
    )
