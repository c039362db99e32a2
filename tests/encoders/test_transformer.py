from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch
from torch.nn import functional

from zeroscd.encoders.taus import TAUS
from zeroscd.encoders.transformer import TransformerEncoder, checked_layer, to_pixels
from zeroscd.errors import SettingsError
from zeroscd.models import ENCODERS

if TYPE_CHECKING:
    from torch import Tensor


class MeanColour:
    """A network whose patch token is the mean normalised colour; remembers its batches."""

    def __init__(self) -> None:
        self.batches: list[tuple[int, ...]] = []

    def __call__(self, pixels: Tensor) -> Tensor:
        self.batches.append(tuple(pixels.shape))
        return functional.avg_pool2d(pixels, 16).permute(0, 2, 3, 1)


def encoder_of(network: MeanColour, *, side_px: int = 64) -> TransformerEncoder:
    return TransformerEncoder(name="toy", tau=0.5, patch_px=16, side_px=side_px, network=network)


def noise(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(height).integers(0, 256, (height, width, 3), dtype=np.uint8)


def test_two_photos_of_one_size_go_through_in_one_batch() -> None:
    network = MeanColour()
    photos = [noise(64, 64), noise(64, 64)[::-1].copy()]
    (first,), (second,) = encoder_of(network).encode(photos)
    assert network.batches == [(2, 3, 64, 64)]
    np.testing.assert_allclose(first.descriptors[::-1], second.descriptors, atol=1e-6)


def test_photos_of_other_sizes_go_through_apart_and_come_back_in_order() -> None:
    network = MeanColour()
    photos = [noise(64, 64), noise(32, 128), noise(64, 64)]
    maps = encoder_of(network).encode(photos)
    assert network.batches == [(2, 3, 64, 64), (1, 3, 32, 128)]
    assert [map_.descriptors.shape[:2] for (map_,) in maps] == [(4, 4), (2, 8), (4, 4)]
    np.testing.assert_array_equal(maps[0][0].descriptors, maps[2][0].descriptors)


def test_descriptors_have_unit_length_and_the_grid_covers_the_photo() -> None:
    ((found,),) = encoder_of(MeanColour()).encode([noise(100, 200)])
    np.testing.assert_allclose(np.linalg.norm(found.descriptors, axis=2), 1.0, atol=1e-6)
    rows, cols = found.descriptors.shape[:2]
    centres = found.grid.centres_xy().reshape(rows, cols, 2)
    np.testing.assert_allclose(centres[-1, -1] + centres[0, 0], [199, 99])


def test_a_patch_describes_its_own_place() -> None:
    photo = np.full((64, 64, 3), 128, dtype=np.uint8)
    photo[16:32, 48:64] = (255, 0, 0)
    ((found,),) = encoder_of(MeanColour()).encode([photo])
    plain = found.descriptors[0, 0]
    differs = np.linalg.norm(found.descriptors - plain, axis=2) > 1e-3
    assert np.argwhere(differs).tolist() == [[1, 3]]


def test_pixels_are_normalised_by_the_statistics_of_imagenet() -> None:
    photo = np.zeros((16, 16, 3), dtype=np.uint8)
    photo[:] = (255, 51, 0)  # 1, 0.2, 0
    pixels = to_pixels(photo, (16, 16))
    expected = [(1 - 0.485) / 0.229, (0.2 - 0.456) / 0.224, (0 - 0.406) / 0.225]
    np.testing.assert_allclose(pixels[:, 3, 5], expected, rtol=1e-6)


def test_bfloat16_moves_descriptors_only_a_little() -> None:
    layer = torch.nn.Conv2d(3, 8, 16, stride=16)

    def network(pixels: Tensor) -> Tensor:
        tokens: Tensor = layer(pixels)
        return tokens.permute(0, 2, 3, 1)

    kinds = [
        TransformerEncoder(name="t", tau=0.5, patch_px=16, side_px=64, network=network, bf16=bf16)
        for bf16 in (False, True)
    ]
    (fp32,), (bf16,) = (kind.encode([noise(64, 64)])[0] for kind in kinds)
    distance = np.linalg.norm(fp32.descriptors - bf16.descriptors, axis=2).max()
    assert 0 < distance < 0.05  # eight bits of mantissa; tau is 0.65


def test_a_network_without_a_head_describes_no_place() -> None:
    assert encoder_of(MeanColour()).places([noise(64, 64)]) is None


@pytest.mark.parametrize("layer", [0, 13, -1])
def test_a_layer_that_is_not_there_is_refused(layer: int) -> None:
    with pytest.raises(SettingsError, match="layers 1 to 12"):
        checked_layer(layer, depth=12)


def test_every_transformer_encoder_has_a_threshold_with_a_source() -> None:
    assert TAUS.keys() == ENCODERS.keys() - {"lite"}
    assert all(0 < tau.value < 2 and tau.source for tau in TAUS.values())
