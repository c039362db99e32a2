"""The committed results of benchmarks/batch.py say what docs/batch.md and docs/cluster.md claim."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

RESULTS = sorted((Path(__file__).parents[2] / "benchmarks" / "results" / "batch").glob("*.json"))


@pytest.fixture(params=RESULTS, ids=lambda path: path.stem)
def result(request: pytest.FixtureRequest) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(request.param.read_text())
    assert content["schema"] == 1
    assert content["machine"]["cores"] >= 1
    return content


def test_both_engines_gave_the_same_rows_and_none_twice(result: dict[str, Any]) -> None:
    found = result["engines"]
    assert found["pairs_asked"] == 2000
    assert found["same_rows"] is True
    for engine in ("local", "ray"):
        assert found[engine]["rows"] == found[engine]["distinct_names"] == 2000
        assert found[engine]["errors"] == 0
    assert found["local"]["regions"] == found["ray"]["regions"] > 2000


@pytest.mark.parametrize("step", ["kills", "actor"])
def test_what_was_killed_ended_with_the_same_rows_and_masks(
    result: dict[str, Any], step: str
) -> None:
    found = result[step]
    assert found["same_rows"] is True
    assert found["same_files"] is True
    assert found["rows"] == found["distinct_names"] == 1000
    if step == "kills":
        assert len(found["killed_after_s"]) == 10
        assert found["exit_codes"].count(-9) >= 8  # the others had ended before their moment came
        assert found["last_exit_code"] == 0
    else:
        assert 0 < found["pairs_done_when_killed"] < 1000
        assert found["exit_code"] == 0


def test_memory_does_not_grow_with_the_pairs(result: dict[str, Any]) -> None:
    few, many = result["memory"]["200"], result["memory"]["2000"]
    assert many["rows"] == 10 * few["rows"]
    assert many["peak_bytes"] < 1.05 * few["peak_bytes"]


def test_the_engine_costs_little_more_than_the_detector(result: dict[str, Any]) -> None:
    assert result["overhead"]["cpu_overhead"] <= 0.1


def test_every_row_of_the_bad_manifests_is_accounted_for(result: dict[str, Any]) -> None:
    found = result["hostile"]
    expected = {"damaged": 13, "empty": 7, "missing": 10, "unsaid": 4}  # as bad_photos makes them
    assert found["photos"]["errors_by_kind"] == expected
    assert found["addresses"]["errors_by_kind"] == {"timed out": 10}
    for name in ("photos", "addresses"):
        assert found[name]["exit_code"] == 0
        assert found[name]["rows"] == found[name]["distinct_names"] == found[name]["asked"] == 100
    for name in ("below a file", "not writable"):
        assert found[name]["exit_code"] == 2
        (line,) = found[name]["stderr"]
        assert line.startswith("error: cannot ")
