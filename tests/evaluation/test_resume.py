"""An evaluation that is killed goes on where it was, and ends with the same scores."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.errors import OutputError
from zeroscd.evaluation.datasets.catalogue import open_dataset
from zeroscd.evaluation.metrics import Counts
from zeroscd.evaluation.run import Run, evaluate
from zeroscd.evaluation.score_ledger import ScoreLedger
from zeroscd.evaluation.scoring import DistanceHistogram, KindHits, PairScore

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from numpy.typing import NDArray

PROGRAM = Path(__file__).parent / "toy.py"
PAIRS, RECORDED = 8, 3
PATIENCE_S = 30.0
SCORE = PairScore(
    stem="a",
    counts=Counts(tp=1, fp=2, fn=3, tn=4),
    seconds=0.5,
    stages={"features": 0.25},
    false_regions=2,
    in_view_px=9,
    histogram=DistanceHistogram(changed=(1, 2), unchanged=(3, 4)),
    kinds=KindHits(hit=2, right=1),
)


@pytest.fixture
def many_pairs(tmp_path: Path, save: Callable[[Path, NDArray[np.uint8]], Path]) -> Path:
    """Pairs that are told apart by the grey of their first photo."""
    root = tmp_path / "many"
    for number in range(PAIRS):
        before = np.full((40, 80, 3), number, np.uint8)
        after, mask = before.copy(), np.zeros((40, 80), np.uint8)
        after[:, : 8 + number] = 200
        mask[:, :16] = 255
        save(root / "t0" / f"{number}.png", before)
        save(root / "t1" / f"{number}.png", after)
        save(root / "mask" / f"{number}.png", mask)
    return root


def without_times(path: Path) -> dict[str, Any]:
    values: dict[str, Any] = json.loads(path.read_text())
    for row in values["per_pair"]:
        del row["seconds"]
    return values


def lines_in(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []


def start(*arguments: str | Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, str(PROGRAM), *map(str, arguments)]
    return subprocess.Popen(command, stdin=subprocess.PIPE)


def run(*arguments: Path) -> None:
    with start(*arguments) as process:
        assert process.wait() == 0


def wait_until(condition: Callable[[], bool]) -> None:
    """Wait for another process; it gets there by itself, however slow the machine is."""
    give_up = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < give_up
        time.sleep(0.005)


@pytest.mark.slow
def test_after_kill_9_no_pair_is_computed_twice_and_the_scores_are_the_same(
    many_pairs: Path, tmp_path: Path
) -> None:
    out, log = tmp_path / "out", tmp_path / "log"
    with start(many_pairs, out, log, str(RECORDED)) as process:
        wait_until(lambda: len(lines_in(out / "pairs.jsonl")) == RECORDED)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    assert len(lines_in(log)) == RECORDED
    assert not (out / "scores.json").exists()

    run(many_pairs, out, log)
    assert Counter(lines_in(log)) == {str(number): 1 for number in range(PAIRS)}

    whole = tmp_path / "whole"
    run(many_pairs, whole, tmp_path / "other log")
    assert without_times(out / "scores.json") == without_times(whole / "scores.json")


def test_after_ctrl_c_the_finished_pairs_are_kept(
    many_pairs: Path, tmp_path: Path, toy: ModuleType
) -> None:
    seen: list[int] = []

    def interrupt(photo: NDArray[np.uint8]) -> None:
        seen.append(int(photo[0, 0, 0]))
        if len(seen) == RECORDED:
            raise KeyboardInterrupt

    dataset = open_dataset("folder", many_pairs)
    detector = toy.ToyDetector.in_frame("t1")
    with pytest.raises(KeyboardInterrupt):
        evaluate(
            dataset, Run(detector=replace(detector, after_each=interrupt), out=tmp_path / "out")
        )
    assert len(lines_in(tmp_path / "out" / "pairs.jsonl")) == RECORDED - 1
    again: list[int] = []
    remember = replace(detector, after_each=lambda photo: again.append(int(photo[0, 0, 0])))
    evaluate(dataset, Run(detector=remember, out=tmp_path / "out"))
    assert again == list(range(RECORDED - 1, PAIRS))


def count_detections(dataset_root: Path, detector: Any, out: Path) -> int:
    seen: list[int] = []
    counting = replace(detector, after_each=lambda photo: seen.append(1))
    evaluate(open_dataset("folder", dataset_root), Run(detector=counting, out=out))
    return len(seen)


def test_only_what_changed_is_computed_again(
    tiny_folder: Path, tmp_path: Path, toy: ModuleType
) -> None:
    detector, out = toy.ToyDetector.in_frame("t1"), tmp_path / "out"
    assert count_detections(tiny_folder, detector, out) == 3
    assert count_detections(tiny_folder, detector, out) == 0
    path = tiny_folder / "t1" / "b.png"
    pixels = np.asarray(Image.open(path)).copy()
    pixels[0, 0] += 1
    Image.fromarray(pixels).save(path)
    assert count_detections(tiny_folder, detector, out) == 1
    pixels[:] = 0
    (tiny_folder / "ignore").mkdir()
    for stem in "abc":
        Image.fromarray(pixels).save(tiny_folder / "ignore" / f"{stem}.png")
    assert count_detections(tiny_folder, detector, out) == 3
    Image.fromarray(pixels + 255).save(tiny_folder / "ignore" / "b.png")
    assert count_detections(tiny_folder, detector, out) == 1
    other = replace(detector, settings=detector.settings.override({"tau": 0.6}))
    assert count_detections(tiny_folder, other, out) == 3
    (out / "masks" / "a.png").unlink()
    assert count_detections(tiny_folder, other, out) == 1


def test_a_line_that_a_crash_cut_short_is_ignored_and_does_not_spoil_the_next(
    tmp_path: Path,
) -> None:
    path = tmp_path / "pairs.jsonl"
    ScoreLedger(path).add("one", SCORE)
    ScoreLedger(path).add("two", SCORE)
    path.write_bytes(path.read_bytes()[:-40])
    ledger = ScoreLedger(path)
    assert ledger.get("one") == SCORE
    assert ledger.get("two") is None
    ledger.add("three", SCORE)
    assert ScoreLedger(path).get("three") == SCORE
    assert ScoreLedger(path).get("one") == SCORE


def test_a_ledger_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"pairs\.jsonl"):
        ScoreLedger(tmp_path / "nowhere" / "pairs.jsonl").add("one", SCORE)


def test_an_output_folder_that_is_a_file_is_refused(
    tiny_folder: Path, tmp_path: Path, toy: ModuleType
) -> None:
    (tmp_path / "out").write_text("in the way")
    with pytest.raises(OutputError, match="out"):
        evaluate(
            open_dataset("folder", tiny_folder),
            Run(detector=toy.ToyDetector.in_frame("t1"), out=tmp_path / "out"),
        )
