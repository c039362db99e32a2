"""Every committed result has the form that benchmarks/README.md promises."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.bench import Measurement, Plan, Spread, to_json

if TYPE_CHECKING:
    from types import ModuleType

FOLDER = Path(__file__).parents[2] / "benchmarks"
# Of pair.py; other scripts keep results of their own form in folders.
RESULTS = sorted((FOLDER / "results").glob("*.json"))
SPREAD = {"median", "least", "most"}
STAGES = {"encode", "align", "coarse", "segment", "refine"}


def check(content: dict[str, Any]) -> None:
    assert set(content) == {
        "schema", "name", "commit", "preset", "settings", "device", "machine", "pairs"
    }  # fmt: skip
    assert content["schema"] == 1
    assert content["commit"] is None or re.fullmatch(r"[\w.-]+\+?", content["commit"])
    assert set(content["machine"]) == {"cpu", "cores", "system", "versions"}
    assert content["machine"]["cores"] >= 1
    assert "torch" in content["machine"]["versions"]
    assert content["pairs"]
    for pair in content["pairs"]:
        check_pair(pair)


def check_pair(pair: dict[str, Any]) -> None:
    assert set(pair) == set(Measurement.__dataclass_fields__)
    assert all(side > 0 for side in pair["size_wh"])
    assert pair["runs"] >= 1
    assert set(pair["stages"]) >= STAGES
    for spread in (pair["total"], *pair["stages"].values()):
        assert set(spread) == SPREAD
        assert 0 <= spread["least"] <= spread["median"] <= spread["most"]
    assert sum(s["least"] for s in pair["stages"].values()) <= pair["total"]["most"] * 1.05
    assert pair["import_seconds"] > 0
    assert pair["load_seconds"] > 0
    assert pair["peak_bytes"] is None or 10**8 < pair["peak_bytes"] < 10**11
    assert set(pair["threads"]) == {"torch", "opencv"}


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.stem)
def test_a_committed_result_keeps_the_promised_form(path: Path) -> None:
    content = json.loads(path.read_text())
    check(content)
    assert content["name"] == path.stem


@pytest.mark.parametrize(
    "path",
    sorted((FOLDER / "results").glob("*/*.json")),
    ids=lambda path: f"{path.parent.name}/{path.stem}",
)
def test_the_form_of_every_other_result_is_described(path: Path) -> None:
    assert isinstance(json.loads(path.read_text()), dict)
    assert f"## `results/{path.parent.name}/NAME.json`" in (FOLDER / "README.md").read_text()


def test_a_new_result_has_the_promised_form_and_every_key_is_described() -> None:
    spread = Spread(median=0.1, least=0.1, most=0.2)
    found = Measurement(
        size_wh=(512, 512),
        runs=5,
        busy=0,
        import_seconds=1.0,
        load_seconds=0.5,
        first_seconds=1.0,
        total=Spread(median=0.5, least=0.5, most=0.6),
        stages=dict.fromkeys(sorted(STAGES), spread),
        peak_bytes=5 * 10**8,
        threads={"torch": 2, "opencv": 2},
    )
    content = {"name": "new", "commit": None, **to_json(Plan(), [found])}
    check(json.loads(json.dumps(content)))
    described = (FOLDER / "README.md").read_text()
    for key in (*content, *(f".{name}" for name in Measurement.__dataclass_fields__)):
        assert f"`{key}" in described, f"benchmarks/README.md does not describe {key}"


def test_the_commit_is_named_where_there_is_a_checkout(pair_benchmark: ModuleType) -> None:
    commit = pair_benchmark.commit()
    if not (FOLDER.parent / ".git").exists():
        assert commit is None
    elif commit is not None:  # git itself may be missing
        assert re.fullmatch(r"[\w.-]*[0-9a-f]{7,40}\+?", commit)
