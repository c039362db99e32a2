"""One line about what was typed and cannot be understood: why, what was meant, where help is."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from zeroscd.text import nearest

if TYPE_CHECKING:
    from collections.abc import Sequence

    import typer

UNKNOWN_COMMAND = re.compile(r"No such command '(.*)'")


def refusal(error: typer.TyperException, arguments: Sequence[str], root: Any) -> str:  # noqa: ANN401 - typer keeps the type of its commands to itself
    """Return the line about a command, option or argument that is unknown, wrong or missing.

    Args:
        error: What typer says.
        arguments: What was typed after the program's name.
        root: The command of the whole program.
    """
    path, command = _command_of(arguments, root)
    help_hint = f"see `{path} --help`"
    # pydantic, inside typer, puts its own kind of error first.
    reason = error.format_message().replace("Value error, ", "").rstrip(".") or "Missing command"
    near = None
    if hasattr(error, "option_name") and hasattr(error, "possibilities"):
        # An unknown option, with our own suggestion instead of typer's.
        reason = str(error)
        near = nearest(error.option_name, [name for one in command.params for name in one.opts])
    elif unknown := UNKNOWN_COMMAND.fullmatch(reason):
        near = nearest(unknown[1], command.commands)
    return f"{reason}; did you mean {near}? ({help_hint})" if near else f"{reason}; {help_hint}"


def _command_of(arguments: Sequence[str], root: Any) -> tuple[str, Any]:  # noqa: ANN401 - as above
    """Return the command that was typed, with the words that lead to it."""
    path, command = ["zeroscd"], root
    for word in arguments:
        inner = getattr(command, "commands", {}).get(word)
        if inner is None:
            break
        path.append(word)
        command = inner
    return " ".join(path), command
