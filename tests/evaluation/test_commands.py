"""`zeroscd evaluate` and `zeroscd ablate`, with the toy detector in place of the networks."""

from __future__ import annotations

import json
from contextvars import copy_context
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import typer

from zeroscd.cli.ablate import ablate
from zeroscd.cli.evaluate import evaluate
from zeroscd.cli.progress import Bar
from zeroscd.errors import DatasetError, OutputError, SettingsError
from zeroscd.evaluation.run import Run
from zeroscd.models import Models

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import ModuleType

    from numpy.typing import NDArray

    from zeroscd.evaluation.datasets.port import Dataset
    from zeroscd.settings import Settings


INTERRUPTED = 130  # 128 + SIGINT


class StillEncoder:
    name, tau = "still", 1.0

    def encode(self, photos: Any) -> list[Any]:
        return [() for _ in photos]


class StillSegmenter:
    name = "still"

    def proposals(self, photo: Any, features: Any) -> Any:
        raise AssertionError


@pytest.fixture
def app(toy: ModuleType, monkeypatch: pytest.MonkeyPatch) -> typer.Typer:
    def make_run(dataset: Dataset, out: Path, **asked: Any) -> Run:
        detector = toy.ToyDetector.in_frame(dataset.frame)
        settings = detector.settings.override(asked["overrides"])
        back = toy.ToyDetector.in_frame("t0") if asked["swap"] else None
        return Run(detector=replace(detector, settings=settings), out=out, swapped=back)

    class DetectorFactory:
        def __init__(self, preset: str, device: str) -> None:
            self.preset = preset

        def check(self, settings: Settings) -> None:
            """Everything is there."""

        def load(self, settings: Settings) -> Models:
            return Models(StillEncoder(), StillSegmenter())

        def build(self, settings: Settings, models: Models) -> Any:
            return toy.ToyDetector(settings=settings, preset=self.preset)

    monkeypatch.setattr("zeroscd.cli.evaluate.make_run", make_run)
    monkeypatch.setattr("zeroscd.cli.ablate.PresetFactory", DetectorFactory)
    app = typer.Typer()
    app.command()(evaluate)
    app.command()(ablate)
    return app


def run(app: typer.Typer, *words: str | Path) -> Any:
    return app(args=[str(word) for word in words], standalone_mode=False)


