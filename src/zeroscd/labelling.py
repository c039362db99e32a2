"""What the changed parts show, and classes of things that do not count."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from zeroscd.labels.classes import NAMES, class_ids
from zeroscd.labels.vegetation import find_vegetation
from zeroscd.refine.vote import unite

if TYPE_CHECKING:
    from zeroscd.arrays import Classes, Mask
    from zeroscd.evidence import Pair
    from zeroscd.judging import Judged
    from zeroscd.refine.regions import Part
    from zeroscd.settings import Settings

MOSTLY = 0.5  # share of a part in classes that do not count from which it is left out


def label_parts(
    judged: Judged, pair: Pair, *, ignored: frozenset[int], settings: Settings
) -> Judged:
    """Say of each changed part what it mostly shows, and leave out what does not count.

    Left out are the parts that mostly show classes that do not count. Pixels of these classes that
    did not change are not judged either, in both photos: what stands there hides the scene. A part
    that shows less of them stays whole, for the outlines of classes are ragged.

    Args:
        judged: What is believed of both photos.
        pair: Both photos; where no network labelled their pixels, nothing is said.
        ignored: Numbers of the classes that do not count.
        settings: With `vegetation=ignore`, vegetation does not count either. Without a network,
            formulas find it. They miss many a bare tree, so a part is left out then where either
            photo shows vegetation in its place.
    """
    no_vegetation = settings.vegetation == "ignore"
    classes_t0, classes_t1 = pair.photo_t0.classes, pair.photo_t1.classes
    if classes_t0 is None or classes_t1 is None:
        return _leave_out(judged, pair, _vegetation(pair), either=True) if no_vegetation else judged
    if out := sorted(ignored | class_ids(["vegetation"]) if no_vegetation else ignored):
        shown = np.isin(classes_t0, out), np.isin(classes_t1, out)
        judged = _leave_out(judged, pair, shown, either=False)
    parts_t0, parts_t1 = judged.parts
    return judged._replace(
        parts=(
            [_labelled(part, classes_t0) for part in parts_t0],
            [_labelled(part, classes_t1) for part in parts_t1],
        )
    )


def _vegetation(pair: Pair) -> tuple[Mask, Mask]:
    return (
        find_vegetation(pair.photo_t0.working.pixels),
        find_vegetation(pair.photo_t1.working.pixels),
    )


def _leave_out(judged: Judged, pair: Pair, shown: tuple[Mask, Mask], *, either: bool) -> Judged:
    """Leave out what mostly shows things that do not count.

    Args:
        judged: What is believed of both photos.
        pair: Both photos.
        shown: Where t0, and where t1, shows such things.
        either: Whether a part is left out for what the other photo shows in its place, too.
    """
    side_t0, side_t1 = pair.sides
    there = (side_t0.bring_mask(shown[1]), side_t1.bring_mask(shown[0])) if either else shown
    kept_t0, kept_t1 = (
        [part for part in parts if max(_share(part, area) for area in areas) <= MOSTLY]
        for parts, *areas in zip(judged.parts, shown, there, strict=True)
    )
    masks = (
        unite((part.segment for part in kept_t0), shown[0].shape),
        unite((part.segment for part in kept_t1), shown[1].shape),
    )
    # A part that is left out is so whole, with its pixels of other classes.
    out_t0, out_t1 = (
        area | (was & ~now) for area, was, now in zip(shown, judged.masks, masks, strict=True)
    )
    changed_t0 = masks[0] | side_t0.bring_mask(masks[1])
    changed_t1 = masks[1] | side_t1.bring_mask(masks[0])
    ignored_t0 = (out_t0 | side_t0.bring_mask(out_t1)) & ~changed_t0
    ignored_t1 = (out_t1 | side_t1.bring_mask(out_t0)) & ~changed_t1
    areas_t0, areas_t1 = judged.ignored
    return judged._replace(
        parts=(kept_t0, kept_t1),
        masks=masks,
        unknown=(judged.unknown[0] | ignored_t0, judged.unknown[1] | ignored_t1),
        ignored=(
            ignored_t0 if areas_t0 is None else ignored_t0 | areas_t0,
            ignored_t1 if areas_t1 is None else ignored_t1 | areas_t1,
        ),
    )


def _labelled(part: Part, classes: Classes) -> Part:
    counts = np.bincount(classes[part.segment.window][part.segment.crop()], minlength=len(NAMES))
    most = int(counts.argmax())
    share = float(counts[most] / part.segment.area_px)
    return part._replace(label=NAMES[most], label_share=share)


def _share(part: Part, area: Mask) -> float:
    inside = part.segment.crop() & area[part.segment.window]
    return float(np.count_nonzero(inside) / part.segment.area_px)
