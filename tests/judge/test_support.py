from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.judge.cues import Cues
from zeroscd.judge.support import MIN_SUPPORT, Knots, score_of, support_of

LIKELY = Cues(ring=0.22, excess=0.08, contrast=0.12, novelty=1.0, area=0.002)
SURE = Cues(ring=0.25, excess=0.15, contrast=0.18, novelty=1.0, area=0.002)
NOVEL = Cues(ring=0.0, excess=0.0, contrast=0.18, novelty=1.18, area=0.01)
cues = st.builds(
    Cues,
    ring=st.floats(0, 1),
    excess=st.floats(-1, 1),
    contrast=st.floats(-1, 1),
    novelty=st.floats(0, 2),
    area=st.floats(0, 1),
)


def test_the_knots_are_the_steps() -> None:
    assert support_of(LIKELY) == pytest.approx(MIN_SUPPORT["likely"])
    assert support_of(SURE) == pytest.approx(MIN_SUPPORT["sure"])
    assert support_of(NOVEL) == pytest.approx(MIN_SUPPORT["sure"])


@pytest.mark.parametrize("weaker", [{"ring": 0.1}, {"excess": 0.01}, {"contrast": 0.01}])
def test_an_aligned_region_is_as_weak_as_its_weakest_cue(weaker: dict[str, float]) -> None:
    assert support_of(replace(SURE, **weaker)) < MIN_SUPPORT["likely"]


def test_novelty_needs_an_area_and_contrast_but_no_verified_surroundings() -> None:
    assert support_of(replace(NOVEL, area=0.009)) == 0.0
    assert support_of(replace(NOVEL, contrast=0.0)) == 0.0
    assert support_of(replace(NOVEL, novelty=1.0)) == 0.0


@given(cues, st.sampled_from(["ring", "excess", "contrast", "novelty"]), st.floats(0, 0.5))
def test_more_of_a_cue_never_lowers_the_support(one: Cues, cue: str, more: float) -> None:
    stronger = replace(one, **{cue: getattr(one, cue) + more})
    assert 0.0 <= support_of(one) <= support_of(stronger) <= 1.0


@given(st.floats(-1, 3), st.floats(-1, 3))
def test_a_scale_rises_from_0_to_1(a: float, b: float) -> None:
    knots = Knots(0.0, 0.4, 1.0)
    low, high = sorted((a, b))
    assert 0.0 <= knots.support(low) <= knots.support(high) <= 1.0


def test_the_score_is_a_rising_share() -> None:
    scores = [score_of(step / 10) for step in range(11)]
    assert scores == sorted(scores)
    assert 0.0 < scores[0] < 0.02
    assert 0.8 < scores[-1] < 0.9
