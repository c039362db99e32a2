from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType


@pytest.fixture(scope="session")
def reference(load_module: Callable[[str, Path], ModuleType]) -> ModuleType:
    """The method in plain loops, as a module."""
    return load_module("zeroscd_tests_reference", Path(__file__).with_name("reference.py"))
