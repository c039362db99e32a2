"""HEIC photos, as phones write them, read by the extra `zeroscd[heic]`."""

from __future__ import annotations

import functools
from importlib import import_module

FORMAT = "HEIF"  # Pillow's name, once pillow-heif is registered
SUFFIXES = frozenset({".heic", ".heif", ".hif"})
# Major brands in the first bytes of a file (ISO 14496-12, section 4.3; ISO 23008-12, annex B).
BRANDS = frozenset({b"heic", b"heix", b"hevc", b"hevx", b"heim", b"heis", b"mif1", b"msf1"})
HINT = "run: pip install 'zeroscd[heic]'"


@functools.cache
def is_available() -> bool:
    """Return whether HEIC photos can be read; pillow-heif then teaches Pillow to do so."""
    try:
        plugin = import_module("pillow_heif")
    except ImportError:
        return False
    plugin.register_heif_opener()
    return True


def is_heif(content: bytes) -> bool:
    r"""Return whether a file is HEIC, by its first bytes.

    Example:
        >>> is_heif(b"\0\0\0\x18ftypheic"), is_heif(b"\xff\xd8\xff\xe0 a JPEG")
        (True, False)
    """
    return content[4:8] == b"ftyp" and content[8:12] in BRANDS
