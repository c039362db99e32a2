from __future__ import annotations

import threading
from concurrent.futures import CancelledError
from typing import TYPE_CHECKING

import pytest

from zeroscd.serve.problems import Problem
from zeroscd.serve.worker import CancelToken, Worker

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def worker() -> Iterator[Worker]:
    made = Worker(max_waiting=2)
    yield made
    made.stop()


@pytest.fixture
def go(worker: Worker) -> Iterator[threading.Event]:
    """Keep the worker busy until this is set."""
    begun, event = threading.Event(), threading.Event()

    def hold() -> None:
        begun.set()
        event.wait(10)

    worker.submit(hold)
    assert begun.wait(10)
    yield event
    event.set()


def test_tasks_run_in_the_order_of_asking_and_in_one_thread(
    worker: Worker, go: threading.Event
) -> None:
    done: list[tuple[int, int]] = []
    tasks = [
        worker.submit(lambda n=n: done.append((n, threading.get_ident())))  # type: ignore[misc]
        for n in range(2)
    ]
    assert [worker.ahead_of(task) for task in tasks][-1] == 1
    go.set()
    for task in tasks:
        task.result(10)
    assert [n for n, _ in done] == [0, 1]
    assert len({thread for _, thread in done}) == 1


def test_one_task_too_many_is_told_when_to_come_again(worker: Worker, go: threading.Event) -> None:
    del go
    for _ in range(2):
        worker.submit(int)
    with pytest.raises(Problem, match="2 requests wait") as refused:
        worker.submit(int)
    assert refused.value.status_code == 429
    assert refused.value.headers is not None
    assert int(refused.value.headers["Retry-After"]) == 4  # two tasks of two seconds
    assert worker.submit(int, always=True) is not None


def test_the_running_task_does_not_count_as_waiting(worker: Worker, go: threading.Event) -> None:
    del go
    assert worker.waiting == 0


def test_a_task_that_is_cancelled_makes_room(worker: Worker, go: threading.Event) -> None:
    tasks = [worker.submit(int) for _ in range(2)]
    assert tasks[0].cancel()
    assert worker.waiting == 1
    go.set()
    assert tasks[1].result(10) == 0


def test_an_accident_reaches_whoever_waits_and_nobody_else(worker: Worker) -> None:
    broken = worker.submit(lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        broken.result(10)
    assert worker.submit(lambda: 7).result(10) == 7


def test_a_cancelled_token_stops_the_task() -> None:
    cancel_token = CancelToken()
    cancel_token.check()
    cancel_token.cancel()
    with pytest.raises(CancelledError):
        cancel_token.check()
