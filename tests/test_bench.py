"""The measuring of a pair's time and memory, by hand and in a real process."""

from __future__ import annotations

import subprocess
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd import bench
from zeroscd.bench import Measurement, Plan, Spread, measure, parse_size, sample_pair, to_json
from zeroscd.errors import SettingsError, ZeroscdError

MEBIBYTE = 2**20


class ScriptedDetector:
    """Takes as long as it is told: one second more each time, as the fake clock counts."""

    def __init__(self, clock: FakeClock) -> None:
        self.clock = clock
        self.seen: list[tuple[int, ...]] = []

    def from_preset(self, name: str, *, device: str, overrides: object) -> ScriptedDetector:
        del name, device, overrides
        self.clock.now += 2.5  # loading
        return self

    def detect(self, before: np.ndarray, after: np.ndarray) -> SimpleNamespace:
        assert before.shape == after.shape
        self.seen.append(before.shape)
        took = float(len(self.seen))
        self.clock.now += took
        return SimpleNamespace(seconds={"encode": took * 0.75, "align": took * 0.25})


class FakeClock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> ScriptedDetector:
    detector = ScriptedDetector(FakeClock())
    module = ModuleType("zeroscd.detector")
    module.Detector = detector  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "zeroscd.detector", module)
    return detector


def test_the_first_comparison_is_told_apart_from_the_median_of_the_others(
    scripted: ScriptedDetector,
) -> None:
    found = bench.measure_here(Plan(size_wh=(64, 48), runs=4), clock=scripted.clock)
    assert scripted.seen == [(48, 64, 3)] * 5
    assert found.first_seconds == 1.0
    # The others took 2, 3, 4 and 5 seconds.
    assert found.total == Spread(median=3.5, least=2.0, most=5.0)
    assert found.stages["encode"] == Spread(median=2.625, least=1.5, most=3.75)
    assert found.stages["align"].median == pytest.approx(3.5 * 0.25)
    assert list(found.stages) == ["encode", "align"]
    assert found.load_seconds == 2.5
    assert found.import_seconds == 0.0


@given(st.lists(st.floats(0, 1e4), min_size=1, max_size=9))
def test_a_spread_is_ordered_and_lies_within_the_runs(seconds: list[float]) -> None:
    spread = Spread.of(seconds)
    assert spread.least <= spread.median <= spread.most
    assert spread.least == pytest.approx(min(seconds), abs=1e-4)
    assert spread.most == pytest.approx(max(seconds), abs=1e-4)


@given(st.integers(32, 8192), st.integers(32, 8192))
def test_a_size_is_read_as_width_before_height(width: int, height: int) -> None:
    assert parse_size(f"{width}x{height}") == (width, height)
    assert parse_size(f"{width}X{height}") == (width, height)


@pytest.mark.parametrize(
    "text", ["", "512", "512x", "x512", "512x31", "9000x512", "-64x64", "a x b"]
)
def test_a_size_that_is_none_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(SettingsError, match="for example 512x512") as caught:
        parse_size(text)
    assert "\n" not in str(caught.value)


def test_the_sample_pair_is_brought_to_the_size_asked_for() -> None:
    before, after = sample_pair((96, 64))
    assert before.shape == after.shape == (64, 96, 3)
    assert np.abs(before.astype(int) - after.astype(int)).mean() > 1  # two photos, not one twice


def test_peak_memory_grows_with_what_the_process_holds() -> None:
    low = bench.peak_bytes()
    if low is None:
        pytest.skip("this system does not tell the peak memory of a process")
    held = np.ones(64 * MEBIBYTE, np.uint8)
    high = bench.peak_bytes()
    assert high is not None
    assert high >= held.nbytes
    assert high >= low
    assert high < 2**40  # in bytes, not in a smaller unit


@pytest.mark.slow
def test_a_fresh_process_times_every_stage_of_the_method() -> None:
    found = measure(Plan(size_wh=(96, 64), runs=2, overrides={"side_px": 96}))
    assert {"encode", "align", "coarse", "segment", "refine"} <= set(found.stages)
    stages = sum(spread.least for spread in found.stages.values())
    assert 0 < stages <= found.total.most * 1.05  # stages do not overlap
    assert found.import_seconds > 0.05  # torch was not there before
    assert found.peak_bytes is None or 50 * MEBIBYTE < found.peak_bytes < 4096 * MEBIBYTE
    assert Measurement.from_json(to_json(Plan(), [found])["pairs"][0]) == found


def test_busy_processes_run_until_the_measuring_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[bytes]] = []

    def start(command: list[str]) -> subprocess.Popen[bytes]:
        started.append(popen(command))
        return started[-1]

    popen = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", start)
    with bench.spinning(2):
        assert [process.poll() for process in started] == [None, None]
    assert all(process.returncode for process in started)


def test_a_busy_process_ends_when_the_one_that_started_it_is_gone() -> None:
    orphaning = "from zeroscd import bench; bench.spinning(1).__enter__(); import os; os._exit(0)"
    # The output ends only when nobody holds it open, so when the spinner has ended, too.
    subprocess.run([sys.executable, "-c", orphaning], check=True, capture_output=True, timeout=60)


def test_what_a_fresh_process_refuses_is_our_own_error() -> None:
    with pytest.raises(ZeroscdError, match="unknown preset 'nothing'"):
        measure(Plan(preset="nothing"))
