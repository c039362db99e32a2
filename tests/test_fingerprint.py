from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from zeroscd import fingerprint

if TYPE_CHECKING:
    from pathlib import Path

FILES = (
    "detector.py",
    "change/coarse.py",
    "survey/page.py",
    "batch/comparer.py",
    "batch/notes.txt",
)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of five files in place of ours."""
    for file in FILES:
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text("first\n")
    monkeypatch.setattr(fingerprint, "__file__", str(tmp_path / "fingerprint.py"))
    return tmp_path


def digest_edited(package: Path, file: str, *, also: tuple[str, ...] = ()) -> tuple[str, str]:
    """The digest of the code before and after an edit."""
    fresh = fingerprint.digest_code.__wrapped__  # not the one that remembers
    before = fresh(also=also)
    (package / file).write_text("second\n")
    return before, fresh(also=also)


@pytest.mark.parametrize("file", ["detector.py", "change/coarse.py"])
def test_code_that_decides_a_result_is_in_its_digest(package: Path, file: str) -> None:
    before, after = digest_edited(package, file)
    assert before != after


@pytest.mark.parametrize("file", ["survey/page.py", "batch/comparer.py"])
def test_code_that_presents_results_is_not(package: Path, file: str) -> None:
    before, after = digest_edited(package, file)
    assert before == after


def test_presenting_code_counts_for_whom_it_decides(package: Path) -> None:
    before, after = digest_edited(package, "batch/comparer.py", also=("batch",))
    assert before != after
    before, after = digest_edited(package, "batch/notes.txt", also=("batch",))
    assert before == after
