#!/usr/bin/env python3
"""Write the accuracy table in docs/lite.md from the committed results; --check only compares.

    python scripts/write_accuracy_table.py

The figures are those of benchmarks/accuracy.py under `judge=all`, `likely` and `sure`.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "lite.md"
RESULTS = ROOT / "benchmarks" / "results" / "accuracy"
FILES = {
    "all": "development-all.json",
    "likely": "development.json",
    "sure": "development-sure.json",
}
PLACE = re.compile(r"(<!-- accuracy -->\n).*?(<!-- end -->)", re.DOTALL)
HEAD = """\
| set | pairs | figure | tutorial | all | **likely** | sure |
|---|---|---|---|---|---|---|
"""
# figure of the results -> heading, digits
FIGURES = {
    "pairs_with_false_alarm": ("alarms", 2),
    "flagged_fraction": ("flagged", 3),
    "false_regions_per_pair": ("regions", 2),
    "f1_macro": ("F1", 3),
    "f1_over_sizes": ("F1 over four sizes", 3),
    "transients_flagged": ("transients", 2),
}
NAMES = {
    "nochange, street": "unchanged streets (street-nochange-dev)",
    "nochange, nature": "unchanged parks, forests, snow (likewise)",
    "parallax": "neighbouring frames (street-parallax-dev)",
    "real2": "real pairs (street-real2-dev)",
    "real": "real pairs (street-real-dev)",
    "views": "one old view of three (street-views-dev)",
    "views, all old photos": "all three old views (likewise, three photos before)",
    "composite": "composites (street-composite-dev)",
}


def table() -> str:
    """Return the table, real unchanged pairs first."""
    sets = {step: json.loads((RESULTS / file).read_text())["sets"] for step, file in FILES.items()}
    return HEAD + "".join(row for name in NAMES for row in rows(name, sets))


def rows(name: str, sets: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of one set, one for each figure that it has."""
    ours = {step: sets[step][name]["zeroscd"] for step in FILES}
    label, pairs = NAMES[name], f"{ours['likely']['pairs']}"
    for key, (heading, digits) in FIGURES.items():
        if ours["likely"].get(key) is None:
            continue
        tutorial = sets["likely"][name].get("tutorial", {}).get(key)
        values = [tutorial, *(ours[step].get(key) for step in FILES)]
        shown = ["-" if value is None else f"{value:.{digits}f}" for value in values]
        shown[2] = f"**{shown[2]}**"
        yield f"| {' | '.join([label, pairs, heading, *shown])} |\n"
        label = pairs = ""


def filled(page: str) -> str:
    """Return a page with its table up to date."""
    return PLACE.sub(lambda found: found[1] + table() + found[2], page)


def main() -> None:
    page = PAGE.read_text(encoding="utf-8")
    if "--check" in sys.argv[1:]:
        sys.exit(int(filled(page) != page))
    PAGE.write_text(filled(page), encoding="utf-8")


if __name__ == "__main__":
    main()
