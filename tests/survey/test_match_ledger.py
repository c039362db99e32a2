from __future__ import annotations

import json
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import pytest

from zeroscd.errors import OutputError
from zeroscd.survey.match_ledger import FILE, MatchLedger
from zeroscd.survey.matching import PhotoMatch

if TYPE_CHECKING:
    from pathlib import Path

FIRST = PhotoMatch(new="/é.jpg", old="/o.jpg", score=0.25, inliers=7, metres=1.5)
SEVERAL = replace(FIRST, also_old=("/p.jpg", "/q.jpg"))
SECOND = PhotoMatch(new="/b.jpg", reason="no old photo")


def test_what_is_written_down_is_known_to_the_next_run(tmp_path: Path) -> None:
    book = MatchLedger(tmp_path)
    assert book.get("one") is None
    book.add("one", FIRST)
    book.add("two", SECOND)
    assert book.get("one") == FIRST
    book.add("four", SEVERAL)
    again = MatchLedger(tmp_path)
    assert again.get("four") == SEVERAL
    assert (again.get("one"), again.get("two"), again.get("three")) == (FIRST, SECOND, None)


def test_with_one_old_photo_a_line_is_as_older_versions_wrote_it(tmp_path: Path) -> None:
    MatchLedger(tmp_path).add("one", FIRST)
    values = json.loads((tmp_path / FILE).read_text())
    assert values.pop("key") == "one"
    assert "also_old" not in values
    assert {**values, "also_old": ()} == asdict(FIRST)


def test_every_way_of_being_cut_short_loses_one_line_at_most(tmp_path: Path) -> None:
    book = MatchLedger(tmp_path)
    book.add("one", FIRST)
    whole = (tmp_path / FILE).read_bytes()
    book.add("two", SECOND)
    both = (tmp_path / FILE).read_bytes()
    for length in range(len(whole), len(both)):
        (tmp_path / FILE).write_bytes(both[:length])
        torn = MatchLedger(tmp_path)
        assert torn.get("one") == FIRST
        torn.add("two", SECOND)
        torn.add("three", SECOND)
        mended = MatchLedger(tmp_path)
        assert [mended.get(key) for key in ("one", "two", "three")] == [FIRST, SECOND, SECOND]


def test_lines_of_another_version_are_looked_for_again(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text('{"key": "one", "colour": "red"}\n[1]\n{"new": "a"}\n')
    assert MatchLedger(tmp_path).get("one") is None


@pytest.mark.parametrize(
    "line",
    [
        "[" * 100_000,
        '{"key": ["one"], "new": "/b.jpg", "reason": "no old photo"}',
        '{"key": "one", "new": 7, "reason": "no old photo"}',
        '{"key": "one", "new": "/b.jpg", "old": "/o.jpg", "score": "high"}',
        '{"key": "one", "new": "/b.jpg"}',
        '{"key": "one", "new": "/b.jpg", "old": "/o.jpg", "also_old": [7]}',
        '{"key": "one", "new": "/b.jpg", "old": "/o.jpg", "also_old": 7}',
        "\xff\x00",
        "9" * 5000,
    ],
)
def test_a_damaged_line_counts_as_absent_whatever_reading_it_raises(
    tmp_path: Path, line: str
) -> None:
    MatchLedger(tmp_path).add("two", SECOND)
    with (tmp_path / FILE).open("ab") as file:
        file.write(line.encode("latin-1") + b"\n")
    ledger = MatchLedger(tmp_path)
    assert ledger.get("one") is None
    assert ledger.get("two") == SECOND


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    book = MatchLedger(tmp_path)
    (tmp_path / FILE).mkdir()
    with pytest.raises(OutputError, match=r"cannot write .*matches\.jsonl: "):
        book.add("one", FIRST)
