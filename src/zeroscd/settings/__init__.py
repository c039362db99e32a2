"""Every number of the method, with its meaning, range and the paper's value; presets by name.

`tree.py` declares them, stage by stage; everything else here reads that.
"""

from zeroscd.settings.presets import PRESETS, preset
from zeroscd.settings.thresholds import (
    THRESHOLDS,
    evidence_settings,
    is_threshold,
    require_same_evidence,
)
from zeroscd.settings.tree import (
    LEAVES,
    PAPER_RULES,
    RANGES,
    AlignSettings,
    ChangeSettings,
    RefineSettings,
    SegmentSettings,
    Settings,
    leaf_names,
    leaf_values,
)

__all__ = [
    "LEAVES",
    "PAPER_RULES",
    "PRESETS",
    "RANGES",
    "THRESHOLDS",
    "AlignSettings",
    "ChangeSettings",
    "RefineSettings",
    "SegmentSettings",
    "Settings",
    "evidence_settings",
    "is_threshold",
    "leaf_names",
    "leaf_values",
    "preset",
    "require_same_evidence",
]
