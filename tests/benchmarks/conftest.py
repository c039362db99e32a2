"""The scripts of benchmarks/ as modules; they are no package."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from types import ModuleType

FOLDER = Path(__file__).parents[2] / "benchmarks"


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # oracles.py imports robustness.py; dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def robustness() -> ModuleType:
    return load("robustness")


@pytest.fixture(scope="session")
def oracles(robustness: ModuleType) -> ModuleType:
    assert robustness.__name__ == "robustness"
    return load("oracles")


@pytest.fixture(scope="session")
def pair_benchmark() -> ModuleType:
    return load("pair")
