import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "fuzz_images.py"


@pytest.fixture(scope="session")
def fuzz_images() -> ModuleType:
    """The script that throws damaged pictures at the reader, as a module."""
    spec = importlib.util.spec_from_file_location("fuzz_images", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def small_pictures(fuzz_images: ModuleType) -> dict[str, bytes]:
    """One picture of 36 x 40 pixels in every format, compression and colour mode, by name."""
    samples: dict[str, bytes] = fuzz_images.samples()
    return samples
