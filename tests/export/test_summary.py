from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from zeroscd.export import summary
from zeroscd.records import Alignment, FurtherPhoto

if TYPE_CHECKING:
    from zeroscd.result import ChangeResult


def test_the_summary_counts_and_measures(result: ChangeResult) -> None:
    assert summary.summary(result) == "1 region added, 1 removed; 6.3 % of the judged scene changed"


def test_more_than_one_region_is_plural(result: ChangeResult) -> None:
    removed = result.regions[0]
    several = replace(result, regions=(removed, replace(removed, id=2), replace(removed, id=3)))
    assert summary.summary(several).startswith("3 regions removed; ")


def test_no_change_is_said_plainly(nothing: ChangeResult) -> None:
    assert summary.summary(nothing) == "No change found"


def test_all_is_well_needs_no_warning(result: ChangeResult) -> None:
    assert summary.warnings(result) == []


def test_a_missing_alignment_is_a_warning_with_its_reason(not_aligned: ChangeResult) -> None:
    (warning,) = summary.warnings(not_aligned)
    assert "could not be aligned: only 3 of 50 matches agree. " in warning


def test_a_mostly_unknown_photo_is_a_warning(result: ChangeResult) -> None:
    unknown = np.ones_like(result.unknown)
    unknown[:, :20] = False
    (warning,) = summary.warnings(replace(result, unknown=unknown, unseen=unknown))
    assert warning.startswith("Only 25 % of the photo is visible in both photos")


def test_the_camera_motion_is_told_in_numbers(result: ChangeResult) -> None:
    sentence = summary.alignment_sentence(result)
    assert "40 of 50 matches agree (80 %)" in sentence
    assert "moved by 10 px, turned by 0.0° and scaled by 1.00" in sentence


def test_motion_of_a_perspective_is_taken_at_the_point_itself() -> None:
    # x' = 2x / (1 + x / 10): at x = 10 it is 10, with slope 2 / (1 + 1)^2 = 0.5 along x and
    # 1 / (1 + 1) = 0.5 along y, so no shift, no turn and half the scale.
    matrix = np.array([[2.0, 0, 0], [0, 1, 0], [0.1, 0, 1]])
    found = summary.motion(Alignment(t1_from_t0=matrix, inliers=4, matches=4), (10.0, 0.0))
    assert found == pytest.approx((0.0, 0.0, 0.5))


def test_coverage_names_what_was_judged_and_why_the_rest_was_not(result: ChangeResult) -> None:
    unknown = result.unknown.copy()
    unknown[:30, 60:] = True
    in_view = replace(result, unknown=unknown)
    assert summary.coverage_sentence(in_view) == (
        "75 % of the photo was judged. Hatched: 12 % not in view of both photos, "
        "12 % in surroundings that match too little."
    )
    assert summary.coverage_sentence(result).startswith(
        "88 % of the photo was judged. Hatched: 12 % not"
    )
    known = replace(result, unknown=np.zeros_like(result.unknown), unseen=result.unseen & False)
    assert summary.coverage_sentence(known) == "The whole photo was judged."


def test_a_pair_that_can_hardly_be_judged_is_a_warning(result: ChangeResult) -> None:
    unknown = np.ones_like(result.unknown)
    unknown[:, :9] = False  # of 80 columns
    assert summary.warnings(replace(result, unknown=unknown)) == []
    unknown[:, 7:9] = True
    (warning,) = summary.warnings(replace(result, unknown=unknown))
    assert warning.startswith("Only 8.8 % of the photo could be judged: elsewhere the photos match")


def test_further_photos_are_named_by_side_and_the_left_out_ones_with_the_reason(
    result: ChangeResult,
) -> None:
    assert summary.further_photos_sentence(result) == ""
    photo = replace(result.before, path="photos/b.jpg")
    old = FurtherPhoto(photo=photo, frame="t0")
    unnamed = FurtherPhoto(photo=replace(photo, path=None), frame="t1", left_out="no match.")
    with_one = replace(result, further_photos=(old,))
    assert summary.further_photos_sentence(with_one) == "Further photos of the place: before b.jpg."
    with_both = replace(result, further_photos=(unnamed, old))
    assert summary.further_photos_sentence(with_both) == (
        "Further photos of the place: before b.jpg. Left out: after (no name) (no match)."
    )
