"""`zeroscd batch`: compare many pairs, on this machine or on a cluster."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from zeroscd.cli.console import answer, say, set_audience, warn
from zeroscd.cli.options import (
    AbsolutePaths,
    Align,
    AsJson,
    Device,
    FailOnError,
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
    read_area_file,
)
from zeroscd.errors import SettingsError, ZeroscdError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from zeroscd.batch import Manifest, Summary
    from zeroscd.batch.comparer import Options
    from zeroscd.batch.job import Engine
    from zeroscd.detector import Detector

SOURCE_HELP = "CSV, JSONL or Parquet with columns before, after, id; or a folder of photos before."


def batch(
    manifest: Annotated[str, typer.Argument(metavar="MANIFEST", help=SOURCE_HELP)],
    out: OutFolder,
    after: Annotated[
        str | None,
        typer.Argument(metavar="[AFTER_DIR]", help="The folder after, if MANIFEST is one."),
    ] = None,
    engine: Annotated[
        Literal["local", "ray"], typer.Option(help="This process, or a Ray cluster.")
    ] = "local",
    write: Annotated[
        str, typer.Option(help="Files for each pair, separated by commas; none; or all.")
    ] = "mask,json",
    preset: Preset = "lite",
    settings: Overrides = None,
    device: Device = "auto",
    workers: Annotated[
        int | None, typer.Option(min=1, help="Pairs compared at once by the local engine.")
    ] = None,
    timeout: Annotated[
        float, typer.Option(min=0.1, help="Longest wait for a remote photo, in seconds.")
    ] = 60.0,
    cache_mb: Annotated[
        int, typer.Option(min=0, help="Memory for photos that occur in several pairs.")
    ] = 256,
    num_gpus: Annotated[
        float | None, typer.Option(min=0, help="Ray: GPUs for each actor, such as 0.5.")
    ] = None,
    concurrency: Annotated[
        int | None, typer.Option(min=1, help="Ray: number of actors; as many as fit if not given.")
    ] = None,
    ray_address: Annotated[
        str | None, typer.Option(help="Ray: a running cluster; a local one is started otherwise.")
    ] = None,
    ignore_all: IgnoreAll = None,
    ignore_classes: IgnoreClasses = None,
    labels: Labels = False,
    align: Align = None,
    absolute_paths: AbsolutePaths = False,
    fail_on_error: FailOnError = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Compare many pairs; writes OUT/changes.parquet, OUT/pairs.parquet and OUT/ID/ for each pair.

    A batch that was stopped or killed continues when the same command is given again.
    """
    set_audience(quiet=quiet, as_json=as_json)
    chosen = pick_engine(
        engine, workers, {"num_gpus": num_gpus, "concurrency": concurrency, "address": ray_address}
    )
    overrides = parse_overrides(settings)
    from zeroscd.alignment.known import read_geometry
    from zeroscd.batch import run
    from zeroscd.cli.detect import check_request
    from zeroscd.cli.progress import Bar
    from zeroscd.detector import Detector

    check_request(preset, overrides, out=out)
    of_classes = labelling(ignore_classes, labels=labels)
    options = replace(
        pair_options(
            partial(Detector.from_preset, preset, device=device, overrides=overrides, **of_classes),
            write=write,
            cache_mb=cache_mb,
            absolute_paths=absolute_paths,
            ignore_all=ignore_all,
        ),
        timeout_s=timeout,
        t1_from_t0=None if align is None else read_geometry(align),
    )
    pairs = find_pairs(manifest, after)
    warn_unread(pairs.unread)
    try:
        with Bar("comparing") as bar:
            summary = run(pairs, out, options=options, engine=chosen, progress=bar)
    except KeyboardInterrupt:
        warn(f"stopped; give the same command again to continue in {out}")
        raise
    tell(summary, out)
    if as_json:
        answer(as_values(summary, out))
    check_compared(summary, fail_on_error=fail_on_error)


