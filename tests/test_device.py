"""Which device the networks run on, told apart by what torch says is there."""

from __future__ import annotations

import re
import threading

import pytest

from zeroscd import device
from zeroscd.device import (
    DEVICES,
    pick_device,
    pick_precision,
    side_by_side,
    thread_count,
    threads,
)
from zeroscd.errors import SettingsError


def pretend(monkeypatch: pytest.MonkeyPatch, *there: str) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: "cuda" in there)
    monkeypatch.setattr("torch.backends.mps.is_available", lambda: "mps" in there)


def test_an_unknown_device_is_refused_with_the_known_ones() -> None:
    said = "unknown device 'gpu'; did you mean cpu? (choose one of: auto, cpu, cuda, mps)"
    with pytest.raises(SettingsError, match=re.escape(said)):
        pick_device("gpu")


@pytest.mark.parametrize(
    ("there", "expected"),
    [((), "cpu"), (("cuda",), "cuda"), (("mps",), "mps"), (("cuda", "mps"), "cuda")],
)
def test_auto_takes_the_accelerator_that_is_there(
    there: tuple[str, ...], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pretend(monkeypatch, *there)
    assert pick_device("auto") == expected


@pytest.mark.parametrize("device", ["cuda", "mps"])
def test_a_device_is_taken_where_it_is_and_refused_where_it_is_not(
    device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = "mps" if device == "cuda" else "cuda"
    pretend(monkeypatch, device, other)
    assert pick_device(device) == device
    pretend(monkeypatch, other)
    with pytest.raises(SettingsError, match=f"device {device} is not available .* --device cpu"):
        pick_device(device)
    assert pick_device("cpu") == "cpu"


def test_precision_follows_the_device_unless_someone_decides(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("torch.cuda.is_bf16_supported", lambda: True)
    found = {device: pick_precision("auto", device=device) for device in ("cpu", "cuda", "mps")}
    assert found == {"cpu": "fp32", "cuda": "bf16", "mps": "fp32"}
    monkeypatch.setattr("torch.cuda.is_bf16_supported", lambda: False)
    assert pick_precision("auto", device="cuda") == "fp32"
    for name in DEVICES:
        assert pick_precision("bf16", device=name) == "bf16"


def test_items_are_computed_at_the_same_time_on_one_thread_each() -> None:
    meeting = threading.Barrier(3, timeout=60)

    def meet(item: str) -> tuple[str, int]:
        meeting.wait()  # breaks unless three are here at once
        return item, thread_count()

    with threads(3):
        assert side_by_side(meet, "abc") == [("a", 1), ("b", 1), ("c", 1)]
        assert thread_count() == 3


def test_with_one_thread_items_are_computed_in_the_thread_that_called() -> None:
    with threads(1):
        found = side_by_side(lambda _: threading.get_ident(), range(3))
    assert found == [threading.get_ident()] * 3
    assert side_by_side(lambda item: item, ()) == []


def test_other_threads_begin_with_all_cores_during_and_after() -> None:
    def of_a_new_thread(_: object) -> int:
        seen: list[int] = []
        other = threading.Thread(target=lambda: seen.append(thread_count()))
        other.start()
        other.join()
        return seen[0]

    with threads(3):
        assert side_by_side(of_a_new_thread, "ab") == [3, 3]
        assert of_a_new_thread(None) == 3


def test_the_first_failure_beside_others_is_raised() -> None:
    with threads(2), pytest.raises(ZeroDivisionError):
        side_by_side(lambda item: 1 // item, [1, 0, 2])


def test_an_interrupt_while_threads_start_ends_them(monkeypatch: pytest.MonkeyPatch) -> None:
    class Interrupted(threading.Barrier):
        def wait(self, timeout: float | None = None) -> int:
            if threading.current_thread() is threading.main_thread():
                raise KeyboardInterrupt
            return super().wait(timeout)

    monkeypatch.setattr(device, "Barrier", Interrupted)
    monkeypatch.setattr(device, "thread_count", lambda: 2)
    with pytest.raises(KeyboardInterrupt):
        side_by_side(str, [1, 2])
    assert not [one for one in threading.enumerate() if one.name.startswith("lone")]
