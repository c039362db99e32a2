from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from PIL import Image

from zeroscd.cli.main import run

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType
    from typing import Protocol

    from numpy.typing import NDArray

    class Toy(Protocol):
        requests: list[tuple[str, str, dict[str, object]]]


SAMPLES = Path(str(files("zeroscd") / "samples"))
SCRIPT = Path(__file__).parents[2] / "scripts" / "make_demo_pair.py"


def pixels(name: str) -> NDArray[np.uint8]:
    with Image.open(SAMPLES / name) as picture:
        return np.asarray(picture, np.uint8) * (255 if picture.mode == "1" else 1)


@pytest.fixture(scope="module")
def recipe(load_module: Callable[[str, Path], ModuleType]) -> ModuleType:
    return load_module("make_demo_pair", SCRIPT)


def test_the_demo_compares_the_shipped_pair_in_the_working_folder(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    toy_detector: Toy,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["demo"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "report: zeroscd-demo/report.html"
    assert toy_detector.requests == [("lite", "auto", {})]
    with Image.open(tmp_path / "zeroscd-demo" / "mask.png") as mask:
        assert mask.size == (768, 640)


def test_the_pair_differs_where_its_truth_says_and_hardly_elsewhere(recipe: ModuleType) -> None:
    canvas_from_t0 = np.linalg.inv(view_matrix(recipe.BEFORE_VIEW))
    t1_from_t0 = view_matrix(recipe.AFTER_VIEW) @ canvas_from_t0
    before, gone, seen = (
        cv2.warpPerspective(picture, t1_from_t0, (768, 640))
        for picture in (pixels("before.jpg"), pixels("truth_removed_t0.png"), np.ones((640, 768)))
    )
    change = (gone > 0) | (pixels("truth_added_t1.png") > 0)
    around = cv2.dilate(change.astype(np.uint8), np.ones((25, 25))) > 0
    lit_alike = recipe.relit(before.astype(np.float32))
    difference = np.abs(cv2.blur(lit_alike - pixels("after.jpg"), (5, 5))).mean(axis=2)
    elsewhere = (seen > 0) & ~around
    assert np.median(difference[elsewhere]) < 3  # grey levels: noise and JPEG
    assert np.median(difference[change]) > 20


def view_matrix(view: list[tuple[int, int]]) -> NDArray[np.float64]:
    corners = np.array([(0, 0), (767, 0), (767, 639), (0, 639)], np.float32)
    matrix = cv2.getPerspectiveTransform(np.array(view, np.float32), corners)
    return np.asarray(matrix, np.float64)


@pytest.mark.slow
def test_the_demo_finds_the_dog_that_left_and_the_dog_that_came(tmp_path: Path) -> None:
    assert run(["demo", "-o", str(tmp_path)]) == 0
    for kind, truth in (("removed", "truth_removed_t0.png"), ("added", "truth_added_t1.png")):
        with Image.open(tmp_path / f"{kind}.png") as picture:
            found = np.asarray(picture) > 0
        dog = pixels(truth) > 0
        # Measured 0.92 of each dog; the rest of this margin is for other processors' rounding.
        assert found[dog].mean() > 0.8
        assert found[~dog].mean() < 0.15  # what lies behind the other dog has altered too


def test_the_samples_are_small_and_name_their_source() -> None:
    assert sum(path.stat().st_size for path in SAMPLES.iterdir()) < 400_000
    text = (SAMPLES / "README.md").read_text()
    assert "Aitzol Berasategi" in text
    assert "CC BY 4.0" in text
    assert "Changes made" in text
