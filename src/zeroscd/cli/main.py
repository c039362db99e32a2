"""The `zeroscd` command: one file a subcommand, and one way to fail."""

from __future__ import annotations

import errno
import os
import sys
from contextvars import copy_context
from typing import TYPE_CHECKING, Annotated

import typer

from zeroscd.cli import INTERRUPTED, index, models
from zeroscd.cli.ablate import ablate
from zeroscd.cli.about import version_lines
from zeroscd.cli.batch import batch
from zeroscd.cli.bench import bench
from zeroscd.cli.console import fail, old_names_shown
from zeroscd.cli.demo import demo
from zeroscd.cli.detect import detect
from zeroscd.cli.evaluate import evaluate
from zeroscd.cli.export_onnx import export_onnx
from zeroscd.cli.geo import geo
from zeroscd.cli.refine_masks import refine_masks
from zeroscd.cli.refusals import refusal
from zeroscd.cli.serve import serve
from zeroscd.cli.settings import settings
from zeroscd.cli.survey import survey
from zeroscd.cli.watch import watch
from zeroscd.errors import ZeroscdError

if TYPE_CHECKING:
    from collections.abc import Sequence

USER_ERROR = 2
CLOSED_PIPE = 1  # Python's own convention

app = typer.Typer(
    name="zeroscd",
    help="What changed between two photos of the same street?",
    epilog="Start with `zeroscd demo`; then `zeroscd detect before.jpg after.jpg -o changes`.",
    suggest_commands=False,  # `refusal` does, for options as well
    pretty_exceptions_enable=False,
)
app.command()(demo)
app.command()(detect)
app.command()(batch)
app.command()(survey)
app.command()(geo)
app.command()(watch)
app.command()(evaluate)
app.command()(ablate)
app.command()(refine_masks)
app.command()(bench)
app.command()(export_onnx)
app.command()(serve)
app.command()(settings)
app.add_typer(index.app, name="index")
app.add_typer(models.app, name="models")


def main() -> None:
    """Run the command line of this process and exit: 0 done, 2 user error, 130 interrupted."""
    try:
        code = run(sys.argv[1:])
        if sys.stdout is not None:  # None: it was closed when the process started
            sys.stdout.flush()
    except OSError as error:
        gone, full = isinstance(error, BrokenPipeError), error.errno == errno.ENOSPC
        if not (gone or full):
            raise
        # Python would complain again when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if full:  # what a command writes elsewhere says so itself
            fail("cannot write to the standard output: no space left; make room")
        code = CLOSED_PIPE if gone else USER_ERROR
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code; what a user got wrong becomes one line."""
    return copy_context().run(_run, arguments)


def _run(arguments: Sequence[str]) -> int:
    if "" in arguments:
        # As a path it would be the current folder.
        where = " ".join(["zeroscd", *arguments[: arguments.index("")]])
        fail(f"the argument after `{where}` is empty; is a variable of the shell not set?")
        return USER_ERROR
    try:
        with old_names_shown():
            code = app(args=list(arguments), prog_name="zeroscd", standalone_mode=False)
    except ZeroscdError as error:
        fail(str(error))
        return USER_ERROR
    except typer.TyperException as error:
        fail(refusal(error, arguments, typer.main.get_command(app)))
        return USER_ERROR
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            raise
        fail(f"no file or folder can be called {error.filename}: {error.strerror}; check the path")
        return USER_ERROR
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED
    return int(code or 0)


def _show_version(wanted: bool) -> None:
    if wanted:
        for line in version_lines():
            typer.echo(line)
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_show_version,
            is_eager=True,
            help="Print the versions that a report of a bug should name.",
        ),
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
