from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest
import torch
from torch.nn import functional

from zeroscd.encoders.vit import VisionTransformer, VitShape
from zeroscd.weights.strict import load_strictly

if TYPE_CHECKING:
    from collections.abc import Callable

TINY = VitShape(dim=64, depth=3, heads=2)
THEIRS = {
    "hidden_size": 64,
    "num_hidden_layers": 3,
    "num_attention_heads": 2,
    "intermediate_size": 256,
    "image_size": 96,
    "layer_norm_eps": 1e-6,
}

# Single precision through three blocks; the numbers are of size 1.
assert_close = partial(torch.testing.assert_close, rtol=0.0, atol=1e-5)


@pytest.fixture(params=["ViT", "DeiT"])
def pair(
    request: pytest.FixtureRequest, randomise: Callable[..., Any], timm_layout: Callable[..., Any]
) -> tuple[VisionTransformer, Any]:
    """Our network and transformers' with the same numbers, with and without distillation."""
    transformers = pytest.importorskip("transformers", reason="needs zeroscd[models]")
    config = getattr(transformers, f"{request.param}Config")(**THEIRS)
    theirs = randomise(
        getattr(transformers, f"{request.param}Model")(config, add_pooling_layer=False)
    )
    shape = replace(TINY, grid_hw=(6, 6), distilled=request.param == "DeiT")
    ours = VisionTransformer(shape).eval()
    load_strictly(ours, timm_layout(theirs.state_dict()), source="reference")
    return ours, theirs


@pytest.mark.parametrize("size_hw", [(96, 96), (64, 160), (128, 112)])
@torch.inference_mode()
def test_tokens_equal_those_of_the_reference_on_any_grid(
    pair: tuple[VisionTransformer, Any], size_hw: tuple[int, int]
) -> None:
    ours, theirs = pair
    pixels = torch.randn(2, 3, *size_hw, generator=torch.Generator().manual_seed(0))
    prefix, patches = ours.tokens(pixels, layer=3)
    expected = theirs(pixels, interpolate_pos_encoding=True).last_hidden_state
    assert expected.std() > 0.5
    assert_close(torch.cat([prefix, patches.flatten(1, 2)], dim=1), expected)
    assert patches.shape[1:3] == (size_hw[0] // 16, size_hw[1] // 16)


@torch.inference_mode()
def test_earlier_layers_equal_the_hidden_states_before_the_norm(
    pair: tuple[VisionTransformer, Any],
) -> None:
    ours, theirs = pair
    pixels = torch.randn(1, 3, 96, 96, generator=torch.Generator().manual_seed(0))
    hidden = theirs(pixels, output_hidden_states=True).hidden_states
    for layer in (1, 2):
        prefix, patches = ours.tokens(pixels, layer=layer)
        found = torch.cat([prefix, patches.flatten(1, 2)], dim=1)
        assert_close(found, hidden[layer])


@torch.inference_mode()
def test_a_mirrored_embedding_stays_mirrored_on_another_grid(randomise: Callable[..., Any]) -> None:
    network = randomise(VisionTransformer(replace(TINY, grid_hw=(5, 8))))
    before = network.positions((7, 13))[0, 1:].reshape(7, 13, 64)
    mirrored = network.pos_embed[:, 1:].reshape(1, 5, 8, 64).flip(2).flatten(1, 2)
    network.pos_embed[:, 1:] = mirrored
    after = network.positions((7, 13))[0, 1:].reshape(7, 13, 64)
    torch.testing.assert_close(after, before.flip(1))


def test_the_trained_grid_keeps_its_positions_exactly() -> None:
    network = VisionTransformer(replace(TINY, grid_hw=(3, 4)))
    assert network.positions((3, 4)) is network.pos_embed


@torch.inference_mode()
def test_with_two_tokens_the_place_is_the_mean_of_both_heads(randomise: Callable[..., Any]) -> None:
    network = randomise(
        VisionTransformer(replace(TINY, grid_hw=(2, 2), distilled=True, head_dim=5))
    )
    pixels = torch.randn(2, 3, 32, 32, generator=torch.Generator().manual_seed(0))
    tokens, _ = network.tokens(pixels, layer=3)
    joint = (
        tokens[:, 0] @ network.head.weight.T
        + network.head.bias
        + tokens[:, 1] @ network.head_dist.weight.T
        + network.head_dist.bias
    )
    descriptor = network.global_descriptor(pixels)
    torch.testing.assert_close(descriptor, joint / joint.norm(dim=1, keepdim=True))


@torch.inference_mode()
def test_with_one_token_the_place_is_the_head_of_the_mean_patch(
    randomise: Callable[..., Any],
) -> None:
    network = randomise(VisionTransformer(replace(TINY, grid_hw=(2, 3), head_dim=5)))
    pixels = torch.randn(2, 3, 32, 48, generator=torch.Generator().manual_seed(0))
    _, patches = network.tokens(pixels, layer=3)
    mean = patches.reshape(2, 6, 64).sum(dim=1) / 6
    expected = functional.linear(mean, network.head.weight, network.head.bias)
    torch.testing.assert_close(
        network.global_descriptor(pixels), functional.normalize(expected, dim=1)
    )
