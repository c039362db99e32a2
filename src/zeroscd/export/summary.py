"""The result in plain sentences, for the report and the command line."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from zeroscd.export.names import photo_name
from zeroscd.records import Alignment

if TYPE_CHECKING:
    from zeroscd.records import Changes, FurtherPhoto, Transients

MOSTLY_UNSEEN = 0.5  # share of pixels out of view above which the report warns
HARDLY_JUDGED = 0.1  # share of judged pixels below which it warns


def summary(result: Changes) -> str:
    """Say what changed in one sentence; an object found in parts counts as several regions."""
    if not result.regions and not result.mask.any():
        return "No change found"
    counts = {kind: sum(r.kind == kind for r in result.regions) for kind in ("added", "removed")}
    found = ", ".join(f"{n} {kind}" for kind, n in counts.items() if n)
    noun = "region " if found.startswith("1 ") else "regions "
    share = f"{percent(result.changed_fraction)} of the judged scene changed"
    return f"{found.replace(' ', f' {noun}', 1)}; {share}" if found else share


def warnings(result: Changes) -> list[str]:
    """Say what a reader must know before believing the result; often nothing."""
    found = []
    if not isinstance(result.alignment, Alignment):
        reason = result.alignment.reason.rstrip(". ")
        found.append(
            f"The photos could not be aligned: {reason}. They were compared as they lie, "
            "so a moved camera may look like change."
        )
    unseen, wanted = float(result.unseen.mean()), 1 - _ignored_fraction(result)
    if result.ignored is not None and (result.ignored | result.unseen).all():
        found.append("All of the photo is left out; nothing is said about it.")
    elif unseen > MOSTLY_UNSEEN:
        found.append(
            f"Only {percent(1 - unseen)} of the photo is visible in both photos; "
            "nothing is said about the rest."
        )
    elif result.judged_fraction < HARDLY_JUDGED * wanted:
        found.append(
            f"Only {percent(result.judged_fraction)} of the photo could be judged: elsewhere the "
            "photos match too little, because the camera moved or light and season differ too "
            "much. An unmarked place there is not known to be unchanged."
        )
    return found


def alignment_sentence(result: Changes) -> str:
    """Say how the camera moved, or that the photos were not aligned."""
    alignment = result.alignment
    if not isinstance(alignment, Alignment):
        return f"Not aligned ({alignment.inliers} of {alignment.matches} matches agreed)."
    height, width = result.before.size_hw
    shift, degrees, scale = motion(alignment, ((width - 1) / 2, (height - 1) / 2))
    inliers, matches = alignment.inliers, alignment.matches
    how = f"Aligned: {inliers} of {matches} matches agree ({percent(inliers / max(matches, 1))})."
    if alignment.given:
        how = "Aligned as given."
    return (
        f"{how} In the middle of the picture the view moved by {shift:.0f} px, turned by "
        f"{degrees:.1f}° and scaled by {scale:.2f}."
    )


def further_photos_sentence(result: Changes) -> str:
    """Name the further photos of the place, and why some were left out; empty if there are none."""
    photos = result.further_photos
    used = [_side_and_name(result, one) for one in photos if one.left_out is None]
    left_out = [
        f"{_side_and_name(result, one)} ({one.left_out.rstrip('. ')})"
        for one in photos
        if one.left_out
    ]
    parts = {"Further photos of the place": used, "Left out": left_out}
    return " ".join(f"{title}: {', '.join(names)}." for title, names in parts.items() if names)


def transients_sentence(result: Changes) -> str:
    """Say how many things stand in one photo only; empty if nobody asked."""
    if result.transients is None:
        return ""
    found = [
        f"{len(one.regions)} in {_side_and_name(result, one)}"
        for one in result.transients
        if one.regions
    ]
    return f"In one photo only: {', '.join(found) if found else 'nothing'}."


def _side_and_name(result: Changes, further: FurtherPhoto | Transients) -> str:
    side = "before" if further.frame == "t0" else "after"
    return f"{side} {photo_name(result, further.photo, otherwise='(no name)')}"


def coverage_sentence(result: Changes) -> str:
    """Say how much of the frame's photo could be compared at all."""
    if not result.unknown.any():
        return "The whole photo was judged."
    unseen, ignored = float(result.unseen.mean()), _ignored_fraction(result)
    # Rounding must not leave a rest of it.
    unverified = max(0.0, round(float(result.unknown.mean()) - unseen - ignored, 9))
    reasons = {
        f"{percent(ignored)} left out": ignored,
        f"{percent(unseen)} not in view of both photos": unseen,
        f"{percent(unverified)} in surroundings that match too little": unverified,
    }
    why = ", ".join(reason for reason, share in reasons.items() if share > 0)
    return f"{percent(result.judged_fraction)} of the photo was judged. Hatched: {why}."


def _ignored_fraction(result: Changes) -> float:
    """Return the share of the photo that both photos show and the user left out."""
    return 0.0 if result.ignored is None else float((result.ignored & ~result.unseen).mean())


def motion(alignment: Alignment, at_xy: tuple[float, float]) -> tuple[float, float, float]:
    """Return shift in pixels, turn in degrees (0..180) and scale of a homography at a point.

    Example:
        >>> turned = np.array([[0.0, -2.0, 3.0], [2.0, 0.0, 4.0], [0.0, 0.0, 1.0]])
        >>> motion(Alignment(t1_from_t0=turned, inliers=4, matches=4), (0.0, 0.0))
        (5.0, 90.0, 2.0)
    """
    matrix = np.asarray(alignment.t1_from_t0, np.float64)
    here = np.array([*at_xy, 1.0])
    x, y, w = matrix @ here
    there = np.array([x / w, y / w])
    jacobian = (matrix[:2, :2] - np.outer(there, matrix[2, :2])) / w
    turn = math.atan2(jacobian[1, 0] - jacobian[0, 1], jacobian[0, 0] + jacobian[1, 1])
    scale = math.sqrt(abs(np.linalg.det(jacobian)))
    return float(np.linalg.norm(there - at_xy)), abs(math.degrees(turn)), scale


def percent(fraction: float) -> str:
    """Write a share with as many digits as it deserves.

    Example:
        >>> percent(0.0312), percent(0.47), percent(0.0), percent(0.0001), percent(1.0)
        ('3.1 %', '47 %', '0 %', '< 0.1 %', '100 %')
    """
    value = 100 * fraction
    if 0 < value < 0.1:  # noqa: PLR2004 - the last digit that is shown
        return "< 0.1 %"
    return f"{value:.0f} %" if value >= 10 or value == 0 else f"{value:.1f} %"  # noqa: PLR2004
