"""The script that compares the Dockerfile with its page finds nothing, and would find something."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def script(load_module: Callable[[str, Path], ModuleType]) -> ModuleType:
    return load_module("check_dockerfile", ROOT / "scripts" / "check_dockerfile.py")


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """What the script looks at, to be spoilt."""
    for name in ("Dockerfile", ".dockerignore", "pyproject.toml", "docs/serve.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    for name in ("README.md", "LICENSE", "THIRD_PARTY.md", "src"):
        (tmp_path / name).touch()
    return tmp_path


def test_the_dockerfile_does_what_its_page_says(script: ModuleType) -> None:
    assert script.problems() == []


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("Dockerfile", "python:3.12.12-slim-bookworm", "python:latest", "not pinned"),
        ("Dockerfile", "python:3.12.12", "python:3.10.1", "older than requires-python"),
        ("Dockerfile", "[serve]", "[server]", "no extra 'server'"),
        ("Dockerfile", "USER zeroscd", "USER root", "as root"),
        ("Dockerfile", "EXPOSE 8000", "EXPOSE 80", "EXPOSE"),
        ("Dockerfile", "/healthz", "/health", "/healthz"),
        ("Dockerfile", '"/state"]', '"/tmp"]', "VOLUME"),
        ("Dockerfile", "LICENSE", "LICENCE", "not there"),
        (".dockerignore", "!src", "", "keeps src out"),
        ("docs/serve.md", "docker build", "build", "docker build"),
        ("docs/serve.md", "pip install '.[serve]'", "pip install .", "pip install '.[serve]'"),
    ],
)
def test_a_difference_is_found(
    script: ModuleType, copy: Path, file: str, old: str, new: str, words: str
) -> None:
    assert script.problems(copy) == []
    text = (copy / file).read_text()
    assert old in text
    (copy / file).write_text(text.replace(old, new))
    assert any(words in line for line in script.problems(copy))
