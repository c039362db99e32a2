"""Get a weight file: download it, or import one that the user has."""

from __future__ import annotations

import http.client
import os
import urllib.error
import urllib.request
from http import HTTPStatus
from typing import TYPE_CHECKING, Protocol

from zeroscd.errors import WeightsError
from zeroscd.weights.part_file import check_free_space, locked_part_file, write_chunks
from zeroscd.weights.store import is_present, path_of
from zeroscd.weights.verify import fault_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from typing import Any, BinaryIO

    from zeroscd.weights.catalogue import WeightFile

OFFLINE_VARIABLE = "ZEROSCD_OFFLINE"
TIMEOUT_SECONDS = 30.0  # without a byte
CHUNK_BYTES = 2**20
MAX_BYTES = 2**34  # of a file whose length is not published; the largest known has 2.6 GB

NETWORK_ERRORS = (OSError, http.client.HTTPException)  # urllib's own errors are OSErrors


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Closes the connection when an address to go on to is none."""

    def http_error_302(self, req: Any, fp: Any, code: int, msg: str, headers: Any) -> Any:  # noqa: ANN401 - urllib's own signature
        try:
            return super().http_error_302(req, fp, code, msg, headers)
        except ValueError:
            fp.close()
            raise

    http_error_301 = http_error_303 = http_error_307 = http_error_308 = http_error_302


class Progress(Protocol):
    """Is told how far a download is."""

    def __call__(self, done_bytes: int, total_bytes: int | None) -> None:
        """Report progress; the total is None where unknown."""


def fetch(row: WeightFile, *, progress: Progress) -> Path:
    """Download a weight file, resuming an earlier attempt.

    Only verified files get the final name: the bytes go to a partial file, are checked for length
    and SHA-256, and then moved. A file that is present is not fetched again.

    Raises:
        WeightsError: No address, no network, no room, or not the published file.
    """
    target = path_of(row)
    with locked_part_file(target) as part:
        if is_present(row):
            return target
        address = _address(row)
        resumed = part.exists()
        _download(address, row, part=part, progress=progress)
        if resumed and fault_of(part, row):
            # The earlier attempt left bytes of another file: start over.
            part.unlink()
            _download(address, row, part=part, progress=progress)
        _move_verified(part, row, target=target)
    return target


def import_file(row: WeightFile, source: Path, *, progress: Progress) -> Path:
    """Copy a file that the user has into the weights folder, if it is the right one.

    Raises:
        WeightsError: It cannot be read, is not the published file (or, where no digest is
            published, no weights at all), or there is no room.
    """
    if fault := fault_of(source, row):
        message = f"{source} {fault}: it is not the published file of {row.name} ({row.page})"
        raise WeightsError(message)
    if not row.sha256:
        from zeroscd.weights.safe import read_tensors  # noqa: PLC0415 - imports torch

        read_tensors(source)  # the only check there is without a digest
    target, size = path_of(row), source.stat().st_size
    with locked_part_file(target) as part:
        check_free_space(part.parent, size)
        with source.open("rb") as origin:
            chunks = _chunks(origin, row.file, done=0, total=size, progress=progress)
            write_chunks(part, chunks, afresh=True)
        _move_verified(part, row, target=target)
    return target


def _address(row: WeightFile) -> str:
    if row.address is None or not row.fetchable:
        message = (
            f"{row.name} cannot be downloaded: {row.note} (see {row.page}); "
            f"a file at hand is imported by `{row.fetch_command}`"
        )
        raise WeightsError(message)
    if os.environ.get(OFFLINE_VARIABLE, "0") != "0":
        raise WeightsError(_not_fetched(row, f"{OFFLINE_VARIABLE} is set"))
    return row.address


def _download(address: str, row: WeightFile, *, part: Path, progress: Progress) -> None:
    """Complete the partial file."""
    done = part.stat().st_size if part.exists() else 0
    if row.size_bytes is not None and done >= row.size_bytes:
        return  # complete, or too long, which verifying finds
    reply = _open(address, row, done=done)
    if reply is None:
        return
    with reply:
        if reply.status != HTTPStatus.PARTIAL_CONTENT:
            done = 0  # the server ignores ranges and sends the whole file
        total = _total(reply, row, done=done)
        check_free_space(part.parent, 0 if total is None else total - done)
        chunks = _chunks(reply, row.file, done=done, total=total, progress=progress)
        write_chunks(part, _bounded(chunks, row, part=part, done=done), afresh=done == 0)


def _bounded(chunks: Iterator[bytes], row: WeightFile, *, part: Path, done: int) -> Iterator[bytes]:
    """Pass chunks on until they are more than the file has; then what came is deleted."""
    most = MAX_BYTES if row.size_bytes is None else row.size_bytes
    for chunk in chunks:
        done += len(chunk)
        if done > most:
            part.unlink(missing_ok=True)
            raise WeightsError(_not_fetched(row, f"{row.address} sends more than {most} bytes"))
        yield chunk


def _open(address: str, row: WeightFile, *, done: int) -> Any | None:  # noqa: ANN401 - a response
    headers = {"Range": f"bytes={done}-"} if done else {}
    request = urllib.request.Request(address, headers=headers)  # noqa: S310 - from our own table
    try:
        return urllib.request.build_opener(_Redirects).open(request, timeout=TIMEOUT_SECONDS)
    except urllib.error.HTTPError as why:
        why.close()
        if why.code == HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            return None  # nothing beyond what we have; verifying decides
        reason = " ".join(str(why.reason).split())  # of several lines for a loop of redirects
        raise WeightsError(_not_fetched(row, f"{address} answers {why.code} {reason}")) from why
    except (*NETWORK_ERRORS, ValueError) as why:  # ValueError: a redirect to no address
        reason = " ".join(str(why).split())
        raise WeightsError(_not_fetched(row, f"{address} cannot be reached ({reason})")) from why


def _total(reply: Any, row: WeightFile, *, done: int) -> int | None:  # noqa: ANN401 - a response
    length = reply.headers.get("Content-Length")
    total = done + int(length) if length and length.isdecimal() else None
    if total is not None and row.size_bytes not in (None, total):
        why = f"{row.address} offers {total} bytes, expected {row.size_bytes}"
        raise WeightsError(_not_fetched(row, why))
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
    return f"{name} broke off after {done} of {whole}; run the command again to resume"


def _move_verified(part: Path, row: WeightFile, *, target: Path) -> None:
    """Move the partial file to its final name if it is the published one, else delete it."""
    if fault := fault_of(part, row):
        part.unlink(missing_ok=True)
        message = f"{row.file} as received {fault} and was deleted; run the command again"
        raise WeightsError(message)
    part.replace(target)


def _not_fetched(row: WeightFile, why: str) -> str:
    return (
        f"{row.name} was not fetched: {why}; get {row.file} (sha256 {row.sha256}) elsewhere "
        f"and run `zeroscd models fetch {row.name} --from {row.file}`"
    )
