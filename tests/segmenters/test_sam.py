from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
import torch

from zeroscd.errors import WeightsError
from zeroscd.models import SEGMENTERS
from zeroscd.segmenters import sam
from zeroscd.segmenters.sam_network import Network, Sam2Network, SamNetwork
from zeroscd.settings import SegmentSettings, Settings
from zeroscd.weights.catalogue import find
from zeroscd.weights.strict import load_strictly

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from torch import Tensor

pytest.importorskip("transformers", reason="needs zeroscd[models]")

NAMES = {"sam": "sam-vit-b", "mobile": "mobile-sam", "sam2": "sam2.1-tiny"}
KINDS = {kind: sam.FORMS[name] for kind, name in NAMES.items()}

# What the networks' names are called in published files, written independently of the rules under
# test: from the modules of the segment-anything, MobileSAM and sam2 repositories.
HEADS = [
    (r"(hypernetworks_mlps\.\d|iou_prediction_head|obj_score_head)\.layers\.0\.", r"\1.layers.1."),
    (r"(hypernetworks_mlps\.\d|iou_prediction_head|obj_score_head)\.proj_in\.", r"\1.layers.0."),
    (r"(hypernetworks_mlps\.\d|iou_prediction_head|obj_score_head)\.proj_out\.", r"\1.layers.2."),
]
BACK_BOTH = [
    *HEADS,
    (r"upscale_conv1", "output_upscaling.0"),
    (r"upscale_layer_norm", "output_upscaling.1"),
    (r"upscale_conv2", "output_upscaling.3"),
    (r"mask_embed\.conv1", "mask_downscaling.0"),
    (r"mask_embed\.layer_norm1", "mask_downscaling.1"),
    (r"mask_embed\.conv2", "mask_downscaling.3"),
    (r"mask_embed\.layer_norm2", "mask_downscaling.4"),
    (r"mask_embed\.conv3", "mask_downscaling.6"),
    (r"point_embed\.(\d)", r"point_embeddings.\1"),
    (r"shared_embedding\.positional_embedding", "pe_layer.positional_encoding_gaussian_matrix"),
]
BACK_SAM = [
    (r"^vision_encoder\.neck\.conv1", "image_encoder.neck.0"),
    (r"^vision_encoder\.neck\.layer_norm1", "image_encoder.neck.1"),
    (r"^vision_encoder\.neck\.conv2", "image_encoder.neck.2"),
    (r"^vision_encoder\.neck\.layer_norm2", "image_encoder.neck.3"),
    (r"^vision_encoder\.layers\.", "image_encoder.blocks."),
    (r"^vision_encoder\.", "image_encoder."),
    (r"patch_embed\.projection", "patch_embed.proj"),
]
BACK_SAM2 = [
    (r"^vision_encoder\.neck\.convs\.(\d)\.", r"image_encoder.neck.convs.\1.conv."),
    (r"^vision_encoder\.backbone\.", "image_encoder.trunk."),
    (r"patch_embed\.projection", "patch_embed.proj"),
    (r"^no_memory_embedding$", "no_mem_embed"),
    (r"\.mlp\.proj_in\.", ".mlp.layers.0."),
    (r"\.mlp\.proj_out\.", ".mlp.layers.1."),
    (r"\.o_proj\.", ".out_proj."),
    (r"^(prompt_encoder|mask_decoder)\.", r"sam_\1."),
]
BACK = {
    "sam": BACK_SAM,
    "mobile": [(r"^vision_encoder\.", "image_encoder.")],
    "sam2": BACK_SAM2,
}
LAST = [(r"layer_norm(\d|_final_attn)", r"norm\1")]


def published(model: Any, kind: str) -> dict[str, Tensor]:
    """Write a network's tensors as its publisher's file has them."""
    rules = [*BACK_BOTH, *BACK[kind], *LAST]
    file: dict[str, Tensor] = {}
    for name, tensor in model.state_dict().items():
        if name.startswith("shared_image_embedding."):
            continue  # the file has one matrix
        if name == "prompt_encoder.point_embed.weight":
            for index in range(4):
                file[f"sam_prompt_encoder.point_embeddings.{index}.weight"] = tensor[[index]]
            continue
        file[rewritten(name, rules)] = tensor
    if kind == "mobile":  # the classifier
        file |= {
            "image_encoder.norm_head.weight": torch.ones(16),
            "image_encoder.norm_head.bias": torch.ones(16),
            "image_encoder.head.weight": torch.ones(1000, 16),
            "image_encoder.head.bias": torch.ones(1000),
        }
    if kind == "sam2":  # parts that only video needs
        file |= {
            "maskmem_tpos_enc": torch.ones(7, 1, 1, 64),
            "no_mem_pos_enc": torch.ones(1, 1, 32),
            "no_obj_ptr": torch.ones(1, 32),
            "no_obj_embed_spatial": torch.ones(1, 64),
            "mask_downsample.weight": torch.ones(1, 1, 4, 4),
            "obj_ptr_proj.layers.0.weight": torch.ones(32, 32),
            "obj_ptr_tpos_proj.weight": torch.ones(64, 32),
            "memory_attention.layers.0.norm1.weight": torch.ones(32),
            "memory_encoder.out_proj.weight": torch.ones(64, 32),
        }
    return file


