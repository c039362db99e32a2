from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from zeroscd import bench
from zeroscd.bench import Measurement, Plan, Spread
from zeroscd.cli.main import run

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def plans(monkeypatch: pytest.MonkeyPatch) -> list[Plan]:
    """Measure nothing, but note what was to be measured."""
    asked: list[Plan] = []

    def measure(plan: Plan) -> Measurement:
        asked.append(plan)
        return Measurement(
            size_wh=plan.size_wh,
            runs=plan.runs,
            busy=plan.busy,
            import_seconds=1.25,
            load_seconds=0.5,
            first_seconds=1.75,
            total=Spread(median=0.75, least=0.7, most=0.9),
            stages={"encode": Spread(median=0.5, least=0.45, most=0.55)},
            peak_bytes=600_000_000,
            threads={"torch": 2},
        )

    monkeypatch.setattr(bench, "measure", measure)
    return asked


def test_bench_prints_every_stage_and_what_surrounds_it(
    plans: list[Plan], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["bench", "--runs", "3", "--set", "side_px=512"]) == 0
    assert plans == [Plan(size_wh=(512, 512), runs=3, overrides={"side_px": "512"})]
    assert capsys.readouterr().out.splitlines() == [
        "512 x 512, median (least to most) of 3 runs",
        "  encode   0.500 s  (0.450 to 0.550)",
        "  total    0.750 s  (0.700 to 0.900)",
        "import 1.2 s, load 0.5 s, first comparison 1.75 s",
        "peak memory 600 MB; threads: torch 2",
    ]


def test_every_size_is_timed_again_beside_busy_processes(
    plans: list[Plan], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["bench", "--size", "64x48", "--size", "96x64", "--busy", "3"]) == 0
    assert [(plan.size_wh, plan.busy) for plan in plans] == [
        ((64, 48), 0),
        ((64, 48), 3),
        ((96, 64), 0),
        ((96, 64), 3),
    ]
    heads = [line for line in capsys.readouterr().out.splitlines() if "runs" in line]
    assert heads[:2] == [
        "64 x 48, median (least to most) of 5 runs",
        "64 x 48, beside 3 busy processes, median (least to most) of 5 runs",
    ]


def test_bench_writes_one_entry_for_each_size(plans: list[Plan], tmp_path: Path) -> None:
    out = tmp_path / "new" / "bench.json"
    sizes = ["--size", "640x480", "--size", "1920x1080"]
    assert run(["bench", *sizes, "--set", "tau=0.9", "-o", str(out)]) == 0
    assert [plan.size_wh for plan in plans] == [(640, 480), (1920, 1080)]
    written = json.loads(out.read_text())
    assert [pair["size_wh"] for pair in written["pairs"]] == [[640, 480], [1920, 1080]]
    assert written["settings"]["change"]["tau"] == 0.9
    assert written["machine"]["cores"] >= 1


@pytest.mark.parametrize(
    "arguments",
    [
        ["--size", "big"],
        ["--preset", "nothing"],
        ["--set", "nothing=1"],
        ["--runs", "0"],
        ["--busy", "-1"],
    ],
)
def test_what_cannot_be_measured_is_one_line_and_starts_nothing(
    arguments: list[str],
    plans: list[Plan],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["bench", *arguments, "-o", str(tmp_path / "bench.json")]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ")
    assert len(captured.err.splitlines()) == 1
    assert plans == []
    assert list(tmp_path.iterdir()) == []
