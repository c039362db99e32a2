from __future__ import annotations

import sqlite3
from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from zeroscd.errors import OutputError
from zeroscd.serve.job_records import Finished
from zeroscd.serve.job_store import JobStore
from zeroscd.serve.service import PhotoPair

if TYPE_CHECKING:
    from pathlib import Path

PAIRS = [PhotoPair(b"b0", b"a0"), PhotoPair(b"b1", b"a1")]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "jobs.sqlite3"


def statuses(store: JobStore, job: str) -> list[str]:
    found = store.status(job)
    assert found is not None
    return [pair.status for pair in found.pairs]


def test_pairs_are_taken_in_the_order_they_came(path: Path) -> None:
    store = JobStore(path)
    first = store.add(PAIRS, preset="lite", values={"alpha": 0.5})
    store.add(PAIRS[:1], preset="lite", values={})
    taken = [store.claim() for _ in range(4)]
    assert [work and (work.job == first.id, work.number) for work in taken] == [
        (True, 0),
        (True, 1),
        (False, 0),
        None,
    ]
    assert taken[1] is not None
    assert (taken[1].photos, taken[1].preset, taken[1].values) == (PAIRS[1], "lite", {"alpha": 0.5})


def test_a_job_is_on_disk_when_it_is_acknowledged(path: Path) -> None:
    job = JobStore(path).add(PAIRS, preset="lite", values={}).id  # never closed, as after kill -9
    again = JobStore(path)
    assert again.recover() == 2
    assert statuses(again, job) == ["waiting", "waiting"]
    work = again.claim()
    assert work is not None
    assert work.photos == PAIRS[0]


def test_a_result_survives_and_its_photos_do_not(path: Path) -> None:
    store = JobStore(path)
    job = store.add([PhotoPair(b"S3CRET" * 50, b"x")], preset="lite", values={}).id
    work = store.claim()
    assert work is not None
    store.finish(work, Finished(b"{}", b"png"))
    store.expire(seconds=60)
    store.close()
    assert b"S3CRET" not in path.read_bytes()
    again = JobStore(path)
    assert again.finished(job, 0) == Finished(b"{}", b"png")
    assert again.finished(job, 1) is None
    assert again.claim() is None


def test_a_pair_that_ends_the_process_again_and_again_is_given_up(path: Path) -> None:
    job = JobStore(path).add(PAIRS[:1], preset="lite", values={}).id
    for waiting in (1, 1, 1, 1, 1, 0):
        store = JobStore(path)
        assert store.recover() == waiting
        work = store.claim()
        assert (work is None) == (waiting == 0)
    found = store.status(job)
    assert found is not None
    assert found.pairs[0].status == "failed"
    assert "stopped each time" in str(found.pairs[0].problem)


def test_a_pair_that_is_released_counts_as_not_begun(path: Path) -> None:
    store = JobStore(path)
    job = store.add(PAIRS[:1], preset="lite", values={}).id
    for _ in range(5):
        work = store.claim()
        assert work is not None
        store.release(work)
    assert statuses(store, job) == ["waiting"]
    assert store.recover() == 1


def test_a_failure_is_kept_in_words(path: Path) -> None:
    store = JobStore(path)
    job = store.add(PAIRS[:1], preset="lite", values={}).id
    work = store.claim()
    assert work is not None
    store.fail(work, "the photo before is damaged")
    found = store.status(job)
    assert found is not None
    assert found.pairs[0].problem == "the photo before is damaged"
    assert store.finished(job, 0) is None


def test_removing_a_job_drops_what_waits_and_ignores_what_comes_late(path: Path) -> None:
    store = JobStore(path)
    job = store.add(PAIRS, preset="lite", values={}).id
    work = store.claim()
    assert work is not None
    assert store.remove(job)
    assert not store.remove(job)
    store.finish(work, Finished(b"{}", b"png"))
    assert store.claim() is None
    assert store.status(job) is None
    assert store.count() == 0


def test_old_jobs_are_forgotten_and_their_space_is_given_back(path: Path) -> None:
    now = 1000.0
    store = JobStore(path, clock=lambda: now)
    old = store.add([PhotoPair(bytes(2_000_000), b"")], preset="lite", values={}).id
    full = store.size_bytes()
    now = 1500.0
    young = store.add(PAIRS, preset="lite", values={}).id
    now = 1601.0
    assert store.expire(seconds=600) == 1
    assert store.status(old) is None
    assert store.status(young) is not None
    assert store.size_bytes() < full - 1_900_000
    assert path.stat().st_size < 200_000


def change(path: Path, statement: str, *values: object) -> None:
    """Damage the database from outside, as a bad sector or another program does."""
    with closing(sqlite3.connect(path)) as db, db:
        db.execute(statement, values)


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE jobs SET settings = '{\"alpha\": 0.'",
        "UPDATE jobs SET settings = '[1]'",
        "UPDATE jobs SET settings = CAST(x'fffe7b7d' AS TEXT)",
        "UPDATE jobs SET settings = '" + "[" * 100_000 + "'",
        "UPDATE pairs SET before = NULL",
        "UPDATE pairs SET after = 'text'",
    ],
)
def test_a_damaged_row_fails_alone(path: Path, statement: str) -> None:
    store = JobStore(path)
    damaged = store.add(PAIRS, preset="lite", values={}).id
    change(path, statement)
    sound = store.add(PAIRS[:1], preset="lite", values={}).id
    work = store.claim()
    assert work is not None
    assert (work.job, work.photos) == (sound, PAIRS[0])
    assert statuses(store, damaged) == ["failed", "failed"]
    found = store.status(damaged)
    assert found is not None
    assert "damaged" in str(found.pairs[0].problem)


