"""Get a weight file: from its address, or from a file that the user already has."""

from __future__ import annotations

import http.client
import os
import urllib.error
import urllib.request
from http import HTTPStatus
from typing import TYPE_CHECKING, Protocol

from zeroscd.errors import WeightsError
from zeroscd.weights.place import check_room, fill, sole_writer
from zeroscd.weights.store import is_present, path_of
from zeroscd.weights.verify import fault_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from typing import Any, BinaryIO

    from zeroscd.weights.catalogue import WeightFile

OFFLINE_VARIABLE = "ZEROSCD_OFFLINE"
PATIENCE_SECONDS = 30.0  # without a byte, until a connection counts as dead
CHUNK_BYTES = 2**20

NETWORK_ERRORS = (OSError, http.client.HTTPException)  # urllib's own errors are OSErrors


class Progress(Protocol):
    """Hears how far a file is."""

    def __call__(self, done_bytes: int, total_bytes: int | None) -> None:
        """Take note; the total is None where nobody knows it."""


def fetch(row: WeightFile, *, progress: Progress) -> Path:
    """Download a weight file, or go on where an earlier try stopped.

    Nothing unverified ever has the final name: the bytes go to a file beside it, are checked for
    length and SHA-256, and then moved. A file that is there already is not fetched again.

    Raises:
        WeightsError: No address, no network, no room, or not the published file.
    """
    target = path_of(row)
    with sole_writer(target) as part:
        if is_present(row):
            return target
        address = _address(row)
        resumed = part.exists()
        _download(address, row, part=part, progress=progress)
        if resumed and fault_of(part, row):
            # The remains of the earlier try were of another file: once more, from zero.
            part.unlink()
            _download(address, row, part=part, progress=progress)
        _settle(part, row, target=target)
    return target


def adopt(row: WeightFile, source: Path, *, progress: Progress) -> Path:
    """Copy a file that the user has into its place, if it is the right one.

    Raises:
        WeightsError: It cannot be read, is not the published file (or, where no digest is
            published, no weights at all), or there is no room.
    """
    if fault := fault_of(source, row):
        message = f"{source} {fault}: it is not the published file of {row.name} ({row.page})"
        raise WeightsError(message)
    if not row.sha256:
        from zeroscd.weights.safe import read_tensors  # noqa: PLC0415 - imports torch

        read_tensors(source)  # nothing else tells it from any other file
    target, size = path_of(row), source.stat().st_size
    with sole_writer(target) as part:
        check_room(part.parent, size)
        with source.open("rb") as origin:
            chunks = _chunks(origin, row.file, done=0, total=size, progress=progress)
            fill(part, chunks, afresh=True)
        _settle(part, row, target=target)
    return target


def _address(row: WeightFile) -> str:
    if row.address is None or not row.fetchable:
        message = (
            f"{row.name} cannot be downloaded: {row.note} (see {row.page}); "
            f"a file at hand is imported by `{row.fetch_command}`"
        )
        raise WeightsError(message)
    if os.environ.get(OFFLINE_VARIABLE, "0") != "0":
        raise WeightsError(_by_hand(row, f"{OFFLINE_VARIABLE} is set"))
    return row.address


def _download(address: str, row: WeightFile, *, part: Path, progress: Progress) -> None:
    """Bring the partial file to its full length."""
    done = part.stat().st_size if part.exists() else 0
    if row.size_bytes is not None and done >= row.size_bytes:
        return  # whole already, or too long: verifying will tell
    reply = _open(address, row, done=done)
    if reply is None:
        return
    with reply:
        if reply.status != HTTPStatus.PARTIAL_CONTENT:
            done = 0  # the server sends everything, whatever it was asked for
        total = _total(reply, row, done=done)
        check_room(part.parent, 0 if total is None else total - done)
        chunks = _chunks(reply, row.file, done=done, total=total, progress=progress)
        fill(part, chunks, afresh=done == 0)


def _open(address: str, row: WeightFile, *, done: int) -> Any | None:  # noqa: ANN401 - a response
    headers = {"Range": f"bytes={done}-"} if done else {}
    request = urllib.request.Request(address, headers=headers)  # noqa: S310 - from our own table
    try:
        return urllib.request.urlopen(request, timeout=PATIENCE_SECONDS)  # noqa: S310
    except urllib.error.HTTPError as why:
        why.close()
        if why.code == HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            return None  # there is nothing beyond what we have: verifying will tell
        raise WeightsError(_by_hand(row, f"{address} answers {why.code} {why.reason}")) from why
    except NETWORK_ERRORS as why:
        raise WeightsError(_by_hand(row, f"{address} cannot be reached ({why})")) from why


def _total(reply: Any, row: WeightFile, *, done: int) -> int | None:  # noqa: ANN401 - a response
    length = reply.headers.get("Content-Length")
    total = None if length is None else done + int(length)
    if total is not None and row.size_bytes not in (None, total):
        why = f"{row.address} offers {total} bytes, expected {row.size_bytes}"
        raise WeightsError(_by_hand(row, why))
    return total


def _chunks(
    origin: BinaryIO, name: str, *, done: int, total: int | None, progress: Progress
) -> Iterator[bytes]:
    progress(done, total)
    while chunk := _read(origin, name, done=done, total=total):
        yield chunk
        done += len(chunk)
        progress(done, total)
    if total is not None and done < total:
        raise WeightsError(_cut(name, done, total))


def _read(origin: BinaryIO, name: str, *, done: int, total: int | None) -> bytes:
    try:
        return origin.read(CHUNK_BYTES)
    except NETWORK_ERRORS as why:
        raise WeightsError(_cut(name, done, total)) from why


def _cut(name: str, done: int, total: int | None) -> str:
    whole = "an unknown length" if total is None else f"{total} bytes"
    return f"{name} broke off after {done} of {whole}; run the command again, it goes on from there"


def _settle(part: Path, row: WeightFile, *, target: Path) -> None:
    """Move a verified file to its final name; throw a wrong one away."""
    if fault := fault_of(part, row):
        part.unlink(missing_ok=True)
        message = f"{row.file} as received {fault} and was thrown away; run it again"
        raise WeightsError(message)
    part.replace(target)


def _by_hand(row: WeightFile, why: str) -> str:
    return (
        f"{row.name} was not fetched: {why}; get {row.file} (sha256 {row.sha256}) elsewhere "
        f"and run `zeroscd models fetch {row.name} --from {row.file}`"
    )
