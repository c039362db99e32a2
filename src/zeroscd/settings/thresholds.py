"""Which settings only weigh evidence, and which decide what evidence there is."""

from __future__ import annotations

from zeroscd.errors import SettingsError
from zeroscd.settings.names import current_name
from zeroscd.settings.tree import LEAVES, Settings, leaf_values

# What only weighs evidence that is there already; all other leaves need the photos again.
THRESHOLDS: frozenset[str] = frozenset(
    name for name, leaf in LEAVES.items() if leaf.declared.threshold
)


def is_threshold(name: str) -> bool:
    """Tell whether a setting, by its name or an old name, only weighs evidence.

    Example:
        >>> is_threshold("alpha"), is_threshold("side_px")
        (True, False)
    """
    return current_name(name, stacklevel=2) in THRESHOLDS


def evidence_settings(settings: Settings) -> Settings:
    """Return a copy with all thresholds at their defaults; equal copies need equal evidence."""
    return settings.override({name: LEAVES[name].default for name in sorted(THRESHOLDS)})


def require_same_evidence(wanted: Settings, gathered: Settings) -> None:
    """Check that two settings differ in thresholds at most.

    Raises:
        SettingsError: They differ in something that decides what is seen.
    """
    here, there = (leaf_values(evidence_settings(one)) for one in (wanted, gathered))
    differing = next((name for name in here if here[name] != there[name]), None)
    if differing is not None:
        message = (
            f"setting {differing} changes the evidence, not its weight; "
            "compare the photos again with a detector of these settings"
        )
        raise SettingsError(message)
