"""What `benchmarks/drive.py` draws and counts, by hand."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.export.table import changes_schema, pairs_schema, write_parquet
from zeroscd.survey.events import Event, write_events

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import ModuleType

    from numpy.typing import NDArray


@pytest.fixture(scope="module")
def odometry(load_script: Callable[[str], ModuleType]) -> ModuleType:
    return load_script("odometry")


@pytest.fixture(scope="module")
def scene(load_script: Callable[[str], ModuleType], odometry: ModuleType) -> ModuleType:
    assert odometry.__name__ == "odometry"  # the other scripts import it
    return load_script("drive_scene")


@pytest.fixture(scope="module")
def scoring(load_script: Callable[[str], ModuleType], scene: ModuleType) -> ModuleType:
    assert scene.__name__ == "drive_scene"
    return load_script("drive_score")


def turn(degrees: float) -> NDArray[np.float64]:
    """Rotate a camera to the right: what was ahead moves left."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]])


def test_a_path_adds_up_turns_and_lengths(odometry: ModuleType) -> None:
    straight = odometry.Step(np.eye(3), np.array([0.0, 0.0, -1.0]), 2.0)
    # Six metres ahead, then a turn to the right: the first camera is behind and to the right.
    corner = odometry.Step(turn(90), turn(90) @ (0.0, 0.0, -1.0), 2.0)
    poses = odometry.path_of([straight, straight, corner, straight])
    assert [(one.x_m, one.z_m) for one in poses] == [
        pytest.approx(each) for each in ((0, 0), (0, 2), (0, 4), (0, 6), (2, 6))
    ]
    assert [math.degrees(one.heading) for one in poses] == pytest.approx([0, 0, 0, 90, 90])


def test_unknown_lengths_lie_between_and_outliers_do_not_count(odometry: ModuleType) -> None:
    steps = [
        odometry.Step(np.eye(3), np.array([0.0, 0.0, -1.0]), length_m)
        for length_m in (4.0, None, 6.0, 13.0, 6.0)
    ]
    z_m = [one.z_m for one in odometry.path_of(steps)]
    # Medians of three: 5, 6, 6, 9.5, of which the unknown one is halfway between 5 and 6.
    assert np.diff(z_m) == pytest.approx([5.0, 5.5, 6.0, 6.0, 9.5])


def test_a_camera_that_looks_down_moves_up_in_its_own_frame(odometry: ModuleType) -> None:
    pitch = math.radians(10)
    ahead = np.array([0.0, -math.sin(pitch), math.cos(pitch)])
    (start, end) = odometry.path_of([odometry.Step(np.eye(3), -ahead, 3.0)])
    assert start.pitch == pytest.approx(pitch)
    assert (end.x_m, end.z_m) == pytest.approx((0, 3))
    right, down, depth = start.to_camera(0.0, 20.0)
    assert math.atan2(down, depth) == pytest.approx(math.atan2(1.4, 20) - pitch)
    assert right == 0


def test_spots_go_to_the_place_and_back(odometry: ModuleType) -> None:
    pose = odometry.Pose(3.0, 5.0, math.radians(90), 0.0)
    assert pose.to_place(2.0, 10.0) == pytest.approx((13.0, 3.0))
    assert pose.to_camera(13.0, 3.0) == pytest.approx((2.0, 1.4, 10.0))


def test_a_thing_stands_where_the_model_says_and_as_tall(
    scene: ModuleType, odometry: ModuleType
) -> None:
    blank = np.zeros((360, 480, 3), np.uint8)
    shot = scene.Shot(
        name="p00_0",
        when="new",
        place=0,
        taken="",
        frame=scene.Frame("frame", blank, blank[..., 0]),
        pose=odometry.Pose(0.0, 0.0, 0.0, 0.0),
        pixels=blank.copy(),
        truth=blank[..., 0].copy(),
    )
    cut = scene.CutOut(scene.CAR, np.full((50, 100, 4), 255, np.uint8), "another")
    scene._pasted(shot, cut, (0.0, 20.0)).into(shot, 7)
    rows, columns = np.nonzero(shot.truth == 7)
    focal_px = 38 * 600 / math.hypot(36, 24)
    assert rows.max() + 0.5 == pytest.approx(179.5 + focal_px * 1.4 / 20, abs=1)
    assert np.ptp(rows) + 1 == pytest.approx(focal_px * 1.9 / 20, abs=1)
    assert np.ptp(columns) + 1 == 2 * (np.ptp(rows) + 1)
    assert columns.mean() == pytest.approx(239.5, abs=1)
    assert scene._pasted(shot, cut, (0.0, -20.0)) is None


