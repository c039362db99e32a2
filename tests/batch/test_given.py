"""Areas that do not count and a known geometry, in a batch."""

from __future__ import annotations

import json
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

import zeroscd
from zeroscd.batch import Options, run
from zeroscd.batch.manifest import open_manifest

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import ModuleType

    Tables = Callable[[Path], tuple[list[dict[str, Any]], list[dict[str, Any]]]]

ALL = json.dumps([[[0, 0], [96, 0], [96, 64], [0, 64]]])


@pytest.fixture
def given(street: Path) -> Path:
    """A manifest whose second pair leaves out all, whose third has a camera that did not move."""
    (street / "all.json").write_text(ALL)
    Image.fromarray(np.zeros((64, 96), np.uint8)).save(street / "nothing.png")
    lines = (
        "before,after,id,ignore,align",
        "t0/0.png,t1/0.png,a,nothing.png,",
        "t0/1.png,t1/1.png,b,all.json,",
        "t0/2.png,t1/2.png,c,,none",
    )
    path = street / "given.csv"
    path.write_text("\n".join(lines))
    return path


def saved(out: Path, pair: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / pair / "changes.json").read_text())
    return found


def test_a_row_may_leave_out_areas_and_say_the_geometry(
    given: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    out = tmp_path / "out"
    run(given, out, options=Options(detector=toy.make))
    pairs, changes = tables(out)
    assert [row["status"] for row in pairs] == ["ok"] * 3
    assert {row["pair"] for row in changes} == {"a", "c"}
    assert [saved(out, pair).get("ignored_fraction") for pair in "abc"] == [0.0, 1.0, None]
    assert [saved(out, pair)["alignment"].get("given") for pair in "abc"] == [None, None, True]


def test_rows_of_every_kind_of_manifest_hold_what_is_given(street: Path) -> None:
    row = {"before": "a.png", "after": "b.png", "roi": "middle.png", "align": "none", "ignore": ""}
    (street / "given.jsonl").write_text(json.dumps(row))
    (found,) = open_manifest(street / "given.jsonl").rows()
    assert found.given == {"roi": "middle.png", "align": "none"}


def test_an_area_of_all_photos_is_left_out_of_every_pair(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    options = Options(detector=toy.make, ignore_all=ALL.encode())
    run(street / "pairs.csv", tmp_path / "out", options=options)
    pairs, changes = tables(tmp_path / "out")
    assert {row["judged_fraction"] for row in pairs} == {0.0}
    assert changes == []


def test_a_geometry_of_all_pairs_holds_where_a_row_says_none(
    given: Path, tmp_path: Path, toy: ModuleType
) -> None:
    shift = np.array([[1.0, 0, 8], [0, 1, 0], [0, 0, 1]])
    out = tmp_path / "out"
    run(given, out, options=Options(detector=toy.make, t1_from_t0=shift))
    found = [saved(out, pair)["alignment"]["t1_from_t0"] for pair in "abc"]
    assert found == [shift.tolist(), shift.tolist(), np.eye(3).tolist()]


def test_a_pair_is_compared_again_when_what_is_given_changes(
    given: Path, tmp_path: Path, toy: ModuleType
) -> None:
    out = tmp_path / "out"
    once = partial(run, given, out)
    assert once(options=Options(detector=toy.make)).reused == 0
    assert once(options=Options(detector=toy.make)).reused == 3
    Image.fromarray(np.full((64, 96), 255, np.uint8)).save(given.parent / "nothing.png")
    assert once(options=Options(detector=toy.make)).reused == 2
    assert saved(out, "a")["ignored_fraction"] == 1.0
    assert once(options=Options(detector=toy.make, ignore_all=ALL.encode())).reused == 0


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("ignore", "absent.png", "absent.png does not exist"),
        ("roi", "small.png", "the region of interest has 10 x 10 pixels and its photo 96 x 64"),
        ("align", "all.json", "the field align holds no homography"),
        ("ignore", "0", "does not exist"),
    ],
)
def test_what_cannot_be_used_is_the_error_of_its_row_alone(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables, column: str, value: str,
    message: str,
) -> None:  # fmt: skip
    (street / "all.json").write_text(ALL)
    Image.fromarray(np.zeros((10, 10), np.uint8)).save(street / "small.png")
    (street / "odd.csv").write_text(
        f"before,after,id,{column}\nt0/0.png,t1/0.png,a,{value}\nt0/1.png,t1/1.png,b,\n"
    )
    run(street / "odd.csv", tmp_path / "out", options=Options(detector=toy.make))
    pairs, _ = tables(tmp_path / "out")
    assert [row["status"] for row in pairs] == ["error", "ok"]
    assert message in pairs[0]["error"]


def test_an_area_inside_the_manifest_is_refused(street: Path) -> None:
    row = {"before": "a.png", "after": "b.png", "ignore": [[[0, 0], [1, 0], [1, 1]]]}
    (street / "inline.jsonl").write_text(json.dumps(row))
    (found,) = open_manifest(street / "inline.jsonl").rows()
    assert found.error == "the column ignore holds a list; give the path of a file"


def test_an_empty_area_of_all_photos_is_an_error_of_every_row(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    run(street / "pairs.csv", tmp_path / "out", options=Options(detector=toy.make, ignore_all=b""))
    pairs, _ = tables(tmp_path / "out")
    assert {row["status"] for row in pairs} == {"error"}


def test_a_pair_loads_without_the_picture_of_what_was_left_out(
    street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    files = ("mask", "removed", "added", "unknown", "json")
    options = Options(detector=toy.make, ignore_all=ALL.encode(), write=files)
    run(street / "pairs.csv", tmp_path / "out", options=options)
    folder = next(path for path in (tmp_path / "out").iterdir() if path.is_dir())
    found = zeroscd.load(folder)
    assert found.ignored is None
    assert found.unknown.all()


def test_tasks_for_label_studio_follow_photos_that_moved(
    street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    options = Options(detector=toy.make, write=("label-studio",))
    once = partial(run, street / "pairs.csv", tmp_path / "out", options=options)
    assert once().reused == 0
    assert once().reused == 6
    (street / "t0").rename(street / "old")
    moved = (street / "pairs.csv").read_text().replace("t0/", "old/")
    (street / "pairs.csv").write_text(moved)
    assert once().reused == 0