def rewritten(name: str, rules: list[tuple[str, str]]) -> str:
    for pattern, replacement in rules:
        name = re.sub(pattern, replacement, name)
    return name


# Names as they stand in sam_vit_b_01ec64.pth, mobile_sam.pt and sam2.1_hiera_tiny.pt.
KNOWN = {
    "sam": {
        "image_encoder.pos_embed",
        "image_encoder.patch_embed.proj.weight",
        "image_encoder.blocks.0.norm1.weight",
        "image_encoder.blocks.1.attn.rel_pos_h",
        "image_encoder.blocks.0.mlp.lin1.bias",
        "image_encoder.neck.3.weight",
        "prompt_encoder.pe_layer.positional_encoding_gaussian_matrix",
        "prompt_encoder.point_embeddings.3.weight",
        "prompt_encoder.mask_downscaling.6.bias",
        "prompt_encoder.not_a_point_embed.weight",
        "mask_decoder.transformer.layers.1.cross_attn_image_to_token.out_proj.weight",
        "mask_decoder.transformer.layers.0.norm4.weight",
        "mask_decoder.transformer.layers.0.mlp.lin2.weight",
        "mask_decoder.transformer.norm_final_attn.bias",
        "mask_decoder.output_upscaling.3.weight",
        "mask_decoder.output_hypernetworks_mlps.3.layers.2.weight",
        "mask_decoder.iou_prediction_head.layers.1.weight",
    },
    "mobile": {
        "image_encoder.patch_embed.seq.0.c.weight",
        "image_encoder.patch_embed.seq.2.bn.running_mean",
        "image_encoder.layers.0.blocks.0.conv3.bn.num_batches_tracked",
        "image_encoder.layers.0.downsample.conv2.c.weight",
        "image_encoder.layers.1.blocks.0.attn.attention_biases",
        "image_encoder.layers.2.blocks.0.attn.qkv.bias",
        "image_encoder.layers.3.blocks.0.local_conv.bn.running_var",
        "image_encoder.layers.3.blocks.0.mlp.fc2.weight",
        "image_encoder.neck.3.weight",
        "image_encoder.head.weight",
        "prompt_encoder.point_embeddings.3.weight",
        "mask_decoder.transformer.layers.0.norm4.weight",
        "mask_decoder.iou_prediction_head.layers.1.weight",
    },
    "sam2": {
        "image_encoder.trunk.pos_embed_window",
        "image_encoder.trunk.patch_embed.proj.weight",
        "image_encoder.trunk.blocks.1.proj.weight",
        "image_encoder.trunk.blocks.0.norm2.weight",
        "image_encoder.trunk.blocks.0.mlp.layers.1.weight",
        "image_encoder.neck.convs.3.conv.weight",
        "sam_prompt_encoder.point_embeddings.0.weight",
        "sam_mask_decoder.transformer.layers.0.self_attn.out_proj.weight",
        "sam_mask_decoder.transformer.layers.1.mlp.layers.0.weight",
        "sam_mask_decoder.conv_s0.weight",
        "sam_mask_decoder.obj_score_token.weight",
        "sam_mask_decoder.pred_obj_score_head.layers.2.weight",
        "sam_mask_decoder.iou_prediction_head.layers.0.weight",
        "no_mem_embed",
    },
}


@pytest.fixture(params=NAMES)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def model(kind: str, request: pytest.FixtureRequest) -> Any:
    return request.getfixturevalue(f"build_{kind}")()


def test_a_published_file_loads_every_number(
    kind: str, model: Any, request: pytest.FixtureRequest
) -> None:
    file = published(model, kind)
    assert KNOWN[kind] <= file.keys()
    expected = {name: tensor.clone() for name, tensor in model.state_dict().items()}
    other = request.getfixturevalue(f"build_{kind}")()
    with torch.no_grad():
        for tensor in other.state_dict().values():
            tensor.zero_()
    load_strictly(other, sam.converted(file, KINDS[kind], source="file"), source="file")
    found = other.state_dict()
    assert all(torch.equal(found[name], tensor) for name, tensor in expected.items())


