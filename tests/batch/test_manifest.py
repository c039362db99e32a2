from __future__ import annotations

import json
import unicodedata
from typing import TYPE_CHECKING, Any

import fsspec
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from zeroscd.batch.manifest import open_folders, open_manifest
from zeroscd.batch.task import Row
from zeroscd.errors import DatasetError

if TYPE_CHECKING:
    from pathlib import Path

ROWS = [
    Row(before="old/1.jpg", after="new/1.jpg", id="elm, 12"),
    Row(before="old/2.jpg", after="new/2.jpg", id="7"),
    Row(before="old/3.jpg", after="new/3.jpg"),
    Row(before="old/4.jpg", error="the manifest says no after"),
]
CSV = """id,before,after,note
"elm, 12",old/1.jpg,new/1.jpg,x
7, old/2.jpg ,new/2.jpg,
,old/3.jpg,new/3.jpg,
,old/4.jpg,,
"""
VALUES: list[dict[str, Any]] = [
    {"before": "old/1.jpg", "after": "new/1.jpg", "id": "elm, 12"},
    {"before": "old/2.jpg", "after": "new/2.jpg", "id": 7},
    {"before": "old/3.jpg", "after": "new/3.jpg", "id": None},
    {"before": "old/4.jpg", "after": "", "id": float("nan")},
]


