"""A detector without networks that finds what is painted on the wall."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.watch.toy import WallSegmenter, wall

from zeroscd.detector import Detector
from zeroscd.given import Given
from zeroscd.models import Models
from zeroscd.watch import Place

if TYPE_CHECKING:
    from zeroscd.settings import Settings


@pytest.fixture(scope="session")
def toy_watch_detector(toy_encoder: object, plain_settings: Settings) -> Detector:
    """Finds what is painted on the wall, to the tile."""
    models = Models(encoder=toy_encoder, segmenter=WallSegmenter())  # type: ignore[arg-type]
    return Detector(plain_settings, models)


@pytest.fixture
def place(toy_watch_detector: Detector) -> Place:
    """The wall; the camera does not move."""
    return Place(toy_watch_detector, [wall()], Given(t1_from_t0="none"))
