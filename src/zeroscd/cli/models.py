"""`zeroscd models`: which weights exist, which are here, and how to get the others."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotation when it runs
from typing import TYPE_CHECKING, Annotated

import typer

from zeroscd.cli.console import answer, busy, columns, warn
from zeroscd.cli.options import AsJson, Device  # noqa: TC001 - typer reads the annotations
from zeroscd.errors import WeightsError
from zeroscd.models import weight_files
from zeroscd.weights.catalogue import CATALOGUE, find
from zeroscd.weights.fetch import fetch, import_file
from zeroscd.weights.store import is_present, path_of, require, weights_folder
from zeroscd.weights.verify import digest_of, fault_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.progress import Progress

    from zeroscd.weights.catalogue import WeightFile
    from zeroscd.weights.fetch import Progress as Listener

app = typer.Typer(help="Model weights: list, fetch, path, verify, check.", no_args_is_help=True)


def complete_weights(incomplete: str) -> list[str]:
    """Return the weights that begin so, for the shell."""
    return [name for name in CATALOGUE if name.startswith(incomplete)]


Names = Annotated[
    list[str],
    typer.Argument(help="Names from `zeroscd models list`.", autocompletion=complete_weights),
]

COLUMNS = ("name", "for", "MB", "licence", "here", "note")


@app.command("list")
def list_models(as_json: AsJson = False) -> None:
    """List the weights that zeroscd knows, and whether they are on this computer."""
    if as_json:
        answer([_as_values(row) for row in CATALOGUE.values()])
        return
    for line in columns([COLUMNS, *(_cells(row) for row in CATALOGUE.values())]):
        typer.echo(line)
    typer.echo(f"\nfolder: {weights_folder()}")


@app.command("fetch")
def fetch_models(
    names: Names,
    source: Annotated[
        Path | None,
        typer.Option("--from", help="Import this file, which you already have.", exists=True),
    ] = None,
) -> None:
    """Download weights, verify them and put them in place; --from imports a file instead."""
    rows = [find(name) for name in names]
    if source is not None and len(rows) != 1:
        message = f"--from imports one file for one name, not {len(rows)}"
        raise WeightsError(message)
    with _bars() as bars:
        for row in rows:
            listener = _listener(bars, row)
            path = (
                fetch(row, progress=listener)
                if source is None
                else import_file(row, source, progress=listener)
            )
            typer.echo(path)
    for row in rows:
        _warn_unverified(row)


@app.command("path")
def show_path(
    name: Annotated[
        str, typer.Argument(help="A name from the list.", autocompletion=complete_weights)
    ],
) -> None:
    """Print where the file of some weights is, or will be."""
    typer.echo(path_of(find(name)))


@app.command("verify")
def verify_models(
    names: Annotated[
        list[str] | None, typer.Argument(help="All that are here, if left out.")
    ] = None,
) -> None:
    """Compute the SHA-256 of weights on this computer and compare it with the published one."""
    rows = [find(name) for name in names] if names else list(_present())
    for row in rows:
        path = path_of(row)
        if fault := fault_of(path, row):
            message = f"{path} {fault}; delete it and run `{row.fetch_command}`"
            raise WeightsError(message)
        typer.echo(f"{row.name}  {'as published' if row.sha256 else 'no digest published'}  {path}")
        _warn_unverified(row)


@app.command("check")
def check_models(
    preset: Annotated[str, typer.Argument(help="Name of a preset.")], device: Device = "auto"
) -> None:
    """Fetch a preset's weights if need be, and check that its models work.

    Compares photos that come with zeroscd, in which it is known what changed. Prints a block that
    can be pasted into an issue.

    Example: zeroscd models check robust
    """
    from zeroscd.model_check import check_preset, report
    from zeroscd.settings import preset as named

    rows = weight_files(named(preset))
    require(row.name for row in rows if not row.fetchable)
    with _bars() as bars:
        for row in rows:
            if not is_present(row):
                fetch(row, progress=_listener(bars, row))
    with busy(f"checking {preset}"):
        found = check_preset(preset, device=device)
        lines = report(preset, found, device=device)
    for line in lines:
        typer.echo(line)
    if found.failed:
        message = (
            f"{len(found.failed)} of {len(found.checks)} checks of {preset} failed; "
            f"the first: {found.failed[0].name} ({found.failed[0].found})"
        )
        raise WeightsError(message)


def _present() -> Iterator[WeightFile]:
    return (row for row in CATALOGUE.values() if is_present(row))


def _cells(row: WeightFile) -> tuple[str, ...]:
    size = "?" if row.size_bytes is None else f"{row.size_bytes / 1e6:.0f}"
    here = "yes" if is_present(row) else "no"
    return row.name, row.kind, size, row.licence, here, row.note


def _as_values(row: WeightFile) -> dict[str, object]:
    return {
        "name": row.name,
        "for": row.kind,
        "bytes": row.size_bytes,
        "licence": row.licence,
        "here": is_present(row),
        "path": str(path_of(row)),
        "sha256": row.sha256 or None,
        "note": row.note or None,
    }


def _warn_unverified(row: WeightFile) -> None:
    """Say on stderr what could not be checked."""
    if not row.sha256:
        digest = digest_of(path_of(row))
        warn(f"nobody published a digest of {row.name}; the sha256 of this file is {digest}")


def _bars() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TransferSpeedColumn

    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
        console=console,
        transient=True,  # what stays on the screen is the path, or one line about what went wrong
        disable=not console.is_terminal,
    )


def _listener(bars: Progress, row: WeightFile) -> Listener:
    task = bars.add_task(row.name, total=row.size_bytes)

    def listen(done_bytes: int, total_bytes: int | None) -> None:
        bars.update(task, completed=done_bytes, total=total_bytes)

    return listen
