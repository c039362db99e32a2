from __future__ import annotations

from typing import TYPE_CHECKING, Any

from zeroscd.export.table import changes_schema, pairs_schema, write_parquet
from zeroscd.survey import compared_pairs as module
from zeroscd.survey.compared_pairs import read_compared_pairs, read_failures

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pytest

Rows = list[dict[str, Any]]


def save(folder: Path, pairs: Rows, changes: Rows) -> None:
    write_parquet(folder / "pairs.parquet", pairs, pairs_schema())
    write_parquet(folder / "changes.parquet", changes, changes_schema())


def test_every_change_comes_with_its_pair(
    tmp_path: Path,
    pair: Callable[..., Any],
    change: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "ROWS", 2)  # so that pairs and changes straddle what is read
    names = ["a", "b", "c", "d", "e"]
    counts = [2, 0, 3, 0, 1]
    pairs = [pair(row=n, pair=name) for n, name in enumerate(names, 1)]
    pairs[3] |= {"status": "error", "error": "broken"}
    changes = [
        change(pair=name, region=region)
        for name, count in zip(names, counts, strict=True)
        for region in range(1, count + 1)
    ]
    save(tmp_path, pairs, changes)
    found = list(read_compared_pairs(tmp_path))
    assert [one.name for one in found] == ["a", "b", "c", "e"]
    assert [[c["region"] for c in one.changes] for one in found] == [[1, 2], [], [1, 2, 3], [1]]
    assert [row["error"] for row in read_failures(tmp_path)] == ["broken"]