def pair_options(
    detector: Callable[[], Detector],
    *,
    write: str,
    cache_mb: int,
    absolute_paths: bool,
    ignore_all: Path | None,
) -> Options:
    """Return how the pairs of a batch or a survey are compared.

    Raises:
        SettingsError: A name of `write` stands for no file.
        ImageError: The area cannot be read.
    """
    from zeroscd.batch.comparer import MEBIBYTE, Options

    return Options(
        detector=detector,
        write=parse_files(write),
        cache_bytes=cache_mb * MEBIBYTE,
        absolute_paths=absolute_paths,
        ignore_all=read_area_file(ignore_all),
    )


def check_compared(summary: Summary, *, fail_on_error: bool) -> None:
    """End a batch or survey of which nothing came with an error.

    Args:
        summary: What was done.
        fail_on_error: Whether a single row with an error is one too.

    Raises:
        ZeroscdError: Every row failed, or one did and that is an error.
    """
    if summary.pairs and summary.failed == summary.pairs:
        message = (
            f"none of {summary.pairs} pairs could be compared; the first: {summary.first_error}"
        )
        raise ZeroscdError(message)
    if summary.failed and fail_on_error:
        message = (
            f"{summary.failed} of {summary.pairs} pairs could not be compared (--fail-on-error)"
        )
        raise ZeroscdError(message)


def warn_unread(unread: Sequence[str]) -> None:
    """Warn of photos of kinds that are not read here, if there are any."""
    from zeroscd.images.folder import unread_warning

    if message := unread_warning(unread):
        warn(message)


def find_pairs(manifest: str, after: str | None) -> Manifest:
    """Open a manifest, or pair two folders.

    Raises:
        DatasetError: It cannot be read.
        SettingsError: One folder alone, or a folder beside a manifest.
    """
    from zeroscd.batch import open_folders, open_manifest

    if after is not None and Path(manifest).is_file():
        message = f"{manifest} is a file: give a manifest alone, or two folders"
        raise SettingsError(message)
    if after is not None:
        return open_folders(manifest, after)
    if Path(manifest).is_dir():
        message = f"{manifest} is a folder: give the folder of the photos after as well"
        raise SettingsError(message)
    return open_manifest(manifest)


def pick_engine(
    name: Literal["local", "ray"], workers: int | None, ray_options: Mapping[str, Any]
) -> Engine:
    """Return the engine of that name, with its options.

    Raises:
        SettingsError: An option of the other engine was given.
    """
    set_options = {option: value for option, value in ray_options.items() if value is not None}
    if name == "local":
        if set_options:
            message = "--num-gpus, --concurrency and --ray-address need --engine ray"
            raise SettingsError(message)
        from zeroscd.batch.local import Local

        return Local(workers=workers)
    if workers is not None:
        message = "--workers is for --engine local; use --concurrency with --engine ray"
        raise SettingsError(message)
    from zeroscd.batch.cluster import Ray

    return Ray(**set_options)


def tell(summary: Summary, out: Path) -> None:
    """Print a summary and the tables' paths."""
    from zeroscd.batch.journal import CHANGES, PAIRS

    compared = summary.pairs - summary.failed
    if summary.failed:
        warn(
            f"{summary.failed} of {summary.pairs} pairs could not be compared; see the column "
            f"error of {out / PAIRS}; the first: {summary.first_error}"
        )
    reused = f", {summary.reused} of them by an earlier run" if summary.reused else ""
    say(f"{compared} of {summary.pairs} pairs compared{reused}; {summary.regions} changed regions")
    if photos := summary.encoded + summary.cache_hits:
        say(f"photos still known from another pair: {summary.cache_hits / photos:.0%}")
    say(f"changes: {out / CHANGES}")
    say(f"pairs: {out / PAIRS}")


def as_values(summary: Summary, out: Path) -> dict[str, object]:
    """Return a summary and the tables' paths as plain values."""
    from dataclasses import asdict

    from zeroscd.batch.journal import CHANGES, PAIRS

    return {
        **asdict(summary),
        "changes_table": str(out / CHANGES),
        "pairs_table": str(out / PAIRS),
    }
