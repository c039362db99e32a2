"""Which settings an ablation tries, from text such as `tau=0.5:0.7:0.05`."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from itertools import product
from typing import TYPE_CHECKING

from zeroscd.errors import SettingsError
from zeroscd.settings.names import current_name

if TYPE_CHECKING:
    from collections.abc import Sequence

MAX_VALUES = 200  # of one range; more is a slip of the keyboard


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One setting and the values that it takes.

    Attributes:
        name: As in `--set name=value`.
        values: As typed, or as counted through a range.
    """

    name: str
    values: tuple[str, ...]

    @property
    def is_numeric(self) -> bool:
        """Whether the values can be laid along the x axis of a curve."""
        return all(_as_number(value) is not None for value in self.values)


def parse_axis(text: str) -> Axis:
    """Read `name=first:last:step` (last included) or `name=value,value,...`.

    Raises:
        SettingsError: It is neither.

    Example:
        >>> parse_axis("tau=0.5:0.7:0.05").values
        ('0.5', '0.55', '0.6', '0.65', '0.7')
        >>> parse_axis("encoder=dinov2-s,dinov2-b").values
        ('dinov2-s', 'dinov2-b')
    """
    name, _, listed = text.partition("=")
    values = _count_through(listed) if ":" in listed else _split(listed)
    if not name.strip() or not values:
        message = f"--over needs name=first:last:step or name=value,value, not {text!r}"
        raise SettingsError(message)
    return Axis(name=current_name(name.strip()), values=values)


def combine(axes: Sequence[Axis]) -> list[dict[str, str]]:
    """Return every combination of values, the last axis changing fastest.

    Raises:
        SettingsError: Two axes vary the same setting.
    """
    names = [axis.name for axis in axes]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        message = f"--over names {twice} twice; give all its values at once: {twice}=value,value"
        raise SettingsError(message)
    return [
        dict(zip(names, values, strict=True)) for values in product(*(axis.values for axis in axes))
    ]


def _split(listed: str) -> tuple[str, ...]:
    found: dict[Decimal | str, str] = {}
    for value in filter(None, map(str.strip, listed.split(","))):
        number = _as_number(value)
        found.setdefault(value if number is None else number, value)  # 1 and 1.0 are one point
    return tuple(found.values())


def _count_through(listed: str) -> tuple[str, ...]:
    numbers = [_as_number(part) for part in listed.split(":")]
    match numbers:
        case [Decimal() as first, Decimal() as last, Decimal() as step] if (
            step > 0 and first <= last <= first + step * MAX_VALUES
        ):
            count = int((last - first) / step) + 1
            return tuple(_plain(first + step * at) for at in range(count))
    return ()


def _as_number(text: str) -> Decimal | None:
    try:
        number = Decimal(text.strip())
    except InvalidOperation:
        return None
    return number if number.is_finite() else None


def _plain(number: Decimal) -> str:
    text = f"{number:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
