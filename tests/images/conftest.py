from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "fuzz_images.py"


@pytest.fixture(scope="session")
def fuzz_images(load_module: Callable[[str, Path], ModuleType]) -> ModuleType:
    """The script that throws damaged pictures at the reader, as a module."""
    return load_module("fuzz_images", SCRIPT)


@pytest.fixture(scope="session")
def small_pictures(fuzz_images: ModuleType) -> dict[str, bytes]:
    """One picture of 36 x 40 pixels in every format, compression and colour mode, by name."""
    samples: dict[str, bytes] = fuzz_images.samples()
    return samples
