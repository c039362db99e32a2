"""Names that have changed: the old ones work for one more minor version, with a warning."""

from __future__ import annotations

import functools
import warnings
from importlib import import_module
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

T = TypeVar("T")

REMOVED_IN = "0.3"


class RenamedWarning(DeprecationWarning):
    """An old name was used; the message says the new one."""


def warn_renamed(old: str, new: str, *, stacklevel: int = 1) -> None:
    """Warn that a name is an old one.

    Args:
        old: As it was used.
        new: What to write instead.
        stacklevel: 1 = blame the caller of the function that calls this, 2 = that one's caller.
    """
    message = f"{old} is now {new}; the old name will be gone in zeroscd {REMOVED_IN}"
    warnings.warn(message, RenamedWarning, stacklevel=stacklevel + 2)


def moved_names(module: str, homes: Mapping[str, str]) -> Callable[[str], object]:
    """Return a `__getattr__` for a module some of whose names have new ones.

    Args:
        module: Its name.
        homes: From an old name to the new one with its module, such as "zeroscd.records.Region".
    """

    def find(name: str) -> object:
        if name not in homes:
            message = f"module {module!r} has no attribute {name!r}"
            raise AttributeError(message)
        warn_renamed(f"{module}.{name}", homes[name])
        home, _, new = homes[name].rpartition(".")
        return getattr(import_module(home), new)

    return find


def renamed_fields(names: Mapping[str, str]) -> Callable[[type[T]], type[T]]:
    """Let a dataclass take and show its fields under old names as well.

    Args:
        names: From old names to new ones; those of other classes do no harm.
    """

    def decorate(kind: type[T]) -> type[T]:
        own = {old: new for old, new in names.items() if hasattr(kind, new)}
        make = kind.__init__

        @functools.wraps(make)
        def init(self: T, **values: object) -> None:
            for old in own.keys() & values.keys():
                if own[old] in values:
                    message = f"{old} and {own[old]} are one field; give it once"
                    raise TypeError(message)
                warn_renamed(old, own[old])
                values[own[old]] = values.pop(old)
            make(self, **values)

        kind.__init__ = init  # type: ignore[method-assign, assignment]
        for old, new in own.items():
            setattr(kind, old, _reader(old, new))
        return kind

    return decorate


def _reader(old: str, new: str) -> property:
    def read(self: object) -> object:
        warn_renamed(old, new)
        return getattr(self, new)

    read.__doc__ = f"Old name of `{new}`."
    return property(read)
