"""Compare one pair: read both photos, encode or reuse them, compare, render the files."""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass, replace
from operator import attrgetter
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.batch.address import Fetcher
from zeroscd.batch.task import FIRST, Outcome
from zeroscd.cache import ExpiringCache
from zeroscd.detector import Detector
from zeroscd.errors import ImageError, SettingsError
from zeroscd.export.files import render
from zeroscd.export.table import PairNotes, change_rows, pair_row
from zeroscd.fingerprint import (
    digest,
    digest_code,
    digest_of_weights,
    digest_values,
    digest_weights,
    versions,
)
from zeroscd.given import Given, is_fixed
from zeroscd.images.exif import read_exif
from zeroscd.images.read import read_photo

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from contextlib import AbstractContextManager

    from zeroscd.alignment.known import KnownGeometry
    from zeroscd.batch.task import Task
    from zeroscd.evidence import EncodedPhoto
    from zeroscd.images.photo import Photo
    from zeroscd.result import ChangeResult
    from zeroscd.settings import Settings

MEBIBYTE = 2**20
LOCKS = 64  # of two workers that need one photo at once, one encodes it and the other waits
PAIR = 2  # photos, of which any more are further views of the place
DEFAULT_FILES = ("mask", "json")  # a few kilobytes a pair


def _lite() -> Detector:
    return Detector.from_preset("lite")


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How pairs are compared, and which files are written for each.

    Attributes:
        detector: Called once in each process to make the detector, such as `functools.partial(
            Detector.from_preset, "robust", device="cuda")`; for Ray it must be picklable.
        write: Files for each pair's folder, names of `zeroscd.export.files.NAMES`; may be empty.
        timeout_s: Longest wait for a remote photo, in seconds.
        cache_bytes: Memory for encoded photos, which other pairs may need again.
        absolute_paths: Write paths of local photos from the root, not relative to the folder of the
            file that holds them.
        ignore_all: The bytes of an area that does not count in any photo (`read_area`).
        t1_from_t0: Known geometry of pairs whose row says none (`Detector.detect`).
    """

    detector: Callable[[], Detector] = _lite
    write: tuple[str, ...] = DEFAULT_FILES
    timeout_s: float = 60.0
    cache_bytes: int = 256 * MEBIBYTE
    absolute_paths: bool = False
    ignore_all: bytes | None = None
    t1_from_t0: KnownGeometry | None = None


class PairComparer:
    """Compares pairs with one detector; threads may share it."""

    def __init__(self, options: Options) -> None:
        self._detector = options.detector()
        self._write = options.write
        self._names_files = "label-studio" in options.write  # by where this process found them
        self._fetch = Fetcher(options.timeout_s)
        self._encoded: ExpiringCache[EncodedPhoto] = ExpiringCache(
            options.cache_bytes, size_of=attrgetter("size_bytes")
        )
        self._encoding = [Lock() for _ in range(LOCKS)]
        self._ignore_all = options.ignore_all
        self._geometry = options.t1_from_t0
        self._fingerprint = digest_values(
            {
                "absolute": options.absolute_paths,
                "detector": fingerprint(self._detector),
                "ignore": None if self._ignore_all is None else digest([self._ignore_all]),
                "geometry": None if self._geometry is None else np.asarray(self._geometry).tolist(),
            }
        )

    @property
    def settings(self) -> Settings:
        """The detector's settings."""
        return self._detector.settings

    def compare(self, task: Task, slots: AbstractContextManager[object]) -> Outcome:
        """Compare a pair, unless an earlier run compared the same bytes in the same way.

        Args:
            task: The pair.
            slots: A semaphore or the like, held while the pair is compared, but not while its
                photos are read or its files rendered.

        Raises:
            ImageError: A photo cannot be read.
        """
        files = [
            _File.read(address, self._fetch, path=path)
            for address, path in zip(task.addresses, task.paths or task.addresses, strict=True)
        ]
        sides = files[: 1 + len(task.also_before)], files[1 + len(task.also_before) :]
        given = {name: self._given(name, value) for name, value in task.given.items()}
        key = self._key(*sides, given)
        if key == task.known:
            return Outcome(row=task.row, name=task.name, key=key, reused=True)
        photos = [self._decode(file) for file in files]
        with slots:
            began = time.perf_counter()
            views = [self._encode(*both) for both in zip(files, photos, strict=True)]
            before, after = views[: len(sides[0])], views[len(sides[0]) :]
            result = self._compare([one for one, _ in before], [one for one, _ in after], given)
            seconds = time.perf_counter() - began
        hits = sum(hit for _, hit in views)
        return replace(
            self._outcome(result, sides, name=task.name),
            row=task.row,
            key=key,
            seconds=round(seconds, 4),
            encoded=len(files) - hits,
            cache_hits=hits,
        )

    def _decode(self, file: _File) -> Photo | None:
        """Decode a photo; None if it is in the cache, where it nearly always stays till needed."""
        if self._encoded.get(file.digest) is not None:
            return None
        return read_photo(file.content, name=file.address)

    def _given(self, name: str, value: str) -> bytes:
        return value.encode() if is_fixed(name, value) else self._fetch(value)

    def _key(
        self, before: Sequence[_File], after: Sequence[_File], given: Mapping[str, bytes]
    ) -> str:
        """Return a digest of everything that a comparison is computed from."""
        views = [f"{len(before)} {len(after)}".encode()] if len(before) + len(after) > PAIR else []
        digests = (file.digest.encode() for file in (*before, *after))
        known = (part for name, data in sorted(given.items()) for part in (name.encode(), data))
        named = [file.address.encode() for file in (*before, *after)] if self._names_files else []
        return digest([self._fingerprint.encode(), *views, *digests, *known, *named])

    def _compare(
        self,
        before: list[EncodedPhoto],
        after: list[EncodedPhoto],
        given: Mapping[str, bytes],
    ) -> ChangeResult:
        try:
            known = Given.from_files(given, ignore_all=self._ignore_all, t1_from_t0=self._geometry)
            evidence = self._detector.compare(
                *known.mark(before, after), t1_from_t0=known.t1_from_t0
            )
        except SettingsError as error:  # of this pair; the others go on
            raise ImageError(str(error)) from error
        return self._detector.decide(evidence)

    def _encode(self, file: _File, photo: Photo | None) -> tuple[EncodedPhoto, bool]:
        """Return the encoded photo, and whether it came from the cache."""
        with self._encoding[int(file.digest, 16) % LOCKS]:
            encoded = self._encoded.get(file.digest)
            hit = encoded is not None
            if encoded is None:
                decoded = photo or read_photo(file.content, name=file.address)
                (encoded,) = self._detector.encode([decoded.pixels])
                self._encoded.put(encoded, file.digest)
        # The same bytes may lie at several addresses.
        return replace(encoded, photo=replace(encoded.photo, path=file.path)), hit

    def _outcome(
        self, result: ChangeResult, sides: tuple[list[_File], list[_File]], *, name: str
    ) -> Outcome:
        # The frames are those of the first photos that could be aligned.
        first = [
            [file.path for file in side].index(str(photo.path))
            for side, photo in zip(sides, (result.before, result.after), strict=True)
        ]
        before, after = (side[number] for side, number in zip(sides, first, strict=True))
        exif = read_exif(before.content), read_exif(after.content)
        notes = PairNotes(name=name, exif=exif, addresses=(before.address, after.address))
        return Outcome(
            row=0,
            name=name,
            pair={**pair_row(result, exif), **({FIRST: first} if any(first) else {})},
            changes=tuple(change_rows(result, exif)),
            files=render(result, self._write, notes),
        )


def fingerprint(detector: Detector) -> str:
    """Return a digest of all that decides a comparison and its files, except the photos."""
    labeller = detector.models.labeller
    classes: dict[str, object] = {}
    if labeller is not None:
        ignored = sorted(detector.ignored_classes)
        classes = {"labeller": [labeller.name, digest_of_weights(labeller.name), ignored]}
    return digest_values(
        {
            **classes,
            "settings": detector.settings.to_dict(),
            "preset": detector.preset,
            "versions": versions(),
            "code": digest_code(also=("batch", "export")),
            "weights": digest_weights(detector.settings),
        }
    )


@dataclass(frozen=True, slots=True)
class _File:
    """The bytes of a photo's file, and its path as results hold it."""

    address: str
    path: str
    content: bytes
    digest: str

    @classmethod
    def read(cls, address: str, fetch: Fetcher, *, path: str) -> _File:
        content = fetch(address)
        return cls(address, path, content, hashlib.sha256(content).hexdigest())
