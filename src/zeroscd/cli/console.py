"""What people see in the terminal: results on stdout; progress, warnings and errors on stderr."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from collections.abc import Iterator


def say(text: str) -> None:
    """Print a result on stdout."""
    typer.echo(one_line(text))


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
    if not console.is_terminal:
        yield
        return
    with console.status(text):
        yield


def one_line(text: str) -> str:
    r"""Make text safe for one line of a terminal, whatever a file name holds.

    Example:
        >>> one_line("no\n such  \x1b[31mfile")
        'no such \\x1b[31mfile'
    """
    joined = " ".join(text.split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in joined)
