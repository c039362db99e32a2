from __future__ import annotations

import contextlib
import dataclasses
import inspect
import json
import pickle
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zeroscd.errors import SettingsError
from zeroscd.renamed import RenamedWarning
from zeroscd.settings import (
    PAPER_RULES,
    PRESETS,
    RANGES,
    THRESHOLDS,
    AlignSettings,
    ChangeSettings,
    RefineSettings,
    SegmentSettings,
    Settings,
    evidence_settings,
    is_threshold,
    leaf_names,
    leaf_values,
    preset,
)
from zeroscd.settings.names import OLD_NAMES

BRANCHES = (AlignSettings, ChangeSettings, SegmentSettings, RefineSettings)


def flat(settings: Settings) -> dict[str, Any]:
    leaves: dict[str, Any] = {}
    for name, value in settings.to_dict().items():
        leaves.update(value if isinstance(value, dict) else {name: value})
    return leaves


def test_every_leaf_has_a_name_of_its_own() -> None:
    names = [f.name for part in BRANCHES for f in dataclasses.fields(part)]
    top = [f.name for f in dataclasses.fields(Settings)]
    assert len(set(names + top)) == len(names + top)
    assert set(leaf_names()) == {"rules", *flat(Settings())}


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("tau", "0.6", 0.6),
        ("tau", "none", None),
        ("tau", None, None),
        ("tau", 1, 1.0),
        ("search_radius", "2", 2),
        ("verify", "overlap", "overlap"),
        ("frame", "t0", "t0"),
        ("encoder", "dinov2-s", "dinov2-s"),
        ("layer", "9", 9),
        ("layer", "None", None),
    ],
)
def test_one_leaf_changes_and_no_other(name: str, text: object, value: object) -> None:
    before = Settings(change=ChangeSettings(tau=0.3))
    after = before.override({name: text})
    assert flat(after) == {**flat(before), name: value}
    assert type(flat(after)[name]) is type(value)
    assert flat(before) == flat(Settings(change=ChangeSettings(tau=0.3)))


def test_later_overrides_win() -> None:
    settings = Settings().override({"verify": "off", "rules": "paper", "beta": "0.4"})
    assert settings.refine.verify == "overlap"
    assert settings.refine.beta == 0.4


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("tua", "0.6", "unknown setting 'tua'; did you mean tau? (`zeroscd settings` lists them"),
        ("Beta", "0.6", "unknown setting 'Beta'; did you mean beta?"),
        ("colour", "red", "unknown setting 'colour'; `zeroscd settings` lists them all"),
        ("t" * 1000, 1, f"unknown setting '{'t' * 79}...; `zeroscd settings` lists them all"),
        ("align", "mutual", "unknown setting 'align'"),
        ("verify", "maybe", "choose one of: overlap, iou, off"),
        ("matching", "", "choose one of: argmax, mutual"),
        ("search_radius", "1.5", "needs a int"),
        ("search_radius", "", "needs a int"),
        ("search_radius", 1.5, "needs a int"),
        ("seed", float("inf"), "needs a int"),
        ("search_radius", "-1", "must lie between 0 and 32, not at '-1'"),
        ("side_px", 0, "must lie between 64 and 8192"),
        ("alpha", "1.01", "must lie between 0 and 1"),
        ("tau", -0.1, "must lie between 0 and 2"),
        ("tau", "high", "needs a float"),
        ("tau", 10**400, "needs a float"),
        ("seed", 10**400, f"not at {10**79}..."),
        pytest.param("seed", 10**5000, "not at a number of thousands of digits", id="seed-huge"),
        pytest.param("tau", 10**5000, "needs a float", id="tau-huge"),
        pytest.param("rules", 10**5000, "choose: paper", id="rules-huge"),
        ("tau", "nan", "needs a float"),
        ("alpha", "inf", "needs a float"),
        ("alpha", None, "needs a float"),
        ("alpha", [0.5], "needs a float"),
        ("rules", "ours", "choose: paper"),
    ],
)
def test_a_wrong_override_is_one_line_that_names_the_choices(
    name: str, value: object, said: str
) -> None:
    with pytest.raises(SettingsError) as refusal:
        Settings().override({name: value})
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