def break_photo(path: Path, photo: bytes) -> None:
    """Break the chain of pages that hold a photo, which SQLite notices when it reads it."""
    change(path, "PRAGMA wal_checkpoint(TRUNCATE)")
    data = bytearray(path.read_bytes())
    pages = range(0, len(data), 4096)
    page = next(at for at in pages if data[at + 4 : at + 1000] in photo)
    data[page : page + 4] = b"\xff\xff\xff\x7f"
    path.write_bytes(data)


def test_a_photo_that_cannot_be_read_or_dropped_stops_no_other_pair(path: Path) -> None:
    first = JobStore(path)
    photo = b"photo" * 2000
    job = first.add([PhotoPair(photo, b""), PAIRS[1]], preset="lite", values={}).id
    first.close()
    break_photo(path, photo)
    store = JobStore(path)
    assert store.recover() == 2
    work = store.claim()
    assert work is not None
    assert work.number == 1
    store.finish(work, Finished(b"{}", b"png"))
    assert store.claim() is None
    assert statuses(store, job) == ["failed", "done"]


def test_a_pair_that_broke_while_it_was_compared_stops_no_start(path: Path) -> None:
    first = JobStore(path)
    photo = b"photo" * 2000
    job = first.add([PhotoPair(photo, b""), PAIRS[1]], preset="lite", values={}).id
    assert first.claim() is not None
    first.close()
    break_photo(path, photo)
    store = JobStore(path)
    store.recover()
    work = store.claim()
    assert work is not None
    assert (work.job, work.number) == (job, 1)
    assert statuses(store, job) == ["failed", "running"]


def test_a_full_disk_leaves_no_transaction_open(path: Path) -> None:
    store = JobStore(path)
    store.add(PAIRS[:1], preset="lite", values={})
    (pages,) = store._db.execute("PRAGMA page_count").fetchone()
    store._db.execute(f"PRAGMA max_page_count = {pages}")
    for _ in range(2):
        with pytest.raises(sqlite3.OperationalError, match="full"):
            store.add([PhotoPair(bytes(100_000), b"")], preset="lite", values={})
    assert store.count() == 1
    assert store.claim() is not None


def test_counting_tells_the_states_apart(path: Path) -> None:
    store = JobStore(path)
    store.add(PAIRS, preset="lite", values={})
    store.claim()
    assert (store.count(), store.count("waiting"), store.count("running")) == (2, 1, 1)


def test_a_file_that_is_no_database_is_refused_in_one_line(path: Path) -> None:
    path.write_bytes(b"not a database" * 100)
    with pytest.raises(OutputError, match="choose another --state"):
        JobStore(path)


SEVERAL = PhotoPair(b"b0", b"a0", (b"b1", b"b2"), (b"a1",))


def rows(path: Path) -> int:
    with closing(sqlite3.connect(path)) as database:
        return int(database.execute("SELECT count(*) FROM further_photos").fetchone()[0])


def test_further_photos_survive_a_crash_and_keep_their_side_and_order(path: Path) -> None:
    JobStore(path).add([PAIRS[0], SEVERAL, PAIRS[1]], preset="lite", values={})  # never closed
    again = JobStore(path)
    assert again.recover() == 3
    taken = [again.claim() for _ in range(3)]
    assert [work and work.photos for work in taken] == [PAIRS[0], SEVERAL, PAIRS[1]]


@pytest.mark.parametrize("end", ["finish", "fail", "remove", "expire"])
def test_further_photos_are_deleted_with_the_others(path: Path, end: str) -> None:
    now = 1000.0
    store = JobStore(path, clock=lambda: now)
    job = store.add([SEVERAL, SEVERAL], preset="lite", values={}).id
    work = store.claim()
    assert work is not None
    assert rows(path) == 6
    if end == "finish":
        store.finish(work, Finished(b"{}", b"png"))
    elif end == "fail":
        store.fail(work, "damaged")
    elif end == "remove":
        store.remove(job)
    else:
        now = 2000.0
        store.expire(seconds=600)
    assert rows(path) == (3 if end in {"finish", "fail"} else 0)


def test_a_further_photo_that_is_no_longer_bytes_fails_its_pair_alone(path: Path) -> None:
    store = JobStore(path)
    job = store.add([SEVERAL, PAIRS[1]], preset="lite", values={}).id
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE further_photos SET photo = 7 WHERE side = 'after'")
    work = store.claim()
    assert work is not None
    assert work.photos == PAIRS[1]
    assert statuses(store, job) == ["failed", "running"]
    assert rows(path) == 0