def test_a_missing_and_a_renamed_tensor_are_named(kind: str, model: Any) -> None:
    file = published(model, kind)
    prefix = "sam_" if kind == "sam2" else ""
    del file[f"{prefix}mask_decoder.iou_token.weight"]
    file["extra"] = file.pop(f"{prefix}prompt_encoder.point_embeddings.2.weight")
    with pytest.raises(WeightsError) as caught:
        load_strictly(model, sam.converted(file, KINDS[kind], source="file"), source="file")
    message = str(caught.value)
    assert "mask_decoder.iou_token.weight" in message
    assert "prompt_encoder.point_embed" in message.split("left over", maxsplit=1)[0]
    assert "extra" in message.split("left over")[1]


def test_the_real_forms_have_the_published_sizes() -> None:
    with torch.device("meta"):
        millions = {
            name: sam.build(form).num_parameters() / 1e6 for name, form in sam.FORMS.items()
        }
    assert millions["sam-vit-b"] == pytest.approx(93.7, abs=0.1)
    assert millions["sam-vit-l"] == pytest.approx(312.3, abs=0.1)
    assert millions["sam-vit-h"] == pytest.approx(641.1, abs=0.1)
    # The publisher counts the video parts too: 38.9, 46, 80.8 and 224.4 million.
    for name, published_millions in (
        ("tiny", 38.9),
        ("small", 46),
        ("base", 80.8),
        ("large", 224.4),
    ):
        assert 5 < published_millions - millions[f"sam2.1-{name}"] < 13


def test_nothing_in_mobile_sams_file_has_no_place() -> None:
    with torch.device("meta"):
        state = sam.build(sam.FORMS["mobile-sam"]).state_dict()
    own = sum(
        tensor.numel() * tensor.element_size()
        for name, tensor in state.items()
        if not name.startswith("shared_image_embedding.")  # the file has one matrix
    )
    classifier = 4 * (1000 * 320 + 1000 + 2 * 320)
    size_bytes = find("mobile-sam").size_bytes
    assert size_bytes is not None
    # A zip's own headers take some hundred bytes for each of the file's 439 tensors.
    assert 0 < size_bytes - own - classifier < 500 * 439


def test_a_file_in_its_place_is_loaded_and_answers_as_the_network_that_wrote_it(
    kind: str,
    model: Any,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
    photo: np.ndarray,
    tmp_path: Path,
) -> None:
    name = NAMES[kind]
    file = tmp_path / "weights.pt"
    torch.save({"model": published(model.float(), kind)}, file)
    monkeypatch.setattr(sam, "require", lambda names: dict.fromkeys(names, file))
    monkeypatch.setattr(sam, "build", lambda _: request.getfixturevalue(f"bare_{kind}")())
    chosen = SegmentSettings(points_per_side=4, pred_iou_thresh=-9.0, stability_score_thresh=0.0)
    settings = Settings(segmenter=name, segment=chosen)
    loaded = sam.load(settings, "cpu").proposals(photo, ()).segments(None)
    written = sam.wrap(model, settings).proposals(photo, ()).segments(None)
    assert len(written) > 1
    assert [one.bits.tobytes() for one in loaded] == [one.bits.tobytes() for one in written]


def test_every_sam_in_the_registry_has_a_form() -> None:
    assert sam.FORMS.keys() == SEGMENTERS.keys() - {"lite"}


@pytest.mark.parametrize(
    ("name", "kind_of_network", "pred_iou_thresh"),
    [
        ("sam-vit-h", SamNetwork, 0.88),
        ("mobile-sam", SamNetwork, 0.88),
        ("sam2.1-base", Sam2Network, 0.8),
    ],
)
def test_a_segmenter_takes_grid_filters_and_precision_from_the_settings(
    name: str, kind_of_network: type, pred_iou_thresh: float
) -> None:
    settings = Settings(
        segmenter=name,
        precision="bf16",
        segment=SegmentSettings(points_per_side=5, crop_n_layers=2),
    )
    segmenter = sam.wrap(None, settings)
    assert segmenter.name == name
    assert isinstance(segmenter.network, kind_of_network)
    assert isinstance(segmenter.network, Network)
    assert segmenter.network.bf16
    assert segmenter.network.pred_iou_thresh == pred_iou_thresh
    assert (segmenter.settings.points_per_side, segmenter.settings.crop_n_layers) == (5, 2)
