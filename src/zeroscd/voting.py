"""The segments of a pair that may vote, and their vote."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from zeroscd.device import side_by_side
from zeroscd.images.components import small_components
from zeroscd.images.tiles import window_of
from zeroscd.refine.vote import unite, vote
from zeroscd.segmenters.port import OneThreadProposals
from zeroscd.segmenters.tiles import segments_in_photo
from zeroscd.segments import Segments

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Mask
    from zeroscd.evidence import Evidence, Pair, Tile
    from zeroscd.records import CoarseChange
    from zeroscd.refine.vote import Flagged
    from zeroscd.segments import Segment
    from zeroscd.settings import RefineSettings

# Share of coarse change above which a segment of a tile is flagged: distances reach beyond a small
# thing, and so do those of what lies beside it. docs/small-things.md has what was tried.
FINER_ALPHA = 0.95
SMALL_SHARE = 0.02  # of the photo: segments of tiles that make up more than that are no small thing


class Voters(NamedTuple):
    """The segments of one photo that may be flagged.

    Attributes:
        whole: Of the photo.
        finer: Of its tiles.
    """

    whole: Segments
    finer: Segments


def all_segments(pair: Pair) -> tuple[Segments, Segments]:
    """Ask for every segment of both photos (paper, step 5)."""
    _prepare_proposals(pair)
    return pair.photo_t0.proposals.segments(None), pair.photo_t1.proposals.segments(None)


def segments_of(
    evidence: Evidence, coarse: tuple[CoarseChange, CoarseChange]
) -> tuple[Voters, Voters]:
    """Return the segments of both photos that may vote: all, or those at coarse change.

    Those at coarse change are nearly all that can be flagged (docs/models.md).
    """
    pair, changed = evidence.pair, (coarse[0].changed, coarse[1].changed)
    of_t0, of_t1 = evidence.segments or _segments_at(pair, changed)
    finer_t0, finer_t1 = _finer_segments(evidence.tiles, pair, changed)
    return Voters(of_t0, finer_t0), Voters(of_t1, finer_t1)


def _segments_at(pair: Pair, changed: tuple[Mask, Mask]) -> tuple[Segments, Segments]:
    _prepare_proposals(pair)
    return (
        pair.photo_t0.proposals.segments(changed[0]),
        pair.photo_t1.proposals.segments(changed[1]),
    )


def _finer_segments(
    tiles: Sequence[Tile], pair: Pair, changed: tuple[Mask, Mask]
) -> tuple[Segments, Segments]:
    """Return the segments of tiles at coarse change, in the pixels of the photos."""
    found: tuple[list[Segment], list[Segment]] = [], []
    for tile in tiles:
        at_t0, at_t1 = (mask[window_of(box)] for mask, box in zip(changed, tile.boxes, strict=True))
        if not (at_t0.any() or at_t1.any()):
            continue
        for side, own in enumerate(_segments_at(tile.pair, (at_t0, at_t1))):
            found[side].extend(segments_in_photo(own, tile.boxes[side], pair.sizes_hw[side]))
    of_t0, of_t1 = (
        Segments(size_hw=size_hw, items=tuple(items))
        for size_hw, items in zip(pair.sizes_hw, found, strict=True)
    )
    return of_t0, of_t1


def _prepare_proposals(pair: Pair) -> None:
    """Prepare the segments of both photos at the same time, where that is sound."""
    both = (pair.photo_t0.proposals, pair.photo_t1.proposals)
    lone = [one for one in both if isinstance(one, OneThreadProposals)]
    side_by_side(lambda one: one.prepare(), lone)


def flag(voters: Voters, coarse: CoarseChange, refine: RefineSettings) -> list[Flagged]:
    """Flag the segments of one photo that are mostly coarse change (paper, step 5)."""
    whole = vote(voters.whole, coarse, alpha=refine.alpha, partial_segments=refine.partial_segments)
    alpha = max(refine.alpha, FINER_ALPHA)
    return whole + _small_things(
        vote(voters.finer, coarse, alpha=alpha, partial_segments=refine.partial_segments),
        voters.finer.size_hw,
    )


def _small_things(flagged: list[Flagged], size_hw: tuple[int, int]) -> list[Flagged]:
    """Keep the segments that make up a small thing together with those they touch."""
    united = unite((one.segment for one in flagged), size_hw)
    small = small_components(united, min_area_px=int(SMALL_SHARE * united.size))
    return [one for one in flagged if small[one.segment.window][one.segment.crop()].all()]
