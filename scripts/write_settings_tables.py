#!/usr/bin/env python3
"""Write the tables of settings in docs/method.md from their declarations; --check only compares.

A table stands between `<!-- settings: NAMES -->` and `<!-- end -->`; NAMES are settings, or stages
(align, change, segment, refine) for all of theirs.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from zeroscd.settings import LEAVES, PRESETS, leaf_values
from zeroscd.settings.declaration import OPEN, allowed_text, value_text

if TYPE_CHECKING:
    from zeroscd.settings.declaration import Leaf

PAGE = Path(__file__).parents[1] / "docs" / "method.md"
PLACE = re.compile(r"(<!-- settings: ([\w ]+) -->\n).*?(<!-- end -->)", re.DOTALL)
HEAD = """\
| setting | default | paper | lite | allowed | threshold | meaning |
|---|---|---|---|---|---|---|
"""


def filled(page: str) -> str:
    """Return a page with all of its tables up to date."""
    return PLACE.sub(lambda found: found[1] + table(found[2].split()) + found[3], page)


def table(names: list[str]) -> str:
    """Return the table of some settings, or of stages, in the order of the method."""
    chosen = [leaf for leaf in LEAVES.values() if {leaf.name, leaf.branch} & set(names)]
    known = {leaf.name for leaf in chosen} | {leaf.branch for leaf in chosen}
    if unknown := set(names) - known:
        sys.exit(f"error: docs/method.md wants a table of {min(unknown)}, which is no setting")
    return HEAD + "".join(row(leaf) for leaf in chosen)


def row(leaf: Leaf) -> str:
    """Return one line of a table; what `lite` and the paper do not change is left empty."""
    lite, paper = leaf_values(PRESETS["lite"])[leaf.name], leaf.declared.paper
    cells = (
        code(leaf.name),
        code(value_text(leaf.default)),
        "" if paper is OPEN else code(value_text(paper)),
        "" if lite == leaf.default else code(value_text(lite)),
        allowed_text(leaf),
        "yes" if leaf.declared.threshold else "",
        leaf.declared.meaning,
    )
    return f"| {' | '.join(cells)} |\n".replace("  ", " ")


def code(text: str) -> str:
    return f"`{text}`"


def main() -> None:
    """Bring the page up to date, or say that it is not."""
    now = PAGE.read_text(encoding="utf-8")
    wanted = filled(now)
    if "--check" in sys.argv[1:]:
        sys.exit(None if now == wanted else "error: docs/method.md is out of date; write it anew")
    PAGE.write_text(wanted, encoding="utf-8")


if __name__ == "__main__":
    main()