@given(st.text(max_size=12), st.one_of(st.none(), st.text(max_size=8), st.floats(), st.integers()))
def test_no_override_raises_anything_but_a_settings_error(name: str, value: object) -> None:
    for leaf in (name, *leaf_names()):
        with contextlib.suppress(SettingsError, RenamedWarning):  # Hypothesis finds old names, too
            Settings().override({leaf: value})


def test_the_papers_rules_are_the_literal_reading() -> None:
    """The table of docs/method.md, column "literal"."""
    literal = Settings().override({"rules": "paper"})
    assert literal.align.matching == "argmax"
    assert literal.align.inlier_patches == 1.25
    assert literal.align.estimator == "ransac"
    assert literal.align.refine_radius == 0
    # A threshold belongs to its encoder: lite has none that holds for every pair.
    assert PRESETS["lite"].override({"rules": "paper"}).change.threshold == "pair"
    assert {PRESETS[name].change.threshold for name in ("paper", "dinov2-b")} == {"encoder"}
    assert literal.change.sampling == "nearest"
    assert literal.change.search_radius == 0
    assert literal.change.coarse_raster == "patch"
    assert literal.change.coarse_frames == "t0"
    assert literal.refine.verify == "overlap"
    assert literal.refine.alpha == 0.8
    assert literal.refine.beta == 0.7
    assert literal.refine.partial_segments == "whole"
    assert literal.segment.prompting == "everything"


@pytest.mark.parametrize("name", PRESETS)
def test_the_papers_rules_undo_what_a_preset_does_differently(name: str) -> None:
    literal = flat(PRESETS[name].override({"rules": "paper"}))
    plain = flat(Settings().override({"rules": "paper"}))
    assert {key: literal[key] for key in PAPER_RULES} == {key: plain[key] for key in PAPER_RULES}
    # Nothing of the refinement may survive: every rule there is an open point of the paper.
    assert {f.name for f in dataclasses.fields(RefineSettings)} <= set(PAPER_RULES)


def test_what_only_weighs_evidence_is_a_threshold_and_nothing_else() -> None:
    refining = {f.name for f in dataclasses.fields(RefineSettings)}
    fitting = {"tau", "threshold", "background_quantile", "tau_share", "coarse_raster"}
    assert refining | fitting | {"consensus", "frame", "judge", "vegetation"} == THRESHOLDS
    assert is_threshold("beta")
    assert not is_threshold("side_px")


def test_every_number_has_its_range_and_every_preset_keeps_to_it() -> None:
    numbers = {
        f.name
        for part in (Settings, *BRANCHES)
        for f in dataclasses.fields(part)
        if type(f.default) in (int, float) or f.name in ("tau", "layer", "pred_iou_thresh")
    }
    assert set(RANGES) == numbers
    for settings in (Settings(), *PRESETS.values()):
        leaves = flat(settings)
        assert all(
            low <= leaves[name] <= high
            for name, (low, high) in RANGES.items()
            if leaves[name] is not None
        )


@given(st.sampled_from(sorted(RANGES)), st.floats(0, 1))
def test_both_ends_of_a_range_may_be_taken_and_nothing_beyond(name: str, share: float) -> None:
    low, high = RANGES[name]
    for value in (low, high, int(low + share * (high - low))):
        if low <= value:
            assert flat(Settings().override({name: value}))[name] == value
    for value in (low - 1, high + 1):
        with pytest.raises(SettingsError, match="must lie between"):
            Settings().override({name: value})


def test_the_rules_name_settings_that_exist() -> None:
    assert set(PAPER_RULES) <= set(leaf_names())


