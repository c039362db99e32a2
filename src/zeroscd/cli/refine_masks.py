"""`zeroscd refine-masks`: snap the drawn masks of a data set to the things in its photos."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from zeroscd.cli.console import answer, say, set_audience, warn
from zeroscd.cli.evaluate import DatasetName, DatasetRoot, Limit, show_dataset
from zeroscd.cli.options import (
    AsJson,
    Device,
    OutFolder,
    Overrides,
    Preset,
    Quiet,
    parse_overrides,
)


def refine_masks(
    dataset: DatasetName,
    root: DatasetRoot,
    out: OutFolder,
    preset: Preset = "lite",
    limit: Limit = None,
    reviewed: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="What the page of an earlier run exported."),
    ] = None,
    settings: Overrides = None,
    device: Device = "auto",
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Snap masks that people drew to the things in the photos, for review.

    Writes OUT/dataset, which `zeroscd evaluate` reads like ROOT, OUT/report.html to accept or
    reject each outline, OUT/masks.json and OUT/blobs.csv. Where the confidence is low, what was
    drawn stays. A run that was stopped continues when the same command is given again.

    Example: zeroscd refine-masks vl-cmu-cd ROOT -o refined
    """
    set_audience(quiet=quiet, as_json=as_json)
    from zeroscd.annotation import read_decisions
    from zeroscd.annotation import refine_masks as refine
    from zeroscd.annotation.report import totals
    from zeroscd.cli.progress import Bar
    from zeroscd.detector import Detector
    from zeroscd.evaluation.datasets.catalogue import open_dataset

    found = open_dataset(dataset, root).first(limit)
    decisions = read_decisions(reviewed) if reviewed else ()
    show_dataset(found)
    detector = Detector.from_preset(preset, device=device, overrides=parse_overrides(settings))
    try:
        with Bar("refining") as bar:
            refined = refine(found, detector, out, reviewed=decisions, progress=bar)
    except KeyboardInterrupt:
        warn(f"stopped; give the same command again to continue in {out}")
        raise
    counts = totals(refined.masks)
    say(
        f"{counts['snapped']} of {counts['blobs']} outlines snapped, {counts['kept']} kept as drawn"
    )
    if refined.unmatched:
        warn(f"reviews of other outlines than these, left out: {len(refined.unmatched)}")
    say(f"masks: {refined.copy}, review: {refined.page}")
    if as_json:
        answer(counts)
