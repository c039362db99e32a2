"""Proposals for drawn areas, in the photo that shows the thing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from zeroscd.annotation.outcome import MIN_CONFIDENCE
from zeroscd.annotation.proposal import confidence_of, propose, views_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from zeroscd.arrays import Mask
    from zeroscd.records import Frame


@pytest.mark.parametrize("frame", ["t0", "t1"])
def test_each_thing_is_found_in_the_photo_that_shows_it(
    street: Any, grow: Callable[..., Mask], iou: Callable[..., float], frame: Frame
) -> None:
    encoded = street.detector.encode([street.before, street.after])
    views = views_of(tuple(encoded), street.coarse, frame, street.detector.settings)
    for thing, photo in ((street.removed, "t0"), (street.added, "t1")):
        found = propose(views, grow(thing, 5))
        assert found.photo == photo
        assert iou(found.mask, thing) > 0.97
        assert found.confidence > 0.7


def test_where_no_photo_shows_a_thing_the_confidence_is_low(
    street: Any, grow: Callable[..., Mask]
) -> None:
    encoded = street.detector.encode([street.before, street.before])
    views = views_of(tuple(encoded), street.coarse, "t1", street.detector.settings)
    assert propose(views, grow(street.added, 5)).confidence < MIN_CONFIDENCE


def test_confidence_is_the_geometric_mean_of_agreement_and_sharpness() -> None:
    """The photo has one edge: along column 20. Half of what is cut out is in the union."""
    photo = np.zeros((40, 40, 3), np.uint8)
    photo[:, 20:] = 100
    columns = np.indices((40, 40))[1]
    outline, drawn = columns >= 20, columns >= 30
    assert confidence_of(photo, drawn, outline, outline) == pytest.approx(1.0)
    assert confidence_of(photo, drawn, outline, drawn) == pytest.approx(0.5**0.5)
    assert confidence_of(photo, outline, drawn, drawn) == 0.0
    assert confidence_of(photo, outline, outline, outline) == 0.0
