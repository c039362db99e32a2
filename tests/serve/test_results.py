"""The committed measurements of the server say what docs/serve.md says they say."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
RESULTS = sorted((ROOT / "benchmarks" / "results" / "serve").glob("*.json"))


@pytest.fixture(params=RESULTS, ids=lambda path: path.stem)
def found(request: pytest.FixtureRequest) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(request.param.read_text())
    assert content["name"] == request.param.stem
    return content


def test_there_is_a_measurement() -> None:
    assert RESULTS


def test_under_load_nobody_got_anything_but_an_answer_or_a_time_to_come_again(
    found: dict[str, Any],
) -> None:
    load = found["load"]
    assert set(load["statuses"]) == {"200", "429"}
    assert load["clients"] >= 64
    assert load["seconds"] >= 120
    assert 0 < load["p50_seconds"] <= load["p95_seconds"] < 90  # the server's own limit
    memory = load["memory_bytes"]
    assert memory["after"] < 1.1 * memory["before"]
    assert load["left_over_files"] == 0


def test_visitors_of_the_page_got_results_or_a_time_to_come_again(found: dict[str, Any]) -> None:
    page = found["page"]
    assert set(page["statuses"]) == {"200", "201", "202", "429"}
    assert page["statuses"]["200"] == page["statuses"]["202"]
    assert page["visitors"] >= 64
    assert 0 < page["compared_seconds"]["p50"] <= page["compared_seconds"]["most"] < 90
    memory = page["memory_bytes"]
    assert memory["most"] < memory["before"] + 1e9  # comparisons may hold 600 MB of it


def test_no_job_was_lost(found: dict[str, Any]) -> None:
    kill = found["kill"]
    assert kill["jobs_acknowledged"] > 0
    assert (kill["jobs_lost"], kill["stale_files_after_start"]) == (0, 0)
    assert set(kill["pairs"]) == {"done"}


def test_every_hostile_upload_was_refused(found: dict[str, Any]) -> None:
    hostile = found["hostile"]
    assert hostile["uploads"] >= 200
    assert hostile["not_4xx"] == 0
    assert hostile["alive_afterwards"]
    assert hostile["left_over_files"] == 0
    assert hostile["slowest_seconds"]["slow_senders"] < 35  # 30 for a body, and some slack
    assert hostile["memory_bytes"]["most"] < 1.5e9


def test_every_key_is_described(found: dict[str, Any]) -> None:
    page = (ROOT / "benchmarks" / "README.md").read_text()
    for key in set(found) - {"schema", "name", "system"}:
        assert f"`{key}`" in page
