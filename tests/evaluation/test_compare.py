"""Our row among published ones, and beside others on the same pairs."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from zeroscd.errors import DatasetError
from zeroscd.evaluation.compare import compare_with_baselines, table_among_published
from zeroscd.evaluation.datasets.catalogue import open_dataset
from zeroscd.evaluation.metrics import Counts
from zeroscd.evaluation.published import LATER, PAPER_TABLE, PAPER_TAU, published_for
from zeroscd.evaluation.run import Run, evaluate

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType

    from zeroscd.evaluation.scores import Scores


@pytest.fixture
def scores(tiny_folder: Path, tmp_path: Path, toy: ModuleType) -> Scores:
    dataset = open_dataset("folder", tiny_folder)
    return evaluate(dataset, Run(detector=toy.ToyDetector.in_frame("t1"), out=tmp_path / "out"))


def test_the_ten_rows_of_the_paper_have_its_printed_mean() -> None:
    assert len(PAPER_TABLE) == 10
    assert sum(PAPER_TABLE["ZeroSCD"]) / 3 == pytest.approx(82.7, abs=0.05)  # printed in the paper
    assert PAPER_TAU[0.65] == max(PAPER_TAU.values()) == PAPER_TABLE["ZeroSCD"][0] / 100


def test_published_rows_are_sorted_and_complete() -> None:
    for dataset, rows in (("vl-cmu-cd", 19), ("pcd2015-tsunami", 11), ("pcd2015-gsv", 11)):
        found = published_for(dataset)
        assert len(found) == rows
        assert [row.f1 for row in found] == sorted((row.f1 for row in found), reverse=True)
    assert published_for("folder") == ()
    assert all(0 < row.f1 < 1 and row.source for row in LATER)


def test_ours_stands_where_its_score_puts_it_and_is_averaged_as_each_row_was(
    scores: Scores,
) -> None:
    lopsided = (Counts(tp=9, fp=1, fn=0, tn=0), Counts(tp=6, fp=0, fn=4, tn=0))
    pairs = tuple(
        replace(pair, counts=counts)
        for pair, counts in zip(scores.pairs[:2], lopsided, strict=True)
    )
    dataset = replace(scores.dataset, name="vl-cmu-cd", notes=("first 2 pairs",))
    table = table_among_published(replace(scores, dataset=dataset, pairs=pairs))
    names = [row.method for row in table]
    macro, harmonic = (18 / 19 + 0.75) / 2, 2 * 0.95 * 0.8 / 1.75
    at = names.index("ours (toy)")
    assert table[at].f1 == pytest.approx(macro)
    assert names.index("Argos") == 0 < at  # 0.863 > 0.849
    assert names.index("TERDNet") > at  # 0.834 < 0.849
    assert table[names.index("GeSCF")].ours == pytest.approx(harmonic)
    assert table[names.index("C-3PO (VGG16)")].ours == pytest.approx(macro)
    assert "first 2 pairs" in table[at].flags
    assert "averaging not stated" in table[names.index("ZeroSCD")].flags


def test_your_own_folder_has_no_published_table(scores: Scores) -> None:
    assert table_among_published(scores) == ()


def test_each_other_method_is_compared_on_exactly_its_own_pairs_with_change(
    scores: Scores, tiny_folder: Path
) -> None:
    baselines = {
        "a": {"one": 0.5, "two": 0.1},
        "b": {"one": 0.3},
        "c": {"one": 0.9, "two": 0.9},
        "z": {"one": 1.0, "two": 1.0},
    }
    (tiny_folder / "published_f1.json").write_text(json.dumps(baselines))
    one, two = compare_with_baselines(scores)
    assert (one.method, one.stems, one.f1) == ("one", ("a", "b"), (0.5, 0.3))
    assert (two.method, two.stems, two.f1) == ("two", ("a",), (0.1,))
    assert (one.f1_macro, one.ours_macro) == pytest.approx((0.4, 0.2))  # ours: 0.4 and 0
    assert (two.f1_macro, two.ours_macro) == pytest.approx((0.1, 0.4))


def test_without_such_a_file_there_is_no_comparison(scores: Scores) -> None:
    assert compare_with_baselines(scores) == ()


@pytest.mark.parametrize(
    "text", ["[1, 2]", "{", '{"a": 3}', '{"a": {"one": "best"}}', '{"a": {"one": 75}}']
)
def test_a_wrong_file_of_other_methods_is_named(
    text: str, scores: Scores, tiny_folder: Path
) -> None:
    (tiny_folder / "published_f1.json").write_text(text)
    with pytest.raises(DatasetError, match=r"published_f1\.json"):
        compare_with_baselines(scores)