def test_csv_jsonl_and_parquet_say_the_same(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(CSV)
    (tmp_path / "m.jsonl").write_text("\n\n".join(map(json.dumps, VALUES)))
    strings = [{**row, "id": None if i > 1 else str(row["id"])} for i, row in enumerate(VALUES)]
    pq.write_table(pa.Table.from_pylist(strings), tmp_path / "m.parquet")
    for name in ("m.csv", "m.jsonl", "m.parquet"):
        manifest = open_manifest(tmp_path / name)
        assert manifest.base == str(tmp_path)
        assert list(manifest.rows()) == ROWS, name
        assert list(manifest.rows()) == ROWS, name


def test_numbers_of_a_parquet_column_are_ids(tmp_path: Path) -> None:
    table = {"before": ["a.jpg", "b.jpg"], "after": ["c.jpg", "d.jpg"], "id": [12, None]}
    pq.write_table(pa.table(table), tmp_path / "m.parquet")
    assert [row.id for row in open_manifest(tmp_path / "m.parquet").rows()] == ["12", None]


def test_a_spreadsheet_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_bytes(b"\xef\xbb\xbfbefore,after\r\na.jpg,b.jpg\r\n")
    assert list(open_manifest(tmp_path / "m.csv").rows()) == [Row(before="a.jpg", after="b.jpg")]


@pytest.mark.parametrize(
    "text",
    [
        "before, after, id\na.jpg, b.jpg, x\n",
        'before;after;id\n"a.jpg" ;b.jpg; "x"\n',
        "sep=|\r\nbefore|after|id\r\na.jpg|b.jpg|x\r\n",
        "\ufeffBefore\tAfter\tID\na.jpg\tb.jpg\tx\n\n",
        "before,after,id,,\na.jpg,b.jpg,x,,\n,,,,\n , ,,,\n",
        "id,before,after,note\rx,a.jpg,b.jpg\r",
        'before,after,note,id\na.jpg,b.jpg,"two\nlines, and a comma",x\n',
    ],
)
def test_what_people_and_spreadsheets_write_is_read_as_meant(tmp_path: Path, text: str) -> None:
    (tmp_path / "m.csv").write_text(text, newline="")
    rows = list(open_manifest(tmp_path / "m.csv").rows())
    assert rows == [Row(before="a.jpg", after="b.jpg", id="x")]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('before,after\na,b\nc,"d\ne,f\ng,h\n', "line 3: a cell spans several lines"),
        ('before,after\na,"b\nc,d\n"e",f\n', "line 2: a cell spans several lines"),
        ('before,after,note\n\na,b,"x\nc,d,\ne,f,\n', "line 3: a cell spans several lines"),
        ("before,after\na,b\nx,old, new.jpg,c\n", "line 3 has 4 cells, the header 2"),
    ],
)
def test_rows_that_would_be_lost_are_refused_with_their_line(
    tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(DatasetError, match=message):
        list(open_manifest(tmp_path / "m.csv").rows())


def test_whole_floats_of_pandas_are_ids_without_a_point(tmp_path: Path) -> None:
    table = {"before": ["a"] * 4, "after": ["b"] * 4, "Id ": [7.0, None, float("nan"), 2.5]}
    pq.write_table(pa.table(table), tmp_path / "m.parquet")
    (tmp_path / "m.jsonl").write_text(
        '\ufeff{"before": "a", "after": "b", "id": 7.0}\n'
        '{"before": "a", "after": "b", "id": null}\n'
        '{"before": "a", "after": "b", "id": NaN}\n'
        '{"before": "a", "after": "b", "id": 2.5}\n'
    )
    for name in ("m.parquet", "m.jsonl"):
        ids = [row.id for row in open_manifest(tmp_path / name).rows()]
        assert ids == ["7", None, None, "2.5"], name


def test_a_column_of_a_parquet_file_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    table = pa.table([["a"], ["b"], ["c"]], names=["before", "after", "After"])
    pq.write_table(table, tmp_path / "m.parquet")
    with pytest.raises(DatasetError, match="it has the column after twice"):
        open_manifest(tmp_path / "m.parquet")


def test_a_json_object_that_says_a_column_twice_is_a_row_with_its_number(tmp_path: Path) -> None:
    (tmp_path / "m.jsonl").write_text('{"before": "a", "after": "b", "before": "c"}\n')
    (row,) = open_manifest(tmp_path / "m.jsonl").rows()
    assert row == Row(error="line 1 of the manifest says before twice")


def test_a_line_that_is_no_json_object_is_a_row_with_its_number(tmp_path: Path) -> None:
    (tmp_path / "m.jsonl").write_text('{"before": "a", "after": "b"}\n{"before": \n[1]\n')
    first, *broken = open_manifest(tmp_path / "m.jsonl").rows()
    assert first.error is None
    assert [row.error for row in broken] == [
        "line 2 of the manifest is not a JSON object",
        "line 3 of the manifest is not a JSON object",
    ]


def test_a_manifest_may_lie_behind_an_address() -> None:
    with fsspec.open("memory://city/2024/m.csv", "wt") as file:
        file.write("before,after\nold/a.jpg,new/a.jpg\n")
    manifest = open_manifest("memory://city/2024/m.csv")
    assert manifest.base == "memory://city/2024"
    assert list(manifest.rows()) == [Row(before="old/a.jpg", after="new/a.jpg")]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("m.csv", b"old;new\na;b\n", r"line 1: it has no column before and no .* \(found: old;new"),
        ("m.csv", b"\n before ,AFTER, After\n", r"line 2: it has the column after twice"),
        ("m.csv", b"before,after\na,b,c.jpg\n", r"line 2 has 3 cells, the header 2; put a path "),
        ("m.csv", b"", r"it is empty; a manifest needs a header"),
        ("m.csv", b"before,after\n\xff\xfe,b\n", r"is not UTF-8 text; save it as UTF-8"),
        ("m.parquet", b"no parquet", r"cannot read .*m\.parquet: "),
        ("m.txt", b"", r"m\.txt is no manifest; give a \.csv"),
    ],
)
def test_a_manifest_that_is_none_is_refused_at_once(
    tmp_path: Path, name: str, content: bytes, message: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DatasetError, match=message) as caught:
        open_manifest(tmp_path / name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("address", ["none.csv", "memory://none.csv", "nonsense://m.csv"])
def test_a_manifest_that_is_not_there_is_refused(tmp_path: Path, address: str) -> None:
    where = address if "://" in address else tmp_path / address
    with pytest.raises(DatasetError, match=f"cannot read .*{address}"):
        open_manifest(where)


def test_a_manifest_may_lie_behind_a_signed_address() -> None:
    with fsspec.open("memory://city/s.csv?Expires=3600&Signature=k/ab.cd", "wt") as file:
        file.write("before,after\nold/a.jpg,new/a.jpg\n")
    manifest = open_manifest("memory://city/s.csv?Expires=3600&Signature=k/ab.cd")
    assert manifest.base == "memory://city"
    assert list(manifest.rows()) == [Row(before="old/a.jpg", after="new/a.jpg")]


def test_photos_of_kinds_that_are_not_read_are_named(tmp_path: Path) -> None:
    files = {
        "old": ["a.jpg", "a.CR2", "b.jpg", "c.nef", "notes.txt"],
        "new": ["a.jfif", "b.NEF", "d.nef"],
    }
    for folder, names in files.items():
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / name).touch()
    manifest = open_folders(tmp_path / "old", tmp_path / "new")
    assert manifest.unread == ("a.CR2", "c.nef", "b.NEF", "d.nef")
    a, b = manifest.rows()
    assert (a.before, a.after) == (f"{tmp_path}/old/a.jpg", f"{tmp_path}/new/a.jfif")
    assert b.error == (f"{tmp_path}/new has 0 photos called b (b.NEF is not read here), not one")


