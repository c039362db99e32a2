"""Read photos by address: a local path, or anything that fsspec opens, within a timeout."""

from __future__ import annotations

import os
import unicodedata
from concurrent.futures import Future
from pathlib import Path
from threading import BoundedSemaphore, Thread
from typing import TYPE_CHECKING, NoReturn
from urllib.parse import unquote

from zeroscd.errors import ImageError
from zeroscd.images.read import DEFAULT_LIMITS, read_file
from zeroscd.text import one_line

if TYPE_CHECKING:
    from zeroscd.images.read import PhotoLimits

# Requests under way, hanging ones included: Python cannot end a thread that hangs.
MAX_REQUESTS = 64
MAX_REASON = 200  # characters of another library's message
HTTP = ("http", "https")
HTTP_HINT = "run: pip install 'zeroscd[http]'"


def is_remote(address: str) -> bool:
    """Return whether fsspec has to open an address.

    Example:
        >>> is_remote("s3://bucket/a.jpg"), is_remote("photos/a.jpg")
        (True, False)
    """
    return "://" in address


def path_of(address: str) -> str:
    """Return the path in an address, without the query that signs it and the archive around it.

    Example:
        >>> path_of("https://host/old/elm%20street.jpg?sig=k/q.s")
        'host/old/elm street.jpg'
        >>> path_of("zip://old/a.jpg::s3://bucket/photos.zip"), path_of("what?.jpg")
        ('old/a.jpg', 'what?.jpg')
    """
    if not is_remote(address):
        return address
    scheme, _, path = address.partition("::")[0].partition("://")
    path = path.partition("?")[0]
    return unquote(path.partition("#")[0]) if scheme in HTTP else path


def missing_package(address: str, error: ImportError) -> str:
    """Return what to install where fsspec misses a package to open an address.

    Example:
        >>> missing_package("https://host/a.jpg", ImportError("..."))
        "http(s) addresses need aiohttp and requests; run: pip install 'zeroscd[http]'"
    """
    schemes = {part.partition("://")[0] for part in address.split("::")}
    if schemes.isdisjoint(HTTP):
        return " ".join(str(error).split())  # fsspec names its package: "Install s3fs to access S3"
    return f"http(s) addresses need aiohttp and requests; {HTTP_HINT}"


def resolve(address: str, *, base: str) -> str:
    """Return an address that no longer depends on the manifest's folder.

    Example:
        >>> resolve("new/a.jpg", base="s3://bucket/2024")
        's3://bucket/2024/new/a.jpg'
    """
    if is_remote(address):
        return address
    if is_remote(base):
        return f"{base.rstrip('/')}/{address.replace(chr(92), '/')}"
    return str(Path(base) / address)


def existing_spelling(path: str) -> str:
    """Return a path as its file is spelled, if that differs from how it was written.

    Manifests from Windows have backslashes, and macOS decomposes accents (Unicode NFD) where other
    systems compose them (NFC). A path that exists as it was written stays.
    """
    if os.path.lexists(path):
        return path
    slashes = path if os.sep == "\\" else path.replace("\\", "/")
    found = Path(slashes).anchor
    for part in Path(slashes).parts[1 if found else 0 :]:
        spellings = (part, *(unicodedata.normalize(form, part) for form in ("NFC", "NFD")))
        existing = (s for s in spellings if os.path.lexists(Path(found) / s))
        found = str(Path(found) / next(existing, part))
    return found if os.path.lexists(found) else path


class Fetcher:
    """Reads files by address, each within a timeout.

    Args:
        timeout_s: Longest wait for a remote file; local files are read without one.
        limits: Largest file.
    """

    def __init__(self, timeout_s: float, *, limits: PhotoLimits = DEFAULT_LIMITS) -> None:
        self._timeout_s = timeout_s
        self._limits = limits
        self._slots = BoundedSemaphore(MAX_REQUESTS)

    def __call__(self, address: str) -> bytes:
        """Return a file's bytes.

        Raises:
            ImageError: It is missing, unreadable, or does not arrive in time.
        """
        if not is_remote(address):
            return read_file(existing_spelling(address), limits=self._limits)
        if not self._slots.acquire(timeout=self._timeout_s):
            self._raise_timeout(address)
        response: Future[bytes] = Future()
        # Not a pool: Python joins a pool's threads when it exits, for ever if one hangs.
        Thread(target=self._request, args=(address, response), daemon=True).start()
        try:
            error = response.exception(self._timeout_s)
        except TimeoutError:
            self._raise_timeout(address)
        if error is not None:
            raise ImageError(_explain(address, error)) from error
        return response.result()

    def _request(self, address: str, response: Future[bytes]) -> None:
        import fsspec  # noqa: PLC0415 - not needed for local photos

        try:
            with fsspec.open(address, "rb") as file:
                response.set_result(file.read(self._limits.max_file_bytes + 1))
        except BaseException as error:  # raised in the thread that waits for it
            response.set_exception(error)
        finally:
            self._slots.release()

    def _raise_timeout(self, address: str) -> NoReturn:
        message = (
            f"{one_line(address)} did not answer within {self._timeout_s:g} s; "
            "check the address or allow more time with --timeout"
        )
        raise ImageError(message)


def _explain(address: str, error: BaseException) -> str:
    name = one_line(address)
    if isinstance(error, FileNotFoundError):
        return f"{name} does not exist; check the address"
    if isinstance(error, ImportError):
        return f"{name} cannot be read: {missing_package(address, error)}"
    text = " ".join(str(error).split())[:MAX_REASON]
    reason = f"{type(error).__name__}: {text}" if text else type(error).__name__
    return f"{name} cannot be read ({reason}); check the address and your rights"
