"""The committed results of benchmarks/models.py say what docs/models.md claims."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

RESULTS = sorted((Path(__file__).parents[2] / "benchmarks" / "results" / "models").glob("*.json"))
PARTS = {
    "encoder_per_photo",
    "decoder_per_64_points",
    "transformers_decoder_per_64_points",
    "bytes_of_64_points_in_flight",
    "coarse",
    "again",
    "everything",
    "changed_share",
    "flagged_masks_iou",
    "ratios",
}


@pytest.fixture(params=RESULTS, ids=lambda path: path.stem)
def result(request: pytest.FixtureRequest) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(request.param.read_text())
    assert content["name"] == request.param.stem
    return content


def test_a_result_says_where_and_how_it_was_measured(result: dict[str, Any]) -> None:
    assert result["schema"] == 1
    assert result["machine"].keys() >= {"cpu", "cores", "versions", "device", "load_average"}
    assert result["precision"] in ("fp32", "bf16")
    assert result["models"].keys() >= {"sam-vit-b", "mobile-sam", "sam2.1-tiny"}
    assert all(found.keys() == PARTS for found in result["models"].values())


def test_both_ways_of_asking_flagged_the_same_masks(result: dict[str, Any]) -> None:
    for found in result["models"].values():
        assert found["flagged_masks_iou"] == 1.0
        assert found["changed_share"] == pytest.approx(0.1, abs=0.005)


def test_memory_and_speed_keep_their_promises(result: dict[str, Any]) -> None:
    for found in result["models"].values():
        assert found["bytes_of_64_points_in_flight"] < 3e9
        for clock in ("wall", "processor"):
            ratio = found["ratios"][clock]["everything_with_transformers_decoder_over_coarse"]
            assert ratio > 5


def test_asking_again_spares_the_encoder(result: dict[str, Any]) -> None:
    for found in result["models"].values():
        assert found["again"]["outlines"] == found["coarse"]["outlines"]
        first, again = (found[way]["per_photo"]["processor"] for way in ("coarse", "again"))
        assert first - again > 0.7 * found["encoder_per_photo"]["processor"]


def test_the_ratios_follow_from_the_seconds(result: dict[str, Any]) -> None:
    for found in result["models"].values():
        for clock in ("wall", "processor"):
            features = result["dinov2_b_both_photos"][clock]
            pair = {
                way: features + 2 * found[way]["per_photo"][clock]
                for way in ("coarse", "everything")
            }
            unavoidable = features + 2 * found["encoder_per_photo"][clock]
            ratios = found["ratios"][clock]
            expected = pair["everything"] / pair["coarse"]
            assert ratios["everything_over_coarse"] == pytest.approx(expected, abs=0.01)
            expected = pair["coarse"] / unavoidable
            assert ratios["coarse_over_unavoidable"] == pytest.approx(expected, abs=0.01)