@pytest.mark.parametrize("name", PRESETS)
def test_presets_are_found_by_name_and_can_be_written_as_json(name: str) -> None:
    settings = preset(name)
    assert settings == PRESETS[name]
    assert json.loads(json.dumps(settings.to_dict())) == settings.to_dict()


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_survives_its_own_values_as_typed_text(name: str) -> None:
    settings = preset(name)
    typed = {key: str(value) for key, value in flat(settings).items()}
    assert settings.override(typed) == settings


def test_an_unknown_preset_is_one_line_that_names_the_known() -> None:
    with pytest.raises(
        SettingsError,
        match=re.escape("unknown preset 'ligth'; did you mean lite? (choose one of: lite"),
    ):
        preset("ligth")


def test_settings_cannot_be_edited() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Settings().frame = "t0"  # type: ignore[misc]


def test_evidence_settings_forget_the_thresholds_and_nothing_else() -> None:
    lite = PRESETS["lite"]
    plain, own = leaf_values(Settings()), leaf_values(lite)
    expected = {name: (plain if name in THRESHOLDS else own)[name] for name in own}
    assert leaf_values(evidence_settings(lite)) == expected == flat(evidence_settings(lite))
    assert evidence_settings(lite) != lite


def test_help_says_of_every_setting_what_it_may_be_what_it_is_and_what_it_does() -> None:
    lines = str(inspect.getdoc(Settings)).splitlines()
    shown = {line.split()[0] for line in lines if line.startswith("    ") and line.split()}
    assert shown == {*flat(Settings()), "align:", "change:", "segment:", "refine:"}
    alpha = "alpha (0 to 1; default 0.8; paper 0.8; threshold): share of coarse change above which"
    for described in (Settings, RefineSettings):
        assert any(
            line.strip().startswith(alpha) for line in str(inspect.getdoc(described)).splitlines()
        )
    assert any("layer (1 to 1000 or none; default none): block" in line for line in lines)
    assert any("verify (overlap, iou or off; default iou; paper overlap" in line for line in lines)
    assert any("0 to 0.5 of the photo's shorter side" in line for line in lines)


@pytest.mark.parametrize(("old", "new"), OLD_NAMES.items())
def test_an_old_name_works_and_warns_with_the_new_one(old: str, new: str) -> None:
    segmenting = new in {f.name for f in dataclasses.fields(SegmentSettings)}
    holder: Any = SegmentSettings if segmenting else RefineSettings
    message = f"{old} is now {new}; the old name will be gone in zeroscd 0.3"
    with pytest.warns(DeprecationWarning, match=f"setting {message}") as warned:
        changed = Settings().override({old: "1"})
    assert warned[0].filename == __file__
    assert flat(changed) == {**flat(Settings()), new: 1}
    with pytest.warns(DeprecationWarning, match=message) as warned:
        built = holder(**{old: 1})
    assert warned[0].filename == __file__
    assert built == holder(**{new: 1})
    with pytest.warns(DeprecationWarning, match=message) as warned:
        assert getattr(built, old) == 1
    assert warned[0].filename == __file__
    with pytest.warns(DeprecationWarning, match=message):
        assert is_threshold(old) == (holder is RefineSettings)


def test_old_names_stand_for_settings_that_exist_and_are_none_themselves() -> None:
    assert set(OLD_NAMES.values()) <= set(leaf_names())
    assert not set(OLD_NAMES) & set(leaf_names())


def test_a_field_is_not_given_by_both_of_its_names() -> None:
    with pytest.raises(TypeError, match="min_width are one field; give it once"):
        RefineSettings(least_width=0.1, min_width=0.2)  # type: ignore[call-arg]


def test_settings_survive_pickling_and_replacing() -> None:
    for settings in PRESETS.values():
        assert pickle.loads(pickle.dumps(settings)) == settings  # noqa: S301 - our own
        assert dataclasses.replace(settings.refine, beta=0.1).beta == 0.1
