"""What a batch calls done is on the disk, as the system's own calls show; and any file may be lost.

strace writes the calls down, so that what Python and SQLite do on the way is among them.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from zeroscd.batch import Options, run
from zeroscd.export import files

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType

NAMES = tuple(f"p{number}" for number in range(6))
CALLS = "fsync,fdatasync,rename,renameat,renameat2,pwrite64,write"
PRINTED = re.compile(r'\bwrite\(1<[^>]*>, "(\w+)\\n"')  # by the toy, once a pair is recorded
STAGE = r"\.zeroscd-\w+\.part"


class Heard:
    """Hears which pairs are compared rather than reused."""

    def __init__(self) -> None:
        self.computed: list[str] = []

    def begin(self, total: int) -> None:
        del total

    def advance(self, stem: str, *, reused: bool) -> None:
        if not reused:
            self.computed.append(stem)


def computed(street: Path, out: Path, options: Options) -> list[str]:
    """Run a batch; return the pairs that were not reused."""
    heard = Heard()
    run(street / "pairs.csv", out, options=options, progress=heard)
    return heard.computed


@pytest.fixture
def strace(tmp_path: Path) -> list[str]:
    """The start of a command that writes down a program's calls; skips where there is none."""
    command = ["strace", "-f", "-y", "-s", "40", "-e", f"trace={CALLS}"]
    if (
        shutil.which("strace") is None
        or subprocess.run([*command, "true"], capture_output=True, check=False).returncode
    ):
        pytest.skip("strace is not installed, or may not be used here")
    return [*command, "-o", str(tmp_path / "strace.log")]


def calls_of(strace: list[str], toy: ModuleType, street: Path, out: Path) -> list[str]:
    """Run a batch in a process of its own; return its calls in the order they were made."""
    batch = [sys.executable, str(toy.__file__), str(street / "pairs.csv"), str(out)]
    answers = "\n" * len(NAMES)
    subprocess.run([*strace, *batch], input=answers, text=True, check=True, stdout=subprocess.PIPE)
    lines = (out.parent / "strace.log").read_text().splitlines()
    # The thread that writes is the one that prints; others only read photos and compare.
    (writer,) = {line.split()[0] for line in lines if PRINTED.search(line)}
    return [line for line in lines if line.split()[0] == writer]


def by_pair(calls: list[str]) -> dict[str, list[str]]:
    """Return, for each pair, the calls from the first for its files until it was called done.

    Those after the last pair are under no name.
    """
    parts: dict[str, list[str]] = {}
    part: list[str] = []
    for call in calls:
        if said := PRINTED.search(call):
            staged = [at for at, one in enumerate(part) if re.search(STAGE, one)]
            parts[said[1]], part = part[staged[0] :], []
        else:
            part.append(call)
    return {**parts, "": part}


def where(calls: list[str], pattern: str) -> int:
    """Return where the one call that is like this stands."""
    found = [at for at, call in enumerate(calls) if re.search(pattern, call)]
    assert len(found) == 1, f"{pattern} {len(found)} times in\n" + "\n".join(calls)
    return found[0]


def first_row(calls: list[str]) -> int:
    """Return where the journal is first written."""
    rows = [at for at, call in enumerate(calls) if re.search(r"pwrite64\(.*/journal\.sq", call)]
    assert rows, "no row was written after the pair's files"
    return rows[0]


@pytest.mark.slow
def test_a_new_pairs_files_and_folder_are_synced_before_the_journals_row(
    strace: list[str], street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    out = tmp_path / "out"
    parts = by_pair(calls_of(strace, toy, street, out))
    assert sorted(parts) == ["", *NAMES]
    for name in NAMES:
        calls = parts[name]
        stage = rf"{out}/{STAGE}/{name}"
        synced = [
            where(calls, rf"fsync\(\d+<{stage}{it}>") for it in ("/mask.png", "/changes.json")
        ]
        synced.append(where(calls, rf"fsync\(\d+<{stage}>"))
        moved = where(calls, rf'rename.*"{stage}".*"{out}/{name}"')
        assert max(synced) < moved < where(calls, rf"fsync\(\d+<{out}>") < first_row(calls)


@pytest.mark.slow
def test_a_pairs_file_that_is_made_again_is_synced_before_the_journals_row(
    strace: list[str], street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    out = tmp_path / "out"
    run(street / "pairs.csv", out, options=Options(detector=toy.make))
    for name in NAMES:
        (out / name / "mask.png").write_bytes(b"")
    parts = by_pair(calls_of(strace, toy, street, out))
    assert sorted(parts) == ["", *NAMES]
    for name in NAMES:
        folder, calls = out / name, parts[name]
        for file in ("mask.png", "changes.json"):
            synced = where(calls, rf"fsync\(\d+<{folder}/{STAGE}/{file}>")
            moved = where(calls, rf'rename.*"{folder}/{STAGE}/{file}".*"{folder}/{file}"')
            assert synced < moved < where(calls, rf"fsync\(\d+<{folder}>") < first_row(calls)


@pytest.mark.slow
def test_both_tables_are_synced_before_they_take_their_names(
    strace: list[str], street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    out = tmp_path / "out"
    calls = by_pair(calls_of(strace, toy, street, out))[""]
    for table in ("changes.parquet", "pairs.parquet"):
        part = rf"{out}/\.{table}\.\d+\.\d+\.part"
        moved = where(calls, rf'rename.*"{part}".*"{out}/{table}"')
        assert where(calls, rf"fsync\(\d+<{part}>") < moved
        assert re.search(rf"fsync\(\d+<{out}>", calls[moved + 1])


@pytest.mark.parametrize("kind", files.NAMES)
def test_a_file_that_lost_its_end_is_made_again_and_no_other_pair_is_compared(
    street: Path, tmp_path: Path, toy: ModuleType, kind: str
) -> None:
    options = Options(detector=toy.make, write=files.NAMES)
    out = tmp_path / "out"
    assert sorted(computed(street, out, options)) == [*NAMES]
    assert computed(street, out, options) == []
    for name, share in zip(NAMES, (0.0, 0.5, 1.0), strict=False):
        path = out / name / files.file_names([kind])[0]
        whole = path.read_bytes()
        path.write_bytes(whole[: int(share * (len(whole) - 1))])
        assert computed(street, out, options) == [name]
        assert without_seconds(path.read_bytes()) == without_seconds(whole)
        assert computed(street, out, options) == []


def without_seconds(content: bytes) -> bytes:
    """Leave out how long the comparison took, which changes.json and the report say."""
    return re.sub(rb"\d+\.\d+ ?s\b|\"\w+\": \d+\.\d+", b"", content)
