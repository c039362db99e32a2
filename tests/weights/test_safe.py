from __future__ import annotations

import pickle
import zipfile
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch

from zeroscd.errors import WeightsError
from zeroscd.weights.safe import read_tensors

if TYPE_CHECKING:
    from pathlib import Path


class Bomb:
    """Runs a command when unpickled the careless way."""

    def __init__(self, victim: Path) -> None:
        self.victim = victim

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return type(self.victim).touch, (self.victim,)


@pytest.mark.parametrize("old_format", [False, True])
def test_tensors_come_back_exactly(tmp_path: Path, *, old_format: bool) -> None:
    wanted = {"a.weight": torch.randn(3, 4), "b": torch.arange(5)}
    torch.save(wanted, tmp_path / "w.pth", _use_new_zipfile_serialization=not old_format)
    found = read_tensors(tmp_path / "w.pth")
    assert found.keys() == wanted.keys()
    assert all(torch.equal(found[key], wanted[key]) for key in wanted)


@pytest.mark.parametrize("wrapper", ["model_state_dict", "state_dict", "model"])
def test_a_dictionary_around_the_tensors_is_taken_off(tmp_path: Path, wrapper: str) -> None:
    torch.save({wrapper: {"a": torch.ones(2)}, "epoch": 7}, tmp_path / "w.pth")
    assert list(read_tensors(tmp_path / "w.pth")) == ["a"]


def test_numpy_scores_beside_the_weights_do_no_harm(tmp_path: Path) -> None:
    torch.save(
        {
            "epoch_num": 12,
            "model_state_dict": {"a": torch.ones(2)},
            "optimizer_state_dict": {"state": {}, "param_groups": [{"lr": 1e-5}]},
            "recalls": np.array([89.7, 95.0, 96.2]),
            "best_r5": np.float64(95.0),
            "not_improved_num": np.int64(0),
        },
        tmp_path / "w.pth",
    )
    assert torch.equal(read_tensors(tmp_path / "w.pth")["a"], torch.ones(2))


def test_numpy_scores_written_by_numpy_1_are_read_too(tmp_path: Path) -> None:
    torch.save(
        {"model": {"a": torch.ones(1)}, "best": np.float64(1.0)},
        tmp_path / "new.pth",
        _use_new_zipfile_serialization=False,
    )
    data = (tmp_path / "new.pth").read_bytes()
    assert b"numpy._core.multiarray" in data
    (tmp_path / "old.pth").write_bytes(
        data.replace(b"numpy._core.multiarray", b"numpy.core.multiarray")
    )
    assert torch.equal(read_tensors(tmp_path / "old.pth")["a"], torch.ones(1))


@pytest.mark.parametrize("as_torch_file", [True, False])
def test_a_pickle_that_would_run_something_is_refused_and_does_not_run(
    tmp_path: Path, *, as_torch_file: bool
) -> None:
    victim, path = tmp_path / "victim", tmp_path / "w.pth"
    content = {"a": torch.ones(1), "b": Bomb(victim)}
    if as_torch_file:
        torch.save(content, path)
    else:
        path.write_bytes(pickle.dumps(content, protocol=2))
    with pytest.raises(WeightsError, match="is refused") as caught:
        read_tensors(path)
    assert "\n" not in str(caught.value)
    assert not victim.exists()


@pytest.mark.parametrize("content", [b"", b"not weights at all", b"PK\x03\x04 broken zip"])
def test_a_file_that_is_no_checkpoint_is_an_error_of_one_line(
    tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "w.pth").write_bytes(content)
    with pytest.raises(WeightsError) as caught:
        read_tensors(tmp_path / "w.pth")
    assert "\n" not in str(caught.value)


