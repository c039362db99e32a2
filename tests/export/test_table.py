from __future__ import annotations

import errno
from typing import TYPE_CHECKING, Any

import pyarrow.parquet as pq
import pytest

from zeroscd.errors import OutputError
from zeroscd.export import table
from zeroscd.export.table import (
    change_rows,
    changes_schema,
    pair_row,
    pairs_schema,
    write_parquet,
)
from zeroscd.images.exif import Exif

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from zeroscd.result import ChangeResult

OLD = Exif(gps=(46.9, 7.4), taken="2019-05-04T12:30:11")
NEW = Exif(gps=(46.8, 7.3), taken="2024-05-04T12:30:11+02:00")


def test_regions_come_back_from_the_file_as_they_were(
    encoded: ChangeResult, tmp_path: Path
) -> None:
    rows = [{"pair": "elm", **row} for row in change_rows(encoded, (OLD, NEW))]
    assert write_parquet(tmp_path / "changes.parquet", rows, changes_schema()) == 2
    removed, added = pq.read_table(tmp_path / "changes.parquet").to_pylist()
    assert removed == {
        "pair": "elm",
        "region": 1,
        "kind": "removed",
        "score": 0.91,
        "area_px": 200,
        "bbox_xywh": [5, 10, 20, 10],
        "polygon_xy": [[[5, 10], [25, 10], [25, 20], [5, 20]]],
        "frame": "t0",
        "support": 0.6,
        "at_border": False,
        "height": 60,
        "width": 80,
        "rle": encoded.regions[0].rle["counts"],
        "latitude": 46.9,
        "longitude": 7.4,
    }
    assert (added["kind"], added["frame"], added["score"]) == ("added", "t1", 0.75)
    assert (added["latitude"], added["longitude"]) == (46.8, 7.3)


def test_the_other_photos_place_stands_in_for_a_missing_one(encoded: ChangeResult) -> None:
    for notes, expected in (
        ((Exif(), NEW), [46.8, 46.8]),
        ((OLD, Exif()), [46.9, 46.9]),
        ((Exif(), Exif()), [None, None]),
    ):
        assert [row["latitude"] for row in change_rows(encoded, notes)] == expected
    assert pair_row(encoded, (OLD, NEW))["latitude"] == 46.8
    assert pair_row(encoded, (OLD, Exif()))["latitude"] == 46.9


def test_a_pair_says_how_it_went(encoded: ChangeResult, not_aligned: ChangeResult) -> None:
    row = pair_row(encoded, (OLD, NEW))
    # 200 + 64 pixels of those that both photos show: all columns but the first ten.
    assert row["changed_fraction"] == pytest.approx(264 / (60 * 70))
    assert (row["regions"], row["aligned"], row["not_aligned"]) == (2, True, None)
    assert (row["taken_before"], row["taken_after"]) == (OLD.taken, NEW.taken)
    row = pair_row(not_aligned)
    assert (row["aligned"], row["not_aligned"]) == (False, "only 3 of 50 matches agree")
    assert set(row) <= set(pairs_schema().names)


def test_rows_are_taken_a_group_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "ROW_GROUP", 10)
    path = tmp_path / "pairs.parquet"
    rows = ({"row": number, "pair": f"p{number}"} for number in range(25))
    assert write_parquet(path, rows, pairs_schema()) == 25
    file = pq.ParquetFile(path)
    assert [file.metadata.row_group(n).num_rows for n in range(3)] == [10, 10, 5]
    assert file.read().column("row").to_pylist() == list(range(25))


def test_a_table_that_breaks_half_way_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "pairs.parquet"
    write_parquet(path, [{"row": 1}], pairs_schema())

    def breaking() -> Iterator[dict[str, Any]]:
        yield {"row": 2}
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(
        OutputError, match=r"pairs\.parquet: No space left on device; make room or choose"
    ):
        write_parquet(path, breaking(), pairs_schema())
    assert pq.read_table(path).column("row").to_pylist() == [1]
    assert [found.name for found in tmp_path.iterdir()] == ["pairs.parquet"]
