"""Names of pairs, safe as folder names on any system."""

from __future__ import annotations

import hashlib
import unicodedata
from pathlib import PurePosixPath

from zeroscd.batch.address import path_of

MAX_LENGTH = 100  # characters; file systems allow 255 bytes, and a number may follow
DIGEST_DIGITS = 8  # hexadecimal, at the end of shortened names
ALLOWED = "-_.+=@ "  # besides letters and digits
# Names that Windows keeps for devices, with or without a suffix.
DEVICES = frozenset(
    {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))}
)


def safe_name(text: str) -> str:
    """Turn an id into a folder's name; different ids may become the same name.

    Example:
        >>> safe_name("Main St/12 (north)")
        'Main St_12 _north_'
        >>> safe_name("..")
        'pair'
    """
    composed = unicodedata.normalize("NFC", text)
    name = "".join(c if c.isalnum() or c in ALLOWED else "_" for c in composed).strip(" .")
    if name.partition(".")[0].lower() in DEVICES:
        name = f"_{name}"
    if len(name) > MAX_LENGTH or len(name.encode()) > 2 * MAX_LENGTH:
        name = f"{name[: MAX_LENGTH // 2].rstrip(' .')}-{_digest(text)}"
    return name or "pair"


def stem(address: str) -> str:
    """Return the file name of an address without its suffix.

    Example:
        >>> stem("s3://bucket/2019/elm_street.jpg"), stem("https://host/b.png?sig=r/t.u")
        ('elm_street', 'b')
    """
    return PurePosixPath(path_of(address).replace("\\", "/")).stem


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:DIGEST_DIGITS]
