"""SAM 2.1 as an encoder: a tiny network with random numbers, in double precision."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch
from torch.nn import functional

from zeroscd.encoders import sam
from zeroscd.errors import SettingsError
from zeroscd.evidence import encoded_photo
from zeroscd.image_embedding import SharedFeatureMap
from zeroscd.images.photo import Photo
from zeroscd.segmenters.automatic import AutomaticSegmenter
from zeroscd.segmenters.sam import FORMS, build
from zeroscd.segmenters.sam_network import Sam2Network, SamImageEmbedding
from zeroscd.settings import SegmentSettings, Settings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zeroscd.arrays import Rgb
    from zeroscd.records import FeatureMap

transformers = pytest.importorskip("transformers", reason="needs zeroscd[models]")

NAME, SIDE_PX = "sam2.1-base", 128
GLOBAL, WINDOWED = 4, 5  # the blocks with patches of 16 pixels
TRUNK = {
    "hidden_size": 8,
    "image_size": [SIDE_PX, SIDE_PX],
    "embed_dim_per_stage": [8, 16, 32, 64],
    "num_attention_heads_per_stage": [1, 1, 2, 2],
    "blocks_per_stage": [1, 1, 2, 1],
    "window_size_per_stage": [8, 4, 4, 2],
    "global_attention_blocks": [GLOBAL - 1],
}


@pytest.fixture(scope="module")
def model() -> Any:
    return tiny_sam2()


def tiny_sam2() -> Any:
    """SAM 2 with numbers of sensible size in every tensor."""
    config = transformers.Sam2Config(
        vision_config={
            "backbone_config": transformers.Sam2HieraDetConfig(**TRUNK),
            "backbone_channel_list": [64, 32, 16, 8],
            "backbone_feature_sizes": [[32, 32], [16, 16], [8, 8]],
            "fpn_hidden_size": 32,
        },
        prompt_encoder_config={"hidden_size": 32, "image_size": SIDE_PX},
        mask_decoder_config={
            "hidden_size": 32,
            "mlp_dim": 64,
            "num_attention_heads": 2,
            "iou_head_hidden_dim": 32,
        },
    )
    tiny = transformers.Sam2Model(config).eval()
    rng = torch.Generator().manual_seed(3)
    with torch.no_grad():
        for name, tensor in tiny.state_dict().items():
            noise = torch.randn(tensor.shape, generator=rng)
            if tensor.ndim == 1:
                tensor.copy_(noise * 0.1 + name.endswith("weight"))
            else:
                tensor.copy_(noise * (1.5 / tensor[0].numel() ** 0.5))
    return tiny.double()


@pytest.fixture
def network(model: Any) -> Sam2Network:
    return Sam2Network(model=model)


def settings(layer: int = GLOBAL) -> Settings:
    return Settings(encoder=NAME, segmenter=NAME, layer=layer)


def noise(height: int, width: int) -> Rgb:
    return np.random.default_rng(height).integers(0, 256, (height, width, 3), dtype=np.uint8)


def descriptors_of(encoder: sam.SamEncoder, photo: Rgb) -> NDArray[np.float32]:
    ((found,),) = encoder.encode([photo])
    return np.asarray(found.descriptors)


def tokens_of(found: FeatureMap) -> torch.Tensor:
    assert isinstance(found, SharedFeatureMap)
    assert isinstance(found.embedding, SamImageEmbedding)
    return found.embedding.tokens.tokens


@pytest.mark.parametrize("layer", [GLOBAL, WINDOWED])
@torch.inference_mode()
def test_descriptors_are_the_keys_that_transformers_attends_with(
    model: Any, network: Sam2Network, layer: int
) -> None:
    photo = noise(SIDE_PX, SIDE_PX)
    attention = model.vision_encoder.backbone.blocks[layer - 1].attn
    seen: list[torch.Tensor] = []
    hook = attention.qkv.register_forward_hook(lambda _, __, output: seen.append(output))
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    pixels = ((torch.from_numpy(photo) / 255 - mean) / std).permute(2, 0, 1)[None]
    model.get_image_features(pixels.double())
    hook.remove()
    keys = torch.unflatten(seen[0], 3, (3, 2, -1))[:, :, :, 1]  # of queries, keys and values
    if layer == WINDOWED:  # four windows of 4 x 4, row by row
        keys = keys.reshape(2, 2, 4, 4, 2, -1).transpose(1, 2).reshape(1, 8, 8, 2, -1)
    centred = keys[0] - keys[0].mean(dim=(0, 1))
    expected = functional.normalize(centred, dim=3).flatten(2) / 2**0.5
    found = descriptors_of(sam.wrap(network, settings(layer)), photo)
    assert expected.std() > 0.05
    np.testing.assert_allclose(found, expected, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found, axis=2), 1, atol=1e-6)


def test_likeness_is_the_mean_of_the_heads_cosines(network: Sam2Network) -> None:
    found = descriptors_of(sam.wrap(network, settings()), noise(SIDE_PX, SIDE_PX))
    heads = found.reshape(8, 8, 2, -1)
    cosines = [
        float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b))
        for a, b in zip(heads[1, 2], heads[6, 5], strict=True)
    ]
    assert float(found[1, 2] @ found[6, 5]) == pytest.approx(np.mean(cosines), abs=1e-6)


def test_what_all_keys_share_moves_neither_descriptors_nor_the_embedding(
    model: Any, network: Sam2Network
) -> None:
    photo, encoder = noise(90, 120), sam.wrap(network, settings())
    ((before,),) = encoder.encode([photo])
    attention = model.vision_encoder.backbone.blocks[GLOBAL - 1].attn
    bias, width = attention.qkv.bias, attention.dim_out
    kept = bias.detach().clone()
    with torch.no_grad():
        bias[width : 2 * width] += torch.linspace(-3, 3, width)
    ((after,),) = encoder.encode([photo])
    with torch.no_grad():
        bias.copy_(kept)
    np.testing.assert_allclose(after.descriptors, before.descriptors, atol=1e-6)
    was, now = tokens_of(before), tokens_of(after)
    torch.testing.assert_close(now, was)
    assert was.std() > 0.05


def test_unrelated_patches_are_about_as_far_apart_as_a_fitted_threshold_expects(
    network: Sam2Network,
) -> None:
    flat = descriptors_of(sam.wrap(network, settings()), noise(SIDE_PX, SIDE_PX)).reshape(64, -1)
    apart = np.linalg.norm(flat[:, None] - flat[None], axis=2)[np.triu_indices(64, 1)]
    assert apart.mean() == pytest.approx(2**0.5, abs=0.05)


@pytest.fixture
def local_network(model: Any) -> Any:
    """Nothing goes from patch to patch, and the pixels of a patch all count alike."""
    kept = {name: tensor.clone() for name, tensor in model.state_dict().items()}
    trunk = model.vision_encoder.backbone
    with torch.no_grad():
        for block in trunk.blocks:
            for layer in (block.attn.proj, block.mlp.proj_out):
                layer.weight.zero_()
        kernel = trunk.patch_embed.projection.weight
        kernel.copy_(kernel.mean(dim=(2, 3), keepdim=True).expand_as(kernel))
    yield Sam2Network(model=model)
    model.load_state_dict(kept)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_patch_is_centred_on_the_pixels_that_reach_it(
    local_network: Sam2Network, axis: int
) -> None:
    """The photo is half as wide as the square: rows keep their size, columns are stretched."""
    encoder = sam.wrap(local_network, settings())
    plain = np.full((SIDE_PX, SIDE_PX // 2, 3), 90, dtype=np.uint8)
    ((dark,),) = encoder.encode([plain])
    at = (3, 4)
    centre_xy = dark.grid.to_pixels(np.array([at[::-1]], dtype=np.float64))[0]
    centre = centre_xy[1 - axis]
    reach = []
    for position in range(round(centre) - 16, round(centre) + 17):
        lit = plain.copy()
        lit[(position, round(centre_xy[0])) if axis == 0 else (round(centre_xy[1]), position)] = 255
        moved = np.linalg.norm(descriptors_of(encoder, lit) - dark.descriptors, axis=2)
        if moved[at] > 4 * np.median(moved):  # all others move a little: they share a mean
            reach.append(position)
    assert reach == list(range(reach[0], reach[-1] + 1))
    # Whole pixels of the photo; of the stretched columns they are two pixels of the square wide.
    assert np.mean(reach) == pytest.approx(centre, abs=0.01 if axis == 0 else 0.5)
    # 16 pixels of the square, and 3 more from the kernel's width.
    assert len(reach) == 19 if axis == 0 else len(reach) in (10, 11)


@pytest.mark.parametrize("size_hw", [(96, 200), (200, 96)])
def test_the_grid_covers_photos_of_any_shape(
    network: Sam2Network, size_hw: tuple[int, int]
) -> None:
    ((found,),) = sam.wrap(network, settings()).encode([noise(*size_hw)])
    assert found.grid.size_hw == found.descriptors.shape[:2] == (8, 8)
    assert found.grid.stride_xy == (size_hw[1] / 8, size_hw[0] / 8)
    # Cell 0 is centred on pixel 6 of the square's 128: 6.5 of 128 pixels from the edge.
    expected = [6.5 / 128 * side - 0.5 for side in size_hw[::-1]]
    assert found.grid.origin_xy == pytest.approx(expected)


@dataclass
class Counting:
    """A network that counts how often it encodes."""

    inner: Sam2Network
    photos: list[tuple[int, ...]] = field(default_factory=list)

    def embed(self, photo: Rgb) -> SamImageEmbedding:
        self.photos.append(photo.shape)
        return self.inner.embed(photo)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)


SCARCE = SegmentSettings(
    points_per_side=2, pred_iou_thresh=0.0, stability_score_thresh=0.0, box_nms_thresh=1.0
)


def segmenter_around(network: Any, name: str = NAME) -> AutomaticSegmenter:
    return AutomaticSegmenter(name=name, network=network, settings=SCARCE)


def test_a_segmenter_around_the_same_network_encodes_nothing_again(network: Sam2Network) -> None:
    counting, photo = Counting(network), noise(90, 120)
    ((found,),) = sam.wrap(counting, settings()).encode([photo])
    encoded = encoded_photo(Photo(pixels=photo), (found,), segmenter_around(counting))
    segments = encoded.proposals.segments(None)
    assert counting.photos == [photo.shape]
    alone = segmenter_around(network).proposals(photo, ()).segments(None)
    assert [one.bits.tobytes() for one in segments] == [one.bits.tobytes() for one in alone]
    assert len({one.bits.tobytes() for one in segments}) > 2


def test_a_segmenter_around_another_network_encodes_for_itself(network: Sam2Network) -> None:
    counting, photo = Counting(network), noise(90, 120)
    ((found,),) = sam.wrap(network, settings()).encode([photo])
    other = segmenter_around(counting, "sam2.1-tiny")
    encoded = encoded_photo(Photo(pixels=photo), (found,), other)
    assert encoded.proposals.size_bytes == 0
    encoded.proposals.segments(None)
    assert counting.photos == [photo.shape]


def test_the_memory_of_an_embedding_counts_once(network: Sam2Network) -> None:
    photo = noise(90, 120)
    ((found,),) = sam.wrap(network, settings()).encode([photo])
    encoded = encoded_photo(Photo(pixels=photo), (found,), segmenter_around(network))
    assert isinstance(found, SharedFeatureMap)
    assert not isinstance(encoded.maps[0], SharedFeatureMap)
    expected = photo.nbytes + found.descriptors.nbytes + found.embedding.size_bytes
    assert encoded.size_bytes == expected


def test_of_a_large_photo_descriptors_and_segments_are_in_pixels_of_its_working_size(
    network: Sam2Network,
) -> None:
    photo = noise(1500, 3000)
    ((found,),) = sam.wrap(network, settings()).encode([photo])
    encoded = encoded_photo(Photo(pixels=photo), (found,), segmenter_around(network))
    assert encoded.size_hw != photo.shape[:2]
    stride_xy = [side / 8 for side in encoded.size_hw[::-1]]
    assert encoded.maps[0].grid.stride_xy == pytest.approx(stride_xy)
    handed: Any = encoded.proposals
    own = network.embed(encoded.working.pixels)  # as without an encoder of the same network
    assert handed.embedding.photo_hw == own.photo_hw == encoded.size_hw
    torch.testing.assert_close(handed.embedding.tokens.tokens, own.tokens.tokens)
    assert handed.segments(None).size_hw == encoded.size_hw


def test_bfloat16_moves_descriptors_only_a_little() -> None:
    photo, single = noise(90, 120), tiny_sam2().float()
    fp32, bf16 = (
        descriptors_of(sam.wrap(Sam2Network(model=single, bf16=bf16), settings()), photo)
        for bf16 in (False, True)
    )
    distance = np.linalg.norm(fp32 - bf16, axis=2)
    assert 0 < distance.mean() < 0.05  # eight bits of mantissa; unrelated ones are 1.4 apart


def test_threads_hear_their_own_photos(network: Sam2Network) -> None:
    encoder, photos = sam.wrap(network, settings()), [noise(90 + one, 120) for one in range(8)]
    expected = [descriptors_of(encoder, photo) for photo in photos]
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda photo: descriptors_of(encoder, photo), photos))
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)


@pytest.mark.parametrize("layer", [1, 3, 6])
def test_a_layer_with_finer_patches_or_none_is_refused(network: Sam2Network, layer: int) -> None:
    with pytest.raises(SettingsError, match=f"layer cannot be {layer}: .* layers 4 to 5"):
        sam.wrap(network, settings(layer))


def test_the_layer_is_gescfs_share_of_the_depth_in_every_size() -> None:
    layers = {}
    for name in ("sam2.1-tiny", "sam2.1-small", "sam2.1-base", "sam2.1-large"):
        with torch.device("meta"):
            network = Sam2Network(model=build(FORMS[name]))
        wrapped = sam.wrap(network, Settings(encoder=name))
        layers[name] = wrapped.layer, wrapped.tap.block.attn.dim_out
    assert layers == {
        "sam2.1-tiny": (6, 384),
        "sam2.1-small": (8, 384),
        "sam2.1-base": (13, 448),
        "sam2.1-large": (26, 576),
    }
