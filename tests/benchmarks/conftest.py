"""The scripts of benchmarks/ as modules; they are no package."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="session")
def load_script(
    load_module: Callable[[str, Path], ModuleType],
) -> Callable[[str], ModuleType]:
    """Import a benchmark under its own name: oracles.py and places.py import robustness.py."""
    return lambda name: load_module(name, FOLDER / f"{name}.py")


@pytest.fixture(scope="session")
def robustness(load_script: Callable[[str], ModuleType]) -> ModuleType:
    return load_script("robustness")


@pytest.fixture(scope="session")
def oracles(load_script: Callable[[str], ModuleType], robustness: ModuleType) -> ModuleType:
    assert robustness.__name__ == "robustness"
    return load_script("oracles")


@pytest.fixture(scope="session")
def tutorial(load_script: Callable[[str], ModuleType]) -> ModuleType:
    return load_script("tutorial")


@pytest.fixture(scope="session")
def several(load_script: Callable[[str], ModuleType]) -> ModuleType:
    return load_script("several")


@pytest.fixture(scope="session")
def accuracy(
    load_script: Callable[[str], ModuleType],
    tutorial: ModuleType,
    pair_benchmark: ModuleType,
    several: ModuleType,
) -> ModuleType:
    found = (tutorial.__name__, pair_benchmark.__name__, several.__name__)
    assert found == ("tutorial", "pair", "several")
    return load_script("accuracy")


@pytest.fixture(scope="session")
def small_things(load_script: Callable[[str], ModuleType], accuracy: ModuleType) -> ModuleType:
    assert accuracy.__name__ == "accuracy"
    return load_script("small_things")


@pytest.fixture(scope="session")
def pair_benchmark(load_script: Callable[[str], ModuleType]) -> ModuleType:
    return load_script("pair")


@pytest.fixture(scope="session")
def vegetation(load_script: Callable[[str], ModuleType], pair_benchmark: ModuleType) -> ModuleType:
    assert pair_benchmark.__name__ == "pair"
    return load_script("vegetation")


@pytest.fixture(scope="session")
def vegetation_changes(
    load_script: Callable[[str], ModuleType], accuracy: ModuleType, vegetation: ModuleType
) -> ModuleType:
    assert (accuracy.__name__, vegetation.__name__) == ("accuracy", "vegetation")
    return load_script("vegetation_changes")
