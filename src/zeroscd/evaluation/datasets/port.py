"""What every data set offers, whatever its folders look like."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

from zeroscd.errors import SettingsError

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.records import Frame, Kind

Kinds: TypeAlias = Literal["both", "removed", "added"]

# What a pixel of a mask file says:
#   white      bright = changed (a file with values 0 and 1 only: 1 = changed)
#   black      dark = changed (PCD2015 as published)
#   class-ids  a class id = changed; 0 = unchanged, 255 = sky, unchanged (VL-CMU-CD as published)
#   colours    any colour but black = changed (ChangeSim)
MaskCode: TypeAlias = Literal["white", "black", "class-ids", "colours"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PairFiles:
    """The files of one pair.

    Attributes:
        stem: The name that the files share; unique in the data set.
        before: The t0 photo.
        after: The t1 photo.
        mask: What truly changed, in the data set's frame.
        removed: What was removed, t0 frame; None where the data does not say.
        added: What was added, t1 frame; None where the data does not say.
        ignore: What does not count (white), in the frame of the mask; None where all counts.
        fold: 0..4, the fold of a published cross-validation that tests on this pair.
    """

    stem: str
    before: Path
    after: Path
    mask: Path
    removed: Path | None = None
    added: Path | None = None
    ignore: Path | None = None
    fold: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Dataset:
    """A data set as it was found on disk, with the protocol of its published comparisons.

    Attributes:
        name: As typed on the command line.
        root: Where it lies.
        layout: One sentence: which of the known distributions this is.
        frame: The photo in whose pixels the masks are drawn.
        code: What a pixel of a mask says.
        pairs: In the order of their names.
        size_hw: Every photo and mask is brought to this size; None leaves them as they are.
        black_is_void: Black areas that touch the border were left by warping and do not count.
        counted: Which changes are compared with the masks; None = both kinds.
        pools_pixels: Whether published tables score the pixels of all pairs together.
        notes: What a reader of the scores must know (stray files, resized photos, ...).
    """

    name: str
    root: Path
    layout: str
    frame: Frame
    code: MaskCode
    pairs: tuple[PairFiles, ...]
    size_hw: tuple[int, int] | None = None
    black_is_void: bool = False
    counted: Kind | None = None
    pools_pixels: bool = False
    notes: tuple[str, ...] = ()

    def first(self, limit: int | None) -> Dataset:
        """Return the same data set with its first `limit` pairs only; None keeps all."""
        if limit is None or limit >= len(self.pairs):
            return self
        note = f"only the first {limit} of {len(self.pairs)} pairs"
        return replace(self, pairs=self.pairs[:limit], notes=(note, *self.notes))

    def counting(self, kinds: Kinds | None) -> Dataset:
        """Return the same data set compared with other changes; None keeps its own choice.

        Raises:
            SettingsError: Things of that kind lie in the other photo than the masks.
        """
        if kinds is None:
            return self
        if kinds == "both":
            return replace(self, counted=None, notes=("compared with both kinds", *self.notes))
        lies_in = {"removed": "t0", "added": "t1"}[kinds]
        if lies_in != self.frame:
            message = (
                f"{kinds} things lie in the {lies_in} photo, but the masks of {self.name} in the "
                f"{self.frame} photo; count both"
            )
            raise SettingsError(message)
        return replace(self, counted=kinds, notes=(f"compared with {kinds} only", *self.notes))
