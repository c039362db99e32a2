from __future__ import annotations

import http.server
import sys
import threading
import time
import unicodedata
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import fsspec
import pytest
from fsspec.implementations.memory import MemoryFileSystem

from zeroscd.batch import address
from zeroscd.batch.address import Fetcher, existing_spelling, resolve
from zeroscd.batch.manifest import open_manifest
from zeroscd.batch.names import stem
from zeroscd.errors import DatasetError, ImageError
from zeroscd.images.read import PhotoLimits

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

WAIT_S, MUCH_S = 0.1, 5.0


class Refused(Exception):  # noqa: N818 - a foreign library's
    """Not an OSError, as the errors of object stores are."""


class OddFileSystem(MemoryFileSystem):  # type: ignore[misc]
    """Files that never come, or that come with an odd exception."""

    protocol = "odd"
    store: dict[str, Any] = {}  # noqa: RUF012 - as its parent has it
    release = threading.Event()

    def _open(self, path: str, *args: object, **kwargs: object) -> Any:
        if "hang" in path:
            self.release.wait(MUCH_S)
        message = "403\n  forbidden"
        raise Refused(message)


@pytest.fixture(autouse=True)
def odd() -> Iterator[None]:
    OddFileSystem.release.clear()
    fsspec.register_implementation("odd", OddFileSystem, clobber=True)
    yield
    OddFileSystem.release.set()


@pytest.mark.parametrize(
    ("written", "base", "expected"),
    [
        ("new/a.jpg", "manifests", "manifests/new/a.jpg"),
        ("/data/a.jpg", "manifests", "/data/a.jpg"),
        ("new/a.jpg", "s3://bucket/x/", "s3://bucket/x/new/a.jpg"),
        ("gs://other/a.jpg", "s3://bucket/x", "gs://other/a.jpg"),
        ("http://host/a.jpg", "manifests", "http://host/a.jpg"),
    ],
)
def test_an_address_is_relative_to_where_the_manifest_lies(
    written: str, base: str, expected: str
) -> None:
    assert resolve(written, base=base) == expected


def test_local_and_remote_files_come_as_their_bytes(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"here")
    with fsspec.open("memory://photos/a.jpg", "wb") as file:
        file.write(b"there")
    fetch = Fetcher(MUCH_S)
    assert fetch(str(tmp_path / "a.jpg")) == b"here"
    assert fetch("memory://photos/a.jpg") == b"there"


def test_paths_of_other_systems_are_read_as_meant(tmp_path: Path) -> None:
    composed, decomposed = (unicodedata.normalize(f, "café") for f in ("NFC", "NFD"))
    (tmp_path / composed).mkdir()
    (tmp_path / composed / f"{decomposed}.jpg").write_bytes(b"here")
    (tmp_path / "a\\b.jpg").write_bytes(b"backslash")
    fetch = Fetcher(MUCH_S)
    for folder in (composed, decomposed):
        for name in (composed, decomposed):
            assert fetch(f"{tmp_path}/{folder}/{name}.jpg") == b"here"
            assert fetch(f"{tmp_path}\\{folder}\\{name}.jpg".replace("\\", "/", 1)) == b"here"
    assert fetch(f"{tmp_path}/a\\b.jpg") == b"backslash"
    with pytest.raises(ImageError, match=r"c.jpg does not exist"):
        fetch(f"{tmp_path}/b\\c.jpg")
    assert existing_spelling("") == ""


def test_a_relative_path_of_windows_is_read_as_meant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "a.jpg").write_bytes(b"here")
    monkeypatch.chdir(tmp_path)
    assert Fetcher(MUCH_S)(r"p\a.jpg") == b"here"
    assert resolve(r"p\a.jpg", base="s3://bucket") == "s3://bucket/p/a.jpg"


def test_a_file_too_large_is_not_read_to_its_end() -> None:
    with fsspec.open("memory://photos/large.jpg", "wb") as file:
        file.write(bytes(1000))
    limits = PhotoLimits(max_file_bytes=10)
    assert len(Fetcher(MUCH_S, limits=limits)("memory://photos/large.jpg")) == 11


def test_a_file_that_never_comes_is_given_up_in_time() -> None:
    began = time.monotonic()
    with pytest.raises(ImageError, match=r"odd://hang/a.jpg did not answer within 0.1 s; .*--tim"):
        Fetcher(WAIT_S)("odd://hang/a.jpg")
    assert time.monotonic() - began < MUCH_S / 2


def test_requests_that_hang_are_bounded_in_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(address, "MAX_REQUESTS", 3)
    fetch, before = Fetcher(WAIT_S), set(threading.enumerate())
    for number in range(6):
        with pytest.raises(ImageError, match="did not answer"):
            fetch(f"odd://hang/{number}.jpg")
    assert len(set(threading.enumerate()) - before) == 3
    OddFileSystem.release.set()
    for thread in set(threading.enumerate()) - before:
        thread.join(MUCH_S)
    with pytest.raises(ImageError, match="Refused"):  # the places are free again
        fetch("odd://a.jpg")


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("odd://a.jpg", r"^odd://a.jpg cannot be read \(Refused: 403 forbidden\); check the "),
        ("memory://photos/none.jpg", r"^memory://photos/none.jpg does not exist; check the "),
        ("nonsense://a.jpg", r"^nonsense://a.jpg cannot be read \(ValueError: Protocol not known"),
    ],
)
def test_whatever_goes_wrong_is_one_line_with_the_address(where: str, message: str) -> None:
    with pytest.raises(ImageError, match=message) as caught:
        Fetcher(MUCH_S)(where)
    assert "\n" not in str(caught.value)


def test_without_a_reader_of_web_addresses_one_learns_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "aiohttp", None)  # as if it were not installed
    monkeypatch.delitem(sys.modules, "fsspec.implementations.http", raising=False)
    loaded = import_module("fsspec.registry")._registry  # what fsspec itself has imported
    monkeypatch.delitem(loaded, "https", raising=False)
    line = (
        r"^https://host/a.png\?sig=1 cannot be read: http\(s\) addresses need aiohttp and "
        r"requests; run: pip install 'zeroscd\[http\]'$"
    )
    with pytest.raises(ImageError, match=line):
        Fetcher(MUCH_S)("https://host/a.png?sig=1")
    with pytest.raises(DatasetError, match=r"^cannot read https://host/m.csv: .*zeroscd\[http\]'$"):
        open_manifest("https://host/m.csv")


@pytest.fixture
def site(tmp_path: Path) -> Iterator[str]:
    """The address of a server of the files in `tmp_path`, which ignores signatures."""
    handler = partial(QuietHandler, directory=str(tmp_path))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


class QuietHandler(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *args: object) -> None:
        """Say nothing."""


def test_signed_web_addresses_are_read_and_named_after_the_photo(tmp_path: Path, site: str) -> None:
    pytest.importorskip("aiohttp", reason="the extra zeroscd[http] is not installed")
    (tmp_path / "b c.png").write_bytes(b"there")
    (tmp_path / "m.csv").write_text(f"before,after\n{site}/a.png?e=1,{site}/b%20c.png?sig=r/t.u\n")
    manifest = open_manifest(f"{site}/m.csv?Expires=3600&Signature=ab.cd")
    (row,) = manifest.rows()
    assert row.after is not None
    assert (manifest.base, stem(row.after)) == (site, "b c")
    assert Fetcher(MUCH_S)(row.after) == b"there"
    with pytest.raises(ImageError, match=r"a\.png\?e=1 does not exist; check the address"):
        Fetcher(MUCH_S)(f"{site}/a.png?e=1")
