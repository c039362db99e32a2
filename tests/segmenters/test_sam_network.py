from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch
from PIL import Image

from zeroscd.segmenters.sam_network import SamNetwork, resized_size, sam2_pixels, sam_pixels

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import TypeAlias

    from torch import Tensor

    from zeroscd.segmenters.sam_network import Sam2Network

    Sams: TypeAlias = SamNetwork | Sam2Network


@pytest.mark.parametrize("size_hw", [(90, 120), (120, 90), (33, 200), (128, 128), (511, 300)])
def test_sams_pixels_equal_those_of_transformers_processor(size_hw: tuple[int, int]) -> None:
    transformers = pytest.importorskip("transformers", reason="needs zeroscd[models]")
    processor = transformers.SamImageProcessorPil(
        size={"longest_edge": 128}, pad_size={"height": 128, "width": 128}
    )
    photo = np.random.default_rng(0).integers(0, 256, (*size_hw, 3), dtype=np.uint8)
    expected = processor(photo, return_tensors="pt")["pixel_values"][0]
    torch.testing.assert_close(sam_pixels(photo, 128), expected, rtol=0, atol=1e-5)


@pytest.mark.parametrize("size_hw", [(90, 120), (300, 200)])
def test_sam2s_pixels_equal_an_antialiased_resize_by_pillow(size_hw: tuple[int, int]) -> None:
    photo = np.random.default_rng(0).integers(0, 256, (*size_hw, 3), dtype=np.uint8)
    planes = [
        np.asarray(
            Image.fromarray(photo[..., channel].astype(np.float32)).resize(
                (128, 128), Image.Resampling.BILINEAR
            )
        )
        for channel in range(3)
    ]
    mean, std = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
    expected = (np.stack(planes, axis=2) / 255 - mean) / std
    found = sam2_pixels(photo, 128).permute(1, 2, 0).numpy()
    np.testing.assert_allclose(found, expected, atol=2e-3)  # Pillow rounds its weights


def test_an_embedding_tells_its_memory(network: Sams, photo: np.ndarray) -> None:
    embedding = network.embed(photo)
    held = {one.untyped_storage().data_ptr(): one for one in tensors_in(embedding)}
    assert (
        embedding.size_bytes
        == sum(one.untyped_storage().nbytes() for one in held.values())
        > 10_000
    )


def tensors_in(thing: object) -> Iterator[Tensor]:
    if isinstance(thing, torch.Tensor):
        yield thing
    parts = [getattr(thing, one.name) for one in fields(thing)] if is_dataclass(thing) else thing
    if isinstance(parts, list | tuple):
        for part in parts:
            yield from tensors_in(part)


def test_the_longer_side_fills_the_square() -> None:
    assert resized_size((480, 640), 1024) == (768, 1024)
    assert resized_size((640, 481), 1024) == (1024, 770)  # 769.6


def test_masks_come_three_to_a_point_in_the_order_of_the_points(
    network: Sams,
) -> None:
    photo = np.random.default_rng(0).integers(0, 256, (90, 120, 3), dtype=np.uint8)
    embedding = network.embed(photo)
    points = np.array([[10.0, 20.0], [100.0, 70.0]])
    logits, scores = network.predict(embedding, points)
    assert logits.shape[0] == scores.shape[0] == 6
    alone, its_scores = network.predict(embedding, points[1:])
    torch.testing.assert_close(logits[3:], alone)
    torch.testing.assert_close(scores[3:], its_scores)


def test_upscaled_logits_keep_their_positions(network: Sams) -> None:
    photo = np.zeros((90, 120, 3), dtype=np.uint8)
    embedding = network.embed(photo)
    side = 32  # of the low-resolution maps of this tiny network: 128 / 4
    columns = (torch.arange(side) + 0.5) / side  # of the square, 0..1
    ramp = columns.expand(1, side, side).double()
    wide = network.upscale_masks(embedding, ramp)[0]
    tall = network.upscale_masks(embedding, ramp.transpose(1, 2))[0]
    assert wide.shape == (90, 120)
    inner = slice(8, -8)  # at the edges interpolation repeats the last value
    resized_rows = 96 / 128 if isinstance(network, SamNetwork) else 1.0
    expected_x = (torch.arange(120) + 0.5) / 120
    expected_y = (torch.arange(90) + 0.5) / 90 * resized_rows
    torch.testing.assert_close(wide[40, inner], expected_x[inner].double(), atol=1e-3, rtol=0)
    torch.testing.assert_close(tall[inner, 40], expected_y[inner].double(), atol=2e-3, rtol=0)


def test_bfloat16_gives_nearly_the_same_masks(network: Sams) -> None:
    photo = np.random.default_rng(0).integers(0, 256, (90, 120, 3), dtype=np.uint8)
    points = np.random.default_rng(1).uniform(10, 80, (12, 2))
    model = network.model.float()
    masks = []
    for bf16 in (False, True):
        chosen = replace(network, model=model, bf16=bf16)
        embedding = chosen.embed(photo)
        logits, _ = chosen.predict(embedding, points)
        assert logits.dtype == torch.float32
        masks.append(chosen.upscale_masks(embedding, logits) > 0)
    both, either = (masks[0] & masks[1]).sum(), (masks[0] | masks[1]).sum()
    assert both < either  # it did compute in another precision
    assert both / either > 0.9
