"""Tiny SAM and SAM 2 with random numbers of sensible size, in double precision.

Double precision: ours computes in batches, the reference point by point, and a mask is a threshold
on sums of another order. In single precision one pixel in a million would flip.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch

from zeroscd.segmenters.sam_network import Sam2Network, SamNetwork
from zeroscd.segmenters.tiny_vit import Stage, TinyVit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from zeroscd.segmenters.port import MaskProposals

SIDE_PX = 128


@pytest.fixture(scope="session")
def bare_sam() -> Callable[[], Any]:
    """Make transformers' SAM, tiny, as it comes."""
    transformers = pytest.importorskip("transformers", reason="needs zeroscd[models]")

    def build() -> Any:
        config = transformers.SamConfig(
            vision_config={
                "hidden_size": 32,
                "num_hidden_layers": 2,
                "num_attention_heads": 2,
                "output_channels": 32,
                "image_size": SIDE_PX,
                "window_size": 3,
                "global_attn_indexes": [1],
                "num_pos_feats": 16,
            },
            prompt_encoder_config={"hidden_size": 32, "image_size": SIDE_PX},
            mask_decoder_config=_decoder(),
        )
        return transformers.SamModel(config).eval()

    return build


@pytest.fixture(scope="session")
def build_sam(bare_sam: Callable[[], Any]) -> Callable[[], Any]:
    """Make transformers' SAM, tiny, with numbers that prove something."""
    return lambda: _local(_randomised(bare_sam()), shift=3.3)


@pytest.fixture(scope="session")
def bare_mobile(bare_sam: Callable[[], Any]) -> Callable[[], Any]:
    """Make SAM with MobileSAM's encoder, tiny, as it comes."""
    stages = (
        Stage(dim=8, blocks=1),
        Stage(dim=8, blocks=1, heads=2, window=3),
        Stage(dim=12, blocks=1, heads=3, window=4, downsample_stride=1),
        Stage(dim=16, blocks=1, heads=2, window=3),
    )

    def build() -> Any:
        model = bare_sam()
        model.vision_encoder = TinyVit(stages, out_channels=32)
        return model.eval()

    return build


@pytest.fixture(scope="session")
def build_mobile(bare_mobile: Callable[[], Any]) -> Callable[[], Any]:
    """Make tiny MobileSAM with numbers that prove something."""
    return lambda: _local(_randomised(bare_mobile()), shift=3.3)


@pytest.fixture(scope="session")
def bare_sam2() -> Callable[[], Any]:
    """Make transformers' SAM 2, tiny, as it comes."""
    transformers = pytest.importorskip("transformers", reason="needs zeroscd[models]")

    def build() -> Any:
        trunk = {
            "hidden_size": 8,
            "image_size": [SIDE_PX, SIDE_PX],
            "embed_dim_per_stage": [8, 16, 32, 64],
            "num_attention_heads_per_stage": [1, 1, 2, 2],
            "blocks_per_stage": [1, 1, 2, 1],
            "window_size_per_stage": [8, 4, 4, 2],
            "global_attention_blocks": [3],
        }
        config = transformers.Sam2Config(
            vision_config={
                "backbone_config": transformers.Sam2HieraDetConfig(**trunk),
                "backbone_channel_list": [64, 32, 16, 8],
                "backbone_feature_sizes": [[32, 32], [16, 16], [8, 8]],
                "fpn_hidden_size": 32,
            },
            prompt_encoder_config={"hidden_size": 32, "image_size": SIDE_PX},
            mask_decoder_config=_decoder(),
        )
        return transformers.Sam2Model(config).eval()

    return build


@pytest.fixture(scope="session")
def build_sam2(bare_sam2: Callable[[], Any]) -> Callable[[], Any]:
    """Make transformers' SAM 2, tiny, with numbers that prove something."""
    return lambda: _local(_randomised(bare_sam2()), shift=-6.7)


