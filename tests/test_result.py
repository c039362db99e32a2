"""A result in a notebook, for other packages, and read again."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib import pyplot as plt

import zeroscd
from zeroscd.detector import Detector
from zeroscd.errors import DatasetError
from zeroscd.export.overlay import draw_overlay
from zeroscd.export.summary import summary
from zeroscd.models import Models

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings

CAR, SIGN = (32, 96, 64, 48), (160, 32, 32, 48)
SHIFT = np.array([[1.0, 0, 32], [0, 1, -16], [0, 0, 1]])


class Heard:
    """Keeps what it hears."""

    def __init__(self) -> None:
        self.total, self.stems = 0, list[str]()

    def begin(self, total: int) -> None:
        self.total = total

    def advance(self, stem: str, *, reused: bool) -> None:
        assert not reused
        self.stems.append(stem)


@pytest.fixture
def scene(draw_scene: Any) -> Any:
    return draw_scene(SHIFT, removed=[CAR], added=[SIGN])


@pytest.fixture
def detector(toy_encoder: PatchEncoder, plain_settings: Settings, scene: Any) -> Detector:
    return Detector(plain_settings, Models(toy_encoder, scene.segmenter()))


@pytest.fixture
def result(detector: Detector, scene: Any) -> ChangeResult:
    return detector.detect(scene.before, scene.after)


def test_a_result_says_in_two_short_lines_what_it_is(result: ChangeResult) -> None:
    text = repr(result)
    assert len(text) < 400
    first, second = text.splitlines()
    assert first.startswith("<ChangeResult: 1 region added, 1 removed; ")
    assert second == " array -> array, 256 x 192, frame t1, preset custom, aligned>"


def test_a_notebook_shows_the_report_in_a_frame_of_its_own(result: ChangeResult) -> None:
    shown = result._repr_html_()
    assert shown.startswith('<iframe sandbox="allow-scripts" ')
    assert shown.count("<") == 2  # the report is text inside an attribute
    assert "1 region added, 1 removed" in shown


def test_going_through_a_result_goes_through_its_regions(result: ChangeResult) -> None:
    assert list(result) == list(result.regions)
    assert len(list(result)) == 2


def test_the_overlay_is_drawn_and_plotted(result: ChangeResult) -> None:
    np.testing.assert_array_equal(result.overlay(), draw_overlay(result))
    axes = result.plot()
    assert axes.get_title() == summary(result)
    (image,) = axes.get_images()
    np.testing.assert_array_equal(image.get_array(), result.overlay())
    assert result.plot(axes) is axes
    plt.close("all")


def test_the_values_are_those_of_changes_json(result: ChangeResult, tmp_path: Path) -> None:
    result.save(tmp_path)
    saved = json.loads((tmp_path / "changes.json").read_text())
    assert json.loads(json.dumps(result.to_dict())) == saved


@pytest.mark.parametrize("name", [".", "changes.json"])
def test_what_was_saved_is_loaded_again(result: ChangeResult, tmp_path: Path, name: str) -> None:
    result.save(tmp_path)
    loaded = zeroscd.load(tmp_path / name)
    for mask in ("mask", "removed", "added", "unknown"):
        np.testing.assert_array_equal(getattr(loaded, mask), getattr(result, mask))
        assert getattr(loaded, mask).dtype == np.bool_
    assert loaded.regions == result.regions
    assert list(loaded) == list(result)
    assert loaded.frame == result.frame
    assert isinstance(loaded.alignment, zeroscd.Alignment)
    assert isinstance(result.alignment, zeroscd.Alignment)
    np.testing.assert_array_equal(loaded.alignment.t1_from_t0, result.alignment.t1_from_t0)
    assert loaded.values["preset"] == "custom"


def test_photos_that_were_not_aligned_are_loaded_with_the_reason(
    result: ChangeResult, tmp_path: Path
) -> None:
    reason = zeroscd.NotAligned(reason="too few matches", inliers=3, matches=9)
    replace(result, alignment=reason).save(tmp_path)
    assert zeroscd.load(tmp_path).alignment == reason


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, r"changes.json cannot be read: No such file or directory; give a folder"),
        ("{", r"changes.json is no JSON: .*; compare"),
        ('{"schema": 2}', r"is no changes.json of schema 1"),
        ("[]", r"is no changes.json of schema 1"),
        ('{"schema": 1}', r"mask.png cannot be read"),
    ],
)
def test_what_cannot_be_loaded_is_named(tmp_path: Path, content: str | None, message: str) -> None:
    if content is not None:
        (tmp_path / "changes.json").write_text(content)
    with pytest.raises(DatasetError, match=message) as caught:
        zeroscd.load(tmp_path)
    assert "\n" not in str(caught.value)


def test_an_incomplete_file_is_named(result: ChangeResult, tmp_path: Path) -> None:
    result.save(tmp_path)
    values = result.to_dict()
    del values["regions"]
    (tmp_path / "changes.json").write_text(json.dumps(values))
    with pytest.raises(DatasetError, match=r"changes.json is not complete: 'regions'"):
        zeroscd.load(tmp_path)


def test_pairs_are_compared_one_after_the_other_and_counted(
    detector: Detector, scene: Any, result: ChangeResult
) -> None:
    heard = Heard()
    pairs = [(scene.before, scene.after), (scene.before, scene.before)]
    first, second = detector.detect_many(pairs, progress=heard)
    np.testing.assert_array_equal(first.mask, result.mask)
    assert not second.mask.any()
    assert (heard.total, heard.stems) == (2, ["1", "2"])


def test_without_supervision_there_is_one_line(
    result: ChangeResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "supervision", None)
    with pytest.raises(zeroscd.OutputError, match="run: pip install supervision"):
        result.to_supervision()


def test_supervision_reads_the_regions(result: ChangeResult) -> None:
    pytest.importorskip("supervision")  # of its dependencies one would replace our OpenCV
    found = result.to_supervision()
    assert found.data["class_name"].tolist() == [region.kind for region in result.regions]
    assert found.confidence.tolist() == pytest.approx([one.score for one in result.regions])
    at = found.data["class_name"].tolist().index("added")
    np.testing.assert_array_equal(found.mask[at], result.added)
    x, y, w, h = result.regions[at].bbox_xywh
    assert found.xyxy[at].tolist() == [x, y, x + w, y + h]
    union = found.mask.any(axis=0)
    assert np.count_nonzero(union ^ result.mask) <= 0.02 * np.count_nonzero(union)


def test_supervision_gets_nothing_where_nothing_changed(detector: Detector, scene: Any) -> None:
    pytest.importorskip("supervision")
    assert len(detector.detect(scene.before, scene.before).to_supervision()) == 0
