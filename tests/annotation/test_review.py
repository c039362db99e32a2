"""Reviews of proposals, read from an export of the page."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from zeroscd.annotation.review import Decision, read_decisions
from zeroscd.errors import DatasetError

if TYPE_CHECKING:
    from pathlib import Path


def test_what_was_said_is_read_and_open_ones_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "reviewed.json"
    blobs = [
        {"pair": "a", "proposal": "1f", "review": "rejected"},
        {"pair": "a", "proposal": "2f", "review": None},
    ]
    path.write_text(json.dumps({"blobs": blobs}))
    assert read_decisions(path) == (Decision("a", "1f", "rejected"),)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ("{", "no reviewed outlines"),
        ("[]", "no reviewed outlines"),
        ('{"events": []}', "there is no 'blobs'"),
        ('{"blobs": [{"review": "accepted"}]}', "there is no 'pair'"),
        ('{"blobs": [{"pair": "a", "proposal": "1", "review": "maybe"}]}', "'maybe' is no review"),
    ],
)
def test_another_file_is_refused_in_one_line(tmp_path: Path, content: str, why: str) -> None:
    path = tmp_path / "reviewed.json"
    path.write_text(content)
    with pytest.raises(DatasetError, match=why) as caught:
        read_decisions(path)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="No such file"):
        read_decisions(tmp_path / "reviewed.json")