def _decoder() -> dict[str, Any]:
    return {"hidden_size": 32, "mlp_dim": 64, "num_attention_heads": 2, "iou_head_hidden_dim": 32}


@pytest.fixture(scope="session")
def randomise() -> Callable[[Any], Any]:
    """Give every tensor of a network its own numbers."""
    return _randomised


def _randomised(model: Any) -> Any:
    """Give every tensor its own numbers; a fresh SAM's embeddings are near 1e-19: no proof."""
    rng = torch.Generator().manual_seed(3)
    with torch.no_grad():
        for name, tensor in model.state_dict().items():
            noise = torch.randn(tensor.shape, generator=rng)
            if name.endswith("running_var"):
                tensor.copy_(noise.abs() + 0.5)
            elif tensor.ndim == 1:  # of normalisations, and biases
                tensor.copy_(noise * 0.1 + name.endswith("weight"))
            elif tensor.ndim == 4 or name.endswith("weight"):
                tensor.copy_(noise * (1.5 / tensor[0].numel() ** 0.5))
            else:
                tensor.copy_(noise * 0.5)
        if hasattr(model, "shared_image_embedding"):
            shared = model.shared_image_embedding.positional_embedding
            model.prompt_encoder.shared_embedding.positional_embedding.copy_(shared)
    return model.double().eval()


@torch.no_grad()
def _local(model: Any, *, shift: float) -> Any:
    """Make the masks differ in place and size; wholly random ones all fill the photo.

    Both upscalings treat the pixels of a cell alike (smooth masks), the last layer of the mask
    heads is steep (stable masks), and one constant channel shifts all logits (small masks).
    """
    decoder = model.mask_decoder
    for layer in (decoder.upscale_conv1, decoder.upscale_conv2):
        layer.weight.copy_(layer.weight[:, :, :1, :1].expand_as(layer.weight))
    decoder.upscale_conv2.weight[:, 0] = 0
    decoder.upscale_conv2.bias[0] = 3
    for head in decoder.output_hypernetworks_mlps:
        head.proj_out.weight *= 30
        head.proj_out.weight[0] = 0
        head.proj_out.bias[0] = shift
    for layer in decoder.transformer.layers:
        attention = layer.cross_attn_image_to_token
        attention.k_proj.weight.copy_(attention.q_proj.weight)
        attention.k_proj.bias.copy_(attention.q_proj.bias.zero_())
    if hasattr(decoder, "conv_s0"):
        decoder.conv_s0.weight *= 0.3
        decoder.conv_s1.weight *= 0.3
        decoder.conv_s0.weight[0] = 0
        decoder.conv_s0.bias[0] = 0
    return model


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Tiny networks lose more to waiting threads than they win."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture
def segments_in_two_threads() -> Callable[[MaskProposals], tuple[int, int]]:
    """Let two threads request all segments at the same time; return how many each got."""

    def request(proposals: MaskProposals) -> tuple[int, int]:
        both = Barrier(2)

        def one(_: int) -> int:
            both.wait()
            return len(proposals.segments(None))

        with ThreadPoolExecutor(2) as threads:
            first, second = threads.map(one, range(2))
        return first, second

    return request


@pytest.fixture(params=["sam", "sam2"])
def network(request: pytest.FixtureRequest) -> SamNetwork | Sam2Network:
    """Both generations in turn."""
    model = request.getfixturevalue(f"build_{request.param}")()
    return SamNetwork(model=model) if request.param == "sam" else Sam2Network(model=model)


@pytest.fixture
def photo() -> np.ndarray:
    """Smooth blobs of colour, wider than high."""
    rng = np.random.default_rng(5)
    rows, cols = np.indices((239, 320)) / 50
    waves = [
        np.sin(rows * a + b) * np.cos(cols * c + d) for a, b, c, d in rng.uniform(0, 3, (3, 4))
    ]
    return (127 + 120 * np.stack(waves, axis=2)).astype(np.uint8)
