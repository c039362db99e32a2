from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
import torch

from zeroscd.segmenters.decoder import decode, image_tokens

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.fixture(params=["sam", "sam2"])
def model(request: pytest.FixtureRequest) -> Any:
    build: Callable[[], Any] = request.getfixturevalue(f"build_{request.param}")
    return build()


def prompts_of(model: Any, points: torch.Tensor) -> torch.Tensor:
    labels = torch.ones(1, len(points), 1, dtype=torch.int)
    encoded: torch.Tensor = model.prompt_encoder(points[None, :, None], labels, None, None)[0][0]
    return encoded


@torch.inference_mode()
def test_masks_equal_those_of_transformers_decoder(model: Any) -> None:
    rng = torch.Generator().manual_seed(0)
    pixels = torch.randn(1, 3, 128, 128, generator=rng, dtype=torch.float64)
    points = torch.rand(9, 2, generator=rng, dtype=torch.float64) * 128
    embedding = model.get_image_embeddings(pixels)
    theirs = model(image_embeddings=embedding, input_points=points[None, :, None])
    logits, scores = decode(
        model.mask_decoder, image_tokens(model, embedding), prompts_of(model, points)
    )
    assert theirs.pred_masks.std() > 1
    assert theirs.iou_scores.std() > 0.1
    # Double precision, sums in another order; the logits are of size 30.
    torch.testing.assert_close(logits, theirs.pred_masks[0], rtol=0, atol=1e-10)
    torch.testing.assert_close(scores, theirs.iou_scores[0], rtol=0, atol=1e-12)


@torch.inference_mode()
def test_in_single_precision_the_difference_is_rounding(model: Any) -> None:
    model = model.float()
    rng = torch.Generator().manual_seed(0)
    pixels = torch.randn(1, 3, 128, 128, generator=rng)
    points = torch.rand(9, 2, generator=rng) * 128
    embedding = model.get_image_embeddings(pixels)
    theirs = model(image_embeddings=embedding, input_points=points[None, :, None]).pred_masks[0]
    ours, _ = decode(model.mask_decoder, image_tokens(model, embedding), prompts_of(model, points))
    assert (ours - theirs).abs().max() < 1e-4 * theirs.abs().max()
