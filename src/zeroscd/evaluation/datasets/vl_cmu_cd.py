"""VL-CMU-CD: street scenes of Pittsburgh over the seasons, in both of its distributions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.evaluation.datasets.port import Dataset, PairFiles
from zeroscd.evaluation.datasets.tree import (
    Joined,
    LeftOut,
    count_note,
    first_holding,
    join,
    pictures_in,
    refuse_missing,
    short_names,
    wrong_layout,
)

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.evaluation.datasets.port import MaskCode

EXPECTED = (
    "ROOT/test/{t0,t1,mask}/NNN_1_XX_0.png (prepared, 0/255) "
    "or ROOT/NNN/{RGB/1_XX.png,RGB/2_XX.png,GT/gtXX.png} (raw, class ids)"
)
SOURCE = "get VL-CMU-CD-binary255.zip (3.5 GB) from the data set Flourish/VL-CMU-CD"
SIZE_HW = (512, 512)  # the paper's; also the prepared distribution's own
TEST_PAIRS = 429
# Sequences of the published test split; the other 98 are for training.
TEST_SEQUENCES = frozenset(
    (
        *(0, 6, 7, 9, 12, 23, 24, 25, 27, 28, 32, 34, 36, 38, 39, 45, 47, 48, 50, 56, 58, 60),
        *(61, 64, 66, 69, 76, 77, 81, 82, 85, 92, 93, 94, 95, 97, 100, 106, 107, 112, 113, 117),
        *(119, 120, 125, 129, 132, 134, 135, 139, 142, 144, 145, 150),
    )
)
UPRIGHT = "0"  # the prepared training photos come in four rotations; the last part of a name


def open_root(root: Path, name: str) -> Dataset:
    """Find the 429 test pairs, prepared or raw.

    Raises:
        DatasetError: Neither distribution is there, or a pair is incomplete.
    """
    parts = ("t0", "t1", "mask")
    prepared = first_holding(
        root, "test", "VL-CMU-CD-binary255/test", "VL-CMU-CD-binary255", holding=parts
    )
    if prepared is not None:
        joined = join(*(prepared / part for part in parts))
        upright = {stem: row for stem, row in joined.rows.items() if _is_upright(stem)}
        layout = "prepared distribution (test/{t0,t1,mask}, white = changed)"
        return _dataset(root, name, Joined(upright, joined.left_out), layout=layout, code="white")
    sequences = _raw_sequences(root)
    if not sequences:
        raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)
    layout = "raw distribution (NNN/{RGB,GT}, class ids, 255 = sky), the 54 test sequences"
    return _dataset(root, name, _join_raw(sequences), layout=layout, code="class-ids")


def _dataset(root: Path, name: str, joined: Joined, *, layout: str, code: MaskCode) -> Dataset:
    if not joined.rows:
        raise wrong_layout(name, root, expected=EXPECTED, source=SOURCE)
    return Dataset(
        name=name,
        root=root,
        layout=layout,
        frame="t0",
        code=code,
        pairs=tuple(
            PairFiles(stem=stem, before=before, after=after, mask=mask)
            for stem, (before, after, mask) in joined.rows.items()
        ),
        size_hw=SIZE_HW,
        black_is_void=True,
        counted="removed",
        notes=(
            "only objects of the t0 photo are labelled: by itself compared with removed only",
            "black areas at the border, left by warping, do not count",
            *count_note(len(joined.rows), TEST_PAIRS),
            *joined.left_out.notes,
        ),
    )


def _is_upright(stem: str) -> bool:
    return stem.rpartition("_")[2] == UPRIGHT


def _raw_sequences(root: Path) -> list[Path]:
    """Return the test sequences of the raw distribution; a folder `test` holds no others."""
    for folder in (root / "test", root / "raw" / "test"):
        found = _sequences_in(folder)
        if found:
            return found
    everything = _sequences_in(root) or _sequences_in(root / "raw")
    return [sequence for sequence in everything if int(sequence.name) in TEST_SEQUENCES]


def _sequences_in(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return [
        child
        for child in sorted(folder.iterdir())
        if child.name.isdecimal() and (child / "GT").is_dir() and (child / "RGB").is_dir()
    ]


def _join_raw(sequences: list[Path]) -> Joined:
    rows: dict[str, tuple[Path, ...]] = {}
    left_out = LeftOut()
    for sequence in sequences:
        pictures, truths = pictures_in(sequence / "RGB"), pictures_in(sequence / "GT")
        photos = dict(pictures.files)
        numbers = {stem.removeprefix("gt") for stem in truths.files if stem.startswith("gt")}
        for number in sorted(numbers):
            before, after = photos.pop(f"1_{number}", None), photos.pop(f"2_{number}", None)
            if before is None or after is None:
                refuse_missing(sequence, f"RGB/{1 if before is None else 2}_{number}.png")
            rows[f"{sequence.name}_1_{number}"] = (before, after, truths.files[f"gt{number}"])
        unread = short_names((*pictures.unread, *truths.unread))
        left_out += LeftOut(
            tuple(f"{sequence.name}/{name}" for name in short_names(photos.values())),
            tuple(f"{sequence.name}/{name}" for name in unread),
        )
    return Joined(rows, left_out)
