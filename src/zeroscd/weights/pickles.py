"""Look at the numbers in a pickle before anything is allocated for them."""

from __future__ import annotations

import itertools
import pickletools
import struct
import zipfile
import zlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from typing import IO

MOST = 2**31  # beyond times in seconds, and beyond any number of elements in a checkpoint of ours
SEED = 2**53  # random seeds have 64 bits and are no size: nobody allocates a petabyte
# What zipfile may raise on altered files.
DAMAGED_ZIP = (
    OSError,
    ValueError,
    RuntimeError,
    LookupError,
    EOFError,
    struct.error,
    zlib.error,
    zipfile.BadZipFile,
)
OLD_FORMAT_PICKLES = 4  # magic number, version, machine, then the tensors


def largest_size_in(path: Path) -> int:
    """Return the largest number in a PyTorch file that a tensor's size could be; 0 if unreadable.

    Reads the instructions of the pickle, runs none, and allocates nothing.
    """
    try:
        if not zipfile.is_zipfile(path):
            with path.open("rb") as file:
                return _largest(file, pickles=OLD_FORMAT_PICKLES)
        with zipfile.ZipFile(path) as archive:
            name = next(name for name in archive.namelist() if name.endswith("data.pkl"))
            with archive.open(name) as file:
                return _largest(file, pickles=1)
    except (*DAMAGED_ZIP, StopIteration):  # no such part
        return 0  # torch says how


def _largest(file: IO[bytes], *, pickles: int) -> int:
    numbers = itertools.chain.from_iterable(_numbers(file) for _ in range(pickles))
    return max((number for number in numbers if number < SEED), default=0)


def _numbers(file: IO[bytes]) -> Iterator[int]:
    try:
        for _, argument, _ in pickletools.genops(file):
            if type(argument) is int:
                yield argument
    except DAMAGED_ZIP:
        return  # no pickle, or its end
