"""`zeroscd ablate`: what a setting is worth on a data set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from zeroscd.cli.console import say, set_audience, show, warn
from zeroscd.cli.evaluate import Count, DatasetName, DatasetRoot, Figures, Limit, show_dataset
from zeroscd.cli.options import Device, OutFolder, Overrides, Preset, Quiet, parse_overrides

if TYPE_CHECKING:
    from zeroscd.detector import Detector
    from zeroscd.models import Models
    from zeroscd.settings import Settings


def ablate(
    dataset: DatasetName,
    root: DatasetRoot,
    out: OutFolder,
    over: Annotated[
        list[str], typer.Option(help="tau=0.5:0.7:0.05 or encoder=a,b; several are combined.")
    ],
    preset: Preset = "lite",
    limit: Limit = None,
    count: Count = None,
    settings: Overrides = None,
    device: Device = "auto",
    figures: Figures = False,
    cache_gb: Annotated[float | None, typer.Option(hidden=True)] = None,
    quiet: Quiet = False,
) -> None:
    """Score many settings on a data set, encoding each pair once.

    Prints a table, and writes OUT/ablation.json and OUT/report.html with the curve beside the
    paper's. An ablation that was stopped continues when the same command is given again.
    """
    set_audience(quiet=quiet)
    from zeroscd.cli.progress import Bar
    from zeroscd.evaluation.ablation.grid import parse_axis
    from zeroscd.evaluation.ablation.run import Plan
    from zeroscd.evaluation.ablation.run import ablate as run_ablation
    from zeroscd.evaluation.datasets.catalogue import open_dataset
    from zeroscd.evaluation.report.ablation_page import ablation_page
    from zeroscd.evaluation.report.figures import check_figures, write_figures
    from zeroscd.settings import preset as preset_settings

    if cache_gb is not None:  # accepted until 0.3
        warn("--cache-gb has no effect any more: nothing is cached on disk; leave it out")
    if figures:
        check_figures()
    plan = Plan(
        settings=preset_settings(preset).override(parse_overrides(settings)),
        axes=tuple(parse_axis(text) for text in over),
        out=out,
    )
    found = open_dataset(dataset, root).counting(count).first(limit)
    show_dataset(found)
    try:
        with Bar() as bar:
            points = run_ablation(found, plan, PresetFactory(preset, device), progress=bar)
    except KeyboardInterrupt:
        warn(f"stopped; give the same command again to continue in {out}")
        raise
    page = ablation_page(plan.axes, points)
    report = page.write(out)
    if figures:
        write_figures(out, charts=page.charts)
    for table in page.tables:
        show(table.to_text())
    for doubt in points[0].scores.warnings:
        warn(doubt)
    say(f"report: {report}")


@dataclass(frozen=True)
class PresetFactory:
    """Makes the detectors of a preset on a device."""

    preset: str
    device: str

    def check(self, settings: Settings) -> None:
        """Refuse settings whose models cannot be loaded, without loading them."""
        from zeroscd.models import check_models

        check_models(settings)

    def load(self, settings: Settings) -> Models:
        """Load the encoder and the segmenter that the settings name."""
        from zeroscd.models import load_models

        return load_models(settings, device=self.device)

    def build(self, settings: Settings, models: Models) -> Detector:
        """Put a detector together."""
        from zeroscd.detector import Detector

        return Detector(settings, models, preset=self.preset)
