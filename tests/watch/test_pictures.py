"""The pictures of a change show its place before and then."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image
from tests.watch.toy import SIZE_HW, wall

from zeroscd.export.pictures import jpeg
from zeroscd.watch.frames import FrameInfo
from zeroscd.watch.pictures import FirstSight, picture_files, window


def read(content: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(content))).astype(int)


def test_both_crops_show_the_place_in_pixels_of_the_reference() -> None:
    reference, frame = wall(), wall()
    frame[100:140, 210:250] = 250  # seen ten pixels to the right
    first = FirstSight(
        frame=FrameInfo(number=0),
        reference_from_frame=np.array([[1.0, 0, -10], [0, 1, 0], [0, 0, 1]]),
        photo_jpeg=jpeg(frame, quality=95),
    )
    files = picture_files(reference, first, (200, 100, 40, 40))
    assert set(files) == {"frame.jpg", "before.jpg", "after.jpg"}
    assert read(files["frame.jpg"]).shape == (*SIZE_HW, 3)
    before, after = read(files["before.jpg"]), read(files["after.jpg"])
    assert before.shape == after.shape == (64, 64, 3)
    assert np.abs(before - reference[88:152, 188:252].astype(int)).mean() < 3
    assert after[14:50, 14:50].min() > 240
    assert after[:9].max() < 130


def test_a_window_ends_with_the_photo() -> None:
    assert window((360, 240, 24, 16), size_hw=SIZE_HW) == (353, 233, 31, 23)


def test_without_a_kept_frame_there_are_no_pictures() -> None:
    first = FirstSight(frame=FrameInfo(number=0), reference_from_frame=np.eye(3))
    assert picture_files(wall(), first, (0, 0, 9, 9)) == {}
