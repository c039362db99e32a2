"""What `benchmarks/watch.py` draws and counts, by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.segments import Segment
from zeroscd.watch.place import View
from zeroscd.watch.tracks import Sighting

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from zeroscd.arrays import Mask

SIZE_HW = (120, 160)


@pytest.fixture(scope="module")
def watch(load_script: Callable[[str], ModuleType], pair_benchmark: ModuleType) -> ModuleType:
    names = (load_script("odometry").__name__, load_script("drive_scene").__name__)
    assert (*names, pair_benchmark.__name__) == ("odometry", "drive_scene", "pair")
    return load_script("watch")


def box(left: int, top: int, width: int, height: int) -> Mask:
    mask = np.zeros(SIZE_HW, bool)
    mask[top : top + height, left : left + width] = True
    return mask


def test_what_stays_is_in_every_later_pass_and_what_passes_in_one_or_two(
    watch: ModuleType,
) -> None:
    cut = np.full((10, 12, 4), 255, np.uint8)
    photo, movers = np.full((*SIZE_HW, 3), 40, np.uint8), box(0, 60, 80, 60)
    made = watch.make_passes(
        photo, movers, [SimpleNamespace(pixels=cut)], np.random.default_rng(3), shake_px=0.0
    )
    assert len(made.photos) == watch.FRAMES
    bright = np.array([photo.mean(axis=2) > 120 for photo in made.photos])
    for mask, first in zip(made.staying, watch.STAYING, strict=True):
        assert mask.sum() == 120
        shown = bright[:, mask].mean(axis=1) > 0.9
        assert shown.tolist() == [k >= first for k in range(watch.FRAMES)]
        assert not (mask & movers).any()
    staying = np.logical_or.reduce(made.staying)
    for mask in made.passing:
        assert not (mask & (staying | movers)).any()


def test_a_report_counts_as_what_three_tenths_of_it_show(watch: ModuleType) -> None:
    truth = {
        "staying": [box(0, 0, 20, 20)],
        "passing": [box(40, 0, 20, 20)],
        "traffic": [box(80, 0, 20, 20)],
    }
    found: set[int] = set()
    shown = [
        watch._shown(region, truth, found)
        for region in (
            box(0, 0, 60, 20),  # a third each of what stays, of nothing, and of what passes
            box(5, 5, 10, 10),
            box(40, 0, 60, 20),
            box(80, 0, 80, 20),
            box(80, 0, 66, 20),
        )
    ]
    assert shown == ["found", "double", "passing", "other", "traffic"]


def test_reports_are_counted_for_each_number_of_frames(watch: ModuleType) -> None:
    stays, passes = box(0, 0, 20, 20), box(40, 40, 20, 20)

    def view(*masks: Mask) -> View:
        segments = [Segment.from_mask(mask) for mask in masks]
        return View(
            sightings=tuple(
                Sighting(kind="added", score=0.5, segment=one) for one in segments if one
            ),
            unchanged=~np.logical_or.reduce([np.zeros(SIZE_HW, bool), *masks]),
            judged_fraction=1.0,
            reference_from_frame=np.eye(3),
        )

    class Place:
        reference = np.zeros((*SIZE_HW, 3), np.uint8)

    truth = {"staying": [stays], "passing": [passes], "traffic": []}
    views = [view(), view(stays, passes), view(stays, passes), view(stays), view(stays)]
    counts = {n: watch._count(Place(), views, truth, n) for n in (1, 3, 5)}
    assert [counts[n]["found"] for n in (1, 3, 5)] == [1, 1, 0]
    assert [counts[n]["passing"] for n in (1, 3, 5)] == [1, 0, 0]
    assert all(one["stayed"] == 1 and one["other"] == 0 for one in counts.values())
