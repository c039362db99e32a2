"""From what a person typed, or handed over in Python, to what a setting holds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from zeroscd.errors import SettingsError
from zeroscd.text import shown

if TYPE_CHECKING:
    from zeroscd.settings.declaration import Leaf


def parse(leaf: Leaf, value: object) -> object:
    """Return the value that a setting takes for it.

    Raises:
        SettingsError: It cannot take it.

    Example:
        >>> from zeroscd.settings import LEAVES
        >>> parse(LEAVES["tau"], "0.6"), parse(LEAVES["tau"], "none"), parse(LEAVES["seed"], 3.0)
        (0.6, None, 3)
    """
    if leaf.choices:
        if value in leaf.choices:
            return value
        options = ", ".join(leaf.choices)
        message = f"setting {leaf.name} cannot be {shown(value)}; choose one of: {options}"
        raise SettingsError(message)
    if leaf.takes_none and (value is None or (isinstance(value, str) and value.lower() == "none")):
        return None
    found, within = _convert(value, leaf.kind), leaf.within
    if found is None or (isinstance(found, float) and not math.isfinite(found)):
        message = f"setting {leaf.name} needs a {leaf.kind.__name__}, not {shown(value)}"
        raise SettingsError(message)
    if within is not None and not within.low <= found <= within.high:
        limits = f"between {within.low} and {within.high}"
        message = f"setting {leaf.name} must lie {limits}, not at {shown(value)}"
        raise SettingsError(message)
    return found


def _convert(value: object, kind: Any) -> Any:  # noqa: ANN401 - a type, a value of it
    """Turn a value into what a setting holds; None where that cannot be without a loss."""
    if kind is int and isinstance(value, float) and not value.is_integer():
        return None
    try:
        return kind(value)
    except (TypeError, ValueError, OverflowError):
        return None
