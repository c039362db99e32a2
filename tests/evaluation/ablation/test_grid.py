"""Which settings are tried."""

from __future__ import annotations

import pytest

from zeroscd.errors import SettingsError
from zeroscd.evaluation.ablation.grid import combine, parse_axis


def test_a_range_ends_with_its_last_value_and_has_no_rounding_dust() -> None:
    assert parse_axis("tau=0.5:0.7:0.05").values == ("0.5", "0.55", "0.6", "0.65", "0.7")
    assert parse_axis("points_per_side=16:64:16").values == ("16", "32", "48", "64")
    assert parse_axis("x=1:2:0.4").values == ("1", "1.4", "1.8")


def test_a_value_that_is_given_twice_is_one_point() -> None:
    assert parse_axis("tau=1,0,1.0,none,0.0,1,none").values == ("1", "0", "none")


def test_a_setting_varies_along_one_axis_only() -> None:
    axes = [parse_axis("tau=1"), parse_axis("alpha=1"), parse_axis("tau=0.5")]
    with pytest.raises(SettingsError, match="--over names tau twice"):
        combine(axes)


@pytest.mark.parametrize(
    "text", ["tau", "tau=", "=1", "tau=1:2", "tau=a:b:c", "tau=0:1:0", "tau=1:0:0.1", "x=0:1:1e-9"]
)
def test_a_range_that_makes_no_sense_is_refused(text: str) -> None:
    with pytest.raises(SettingsError, match="--over needs"):
        parse_axis(text)


def test_values_are_combined_with_the_last_axis_changing_fastest() -> None:
    axes = [parse_axis("encoder=a,b"), parse_axis("tau=1,2")]
    assert combine(axes) == [
        {"encoder": "a", "tau": "1"},
        {"encoder": "a", "tau": "2"},
        {"encoder": "b", "tau": "1"},
        {"encoder": "b", "tau": "2"},
    ]
    assert [axis.is_numeric for axis in axes] == [False, True]
