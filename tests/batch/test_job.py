"""A batch from manifest to Parquet: nothing lost, nothing twice, whatever happens on the way."""

from __future__ import annotations

import csv
import json
import os
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image
from pycocotools import mask as coco_mask

from zeroscd.batch import Local, Options, open_folders, run
from zeroscd.batch.journal import Journal
from zeroscd.errors import OutputError, SettingsError, WeightsError, ZeroscdError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from types import ModuleType

    from zeroscd.batch.task import Outcome, Task

    Tables = Callable[[Path], tuple[list[dict[str, Any]], list[dict[str, Any]]]]

PAIRS, RECORDED = 6, 2


class Counting:
    """Hears a batch's progress."""

    def __init__(self) -> None:
        self.total = 0
        self.heard: list[tuple[str, bool]] = []

    def begin(self, total: int) -> None:
        self.total = total

    def advance(self, stem: str, *, reused: bool) -> None:
        self.heard.append((stem, reused))


def quick(toy: ModuleType, **settings: Any) -> Options:
    return Options(detector=partial(toy.make, **settings))


def computed(progress: Counting) -> list[str]:
    return sorted(name for name, reused in progress.heard if not reused)


def cells(path: Path) -> list[dict[str, Any]]:
    """The rows of a CSV table, those cells that are JSON read as such."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{name: cell or None for name, cell in row.items()} for row in csv.DictReader(file)]


def test_csv_tables_say_what_the_parquet_tables_say(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    out = tmp_path / "out"
    options = replace(quick(toy), write=("csv", "geojson"))
    run(street / "pairs.csv", out, options=options)
    for rows, name in zip(tables(out), ("pairs", "changes"), strict=True):
        found = cells(out / f"{name}.csv")
        assert len(found) == len(rows) >= PAIRS
        for row, line in zip(rows, found, strict=True):
            assert set(line) - set(row) <= {"seconds"}  # which `tables` leaves out
            for column, value in row.items():
                text = isinstance(value, str | None)
                assert (line[column] if text else json.loads(line[column])) == value
    for number in range(PAIRS):
        mine = [row for row in cells(out / "changes.csv") if row["pair"] == f"p{number}"]
        assert cells(out / f"p{number}" / "changes.csv") == mine
        content = json.loads((out / f"p{number}" / "changes.geojson").read_text())
        assert [one["id"] for one in content["features"]] == [
            f"p{number}/{row['region']}" for row in mine
        ]


def test_label_studio_finds_the_photos_of_a_batch_where_it_ran(
    street: Path, tmp_path: Path, toy: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    options = replace(quick(toy), write=("label-studio",))
    run(street.relative_to(tmp_path) / "pairs.csv", tmp_path / "out", options=options)
    task = json.loads((tmp_path / "out" / "p3" / "label_studio.json").read_text())
    assert task["data"] == {
        "before": "/data/local-files/?d=street/t0/3.png",
        "after": "/data/local-files/?d=street/t1/3.png",
        "pair": "p3",
    }


def test_without_csv_there_are_no_such_tables(
    street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    run(street / "pairs.csv", tmp_path / "out", options=quick(toy))
    assert not list((tmp_path / "out").rglob("*.csv"))


def test_a_csv_table_never_takes_the_place_of_the_manifest(street: Path, toy: ModuleType) -> None:
    before = (street / "pairs.csv").read_bytes()
    options = replace(quick(toy), write=("csv",))
    with pytest.raises(OutputError, match=r"pairs\.csv: it is the manifest; choose another"):
        run(street / "pairs.csv", street, options=options)
    assert (street / "pairs.csv").read_bytes() == before
    assert sorted(path.name for path in street.iterdir()) == ["pairs.csv", "t0", "t1"]
    assert run(street / "pairs.csv", street, options=quick(toy)).failed == 0


def test_rows_folders_and_pixels_agree_with_the_detector(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    out = tmp_path / "out"
    summary = run(street / "pairs.csv", out, options=quick(toy))
    pairs, changes = tables(out)
    assert [row["pair"] for row in pairs] == [f"p{n}" for n in range(PAIRS)]
    assert (summary.pairs, summary.failed, summary.reused) == (PAIRS, 0, 0)
    assert summary.regions == len(changes) >= PAIRS
    for number, row in enumerate(pairs):
        names = (f"t0/{number}.png", f"t1/{number}.png")
        expected = toy.make().detect(*(street / name for name in names))
        paths = [f"../street/{name}" for name in names]
        assert (row["row"], row["before"], row["after"]) == (number + 1, *paths)
        assert (row["status"], row["error"]) == ("ok", None)
        assert row["regions"] == len(expected.regions)
        assert row["changed_fraction"] == expected.changed_fraction
        mine = [change for change in changes if change["pair"] == row["pair"]]
        assert [change["score"] for change in mine] == [r.score for r in expected.regions]
        for change, region in zip(mine, expected.regions, strict=True):
            rle = {"size": [change["height"], change["width"]], "counts": change["rle"]}
            assert coco_mask.area(rle) == change["area_px"] == region.area_px
            assert coco_mask.toBbox(rle).tolist() == change["bbox_xywh"] == [*region.bbox_xywh]
            rings = [[list(point) for point in ring] for ring in region.polygon_xy]
            assert change["polygon_xy"] == rings
        with Image.open(out / row["pair"] / "mask.png") as mask:
            assert ((np.asarray(mask) > 0) == expected.mask).all()
        saved = json.loads((out / row["pair"] / "changes.json").read_text())
        assert saved["before"]["path"] == f"../{paths[0]}"


@pytest.mark.slow
def test_after_kill_9_no_pair_is_computed_twice_and_the_tables_are_the_same(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    out, progress = tmp_path / "out", Counting()
    recorded = killed_after(RECORDED, toy, street / "pairs.csv", out)
    assert sorted(recorded) == sorted(names_in(out / "journal.sqlite"))
    assert not (out / "pairs.parquet").exists()

    run(street / "pairs.csv", out, options=quick(toy), progress=progress)
    assert computed(progress) == sorted({f"p{number}" for number in range(PAIRS)} - {*recorded})
    run(street / "pairs.csv", tmp_path / "whole", options=quick(toy))
    assert tables(out) == tables(tmp_path / "whole")


def killed_after(count: int, toy: ModuleType, manifest: Path, out: Path) -> list[str]:
    """Kill a batch when it has recorded some pairs; return their names."""
    command = [sys.executable, str(toy.__file__), str(manifest), str(out)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        recorded = [process.stdout.readline().strip()]
        while len(recorded) < count:
            print(file=process.stdin, flush=True)
            recorded.append(process.stdout.readline().strip())
        process.kill()
        assert process.wait() == -signal.SIGKILL
    return recorded


def names_in(journal: Path) -> list[str]:
    with closing(sqlite3.connect(journal)) as database:
        return [name for (name,) in database.execute("SELECT name FROM done")]


def test_only_what_changed_is_computed_again(street: Path, tmp_path: Path, toy: ModuleType) -> None:
    def again(**settings: Any) -> list[str]:
        progress = Counting()
        run(
            street / "pairs.csv",
            tmp_path / "out",
            options=quick(toy, **settings),
            progress=progress,
        )
        return computed(progress)

    everything = [f"p{n}" for n in range(PAIRS)]
    assert again() == everything
    assert again() == []
    path = street / "t1" / "3.png"
    pixels = np.asarray(Image.open(path)).copy()
    pixels[0, 0] ^= 255
    Image.fromarray(pixels).save(path)
    assert again() == ["p3"]
    (tmp_path / "out" / "p5" / "mask.png").unlink()
    assert again() == ["p5"]
    assert again(tau=0.6) == everything


def files_of(street: Path, out: Path, toy: ModuleType) -> list[Path]:
    run(street / "pairs.csv", out, options=quick(toy))
    return sorted(out.glob("p*/*"))


def test_a_flipped_byte_anywhere_in_a_pairs_files_makes_that_pair_again_and_no_other(
    street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    for path in files_of(street, tmp_path / "out", toy):
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
        progress = Counting()
        run(street / "pairs.csv", tmp_path / "out", options=quick(toy), progress=progress)
        assert computed(progress) == [path.parent.name]
        assert path.read_bytes() != bytes(content)


def test_a_pairs_files_are_on_the_disk_before_the_journal_says_so(
    street: Path, tmp_path: Path, toy: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[str] = []
    at_record: dict[str, list[str]] = {}
    fsync, record = os.fsync, Journal.record

    def watched_fsync(descriptor: int) -> None:
        synced.append(str(Path(f"/proc/self/fd/{descriptor}").readlink()))
        fsync(descriptor)

    def watched_record(journal: Journal, outcome: Outcome) -> None:
        at_record[outcome.name] = [*synced]
        record(journal, outcome)

    monkeypatch.setattr(os, "fsync", watched_fsync)
    monkeypatch.setattr(Journal, "record", watched_record)
    out = tmp_path / "out"
    run(street / "pairs.csv", out, options=quick(toy))
    for name, paths in at_record.items():
        ends = [path.partition(".part")[2] for path in paths if ".part/" in path]
        assert {f"/{name}", f"/{name}/mask.png", f"/{name}/changes.json"} <= {*ends}
        assert paths[-1] == str(out)  # the folder's own name, too
    assert [Path(path).name.split(".")[1] for path in synced[-4::2]] == ["changes", "pairs"]


def test_what_a_killed_run_left_half_written_is_removed_by_the_next(
    street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    out = tmp_path / "out"
    files_of(street, out, toy)
    (out / ".zeroscd-0123abcd.part" / "p1").mkdir(parents=True)
    (out / ".zeroscd-0123abcd.part" / "p1" / "mask.png").touch()
    (out / ".pairs.parquet.7.8.part").touch()
    (out / "p3" / ".zeroscd-0123abcd.part").mkdir()
    (out / "p3" / "mask.png").unlink()
    (out / "of the user.part").touch()
    files_of(street, out, toy)
    assert [path.name for path in out.rglob("*.part")] == ["of the user.part"]


def test_a_link_in_place_of_a_pairs_folder_is_not_followed(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    for folder in (out, elsewhere):
        folder.mkdir()
    (out / "p1").symlink_to(elsewhere)
    (out / "p2").symlink_to(tmp_path / "nowhere")
    (out / "p3").write_text("a file")
    for _ in range(2):
        assert run(street / "pairs.csv", out, options=quick(toy)).failed == 3
        errors = [row["error"] for row in tables(out)[0][1:4]]
        assert errors == [
            f"{out}/p1 is a link, not a folder; remove it",
            f"{out}/p2 is a link, not a folder; remove it",
            f"{out}/p3 is a file, not a folder; remove it",
        ]
    assert list(elsewhere.iterdir()) == []
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("name", ["journal.sqlite", "changes.parquet"])
def test_a_link_in_place_of_a_file_of_ours_is_refused(
    street: Path, tmp_path: Path, toy: ModuleType, name: str
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).symlink_to(tmp_path / "mine")
    with pytest.raises(OutputError, match=rf"{name}: it is a link to .*mine; remove the link"):
        run(street / "pairs.csv", tmp_path / "out", options=quick(toy))
    assert not (tmp_path / "mine").exists()


def test_a_manifest_may_grow_and_lose_rows(
    street: Path,
    tmp_path: Path,
    toy: ModuleType,
    tables: Tables,
    write_manifest: Callable[..., Path],
) -> None:
    out, progress = tmp_path / "out", Counting()
    rows = [(f"t0/{n}.png", f"t1/{n}.png", f"p{n}") for n in (4, 0, 2)]
    run(write_manifest(street / "few.csv", rows), out, options=quick(toy))
    rows = [(f"t0/{n}.png", f"t1/{n}.png", f"p{n}") for n in (1, 2, 0)]
    run(write_manifest(street / "few.csv", rows), out, options=quick(toy), progress=progress)
    assert computed(progress) == ["p1"]
    assert [row["pair"] for row in tables(out)[0]] == ["p1", "p2", "p0"]


def test_every_row_of_a_hostile_manifest_is_accounted_for(
    street: Path,
    tmp_path: Path,
    toy: ModuleType,
    tables: Tables,
    write_manifest: Callable[..., Path],
) -> None:
    (street / "t1" / "1.png").write_bytes((street / "t1" / "1.png").read_bytes()[:200])
    (street / "t1" / "2.png").write_bytes(b"")
    rows = [
        ("t0/0.png", "t1/0.png", "same"),
        ("t0/1.png", "t1/1.png", "cut short"),
        ("t0/2.png", "t1/2.png", "empty"),
        ("t0/9.png", "t1/0.png", "missing"),
        ("", "t1/0.png", "unsaid"),
        ("t0/3.png", "t1/3.png", "same"),
        ("t0/4.png", "t1/4.png", "SAME"),
        ("t0/5.png", "t1/5.png", "../../etc"),
        ("t0/5.png", "t1/5.png", "pairs.parquet"),
        ("t0/5.png", "t1/5.png", ""),
    ]
    out = tmp_path / "out"
    progress = Counting()
    summary = run(
        write_manifest(street / "bad.csv", rows), out, options=quick(toy), progress=progress
    )
    pairs, changes = tables(out)
    assert [row["pair"] for row in pairs] == [
        "same", "cut short", "empty", "missing", "unsaid",
        "same-2", "SAME-3", "_.._etc", "pairs.parquet-2", "5",
    ]  # fmt: skip
    assert [row["id"] for row in pairs[:9]] == [row[2] for row in rows[:9]]
    errors = {row["pair"]: row["error"] for row in pairs if row["status"] == "error"}
    assert "damaged or cut short" in errors["cut short"]
    assert "is empty (0 bytes)" in errors["empty"]
    assert "does not exist" in errors["missing"]
    assert errors["unsaid"] == "the manifest says no before"
    assert len(errors) == summary.failed == 4
    assert {change["pair"] for change in changes} == {r["pair"] for r in pairs} - set(errors)
    folders = {path.name for path in out.iterdir() if path.is_dir()}
    assert folders == {r["pair"] for r in pairs} - set(errors)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "street"]
    assert progress.total == len(progress.heard) == 9  # the row without a photo needs no wait


def test_a_photo_that_is_repaired_is_compared_the_next_time(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    out, path = tmp_path / "out", street / "t0" / "2.png"
    whole = path.read_bytes()
    path.write_bytes(whole[:100])
    assert run(street / "pairs.csv", out, options=quick(toy)).failed == 1
    path.write_bytes(whole)
    summary = run(street / "pairs.csv", out, options=quick(toy))
    assert (summary.failed, summary.reused) == (0, PAIRS - 1)
    run(street / "pairs.csv", tmp_path / "fresh", options=quick(toy))
    assert tables(out) == tables(tmp_path / "fresh")


def test_a_fault_inside_costs_one_pair_and_not_the_night(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    def stumble(result: Any) -> None:
        if result.after.path.endswith("3.png"):
            message = "ours\nto mend"
            raise ZeroDivisionError(message)

    summary = run(
        street / "pairs.csv", tmp_path / "out", options=Options(detector=partial(toy.make, stumble))
    )
    assert summary.failed == 1
    row = tables(tmp_path / "out")[0][3]
    assert row["error"] == r"failed inside: ZeroDivisionError('ours\nto mend')"


def test_what_would_fail_for_every_pair_ends_the_run(
    street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    def damaged() -> Any:
        message = "the weights are damaged"
        raise WeightsError(message)

    with pytest.raises(WeightsError, match="damaged"):
        run(street / "pairs.csv", tmp_path / "out", options=Options(detector=damaged))
    with pytest.raises(SettingsError, match="file to write 'masks'; did you mean mask"):
        run(street / "pairs.csv", tmp_path / "new", options=Options(write=("masks",)))
    assert not (tmp_path / "new").exists()


def test_an_output_that_cannot_be_written_is_refused_with_its_path(
    street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="file is not a folder"):
        run(street / "pairs.csv", tmp_path / "file" / "out", options=quick(toy))
    (tmp_path / "out" / "changes.parquet").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"changes\.parquet"):
        run(street / "pairs.csv", tmp_path / "out", options=quick(toy))
    assert not list((tmp_path / "out").glob(".*part"))


def test_a_photo_of_many_pairs_is_encoded_once(
    street: Path, tmp_path: Path, toy: ModuleType, write_manifest: Callable[..., Path]
) -> None:
    detector = toy.make()
    rows = [("t0/0.png", f"t1/{n}.png", f"p{n}") for n in range(PAIRS)]
    manifest = write_manifest(street / "one.csv", rows)
    options = Options(detector=lambda: detector)
    summary = run(manifest, tmp_path / "out", options=options, engine=Local(workers=3))
    assert detector.models.encoder.encoded == 1 + PAIRS
    assert (summary.encoded, summary.cache_hits) == (PAIRS + 1, PAIRS - 1)


def test_several_workers_give_the_same_tables(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    for name, workers in (("one", 1), ("three", 3)):
        run(
            street / "pairs.csv", tmp_path / name, options=quick(toy), engine=Local(workers=workers)
        )
    assert tables(tmp_path / "one") == tables(tmp_path / "three")


def test_without_files_there_are_no_folders_and_the_tables_are_the_same(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    run(street / "pairs.csv", tmp_path / "full", options=quick(toy))
    run(street / "pairs.csv", tmp_path / "bare", options=Options(detector=toy.make, write=()))
    assert tables(tmp_path / "full") == tables(tmp_path / "bare")
    assert not [path for path in (tmp_path / "bare").iterdir() if path.is_dir()]


def test_two_folders_are_a_manifest(
    street: Path, tmp_path: Path, toy: ModuleType, tables: Tables
) -> None:
    run(open_folders(street / "t0", street / "t1"), tmp_path / "out", options=quick(toy))
    run(street / "pairs.csv", tmp_path / "listed", options=quick(toy))
    found, listed = tables(tmp_path / "out"), tables(tmp_path / "listed")
    assert [row["pair"] for row in found[0]] == [str(n) for n in range(PAIRS)]
    scores = [[change["score"] for change in changes] for _, changes in (found, listed)]
    assert scores[0] == scores[1]


def test_an_empty_manifest_gives_empty_tables(
    tmp_path: Path, toy: ModuleType, tables: Tables, write_manifest: Callable[..., Path]
) -> None:
    summary = run(write_manifest(tmp_path / "m.csv", []), tmp_path / "out", options=quick(toy))
    assert summary.pairs == 0
    assert tables(tmp_path / "out") == ([], [])


def test_an_engine_that_loses_pairs_is_found_out(
    street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    class Forgetful:
        def run(self, tasks: Iterable[Task], options: Options) -> Iterator[Outcome]:
            for outcome in Local().run(tasks, options):
                if outcome.name != "p4":
                    yield outcome

    with pytest.raises(ZeroscdError, match="1 pairs have no outcome"):
        run(street / "pairs.csv", tmp_path / "out", options=quick(toy), engine=Forgetful())
    assert not (tmp_path / "out" / "pairs.parquet").exists()