def test_names_of_another_unicode_form_are_one_photo(tmp_path: Path) -> None:
    composed, decomposed = (unicodedata.normalize(f, "café.jpg") for f in ("NFC", "NFD"))
    for folder, name in (("old", composed), ("new", decomposed)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / name).touch()
    (row,) = open_folders(tmp_path / "old", tmp_path / "new").rows()
    assert row.error is None
    assert row.id == "café"


def test_folders_are_joined_by_stem_and_nothing_is_left_out(tmp_path: Path) -> None:
    files = {
        "old": ["b.jpg", "a.PNG", "only old.jpg", "twice.jpg", "twice.png", "notes.txt", ".c.jpg"],
        "new": ["a.jpg", "b.tif", "only new.jpg", "twice.jpg"],
    }
    for folder, names in files.items():
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / name).touch()
    old, new = tmp_path / "old", tmp_path / "new"
    rows = list(open_folders(old, new).rows())
    assert rows[:2] == [
        Row(before=f"{old}/a.PNG", after=f"{new}/a.jpg", id="a"),
        Row(before=f"{old}/b.jpg", after=f"{new}/b.tif", id="b"),
    ]
    assert [(row.id, row.error) for row in rows[2:]] == [
        ("only new", f"{old} has 0 photos called only new (none), not one"),
        ("only old", f"{new} has 0 photos called only old (none), not one"),
        ("twice", f"{old} has 2 photos called twice (twice.jpg, twice.png), not one"),
    ]


def test_folders_may_be_addresses() -> None:
    for name in ("old/a.jpg", "new/a.png"):
        with fsspec.open(f"memory://town/{name}", "wb") as file:
            file.write(b"x")
    (row,) = open_folders("memory://town/old", "memory://town/new").rows()
    assert (row.before, row.after) == ("memory://town/old/a.jpg", "memory://town/new/a.png")


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"cannot read .*none: No such file"):
        open_folders(tmp_path, tmp_path / "none")


SEVERAL = [
    Row(
        before="old/1.jpg",
        after="new/1.jpg",
        id="elm",
        also_before=("old/1b.jpg", "old/1c.jpg"),
        also_after=("new/1b.jpg",),
    ),
    Row(before="old/2.jpg", after="new/2.jpg", id="oak"),
]


def test_a_side_of_several_photos_is_split_at_bars_in_csv_and_a_list_elsewhere(
    tmp_path: Path,
) -> None:
    (tmp_path / "m.csv").write_text(
        "before,after,id\n"
        "old/1.jpg | old/1b.jpg|old/1c.jpg,new/1.jpg|new/1b.jpg|,elm\n"
        "old/2.jpg,new/2.jpg,oak\n"
    )
    lists = [
        {
            "before": ["old/1.jpg", "old/1b.jpg", "old/1c.jpg"],
            "after": ["new/1.jpg", " ", "new/1b.jpg"],
            "id": "elm",
        },
        {"before": ["old/2.jpg"], "after": ["new/2.jpg"], "id": "oak"},
    ]
    (tmp_path / "m.jsonl").write_text("\n".join(map(json.dumps, lists)))
    pq.write_table(pa.Table.from_pylist(lists), tmp_path / "m.parquet")
    for name in ("m.csv", "m.jsonl", "m.parquet"):
        assert list(open_manifest(tmp_path / name).rows()) == SEVERAL, name


def test_a_file_whose_name_has_a_bar_is_one_photo(tmp_path: Path) -> None:
    (tmp_path / "old|1.jpg").touch()
    (tmp_path / "m.csv").write_text("before,after\nold|1.jpg,new|1.jpg\n")
    (tmp_path / "m.jsonl").write_text('{"before": "old|2.jpg", "after": "new.jpg"}')
    (row,) = open_manifest(tmp_path / "m.csv").rows()
    assert row == Row(before="old|1.jpg", after="new", also_after=("1.jpg",))
    (row,) = open_manifest(tmp_path / "m.jsonl").rows()
    assert row == Row(before="old|2.jpg", after="new.jpg")


def test_a_list_without_photos_is_a_missing_photo(tmp_path: Path) -> None:
    (tmp_path / "m.jsonl").write_text('{"before": [], "after": ["", "a.jpg"]}')
    (row,) = open_manifest(tmp_path / "m.jsonl").rows()
    assert row == Row(after="a.jpg", error="the manifest says no before")
