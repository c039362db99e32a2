from __future__ import annotations

import errno
import multiprocessing
import subprocess
import sys
import textwrap
from threading import Barrier
from typing import TYPE_CHECKING

import pytest
import torch

from zeroscd.errors import WeightsError
from zeroscd.weights.fetch import fetch, import_file
from zeroscd.weights.part_file import write_chunks

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from typing import Any

    from zeroscd.weights.catalogue import WeightFile


def quiet(done_bytes: int, total_bytes: int | None) -> None:
    """Take no note of progress."""


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if not path.name.startswith(".")}


def test_a_whole_download_has_the_published_bytes(server: Any, row: WeightFile) -> None:
    heard: list[tuple[int, int | None]] = []
    path = fetch(row, progress=lambda done, total: heard.append((done, total)))
    assert path.read_bytes() == server.content
    assert heard[0] == (0, len(server.content))
    assert heard[-1] == (len(server.content), len(server.content))


def test_a_file_that_is_there_is_not_fetched_again(server: Any, row: WeightFile) -> None:
    fetch(row, progress=quiet)
    fetch(row, progress=quiet)
    assert server.ranges == [None]


def test_a_download_that_breaks_off_keeps_what_came_and_has_no_final_name(
    server: Any, row: WeightFile, folder: Path
) -> None:
    server.cut_after = 1_500_000
    with pytest.raises(WeightsError, match=r"broke off after 1500000 of 3000000 bytes"):
        fetch(row, progress=quiet)
    assert names_in(folder) == {"model.pth.part"}
    assert (folder / "model.pth.part").read_bytes() == server.content[:1_500_000]


def test_the_next_try_asks_only_for_the_rest(server: Any, row: WeightFile, folder: Path) -> None:
    server.cut_after = 1_500_000
    with pytest.raises(WeightsError):
        fetch(row, progress=quiet)
    server.cut_after = None
    heard: list[int] = []
    path = fetch(row, progress=lambda done, _: heard.append(done))
    assert server.ranges == [None, "bytes=1500000-"]
    assert heard[0] == 1_500_000
    assert path.read_bytes() == server.content
    assert names_in(folder) == {"model.pth"}


def test_a_server_that_knows_no_ranges_is_read_from_the_start(
    server: Any, row: WeightFile, folder: Path
) -> None:
    folder.mkdir()
    (folder / "model.pth.part").write_bytes(server.content[:1000])
    server.honours_ranges = False
    assert fetch(row, progress=quiet).read_bytes() == server.content


@pytest.mark.parametrize("length", [1000, 3_000_000, 4_000_000])
def test_the_remains_of_another_file_are_replaced(
    length: int, server: Any, row: WeightFile, folder: Path
) -> None:
    folder.mkdir()
    (folder / "model.pth.part").write_bytes(b"x" * length)
    assert fetch(row, progress=quiet).read_bytes() == server.content


def test_remains_that_are_whole_are_not_downloaded_again(
    server: Any, row_of: Callable[..., WeightFile], folder: Path
) -> None:
    row = row_of(server.content, address=server.address, size_bytes=None)
    folder.mkdir()
    (folder / "model.pth.part").write_bytes(server.content)
    assert fetch(row, progress=quiet).read_bytes() == server.content
    assert server.ranges == [f"bytes={len(server.content)}-"]  # answered with 416


def test_wrong_bytes_of_the_right_length_are_thrown_away(
    server: Any, row: WeightFile, folder: Path
) -> None:
    server.content = b"x" * len(server.content)
    with pytest.raises(WeightsError, match=f"damaged .*expected {row.sha256}"):
        fetch(row, progress=quiet)
    assert names_in(folder) == set()


def test_a_wrong_length_is_refused_before_a_byte_is_written(
    server: Any, row: WeightFile, folder: Path
) -> None:
    server.content = server.content[:-1]
    with pytest.raises(WeightsError, match="offers 2999999 bytes, expected 3000000"):
        fetch(row, progress=quiet)
    assert names_in(folder) == set()


def test_a_promise_longer_than_the_reply_counts_as_broken_off(
    server: Any, row_of: Callable[..., WeightFile], folder: Path
) -> None:
    server.promised = len(server.content) + 5
    row = row_of(server.content, address=server.address, size_bytes=None)
    with pytest.raises(WeightsError, match="broke off"):
        fetch(row, progress=quiet)
    assert names_in(folder) == {"model.pth.part"}


