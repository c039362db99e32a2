"""`zeroscd evaluate`: score a preset on a data set."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from zeroscd.cli.console import answer, note, say, set_audience, show, warn
from zeroscd.cli.options import (
    AsJson,
    Device,
    OutFolder,
    Overrides,
    Preset,
    Quiet,
    parse_overrides,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.evaluation.datasets.port import Dataset
    from zeroscd.evaluation.run import Run


def complete_datasets(incomplete: str) -> list[str]:
    """Return the data sets that begin so, for the shell."""
    from zeroscd.evaluation.datasets.catalogue import DATASETS

    return [name for name in DATASETS if name.startswith(incomplete)]


DatasetName = Annotated[
    str,
    typer.Argument(
        metavar="DATASET",
        help="folder, vl-cmu-cd, pcd2015-tsunami, ...",
        autocompletion=complete_datasets,
    ),
]
DatasetRoot = Annotated[Path, typer.Argument(metavar="ROOT", help="Where the data set lies.")]
Figures = Annotated[
    bool, typer.Option("--figures", help="Also write charts and panels as PNG and PDF.")
]
Count = Annotated[
    Literal["both", "removed", "added"] | None,
    typer.Option(help="Which changes to compare; the data set's own choice if not given."),
]
Limit = Annotated[int | None, typer.Option(min=1, help="Only the first N pairs.")]


def evaluate(
    dataset: DatasetName,
    root: DatasetRoot,
    out: OutFolder,
    preset: Preset = "lite",
    limit: Limit = None,
    count: Count = None,
    settings: Overrides = None,
    device: Device = "auto",
    shown: Annotated[
        list[str] | None,
        typer.Option("--show", help="Show this pair in the report; may be repeated."),
    ] = None,
    swap: Annotated[
        bool, typer.Option("--swap", help="Also swap the photos: temporal consistency.")
    ] = False,
    figures: Figures = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Score a preset on a data set; writes OUT/scores.json and OUT/report.html.

    An evaluation that was stopped continues where it was when the same command is given again.
    """
    set_audience(quiet=quiet, as_json=as_json)
    from zeroscd.cli.progress import Bar
    from zeroscd.evaluation.datasets.catalogue import open_dataset
    from zeroscd.evaluation.report.figures import check_figures, write_figures
    from zeroscd.evaluation.report.page import score_page
    from zeroscd.evaluation.report.panels import check_chosen
    from zeroscd.evaluation.run import evaluate as run_evaluation

    found = open_dataset(dataset, root).counting(count).first(limit)
    check_chosen(found, shown or [])
    if figures:
        check_figures()
    show_dataset(found)
    run = make_run(
        found, out, preset=preset, device=device, overrides=parse_overrides(settings), swap=swap
    )
    try:
        with Bar() as bar:
            scores = run_evaluation(found, run, progress=bar)
    except KeyboardInterrupt:
        warn(f"stopped; give the same command again to continue in {out}")
        raise
    page = score_page(scores, out, chosen=shown or [])
    report = page.write(out)
    if figures:
        write_figures(out, charts=page.charts, panels=page.panels)
    for table in reversed(page.tables):
        show(table.to_text())
    for doubt in scores.warnings:
        warn(doubt)
    say(f"report: {report}")
    if as_json:
        answer(scores.to_dict())


def make_run(
    dataset: Dataset,
    out: Path,
    *,
    preset: str,
    device: str,
    overrides: Mapping[str, object],
    swap: bool,
) -> Run:
    """Load a detector for the frame of a data set's masks, and one for swapped photos if asked."""
    from zeroscd.detector import Detector
    from zeroscd.evaluation.run import Run

    detector = Detector.from_preset(
        preset, device=device, overrides={"frame": dataset.frame, **overrides}
    )
    other = {"t0": "t1", "t1": "t0"}[dataset.frame]
    back = Detector(
        detector.settings.override({"frame": other}), detector.models, preset=detector.preset
    )
    return Run(detector=detector, out=out, swapped=back if swap else None)


def show_dataset(dataset: Dataset) -> None:
    """Print on stderr which data set and layout was found."""
    note(
        f"{dataset.name}: {len(dataset.pairs)} pairs, {dataset.layout}, "
        f"masks in the {dataset.frame} frame"
    )
    for one in dataset.notes:
        note(f"note: {one}")
