"""Pairs with several photos on a side, in a batch."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

from zeroscd.batch import Local, Options, run

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    Tables = Callable[[Path], tuple[list[dict[str, Any]], list[dict[str, Any]]]]

TABLES = ("pairs.parquet", "changes.parquet")
SINGLE_CHANGES = [
    "pair", "region", "kind", "score", "area_px", "bbox_xywh", "polygon_xy", "frame", "support",
    "at_border", "height", "width", "rle", "latitude", "longitude",
]  # fmt: skip
SINGLE_PAIRS = [
    "row", "id", "pair", "before", "after", "status", "error", "regions", "changed_fraction",
    "judged_fraction", "aligned", "not_aligned", "latitude", "longitude", "taken_before",
    "taken_after", "seconds",
]  # fmt: skip


@pytest.fixture
def several(street: Path) -> Path:
    """The street with a second old photo of each place, a shade darker, and its manifest.

    The second old photo of place 1 shows what changed already; that of place 2 is another place.
    """
    (street / "t0b").mkdir()
    shown = {1: "t1/1.png", 2: "t0/5.png"}
    for number in range(6):
        with Image.open(street / shown.get(number, f"t0/{number}.png")) as photo:
            darker = np.asarray(photo).astype(int) - 3
        Image.fromarray(darker.clip(0).astype(np.uint8)).save(street / "t0b" / f"{number}.png")
    rows = [f"t0/{n}.png|t0b/{n}.png,t1/{n}.png,p{n}\n" for n in range(3)]
    path = street / "several.csv"
    path.write_text("before,after,id\n" + "".join(rows) + "t0/3.png,t1/3.png,p3\n")
    return path


def computed(manifest: Path, out: Path, options: Options) -> list[str]:
    """Run a batch; return the names of the pairs that were compared."""
    names: list[str] = []

    class Ear:
        def begin(self, total: int) -> None: ...

        def advance(self, stem: str, *, reused: bool) -> None:
            names.extend([] if reused else [stem])

    run(manifest, out, options=options, progress=Ear())
    return sorted(names)


def test_tables_name_the_further_photos_and_count_the_views(
    several: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    run(several, tmp_path / "out", options=Options(detector=toy.make))
    pairs, changes = tables(tmp_path / "out")
    assert [row["also_before"] for row in pairs] == [
        [f"../street/t0b/{number}.png"] for number in range(3)
    ] + [[]]
    assert [row["also_after"] for row in pairs] == [[], [], [], []]
    votes = {row["pair"]: (row["seen_by"], row["agreed_by"]) for row in changes}
    # Place 1: one of two old photos shows the change already. Place 2: the second is no view.
    assert votes == {"p0": (2, 2), "p2": (1, 1), "p3": (1, 1)}
    saved = json.loads((tmp_path / "out" / "p2" / "changes.json").read_text())
    (further,) = saved["further_photos"]
    assert further["path"] == "../../street/t0b/2.png"
    assert further["side"] == "before"
    assert further["left_out"].startswith("not aligned: ")


def test_a_row_is_what_the_detector_says_of_the_same_photos(
    several: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    run(several, tmp_path / "out", options=Options(detector=toy.make))
    street = several.parent
    for row in tables(tmp_path / "out")[0][:3]:
        number = row["row"] - 1
        old = [street / "t0" / f"{number}.png", street / "t0b" / f"{number}.png"]
        expected = toy.make().detect(old, street / "t1" / f"{number}.png")
        assert row["regions"] == len(expected.regions)
        with Image.open(tmp_path / "out" / row["pair"] / "mask.png") as mask:
            assert ((np.asarray(mask) > 0) == expected.mask).all()


def test_columns_of_views_are_there_only_where_a_pair_has_several_photos(
    several: Path, tmp_path: Path, toy: ModuleType
) -> None:
    options = Options(detector=toy.make)
    run(several.parent / "pairs.csv", tmp_path / "single", options=options)
    run(several, tmp_path / "several", options=options)
    single, more = (
        {name: pq.read_schema(tmp_path / out / name).names for name in TABLES}
        for out in ("single", "several")
    )
    assert single == {"pairs.parquet": SINGLE_PAIRS, "changes.parquet": SINGLE_CHANGES}
    further = {name: {*more[name]} - {*single[name]} for name in TABLES}
    assert further == {
        "pairs.parquet": {"also_before", "also_after"},
        "changes.parquet": {"seen_by", "agreed_by"},
    }


def test_lists_of_one_photo_give_the_very_bytes_of_a_single_photo(
    street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    lists = [{"before": [f"t0/{n}.png"], "after": [f"t1/{n}.png"], "id": f"p{n}"} for n in range(6)]
    (street / "lists.jsonl").write_text("\n".join(map(json.dumps, lists)))
    options = Options(detector=toy.make, write=("mask", "json", "report"))
    names = [path.name for path in (street / "pairs.csv", street / "lists.jsonl")]
    for name in names:
        run(street / name, tmp_path / name, options=options)
    one, two = (tmp_path / name for name in names)
    files = sorted(path.relative_to(one) for path in one.glob("p*/*"))
    assert len(files) == 6 * 3
    for file in [Path("changes.parquet"), *files]:
        assert without_seconds(one / file) == without_seconds(two / file), file


def without_seconds(path: Path) -> bytes:
    if path.name != "changes.json":
        return path.read_bytes()
    saved = json.loads(path.read_text())
    assert [*saved][-1] == "seconds"
    return json.dumps({**saved, "seconds": None}).encode()


def test_a_further_photo_that_changes_or_moves_is_compared_again(
    several: Path, tmp_path: Path, toy: ModuleType
) -> None:
    out, options = tmp_path / "out", Options(detector=toy.make)
    assert computed(several, out, options) == ["p0", "p1", "p2", "p3"]
    assert computed(several, out, options) == []
    path = several.parent / "t0b" / "1.png"
    with Image.open(path) as photo:
        pixels = np.asarray(photo).copy()
    pixels[0, 0] ^= 255
    Image.fromarray(pixels).save(path)
    assert computed(several, out, options) == ["p1"]
    text = several.read_text()
    several.write_text(text.replace("t0/0.png|t0b/0.png,t1/0.png", "t0/0.png,t0b/0.png|t1/0.png"))
    assert computed(several, out, options) == ["p0"]  # the same bytes, on the other side
    several.write_text(text.replace("|t0b/0.png", ""))
    assert computed(several, out, options) == ["p0"]


def test_a_missing_further_photo_is_an_error_of_its_row_alone(
    several: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    (several.parent / "t0b" / "0.png").unlink()
    summary = run(several, tmp_path / "out", options=Options(detector=toy.make))
    assert summary.failed == 1
    row = tables(tmp_path / "out")[0][0]
    assert "t0b/0.png does not exist" in row["error"]
    assert row["also_before"] == ["../street/t0b/0.png"]


def test_where_the_first_photo_cannot_be_aligned_the_row_begins_with_the_next(
    several: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    several.write_text("before,after,id\nt0/5.png|t0/2.png,t1/2.png,p2\n")
    run(several, tmp_path / "out", options=Options(detector=toy.make))
    pairs, changes = tables(tmp_path / "out")
    assert pairs[0]["before"] == "../street/t0/2.png"
    assert pairs[0]["also_before"] == ["../street/t0/5.png"]
    saved = json.loads((tmp_path / "out" / "p2" / "changes.json").read_text())
    assert saved["before"]["path"] == "../../street/t0/2.png"
    assert {row["pair"] for row in changes} == {"p2"}


def test_a_photo_that_several_pairs_share_as_a_view_is_encoded_once(
    several: Path, tmp_path: Path, toy: ModuleType
) -> None:
    detector = toy.make()
    old = "|".join(f"t0/{number}.png" for number in range(3))
    rows = [f"{old},t1/{number}.png,p{number}\n" for number in range(6)]
    several.write_text("before,after,id\n" + "".join(rows))
    options = Options(detector=lambda: detector)
    summary = run(several, tmp_path / "out", options=options, engine=Local(workers=2))
    assert detector.models.encoder.encoded == 3 + 6
    assert (summary.encoded, summary.cache_hits) == (3 + 6, 6 * 3 - 3)


def test_several_workers_give_the_same_tables_of_views(
    several: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    options = partial(Options, detector=toy.make)
    for name, workers in (("one", 1), ("three", 3)):
        run(several, tmp_path / name, options=options(), engine=Local(workers=workers))
    assert tables(tmp_path / "one") == tables(tmp_path / "three")
