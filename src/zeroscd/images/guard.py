"""Run Pillow silently, with every failure an ImageError."""

from __future__ import annotations

import logging
import os
import struct
import threading
import warnings
import zlib
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image, UnidentifiedImageError

from zeroscd.errors import ImageError

if TYPE_CHECKING:
    from collections.abc import Iterator

# Catching this much is right here and nowhere else: Pillow's parsers read bytes from anywhere and
# document no particular exceptions. The price is that a bug of ours in here is reported as damage,
# so tests read every format. The first four are what `scripts/fuzz_images.py` met in half a
# million inputs, with the newest and the oldest supported Pillow.
DAMAGE = (
    OSError,  # truncated, or a decoder's error: nearly all
    ValueError,  # numbers out of range, texts too large or not decodable
    SyntaxError,  # a broken chunk of a PNG, an invalid header
    TypeError,  # tags of the wrong type
    # Not met yet, but likely in a parser: another Pillow may raise them.
    LookupError,
    ArithmeticError,
    AttributeError,
    AssertionError,
    EOFError,
    MemoryError,
    RuntimeError,
    struct.error,
    zlib.error,
)

# Warning filters and stderr are global to the process: two threads that change them at once would
# restore each other's. Decoding takes milliseconds where detection takes a second.
_LOCK = threading.Lock()

# Without any handler, Python prints the errors that Pillow logs. With this one it does not, and an
# application that configured Pillow's log still gets them.
_PILLOW_LOG, _NULL_HANDLER = logging.getLogger("PIL"), logging.NullHandler()

_STDERR = 2  # file descriptor: libtiff writes to it directly


@contextmanager
def guarded(name: str) -> Iterator[None]:
    """Silence Pillow inside, and turn every exception of its parsers into an ImageError.

    Args:
        name: Of the photo, for messages.

    Raises:
        ImageError: Pillow failed.
    """
    with _LOCK, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about metadata; the reader checks sizes itself
        _PILLOW_LOG.addHandler(_NULL_HANDLER)
        try:
            yield
        except UnidentifiedImageError as error:
            message = f"{name} is not a photo that can be read here; convert it to JPEG or PNG"
            raise ImageError(message) from error
        except Image.DecompressionBombError as error:
            message = f"{name} claims a size that no photo has; make it smaller"
            raise ImageError(message) from error
        except DAMAGE as error:
            message = f"{name} is damaged or cut short; copy it again or export it anew"
            raise ImageError(message) from error
        finally:
            _PILLOW_LOG.removeHandler(_NULL_HANDLER)


@contextmanager
def libtiff_muted() -> Iterator[None]:
    """Keep libtiff's messages off stderr; only inside `guarded`, whose lock it needs."""
    try:
        stderr = os.dup(_STDERR)
    except OSError:  # the process has no stderr
        yield
        return
    try:
        with Path(os.devnull).open("wb") as devnull:
            os.dup2(devnull.fileno(), _STDERR)
        yield
    finally:
        os.dup2(stderr, _STDERR)
        os.close(stderr)