def test_a_disk_that_is_too_small_is_noticed_before_the_download(
    row: WeightFile, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = type("Usage", (), {"free": 2_999_999})
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage)
    with pytest.raises(WeightsError, match=r"is full: 3 MB needed, 3 MB free; make room or set"):
        fetch(row, progress=quiet)
    assert names_in(folder) == set()


@pytest.mark.skipif(sys.platform == "win32", reason="file size limits are a Unix thing")
def test_a_disk_that_fills_up_on_the_way_gets_its_room_back(row: WeightFile, folder: Path) -> None:
    code = textwrap.dedent(f"""
        import resource
        from zeroscd.errors import WeightsError
        from zeroscd.weights.catalogue import WeightFile
        from zeroscd.weights.fetch import fetch
        resource.setrlimit(resource.RLIMIT_FSIZE, (2_000_000, 2_000_000))
        row = {row!r}
        try:
            fetch(row, progress=lambda done_bytes, total_bytes: None)
        except WeightsError as why:
            print(why)
    """)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "cannot write in" in done.stdout
    assert "make room or set ZEROSCD_HOME" in done.stdout
    assert names_in(folder) == set()


def test_other_write_errors_keep_the_bytes_for_the_next_try(
    row: WeightFile, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(self: Any, chunk: bytes) -> int:
        raise OSError(errno.EIO, "input/output error")

    class Broken:
        def __enter__(self) -> Any:
            return self

        def __exit__(self, *_: object) -> None:
            """Close nothing."""

        write = broken

    folder.mkdir()
    (folder / "model.pth.part").write_bytes(b"x")
    monkeypatch.setattr("builtins.open", lambda *_, **__: Broken())
    with pytest.raises(WeightsError, match=r"cannot write in .*input/output error"):
        fetch(row, progress=quiet)
    assert names_in(folder) == {"model.pth.part"}


def _fetch_in_a_process(row: WeightFile) -> bytes:
    return fetch(row, progress=quiet).read_bytes()


def test_two_processes_at_once_download_it_once(server: Any, row: WeightFile, folder: Path) -> None:
    server.second_request = Barrier(2)  # two requests would meet here; one gives up after a second
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        results = pool.map(_fetch_in_a_process, [row, row], chunksize=1)
    assert results == [server.content, server.content]
    assert server.ranges == [None]
    assert names_in(folder) == {"model.pth"}


def test_no_network_names_the_file_its_hash_and_the_command(
    row_of: Callable[..., WeightFile], folder: Path
) -> None:
    row = row_of(b"abc", address="http://127.0.0.1:9/model.pth")
    with pytest.raises(WeightsError) as caught:
        fetch(row, progress=quiet)
    message = str(caught.value)
    assert "model.pth" in message
    assert row.sha256 in message
    assert "`zeroscd models fetch toy --from model.pth`" in message
    assert "\n" not in message
    assert names_in(folder) == set()


def test_offline_mode_does_not_even_ask(
    server: Any, row: WeightFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ZEROSCD_OFFLINE", "1")
    with pytest.raises(WeightsError, match=f"ZEROSCD_OFFLINE is set.*{row.sha256}"):
        fetch(row, progress=quiet)
    assert server.ranges == []


def test_an_address_that_answers_404_says_so(server: Any, row: WeightFile) -> None:
    server.status = 404
    with pytest.raises(WeightsError, match="answers 404 Not Found"):
        fetch(row, progress=quiet)


@pytest.mark.parametrize("changed", [{"address": None}, {"sha256": ""}, {"sha256": "08c60483"}])
def test_nothing_is_downloaded_that_cannot_be_verified(
    changed: dict[str, str], server: Any, row_of: Callable[..., WeightFile]
) -> None:
    row = row_of(server.content, **({"address": server.address} | changed))
    with pytest.raises(WeightsError, match=r"cannot be downloaded.*--from model\.pth"):
        fetch(row, progress=quiet)
    assert server.ranges == []


def test_a_file_at_hand_is_copied_into_its_place(
    server: Any, row: WeightFile, tmp_path: Path
) -> None:
    source = tmp_path / "downloaded by hand.pth"
    source.write_bytes(server.content)
    assert import_file(row, source, progress=quiet).read_bytes() == server.content
    assert source.exists()
    assert server.ranges == []


def test_a_wrong_file_at_hand_is_refused_and_left_alone(
    row: WeightFile, tmp_path: Path, folder: Path
) -> None:
    source = tmp_path / "other.pth"
    source.write_bytes(b"something else")
    with pytest.raises(
        WeightsError, match="has 14 bytes, expected 3000000: it is not the published"
    ):
        import_file(row, source, progress=quiet)
    assert source.read_bytes() == b"something else"
    assert not folder.exists()


def test_without_a_published_digest_only_weights_are_taken(
    row_of: Callable[..., WeightFile], tmp_path: Path, folder: Path
) -> None:
    source, row = tmp_path / "model.pth", row_of(b"", sha256="", size_bytes=None)
    source.write_bytes(b"<html>sign in to download</html>")
    with pytest.raises(WeightsError, match=r"model\.pth is a web page"):
        import_file(row, source, progress=quiet)
    assert not folder.exists()
    torch.save({"a": torch.ones(2)}, source)
    assert import_file(row, source, progress=quiet).read_bytes() == source.read_bytes()


def test_the_published_beginning_of_a_digest_is_enough_to_refuse(
    row_of: Callable[..., WeightFile], tmp_path: Path
) -> None:
    source = tmp_path / "gated.pth"
    source.write_bytes(b"abc")
    row = row_of(b"abc", sha256="ba7816bf", size_bytes=None)
    assert import_file(row, source, progress=quiet).read_bytes() == b"abc"
    with pytest.raises(WeightsError, match="expected 00000000"):
        import_file(row_of(b"abc", sha256="00000000", size_bytes=None), source, progress=quiet)


def test_a_folder_that_cannot_be_made_is_an_error_of_one_line(
    row: WeightFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("ZEROSCD_HOME", str(tmp_path / "file"))
    with pytest.raises(WeightsError, match=r"cannot write in .*set ZEROSCD_HOME"):
        fetch(row, progress=quiet)


WEB_PAGE, LFS_POINTER = (
    b"\xef\xbb\xbf\n<!DOCTYPE html><html><body>too large to scan</body></html>",
    b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 12345\n",
)


@pytest.mark.parametrize(("content", "what"), [(WEB_PAGE, "web page"), (LFS_POINTER, "Git LFS")])
@pytest.mark.parametrize("sha256", ["", "0" * 64])
def test_what_came_in_place_of_weights_is_called_what_it_is(
    row_of: Callable[..., WeightFile], tmp_path: Path, content: bytes, what: str, sha256: str
) -> None:
    source = tmp_path / "model.pth"
    source.write_bytes(content)
    with pytest.raises(WeightsError, match=what):
        import_file(row_of(b"abc", sha256=sha256, size_bytes=None), source, progress=quiet)


def test_a_body_without_end_is_stopped(
    server: Any, row_of: Callable[..., WeightFile], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("zeroscd.weights.fetch.MAX_BYTES", 2_000_000)
    row = row_of(server.content, address=server.address, size_bytes=None)
    with pytest.raises(WeightsError, match="sends more than 2000000 bytes"):
        fetch(row, progress=quiet)
    assert names_in(folder) == set()


@pytest.mark.parametrize("length", ["abc", "-5", "1e9"])
def test_a_length_that_is_no_number_is_unknown(server: Any, row: WeightFile, length: str) -> None:
    server.promised = length
    assert fetch(row, progress=quiet).read_bytes() == server.content


@pytest.mark.parametrize("goal", ["http://[bad/model", "file:///etc/passwd"])
def test_a_redirect_that_leads_nowhere_is_one_line(server: Any, row: WeightFile, goal: str) -> None:
    server.redirect = goal
    with pytest.raises(WeightsError, match="was not fetched") as caught:
        fetch(row, progress=quiet)
    assert str(caught.value).isprintable()


def test_a_partial_file_that_is_a_link_is_not_written_through(
    row: WeightFile, folder: Path, tmp_path: Path
) -> None:
    folder.mkdir()
    victim = tmp_path / "victim"
    victim.write_bytes(b"mine")
    (folder / "model.pth.part").symlink_to(victim)
    with pytest.raises(WeightsError, match="is a link"):
        fetch(row, progress=quiet)
    with pytest.raises(WeightsError, match="cannot write"):
        write_chunks(folder / "model.pth.part", [b"theirs"], afresh=True)
    assert victim.read_bytes() == b"mine"