def test_a_cut_off_checkpoint_is_called_damaged(tmp_path: Path) -> None:
    torch.save({"a": torch.randn(1000)}, tmp_path / "w.pth")
    data = (tmp_path / "w.pth").read_bytes()
    (tmp_path / "w.pth").write_bytes(data[: len(data) // 2])
    with pytest.raises(WeightsError, match=r"damaged|refused"):
        read_tensors(tmp_path / "w.pth")


@pytest.mark.parametrize("content", [b"quota exceeded\n", b"", b"\x80\x02", b"PK\x03\x04"])
def test_what_is_no_checkpoint_at_all_is_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "w.pth").write_bytes(content)
    with pytest.raises(WeightsError, match=r"damaged|refused"):
        read_tensors(tmp_path / "w.pth")


@pytest.mark.parametrize("old_format", [True, False])
def test_no_altered_byte_of_a_checkpoint_escapes_as_another_error(
    tmp_path: Path, *, old_format: bool
) -> None:
    path = tmp_path / "w.pth"
    torch.save({"a": torch.ones(3)}, path, _use_new_zipfile_serialization=not old_format)
    data = path.read_bytes()
    for at in range(0, len(data), 7):
        for altered in (data[:at], data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :]):
            path.write_bytes(altered)
            with suppress(WeightsError):
                read_tensors(path)


def test_data_without_named_tensors_is_no_checkpoint(tmp_path: Path) -> None:
    tables: list[dict[str, object]] = [{"a": torch.ones(1), "b": 3}, {}, {"model": {}}]
    for data in tables:
        torch.save(data, tmp_path / "w.pth")
        with pytest.raises(WeightsError, match="holds no table of named tensors"):
            read_tensors(tmp_path / "w.pth")


def test_safetensors_are_known_by_their_content(tmp_path: Path) -> None:
    safetensors = pytest.importorskip("safetensors.torch", reason="needs zeroscd[models]")
    wanted = {"a": torch.randn(2, 3)}
    safetensors.save_file(wanted, tmp_path / "renamed.pth")
    assert torch.equal(read_tensors(tmp_path / "renamed.pth")["a"], wanted["a"])
    data = (tmp_path / "renamed.pth").read_bytes()
    (tmp_path / "cut.pth").write_bytes(data[:-4])
    with pytest.raises(WeightsError, match="is damaged"):
        read_tensors(tmp_path / "cut.pth")


@pytest.mark.parametrize("old_format", [True, False])
def test_a_file_that_asks_for_64_gigabytes_is_refused_before_they_are_allocated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, old_format: bool
) -> None:
    path = tmp_path / "w.pth"
    torch.save({"a": torch.ones(1000)}, path, _use_new_zipfile_serialization=not old_format)
    asked = b"\x8a\x05" + (16 * 10**9).to_bytes(5, "little")  # a long number, in place of 1000
    if old_format:
        path.write_bytes(path.read_bytes().replace(b"M\xe8\x03", asked))
    else:
        with zipfile.ZipFile(path) as archive:
            parts = {name: archive.read(name) for name in archive.namelist()}
        with zipfile.ZipFile(path, "w") as archive:
            for name, content in parts.items():
                archive.writestr(name, content.replace(b"M\xe8\x03", asked))
    monkeypatch.setattr(torch, "load", None)  # nobody gets so far
    with pytest.raises(WeightsError, match="asks for 16000000000 numbers at once"):
        read_tensors(path)


def test_large_numbers_that_are_no_sizes_do_no_harm(tmp_path: Path) -> None:
    content = {"model": {"a": torch.ones(2)}, "seed": 2**63 + 11, "time": 1_790_000_000}
    torch.save(content, tmp_path / "w.pth")
    assert list(read_tensors(tmp_path / "w.pth")) == ["a"]


def test_a_web_page_in_place_of_a_checkpoint_is_called_that(tmp_path: Path) -> None:
    (tmp_path / "w.pth").write_bytes(b"<html><body>sign in</body></html>")
    with pytest.raises(WeightsError, match="is a web page"):
        read_tensors(tmp_path / "w.pth")
