"""Pillow at work: without a word, and with every failure an ImageError."""

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

# A wide net is right at this door and nowhere else: behind it lie parsers that meet bytes from
# anywhere and promise no particular exception. The price is that a mistake of ours in here looks
# like damage, so tests read every format. The first four are what `scripts/fuzz_images.py` found
# in half a million inputs, with the newest and the oldest Pillow allowed.
DAMAGE = (
    OSError,  # cut short, a decoder's error; nearly all
    ValueError,  # numbers out of range, texts too large or not decodable
    SyntaxError,  # a broken chunk of a PNG, a header against the rules
    TypeError,  # tags of the wrong kind
    # Never met, but a parser's natural failures: the next Pillow may have them.
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

# Warning filters and the error stream belong to the whole process: two threads that change them
# at once would restore each other's. Decoding takes milliseconds where detection takes a second.
_ONE_AT_A_TIME = threading.Lock()

# Without any handler, Python prints errors that Pillow logs. With this one it does not, and an
# application that asked for Pillow's log still gets it.
_PILLOW_LOG, _NOWHERE = logging.getLogger("PIL"), logging.NullHandler()

_STDERR = 2  # the file descriptor, which is what libtiff writes to


@contextmanager
def guarded(name: str) -> Iterator[None]:
    """Keep Pillow silent inside, and turn whatever it trips over into an ImageError.

    Args:
        name: What the photo is called in messages.

    Raises:
        ImageError: Pillow failed, in any way.
    """
    with _ONE_AT_A_TIME, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # odd metadata is no news; sizes are checked by the reader
        _PILLOW_LOG.addHandler(_NOWHERE)
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
            _PILLOW_LOG.removeHandler(_NOWHERE)


@contextmanager
def libtiff_muted() -> Iterator[None]:
    """Keep libtiff's own lines about damage off the error stream; call it inside `guarded`."""
    try:
        kept = os.dup(_STDERR)
    except OSError:  # a process without an error stream needs no muting
        yield
        return
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), _STDERR)
        yield
    finally:
        os.dup2(kept, _STDERR)
        os.close(kept)