def event(number: int, photo: str, **values: Any) -> Event:
    return Event(
        **{
            "id": number,
            "kind": "added",
            "score": 0.5,
            "sightings": 1,
            "views": 1,
            "missed_by": 0,
            "best_pair": photo,
            "best_region": number,
            "best_photo": photo,
            "photos": (photo,),
            "regions": ((photo, number),),
            "first_seen": None,
            "last_seen": None,
            "longitude": 0.0,
            "latitude": 0.0,
            "position": "bearings",
            "uncertainty_m": 4.0,
            **values,
        }
    )


def square(left: int) -> list[list[list[int]]]:
    return [[[left, 0], [left + 10, 0], [left + 10, 10], [left, 10]]]


def test_each_event_counts_as_what_its_regions_show(scoring: ModuleType, tmp_path: Path) -> None:
    folder, changes = tmp_path / "drive", tmp_path / "changes"
    (folder / "truth").mkdir(parents=True)
    changes.mkdir()
    numbers, traffic = np.zeros((20, 60), np.uint8), np.zeros((20, 60), np.bool_)
    numbers[:10, :10], numbers[:10, 10:20], traffic[:10, 20:30] = 1, 101, True
    Image.fromarray(numbers).save(folder / "truth" / "p00_0.png")
    Image.fromarray(traffic).save(folder / "truth" / "p00_0_movers.png")
    north_deg = 3 / 111_195
    thing = {"thing": 1, "latitude": north_deg, "longitude": 0.0, "photos": ["p00_0", "p00_2"]}
    missed = {**thing, "thing": 2}
    (folder / "truth.json").write_text(json.dumps({"things": [thing, missed]}))
    lefts = (0, 0, 10, 20, 40)  # the thing, once more, a passer-by, traffic, nothing
    rows = [
        {
            "pair": "p",
            "region": number,
            "kind": "added",
            "frame": "t1",
            "height": 20,
            "width": 60,
            "polygon_xy": square(left),
        }
        for number, left in enumerate(lefts, 1)
    ]
    write_parquet(changes / "changes.parquet", rows, changes_schema())
    pair = {"pair": "p", "before": "../old/p00_1.jpg", "after": "../new/p00_0.jpg"}
    write_parquet(changes / "pairs.parquet", [{**pair, "status": "ok"}], pairs_schema())
    write_events(changes, [event(number, "p") for number in range(1, 6)])
    found = scoring.score(changes, scoring.Truth.read(folder))
    (position,) = found.pop("positions")
    assert found == {
        "things": 2,
        "things_detected": 1,
        "found": 1,
        "double": 1,
        "events": 5,
        "false_passers": 1,
        "false_traffic": 1,
        "false_other": 1,
    }
    assert position == {
        "thing": 1,
        "sightings": 1,
        "photos": 2,
        "position": "bearings",
        "error_m": pytest.approx(3.0, abs=0.01),
        "uncertainty_m": 4.0,
    }


def test_sums_over_drives_keep_the_two_kinds_of_position_apart(scoring: ModuleType) -> None:
    def drive(*errors_m: float, position: str) -> dict[str, Any]:
        found = [{"position": position, "error_m": one, "uncertainty_m": 4.0} for one in errors_m]
        return {**dict.fromkeys(scoring.SUMS, 1), "positions": found}

    total = scoring.add_up([drive(1.0, 2.0, 9.0, position="bearings"), drive(position="camera")])
    assert total["found"] == 2
    assert (total["bearings"], total["bearings_within"]) == (3, 2)
    assert (total["bearings_median_m"], total["bearings_max_m"]) == (2.0, 9.0)
    assert (total["camera"], total["camera_median_m"]) == (0, None)