def test_evaluate_writes_the_promised_files_and_prints_the_table(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(app, "evaluate", "folder", tiny_folder, "-o", tmp_path / "out", "--swap")
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    promised = {
        *("pairs", "f1_macro", "f1_pooled", "f1_hm", "precision_macro", "recall_macro"),
        *("iou_macro", "no_change", "per_pair", "settings", "versions"),
    }
    assert promised <= set(scores)
    row = {"stem", "f1", "precision", "recall", "seconds", "flagged_fraction"}
    assert row <= set(scores["per_pair"][0])
    assert scores["temporal_consistency"] == 1.0
    assert (tmp_path / "out" / "report.html").exists()
    shown = capsys.readouterr()
    assert "F1, mean over pairs" in shown.out
    assert "0.200" in shown.out
    assert "share of them with a false region of 100 px or more" in shown.out
    page = (tmp_path / "out" / "report.html").read_text()
    assert "false regions a pair in those" in page
    assert "3 pairs, t0/ t1/ mask/ with equal names" in shown.err


def test_a_program_gets_the_scores_and_the_tables_go_to_stderr(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = "evaluate", "folder", tiny_folder, "-o", tmp_path / "out", "--json"
    copy_context().run(lambda: run(app, *words))
    shown = capsys.readouterr()
    assert json.loads(shown.out) == json.loads((tmp_path / "out" / "scores.json").read_text())
    assert "F1, mean over pairs" in shown.err


@pytest.mark.parametrize("command", [["evaluate"], ["ablate", "--over", "tau=1"]])
def test_quiet_commands_write_their_files_and_print_nothing(
    app: typer.Typer,
    tiny_folder: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    command: list[str],
) -> None:
    name, *options = command
    where = tiny_folder, "-o", tmp_path / "out"
    copy_context().run(lambda: run(app, name, "folder", *where, "--quiet", *options))
    assert capsys.readouterr().out == ""
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.parametrize("command", [["evaluate"], ["ablate", "--over", "tau=1"]])
def test_a_name_that_is_too_long_for_a_folder_is_refused(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path, command: list[str]
) -> None:
    name, *options = command
    with pytest.raises(OutputError, match="File name too long"):
        run(app, name, "folder", tiny_folder, "-o", tmp_path / ("a" * 300), *options)


def test_a_mask_that_is_not_as_large_as_its_photo_is_named(
    app: typer.Typer,
    tiny_folder: Path,
    tmp_path: Path,
    save: Callable[[Path, NDArray[np.uint8]], Path],
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = "evaluate", "folder", tiny_folder, "-o", tmp_path / "out"
    run(app, *words)
    assert "as large" not in capsys.readouterr().err
    save(tiny_folder / "mask" / "b.png", np.zeros((20, 60), np.uint8))
    for _ in range(2):  # also when its score comes from the ledger
        run(app, *words)
        (line,) = [one for one in capsys.readouterr().err.splitlines() if "as large" in one]
        assert line.startswith("warning: not as large as their t1 photo: masks of b; what")
    said = line.removeprefix("warning: ")
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    assert said in scores["protocol"]["notes"]
    assert said in (tmp_path / "out" / "report.html").read_text()
    run(app, "ablate", "folder", tiny_folder, "-o", tmp_path / "sweep", "--over", "tau=1")
    assert line in capsys.readouterr().err


def test_a_mask_in_colours_is_scored_like_a_white_one_and_named(
    app: typer.Typer,
    tiny_folder: Path,
    tmp_path: Path,
    save: Callable[[Path, NDArray[np.uint8]], Path],
    capsys: pytest.CaptureFixture[str],
) -> None:
    colours = np.zeros((40, 80, 3), np.uint8)
    colours[:, 8:32] = (64, 0, 0)  # as columns 2 to 8 of the white one
    colours[:, 76:] = (224, 224, 192)  # VOC's void
    save(tiny_folder / "mask" / "a.png", colours)
    for _ in range(2):  # also when its score comes from the ledger
        run(app, "evaluate", "folder", tiny_folder, "-o", tmp_path / "out")
        assert "warning: not black and white" in capsys.readouterr().err
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    assert scores["per_pair"][0]["f1"] == pytest.approx(0.4)
    assert scores["pixels"]["tn"] == 40 * 4 * (11 + 15 + 19)  # a without its void column, b, c
    said = "not black and white, so everything but black counts as white: masks of a"
    assert said in scores["protocol"]["notes"]


def test_a_protocol_that_sets_one_size_takes_masks_of_any_size(
    app: typer.Typer,
    tmp_path: Path,
    save: Callable[[Path, NDArray[np.uint8]], Path],
    capsys: pytest.CaptureFixture[str],
) -> None:
    test = tmp_path / "test"
    for part in ("t0", "t1"):
        save(test / part / "000_1_00_0.png", np.full((96, 128, 3), 90, np.uint8))
    save(test / "mask" / "000_1_00_0.png", np.zeros((64, 64), np.uint8))
    run(app, "evaluate", "vl-cmu-cd", tmp_path, "-o", tmp_path / "out")
    assert "as large" not in capsys.readouterr().err


def test_evaluate_keeps_to_the_first_pairs(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path
) -> None:
    run(app, "evaluate", "folder", tiny_folder, "-o", tmp_path / "out", "--limit", "1")
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    assert [row["stem"] for row in scores["per_pair"]] == ["a"]


def test_one_kind_alone_is_compared_when_asked_for(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path
) -> None:
    for kinds, f1 in (("added", 0.2), ("both", 0.2)):
        out = tmp_path / kinds
        run(app, "evaluate", "folder", tiny_folder, "-o", out, "--count", kinds)
        scores = json.loads((out / "scores.json").read_text())
        assert scores["f1_macro"] == pytest.approx(f1)
    assert scores["protocol"]["counted"] == "removed and added"


def test_other_methods_on_the_same_pairs_are_printed(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    published = {"a": {"other": 0.5}, "b": {"other": 0.25, "third": 0.125}}
    (tiny_folder / "published_f1.json").write_text(json.dumps(published))
    run(app, "evaluate", "folder", tiny_folder, "-o", tmp_path / "out")
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["method", "pairs", "F1", "ours"] in lines
    assert ["other", "2", "0.375", "0.200"] in lines
    assert ["third", "1", "0.125", "0.000"] in lines
    assert ["a", "other", "0.500", "0.400"] in lines


def test_what_cannot_be_shown_is_refused_before_anything_is_computed(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    with pytest.raises(SettingsError, match="nowhere"):
        run(app, "evaluate", "folder", tiny_folder, "-o", out, "--show", "nowhere")
    with pytest.raises(SettingsError, match="KEY=VALUE"):
        run(app, "evaluate", "folder", tiny_folder, "-o", out, "--set", "tau")
    with pytest.raises(DatasetError, match="expected ROOT"):
        run(app, "evaluate", "vl-cmu-cd", tiny_folder, "-o", out)
    assert not out.exists()


def test_figures_without_matplotlib_are_refused_at_once(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    with pytest.raises(OutputError, match=r"pip install 'zeroscd\[figures\]'"):
        run(app, "evaluate", "folder", tiny_folder, "-o", tmp_path / "out", "--figures")
    assert not (tmp_path / "out").exists()


def test_after_ctrl_c_evaluate_says_how_to_go_on(
    app: typer.Typer,
    toy: ModuleType,
    tiny_folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(toy.ToyDetector, "detect", stop)
    assert run(app, "evaluate", "folder", tiny_folder, "-o", tmp_path / "out") == INTERRUPTED
    assert "same command again" in capsys.readouterr().err
    assert not (tmp_path / "out" / "scores.json").exists()


def test_the_size_of_the_former_cache_is_accepted_with_a_warning(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = "ablate", "folder", tiny_folder, "-o", tmp_path / "out", "--over", "tau=1"
    assert not run(app, *words)
    assert "cache" not in capsys.readouterr().err
    assert not run(app, *words, "--cache-gb", "1")
    assert "warning: --cache-gb has no effect" in capsys.readouterr().err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "ablation.json",
        "tables.md",
        "tables.tex",
        "report.html",
        "runs",
    }


def test_the_presets_own_tau_is_a_point_like_others(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert not run(app, "ablate", "folder", tiny_folder, "-o", out, "--over", "tau=none,0.65")
    assert "0.754" in (out / "report.html").read_text()  # the paper's, for the other point


def test_ablate_prints_the_curve_beside_the_papers(
    app: typer.Typer, tiny_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    run(app, "ablate", "folder", tiny_folder, "-o", out, "--over", "tau=0.6:0.7:0.05")
    shown = [line.split() for line in capsys.readouterr().out.splitlines()]
    rows = [[cell for cell in line if cell != ">"] for line in shown]
    assert ["0.65", "0.200", "0.267", "0.200", "0.250", "0.167", "0.754"] in rows
    page = (out / "report.html").read_text()
    assert "paper, VL-CMU-CD" in page
    assert "<li>best F1 <span>0.200</span></li>\n<li>tau <span>0.6</span></li>" in page
    assert page.count("<polyline") == 3  # ours and the paper's F1, then precision over recall
    assert len(json.loads((out / "ablation.json").read_text())["points"]) == 3


def test_the_remaining_time_counts_only_what_was_computed_now() -> None:
    seconds = iter([0.0, 100.0, 160.0, 160.0])
    bar = Bar(clock=lambda: next(seconds))
    bar.begin(10)
    for _ in range(3):
        bar.advance("old", reused=True)
    assert bar.remaining() == ""
    bar.advance("new", reused=False)  # 60 s for one pair, six are left
    assert bar.remaining() == "0:06:00 left"
