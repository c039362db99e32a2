"""Names and values as they stand in a message of one line."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

LONGEST_SHOWN = 80  # characters of a refused value that a message repeats


def one_line(path: str) -> str:
    """Name a path so that no line break, control or invisible character of it gets through."""
    return path if path and path.isprintable() else repr(path)


def is_text(name: str) -> bool:
    r"""Tell whether a name can be stored as UTF-8; file names out of old archives cannot.

    Example:
        >>> is_text("café"), is_text("caf\udce9")
        (True, False)
    """
    return not any("\ud800" <= c <= "\udfff" for c in name)


def shown(value: object) -> str:
    """Write a refused value into a message of one line; a long one is cut.

    Example:
        >>> shown("high"), shown("a" * 1000)[-5:]
        ("'high'", 'aa...')
    """
    try:
        text = repr(value)
    except ValueError:  # Python writes no integer above some thousand digits
        return "a number of thousands of digits"
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def nearest(name: object, known: Collection[str]) -> str | None:
    """Return the known name that somebody may have meant; None if nothing is near.

    Example:
        >>> nearest("tua", ["tau", "alpha"]), nearest("colour", ["tau", "alpha"])
        ('tau', None)
    """
    text = str(name)[:LONGEST_SHOWN].lower()  # a longer one is no slip of the keyboard
    return next(iter(get_close_matches(text, known, n=1)), None)


def unknown(kind: str, name: object, known: Collection[str]) -> str:
    """Say that nothing of a kind has this name, and what has.

    Example:
        >>> unknown("preset", "ligth", ["lite", "robust"])
        "unknown preset 'ligth'; did you mean lite? (choose one of: lite, robust)"
        >>> unknown("preset", "huge", ["lite", "robust"])
        "unknown preset 'huge'; choose one of: lite, robust"
    """
    choices, near = f"choose one of: {', '.join(known)}", nearest(name, known)
    rest = f"did you mean {near}? ({choices})" if near else choices
    return f"unknown {kind} {shown(name)}; {rest}"
