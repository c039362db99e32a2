from __future__ import annotations

import cv2
import numpy as np
import pytest

from zeroscd.export.colormap import apply_colormap, css_gradient, scale_end


@pytest.mark.parametrize(("largest", "end"), [(0.0, 0.5), (0.3, 0.5), (1.25, 1.25)])
def test_the_scale_ends_at_the_largest_distance_but_not_below_a_half(
    largest: float, end: float
) -> None:
    assert scale_end(np.array([[0.0, largest]], np.float32)) == end


def test_distances_run_through_the_palette_and_unseen_is_grey() -> None:
    heatmap = np.array([[0.0, 0.5, 1.0, 0.7]], np.float32)
    unseen = np.array([[False, False, False, True]])
    found = apply_colormap(heatmap, unseen=unseen, end=1.0)
    levels = np.array([[0, 128, 255]], np.uint8)
    assert np.array_equal(found[:, :3], cv2.applyColorMap(levels, cv2.COLORMAP_INFERNO)[..., ::-1])
    assert found[0, 3].tolist() == [128, 128, 128]


def test_brightness_grows_with_the_distance() -> None:
    ramp = np.linspace(0, 1, 9, dtype=np.float32)[None]
    light = apply_colormap(ramp, unseen=np.zeros((1, 9), bool), end=1.0).sum(axis=2)[0]
    assert (np.diff(light.astype(int)) > 0).all()


def test_the_scale_on_the_page_starts_and_ends_like_the_map() -> None:
    ends = np.array([[0.0, 1.0]], np.float32)
    low, high = apply_colormap(ends, unseen=np.zeros((1, 2), bool), end=1.0)[0].tolist()
    gradient = css_gradient()
    assert gradient.startswith(f"linear-gradient(to right, rgb({low[0]},{low[1]},{low[2]})")
    assert gradient.endswith(f"rgb({high[0]},{high[1]},{high[2]}))")
