"""A geometry that the user knows is read, checked and used as it is."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.alignment.homography import apply
from zeroscd.alignment.known import known_alignment, read_geometry
from zeroscd.errors import SettingsError

if TYPE_CHECKING:
    from pathlib import Path

SHIFT = [[1.0, 0, 8], [0, 1, -4], [0, 0, 1]]
SAME = ((120, 160), (120, 160))


def test_a_camera_that_did_not_move_lays_edges_on_edges() -> None:
    found = known_alignment("none", sizes_hw=((120, 160), (60, 80)))
    corners = apply(found.t1_from_t0, np.array([[-0.5, -0.5], [159.5, 119.5]]))
    assert corners.ravel().tolist() == pytest.approx([-0.5, -0.5, 79.5, 59.5])
    assert (found.given, found.matches) == (True, 0)


def test_a_homography_is_brought_to_its_usual_scale() -> None:
    found = known_alignment(2 * np.array(SHIFT), sizes_hw=SAME)
    assert found.t1_from_t0.tolist() == SHIFT


FILES = {
    "rows": json.dumps(SHIFT),
    "named": json.dumps({"t1_from_t0": SHIFT}),
    "changes.json": json.dumps({"schema": 1, "alignment": {"t1_from_t0": SHIFT, "inliers": 9}}),
    "text": "1 0 8\n0 1 -4\n0 0 1\n",
    "commas": "1, 0, 8; 0, 1, -4; 0, 0, 1",
}


@pytest.mark.parametrize("text", FILES.values(), ids=FILES.keys())
def test_nine_numbers_are_read_from_json_or_text(tmp_path: Path, text: str) -> None:
    (tmp_path / "shift").write_text(text)
    np.testing.assert_array_equal(read_geometry(str(tmp_path / "shift")), SHIFT)


def test_none_is_no_file() -> None:
    assert read_geometry("none") == "none"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1 2 3",
        "[1, 2, 3]",
        "one 0 8 0 1 -4 0 0 1",
        "[[1" + "0" * 400 + ", 0, 8], [0, 1, -4], [0, 0, 1]]",
        '{"alignment": {"t1_from_t0": null}}',
        "nan",
    ],
)
def test_a_file_with_something_else_is_refused_by_name(tmp_path: Path, text: str) -> None:
    (tmp_path / "shift").write_text(text)
    with pytest.raises(SettingsError, match="shift holds no homography; give t1_from_t0 as 3 x 3"):
        read_geometry(str(tmp_path / "shift"))


def test_a_tiny_scale_is_a_scale_like_others() -> None:
    found = known_alignment(1e-6 * np.array(SHIFT), sizes_hw=SAME)
    assert found.t1_from_t0.ravel().tolist() == pytest.approx([1, 0, 8, 0, 1, -4, 0, 0, 1])


def test_a_file_that_is_not_there_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"cannot read nowhere: No such file.*give 'none' or"):
        read_geometry("nowhere")


WRONG: dict[str, tuple[Any, str]] = {
    "a word": ("fixed", "t1_from_t0 is 'fixed'; give 3 x 3 numbers or 'none'"),
    "singular": (np.diag([1.0, 0, 1]), "cannot be inverted"),
    "mirrored": ([[-1, 0, 160], [0, 1, 0], [0, 0, 1]], "mirrors or flattens"),
    "far too large": (np.diag([20.0, 20, 1]), "changes the scale 20 times"),
    "not finite": (np.full((3, 3), np.nan), "holds no homography"),
    "two rows": (np.eye(2), "holds no homography"),
}


@pytest.mark.parametrize(("given", "message"), WRONG.values(), ids=WRONG.keys())
def test_what_cannot_relate_two_photos_is_refused(given: Any, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        known_alignment(given, sizes_hw=SAME)
