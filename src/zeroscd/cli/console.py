"""What people see in the terminal: results on stdout; progress, warnings and errors on stderr."""

from __future__ import annotations

import json
import warnings
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import typer

from zeroscd.renamed import RenamedWarning

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence


@dataclass(frozen=True, slots=True)
class Audience:
    """Who reads what a command prints.

    Attributes:
        quiet: Nobody, as long as nothing goes wrong.
        as_json: A program reads stdout, so that what is for people goes to stderr.
    """

    quiet: bool = False
    as_json: bool = False


# `run` gives each command a context of its own.
PERSON = Audience()
_audience: ContextVar[Audience] = ContextVar("audience", default=PERSON)


def set_audience(*, quiet: bool = False, as_json: bool = False) -> None:
    """Choose who reads the rest of this command."""
    _audience.set(Audience(quiet, as_json))


def is_quiet() -> bool:
    """Tell whether only warnings and errors are wanted."""
    return _audience.get().quiet


def say(text: str) -> None:
    """Print a line for people about what came out: on stdout, unless that is for a program."""
    show(one_line(text))


def show(text: str) -> None:
    """Print several lines for people, such as a table, where `say` prints one."""
    if not is_quiet():
        typer.echo(text, err=_audience.get().as_json)


def note(text: str) -> None:
    """Print on stderr what people may like to know while a command runs."""
    if not is_quiet():
        typer.echo(one_line(text), err=True)


def answer(values: object) -> None:
    """Print the one JSON document that a program asked for."""
    typer.echo(json.dumps(values, indent=1, allow_nan=False))


def answer_line(values: object) -> None:
    """Print a line of JSON at once, for a program that waits for it."""
    typer.echo(json.dumps(values, allow_nan=False))


def warn(text: str) -> None:
    """Print what a user must know on stderr."""
    typer.echo(f"warning: {one_line(text)}", err=True)


def fail(text: str) -> None:
    """Print the one line that explains why nothing came of it."""
    typer.echo(f"error: {one_line(text)}", err=True)


@contextmanager
def busy(text: str) -> Iterator[None]:
    """Show that a long step runs, where a person watches stderr; nothing elsewhere."""
    from rich.console import Console

    console = Console(stderr=True)
    if is_quiet() or not console.is_terminal:
        yield
        return
    with console.status(text):
        yield


@contextmanager
def old_names_shown() -> Iterator[None]:
    """Print one `warning:` line for each old name used, where Python would print nothing."""
    told: set[str] = set()
    with warnings.catch_warnings():
        warnings.simplefilter("always", RenamedWarning)
        python_shows: Callable[..., None] = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: object) -> None:
            if not issubclass(category, RenamedWarning):
                python_shows(message, category, *where)
            elif str(message) not in told:
                told.add(str(message))
                warn(str(message))

        warnings.showwarning = cast("Any", show)
        yield


def columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a line for each row, its cells below each other.

    Example:
        >>> columns([("name", "MB"), ("sam-vit-b", "375")])
        ['name       MB', 'sam-vit-b  375']
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(map(str.ljust, cells, widths)) for cells in rows)
    return [line.rstrip() for line in lines]


def one_line(text: str) -> str:
    r"""Make text safe for one line of a terminal, whatever a file name holds.

    Example:
        >>> one_line("no\n such  \x1b[31mfile")
        'no such \\x1b[31mfile'
    """
    joined = " ".join(text.split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in joined)
