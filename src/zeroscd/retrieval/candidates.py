"""Which old photos are compared with a new one: by where, when and in which direction taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from zeroscd.errors import SettingsError

if TYPE_CHECKING:
    from datetime import date

    from zeroscd.images.exif import Exif
    from zeroscd.retrieval.gps import Nearby

HEADING = "heading"  # column, which indexes of older versions lack
# Two photos of the usual field of view, 60 to 75 degrees, have next to nothing in common when their
# headings differ by more. The compasses of phones err by 10 to 20 degrees.
MAX_TURN_DEG = 60.0
FULL_TURN = 360.0


@dataclass(frozen=True, slots=True)
class DateSpan:
    """Days on which photos were taken, by their cameras' clocks.

    Attributes:
        first: First day; None = any before the last.
        last: Last day; None = any after the first.

    Raises:
        SettingsError: The last day is before the first.

    Example:
        >>> from datetime import date
        >>> str(DateSpan(date(2019, 5, 1), date(2019, 5, 31))), str(DateSpan(last=date(2020, 1, 1)))
        ('from 2019-05-01 until 2019-05-31', 'until 2020-01-01')
    """

    first: date | None = None
    last: date | None = None

    def __post_init__(self) -> None:
        if self.first and self.last and self.last < self.first:
            message = f"no day is {self}; exchange --old-from and --old-until"
            raise SettingsError(message)

    def __str__(self) -> str:
        ends = (("from", self.first), ("until", self.last))
        return " ".join(f"{word} {day.isoformat()}" for word, day in ends if day)

    def where(self) -> str:
        """Return an SQL condition on the column `taken`, ISO 8601 text; null where it is empty."""
        parts = ["taken IS NOT NULL"]
        if self.first:
            parts.append(f"taken >= '{self.first.isoformat()}'")
        if self.last:
            parts.append(f"taken < '{self.last.isoformat()}T24'")  # after every hour of that day
        return " AND ".join(parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidates:
    """Which old photos may show the place of a new one.

    Attributes:
        nearby: Those taken in this circle; those without a position are left out. None = all.
        dates: Those taken on these days; those without a time are left out. None = all.
        heading_deg: Those that look the same way, up to `MAX_TURN_DEG`, and those of which no
            heading is known. None = all.
    """

    nearby: Nearby | None = None
    dates: DateSpan | None = None
    heading_deg: float | None = None

    @property
    def few(self) -> bool:
        """Whether place or time restrict them, so that all can be compared exactly."""
        return self.nearby is not None or self.dates is not None

    def where(self, columns: list[str]) -> str | None:
        """Return an SQL condition, or None if all photos are candidates.

        Args:
            columns: Of the table, which may lack the one of headings.
        """
        parts = [one.where() for one in (self.nearby, self.dates) if one is not None]
        if self.heading_deg is not None and HEADING in columns:
            parts.append(_heading_within(self.heading_deg))
        return " AND ".join(f"({part})" for part in parts) or None

    def holds(self, exif: Exif) -> bool:
        """Return whether a photo for which the condition holds is one: a circle is no box."""
        return self.nearby is None or self.nearby.holds(exif.gps)


ALL = Candidates()


def _heading_within(heading_deg: float) -> str:
    """Return an SQL condition on headings, 0 <= heading < 360, on both sides of north."""
    low = (heading_deg - MAX_TURN_DEG) % FULL_TURN
    high = (heading_deg + MAX_TURN_DEG) % FULL_TURN
    operator = "AND" if low <= high else "OR"
    return f"{HEADING} IS NULL OR ({HEADING} >= {low!r} {operator} {HEADING} <= {high!r})"
