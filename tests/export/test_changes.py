from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from zeroscd.export.changes import changes, changes_json

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.result import ChangeResult


def test_the_json_says_what_the_result_says(result: ChangeResult) -> None:
    found = json.loads(changes_json(result))
    settings = found.pop("settings")
    assert settings["refine"]["alpha"] == 0.8
    # mask: 20 x 10 removed and 8 x 8 added; known: 80 x 60 less the 10 x 60 that only t1 shows
    assert found.pop("changed_fraction") == pytest.approx((200 + 64) / (4800 - 600))
    assert found.pop("judged_fraction") == pytest.approx((4800 - 600) / 4800)
    assert found == {
        "schema": 1,
        "before": {"path": "photos/old street.jpg", "width": 80, "height": 60},
        "after": {"path": "photos/new.jpg", "width": 80, "height": 60},
        "frame": "t1",
        "preset": "lite",
        "alignment": {
            "t1_from_t0": [[1, 0, 10], [0, 1, 0], [0, 0, 1]],
            "inliers": 40,
            "matches": 50,
            "reason": None,
        },
        "regions": [
            {
                "id": 1,
                "kind": "removed",
                "score": 0.91,
                "area_px": 200,
                "bbox_xywh": [5, 10, 20, 10],
                "polygon_xy": [[[5, 10], [25, 10], [25, 20], [5, 20]]],
                "rle": {"size": [60, 80], "counts": "made up"},
                "frame": "t0",
                "support": 0.6,
                "at_border": False,
            },
            {
                "id": 2,
                "kind": "added",
                "score": 0.75,
                "area_px": 64,
                "bbox_xywh": [50, 30, 8, 8],
                "polygon_xy": [[[50, 30], [58, 30], [58, 38], [50, 38]]],
                "rle": {"size": [60, 80], "counts": "made up"},
                "frame": "t1",
                "support": 0.6,
                "at_border": False,
            },
        ],
        "seconds": {"features": 0.5, "segments": 1.25},
    }


def test_seconds_come_last_so_that_the_rest_can_be_compared(result: ChangeResult) -> None:
    assert list(changes(result))[-1] == "seconds"


def test_photos_that_were_not_aligned_have_a_reason_and_no_matrix(
    not_aligned: ChangeResult,
) -> None:
    assert changes(not_aligned)["alignment"] == {
        "t1_from_t0": None,
        "inliers": 3,
        "matches": 50,
        "reason": "only 3 of 50 matches agree",
    }


@pytest.mark.parametrize("path", ["straße.jpg", "broken \udcff name.jpg", 'a"b\n.jpg'])
def test_any_file_name_survives(named: Callable[[str], ChangeResult], path: str) -> None:
    assert json.loads(changes_json(named(path)))["before"]["path"] == path
