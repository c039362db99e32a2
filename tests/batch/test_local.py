"""The local engine's pipeline: what it may hold, and what happens at the same time."""

from __future__ import annotations

import os
import threading
from concurrent.futures import Future
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import pytest
import torch
from threadpoolctl import threadpool_info

from zeroscd.batch import comparer as comparer_module
from zeroscd.batch import local
from zeroscd.batch.comparer import Options, PairComparer
from zeroscd.batch.local import Local, outcome_of, run_all
from zeroscd.batch.task import Outcome, Task
from zeroscd.errors import ImageError, OutputError
from zeroscd.images.read import read_photo
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    from zeroscd.images.photo import Photo

PATIENCE_S = 20.0


def tasks_of(street: Path, count: int, names: tuple[str, str] = ("t0", "t1")) -> Iterator[Task]:
    for number in range(count):
        before, after = (str(street / name / f"{number % 6}.png") for name in names)
        yield Task(row=number + 1, name=str(number), before=before, after=after)


def test_only_a_few_pairs_are_under_way_however_many_there_are(
    street: Path, toy: ModuleType
) -> None:
    taken = finished = most = 0

    def counted() -> Iterator[Task]:
        nonlocal taken, most
        for task in tasks_of(street, 100):
            taken += 1
            most = max(most, taken - finished)
            yield task

    rows = []
    for outcome in Local(workers=1).run(counted(), Options(detector=toy.make)):
        rows.append(outcome.row)
        finished += 1
    assert sorted(rows) == list(range(1, 101))
    assert most <= 7  # one compared, three read or drawn, two waiting, one just taken


def test_the_next_photos_are_read_while_a_pair_is_compared(
    street: Path, toy: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    read_t1 = [threading.Event() for _ in range(2)]
    compared: list[bool] = []

    def read(content: bytes, *, name: str) -> Photo:
        if "/t1/" in name:
            read_t1[int(Path(name).stem)].set()
        return read_photo(content, name=name)

    def wait_for_the_other(result: Any) -> None:
        compared.append(all(event.wait(PATIENCE_S) for event in read_t1))

    monkeypatch.setattr(comparer_module, "read_photo", read)
    comparer = PairComparer(Options(detector=lambda: toy.make(wait_for_the_other)))
    assert len(list(run_all(tasks_of(street, 2), comparer, workers=1, cores=1))) == 2
    assert compared == [True, True]


def test_no_more_pairs_than_workers_are_compared_at_once(street: Path, toy: ModuleType) -> None:
    turn, now, most = threading.Lock(), 0, 0
    together = threading.Barrier(2)

    class Counting(toy.ToyDetector):  # type: ignore[name-defined,misc]
        def compare(self, *views: Any, **known: Any) -> Any:
            nonlocal now, most
            with turn:
                now += 1
                most = max(most, now)
            together.wait(PATIENCE_S)  # breaks unless two are here at once
            found = super().compare(*views, **known)
            with turn:
                now -= 1
            return found

    model = toy.make()
    options = Options(detector=lambda: Counting(model.settings, model.models))
    outcomes = list(Local(workers=2).run(tasks_of(street, 8), options))
    assert [outcome.error for outcome in outcomes] == [None] * 8
    assert most == 2


def test_workers_share_the_cores_and_give_them_back(
    street: Path, toy: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    monkeypatch.setattr(local, "thread_count", lambda: 6)
    before = allowed()
    watch = Options(detector=lambda: toy.make(lambda result: seen.append(allowed())))
    for workers, share in ((2, 3), (4, 1), (9, 1)):
        seen.clear()
        assert len(list(Local(workers=workers).run(tasks_of(street, 3), watch))) == 3
        assert seen == [(share, share, share)] * 3
    assert allowed() == before


def allowed() -> tuple[int, int, int]:
    """Threads of torch, of OpenCV and of NumPy's algebra."""
    blas = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
    return torch.get_num_threads(), cv2.getNumThreads(), max(blas)


def test_only_the_lite_models_are_light_enough_for_a_pair_on_each_core(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: 12)
    assert local.default_workers(Settings()) == 12
    assert local.default_workers(Settings(encoder="dinov2-b")) == 1
    assert local.default_workers(Settings(segmenter="sam-vit-h")) == 1


def test_a_consumer_that_stops_leaves_no_thread_behind(street: Path, toy: ModuleType) -> None:
    before = threading.active_count()
    running = Local().run(tasks_of(street, 50), Options(detector=toy.make))
    next(running)
    running.close()  # type: ignore[attr-defined]
    assert threading.active_count() == before


def test_the_same_bytes_at_two_addresses_keep_their_own_names(
    street: Path, toy: ModuleType
) -> None:
    (street / "t1" / "0.png").write_bytes((street / "t0" / "0.png").read_bytes())
    comparer = PairComparer(Options(detector=toy.make, write=("json",)))
    (task,) = tasks_of(street, 1)
    outcome = comparer.compare(task, nullcontext())
    assert (outcome.encoded, outcome.cache_hits) == (1, 1)
    text = outcome.files["changes.json"].decode()
    assert task.before in text
    assert task.after in text
    assert outcome.changes == ()


def test_a_known_pair_is_not_decoded(street: Path, toy: ModuleType) -> None:
    (task,) = tasks_of(street, 1)
    options = Options(detector=toy.make)
    key = PairComparer(options).compare(task, nullcontext()).key
    known = Task(row=1, name="0", before=task.before, after=task.after, known=key)
    outcome = PairComparer(options).compare(known, nullcontext())
    assert outcome == Outcome(row=1, name="0", key=key, reused=True)
    swapped = Task(row=1, name="0", before=task.after, after=task.before, known=key)
    assert not PairComparer(options).compare(swapped, nullcontext()).reused


TASK = Task(row=3, name="elm", before="b", after="a")


def failed(error: BaseException) -> Future[Outcome]:
    future: Future[Outcome] = Future()
    future.set_exception(error)
    return future


def test_a_photo_that_cannot_be_read_is_an_outcome() -> None:
    outcome = outcome_of(failed(ImageError("gone")), TASK)
    assert outcome == Outcome(row=3, name="elm", error="gone")


@pytest.mark.parametrize("error", [OutputError("disk full"), KeyboardInterrupt()])
def test_what_is_not_the_pairs_fault_goes_up(error: BaseException) -> None:
    with pytest.raises(type(error)):
        outcome_of(failed(error), TASK)
