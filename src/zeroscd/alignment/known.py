"""A geometry that the user knows: a camera that did not move, or a homography from elsewhere."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from zeroscd.alignment.homography import degeneracy, scaling
from zeroscd.errors import SettingsError
from zeroscd.records import Alignment
from zeroscd.text import one_line

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from zeroscd.arrays import Homography

    KnownGeometry: TypeAlias = Literal["none"] | ArrayLike

FIXED: Literal["none"] = "none"  # nothing to align
NUMBERS = 9
MAX_BYTES = 1_000_000  # of a file with nine numbers, or of a changes.json
REMEDY = "give t1_from_t0 as 3 x 3 numbers, as JSON or text"


def known_alignment(
    t1_from_t0: KnownGeometry, *, sizes_hw: tuple[tuple[int, int], tuple[int, int]]
) -> Alignment:
    """Return a known geometry as an alignment without matches.

    Args:
        t1_from_t0: (3, 3) homography in pixels of the photos, or "none" where the camera did not
            move: edges then lie on edges.
        sizes_hw: Height and width of the photo before and of the photo after.

    Raises:
        SettingsError: It is no such homography, or cannot relate two photos of one place.

    Example:
        >>> known_alignment("none", sizes_hw=((4, 6), (4, 6))).t1_from_t0.tolist()
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    if isinstance(t1_from_t0, str):
        if t1_from_t0 != FIXED:
            message = f"t1_from_t0 is {one_line(t1_from_t0)!r}; give 3 x 3 numbers or {FIXED!r}"
            raise SettingsError(message)
        return Alignment(t1_from_t0=scaling(*sizes_hw), inliers=0, matches=0, given=True)
    homography = _checked(t1_from_t0, name="t1_from_t0")
    if reason := degeneracy(homography, size_a_hw=sizes_hw[0], size_b_hw=sizes_hw[1]):
        message = f"t1_from_t0 cannot be used: {reason}; is it from t0 to t1, in pixels?"
        raise SettingsError(message)
    return Alignment(t1_from_t0=homography, inliers=0, matches=0, given=True)


def refuse_for_several(t1_from_t0: KnownGeometry) -> None:
    """Refuse a homography where a side has several photos, of which it can relate one pair only.

    Raises:
        SettingsError: It is no `FIXED`.
    """
    if not isinstance(t1_from_t0, str):
        message = f"t1_from_t0 relates two photos, not several; give one a side, or {FIXED!r}"
        raise SettingsError(message)


def read_geometry(value: str) -> KnownGeometry:
    """Read what a user names: "none", or a file with a homography.

    Args:
        value: "none", or the path of a file with 3 x 3 numbers as text or JSON, or of a
            `changes.json`, whose alignment is then used again.

    Raises:
        SettingsError: The file cannot be read or holds something else.
    """
    if value == FIXED:
        return FIXED
    try:
        path = Path(value)
        if path.stat().st_size > MAX_BYTES:
            message = f"{one_line(value)} is too large for nine numbers; {REMEDY}"
            raise SettingsError(message)
        return geometry_in(path.read_bytes(), name=one_line(value))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        message = f"cannot read {one_line(value)}: {reason}; give {FIXED!r} or a file"
        raise SettingsError(message) from error


def geometry_in(content: bytes, *, name: str) -> KnownGeometry:
    """Read the same from the bytes of a file, or from the word "none".

    Raises:
        SettingsError: They hold something else.

    Example:
        >>> geometry_in(b"1 0 8, 0 1 0, 0 0 1", name="shift.txt")[0].tolist()
        [1.0, 0.0, 8.0]
    """
    return FIXED if content.strip() == FIXED.encode() else _homography(content, name=name)


def _homography(content: bytes, *, name: str) -> Homography:
    """Read 3 x 3 numbers from JSON, alone or as `t1_from_t0`, or from text."""
    text = content.decode("utf-8", "replace")
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        value = _from_text(text)
    if isinstance(value, dict):
        inner = value.get("alignment", value)
        value = inner.get("t1_from_t0") if isinstance(inner, dict) else None
    return _checked(value, name=name)


def _from_text(text: str) -> list[list[str]] | None:
    numbers = text.replace(",", " ").replace(";", " ").split()
    return [numbers[i : i + 3] for i in (0, 3, 6)] if len(numbers) == NUMBERS else None


def _checked(value: object, *, name: str) -> Homography:
    try:
        homography = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        homography = np.empty(0)
    if homography.shape != (3, 3) or not np.isfinite(homography).all():
        message = f"{name} holds no homography; {REMEDY}"
        raise SettingsError(message)
    scale = homography[2, 2]
    if scale == 0 or abs(np.linalg.det(homography / scale)) < np.finfo(float).eps:
        message = f"the homography in {name} cannot be inverted; {REMEDY}"
        raise SettingsError(message)
    return np.asarray(homography / scale)
