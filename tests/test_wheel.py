"""What pip installs from this checkout: the package with its data and licences, nothing else."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, PackagePath, distribution
from pathlib import Path

import pytest

import zeroscd

SOURCE = Path(__file__).parents[1] / "src" / "zeroscd"


@pytest.fixture(scope="module")
def installed() -> list[PackagePath]:
    """The files of the wheel that was installed, if these tests run with it."""
    try:
        files = distribution("zeroscd").files or []
    except PackageNotFoundError:
        files = []
    package = [file for file in files if file.as_posix() == "zeroscd/__init__.py"]
    if not package or Path(str(package[0].locate())).resolve() != Path(zeroscd.__file__).resolve():
        pytest.skip("zeroscd is not installed from a wheel here, as .ci/run does it")
    return files


def test_the_wheel_holds_the_package_and_nothing_else(installed: list[PackagePath]) -> None:
    found = {file.as_posix() for file in installed if file.parts[0] == "zeroscd"}
    kept = {path for path in SOURCE.rglob("*") if path.is_file()}
    wanted = {f"zeroscd/{path.relative_to(SOURCE).as_posix()}" for path in kept}
    assert {name for name in found if not name.endswith(".pyc")} == {
        name for name in wanted if not name.endswith(".pyc")
    }
    elsewhere = {file.parts[0] for file in installed} - {"zeroscd"}
    assert {name.rpartition(".")[2] for name in elsewhere} <= {"dist-info", ""}
    assert "zeroscd/py.typed" in found


def test_the_wheel_holds_the_licences(installed: list[PackagePath]) -> None:
    names = {file.name for file in installed if "licenses" in file.parts}
    assert names == {"LICENSE", "THIRD_PARTY.md"}
