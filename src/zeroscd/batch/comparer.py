"""Where a task becomes an outcome: read, look up, compare, draw."""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass, replace
from operator import attrgetter
from threading import Lock
from typing import TYPE_CHECKING

from zeroscd.batch.address import Fetcher
from zeroscd.batch.task import Outcome
from zeroscd.cache import ExpiringCache
from zeroscd.detector import Detector
from zeroscd.export.files import render
from zeroscd.export.table import change_rows, pair_row
from zeroscd.fingerprint import digest, digest_code, digest_values, digest_weights, versions
from zeroscd.images.exif import Exif, read_exif
from zeroscd.images.read import read_photo

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from zeroscd.batch.task import Task
    from zeroscd.evidence import EncodedPhoto
    from zeroscd.images.photo import Photo
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings

MEBIBYTE = 2**20
LOOKS = 64  # locks: two workers that meet one photo at once look at it one after the other
DEFAULT_FILES = ("mask", "json")  # a few kilobytes a pair


def _lite() -> Detector:
    return Detector.from_preset("lite")


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How pairs are compared and what is kept of them.

    Attributes:
        detector: Makes the detector, once a process, such as `functools.partial(
            Detector.from_preset, "robust", device="cuda")`; for Ray it must be picklable.
        write: Files for each pair's folder, names of `zeroscd.export.files.FILES`; may be empty.
        timeout_s: Longest wait for a remote photo, in seconds.
        cache_bytes: Memory for photos that may occur again.
    """

    detector: Callable[[], Detector] = _lite
    write: tuple[str, ...] = DEFAULT_FILES
    timeout_s: float = 60.0
    cache_bytes: int = 256 * MEBIBYTE


class PairComparer:
    """One detector at work; threads may share it."""

    def __init__(self, options: Options) -> None:
        self._detector = options.detector()
        self._write = options.write
        self._fetch = Fetcher(options.timeout_s)
        self._encoded: ExpiringCache[EncodedPhoto] = ExpiringCache(
            options.cache_bytes, size_of=attrgetter("size_bytes")
        )
        self._looking = [Lock() for _ in range(LOOKS)]
        self._fingerprint = fingerprint(self._detector)

    @property
    def settings(self) -> Settings:
        """What the detector decides by."""
        return self._detector.settings

    def compare(self, task: Task, turns: AbstractContextManager[object]) -> Outcome:
        """Compare a pair, unless an earlier run compared the same bytes in the same way.

        Args:
            task: The pair.
            turns: Entered to compare; reading before and drawing after need no turn.

        Raises:
            ImageError: A photo cannot be read.
        """
        files = [_File.read(address, self._fetch) for address in (task.before, task.after)]
        key = digest([self._fingerprint.encode(), *(file.digest.encode() for file in files)])
        if key == task.known:
            return Outcome(row=task.row, name=task.name, key=key, reused=True)
        notes = (read_exif(files[0].content), read_exif(files[1].content))
        photos = [self._decode(file) for file in files]
        with turns:
            began = time.perf_counter()
            result, hits = self._compare(files, photos)
            seconds = time.perf_counter() - began
        return replace(
            self._present(result, notes),
            row=task.row,
            name=task.name,
            key=key,
            seconds=round(seconds, 4),
            looks=len(files),
            hits=hits,
        )

    def _decode(self, file: _File) -> Photo | None:
        """Decode a photo before its turn; None if its view is there, as it nearly always stays."""
        if self._encoded.get(file.digest) is not None:
            return None
        return read_photo(file.content, name=file.address)

    def _compare(self, files: list[_File], photos: list[Photo | None]) -> tuple[ChangeResult, int]:
        before, after = (self._view(file, photo) for file, photo in zip(files, photos, strict=True))
        result = self._detector.decide(self._detector.compare(before[0], after[0]))
        return result, before[1] + after[1]

    def _view(self, file: _File, photo: Photo | None) -> tuple[EncodedPhoto, bool]:
        """Return what the encoder sees in a photo, and whether it was known already."""
        with self._looking[int(file.digest, 16) % LOOKS]:
            view = self._encoded.get(file.digest)
            hit = view is not None
            if view is None:
                decoded = photo or read_photo(file.content, name=file.address)
                (view,) = self._detector.encode([decoded.pixels])
                self._encoded.put(view, file.digest)
        # The same bytes may lie at several addresses.
        return replace(view, photo=replace(view.photo, path=file.address)), hit

    def _present(self, result: ChangeResult, notes: tuple[Exif, Exif]) -> Outcome:
        return Outcome(
            row=0,
            name="",
            pair=pair_row(result, notes),
            changes=tuple(change_rows(result, notes)),
            files=render(result, self._write),
        )


def fingerprint(detector: Detector) -> str:
    """Return the digest of everything but the photos that decides a comparison and its files."""
    return digest_values(
        {
            "settings": detector.settings.to_dict(),
            "preset": detector.preset,
            "versions": versions(),
            "code": digest_code(also=("batch", "export")),
            "weights": digest_weights(detector.settings),
        }
    )


@dataclass(frozen=True, slots=True)
class _File:
    """A photo's file as it was read."""

    address: str
    content: bytes
    digest: str

    @classmethod
    def read(cls, address: str, fetch: Fetcher) -> _File:
        content = fetch(address)
        return cls(address, content, hashlib.sha256(content).hexdigest())
