"""`zeroscd settings`: every setting with its value, what it may be and what it means."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import typer

from zeroscd.cli.console import columns
from zeroscd.cli.options import AsJson, Preset  # noqa: TC001 - typer reads the annotations

if TYPE_CHECKING:
    from zeroscd.settings.declaration import Leaf


def settings(
    preset: Preset = "lite",
    as_json: AsJson = False,
) -> None:
    """List every setting: its value in a preset, the paper's literal value, and what it means.

    Example: zeroscd settings --preset robust
    """
    from zeroscd.settings import LEAVES, leaf_values
    from zeroscd.settings import preset as named

    values = leaf_values(named(preset))
    if as_json:
        listed = [_plain(leaf, values[name]) for name, leaf in LEAVES.items()]
        typer.echo(json.dumps({"preset": preset, "settings": listed}, indent=2))
        return
    rows = [_cells(leaf, values[name]) for name, leaf in LEAVES.items()]
    for line in columns([("setting", preset, "paper", "meaning"), *rows]):
        typer.echo(line)
    typer.echo("\nChange one with --set SETTING=VALUE; --set rules=paper takes the column `paper`.")


def _cells(leaf: Leaf, value: object) -> tuple[str, ...]:
    from zeroscd.settings.declaration import OPEN, allowed_text, value_text

    paper, allowed = leaf.declared.paper, allowed_text(leaf)
    return (
        leaf.name,
        value_text(value),
        "" if paper is OPEN else value_text(paper),
        leaf.declared.meaning + (f" [{allowed}]" if allowed else ""),
    )


def _plain(leaf: Leaf, value: object) -> dict[str, Any]:
    from zeroscd.settings.declaration import OPEN

    declared, within = leaf.declared, leaf.within
    return {
        "name": leaf.name,
        "stage": leaf.branch,
        "value": value,
        "default": leaf.default,
        "type": leaf.kind.__name__,
        "choices": leaf.choices or None,
        "range": within and [within.low, within.high],
        "unit": (within and within.unit) or None,
        "none_allowed": leaf.takes_none,
        "paper": None if declared.paper is OPEN else declared.paper,
        "threshold": declared.threshold,
        "meaning": declared.meaning,
    }
