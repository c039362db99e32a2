"""`zeroscd --version`: what a report of a bug should say."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from typing import TYPE_CHECKING

from zeroscd import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator

# Distributions, the last of which come with extras and are left out where they are not installed.
PACKAGES = ("torch", "numpy", "opencv-python-headless", "pillow")
OPTIONAL_PACKAGES = ("transformers",)
THREAD_VARIABLES = ("OMP_NUM_THREADS", "CUDA_VISIBLE_DEVICES")  # that move what torch uses


def version_lines() -> Iterator[str]:
    """Yield the version of zeroscd, then those of what it stands on; nothing slow is imported.

    A version of torch ends in what it was built for, such as `+cpu` or `+cu126`.
    """
    yield f"zeroscd {__version__}"
    yield f"python {platform.python_version()}"
    yield f"platform {platform.platform()}"
    yield f"cores {_cores()}"
    for name in THREAD_VARIABLES:
        if name in os.environ:
            yield f"{name} {os.environ[name]}"
    for name in PACKAGES:
        yield f"{name} {_version(name) or 'not installed'}"
    for name in OPTIONAL_PACKAGES:
        if version := _version(name):
            yield f"{name} {version}"


def _cores() -> int:
    """Return how many cores this process may use, which torch gives its threads to."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
