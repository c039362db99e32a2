"""SAM ViT-B, -L and -H, MobileSAM, and SAM 2.1 tiny to large, from the files as published."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import torch

from zeroscd.segmenters.automatic import AutomaticSegmenter
from zeroscd.segmenters.sam_network import Sam2Network, SamNetwork
from zeroscd.segmenters.tiny_vit import TinyVit
from zeroscd.weights.backend import import_transformers
from zeroscd.weights.rename import renamed
from zeroscd.weights.safe import read_tensors
from zeroscd.weights.store import require
from zeroscd.weights.strict import load_strictly

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from torch import Tensor, nn

    from zeroscd.settings import Settings
    from zeroscd.weights.rename import Rules

# From published names to those of transformers' networks; each rule applies to the last's result.
_HEADS: Rules = tuple(
    (rf"({head})\.layers\.{old}\.", rf"\1.{new}.")
    # In this order: what was layers.1 becomes layers.0 only when the old layers.0 is gone.
    for old, new in ((0, "proj_in"), (2, "proj_out"), (1, "layers.0"))
    for head in ("iou_prediction_head", r"output_hypernetworks_mlps\.\d", "pred_obj_score_head")
)
_PROMPTS_AND_DECODER: Rules = (
    (r"^prompt_encoder\.pe_layer\.positional_encoding_gaussian_matrix$", "positions"),
    (r"^prompt_encoder\.point_embeddings\.", "prompt_encoder.point_embed."),
    (r"\.mask_downscaling\.0\.", ".mask_embed.conv1."),
    (r"\.mask_downscaling\.1\.", ".mask_embed.layer_norm1."),
    (r"\.mask_downscaling\.3\.", ".mask_embed.conv2."),
    (r"\.mask_downscaling\.4\.", ".mask_embed.layer_norm2."),
    (r"\.mask_downscaling\.6\.", ".mask_embed.conv3."),
    (r"\.output_upscaling\.0\.", ".upscale_conv1."),
    (r"\.output_upscaling\.1\.", ".upscale_layer_norm."),
    (r"\.output_upscaling\.3\.", ".upscale_conv2."),
    (r"\.norm(\d|_final_attn)\.", r".layer_norm\1."),
    *_HEADS,
)
SAM_RULES: Rules = (
    *_PROMPTS_AND_DECODER,
    (r"^image_encoder\.neck\.0\.", "vision_encoder.neck.conv1."),
    (r"^image_encoder\.neck\.1\.", "vision_encoder.neck.layer_norm1."),
    (r"^image_encoder\.neck\.2\.", "vision_encoder.neck.conv2."),
    (r"^image_encoder\.neck\.3\.", "vision_encoder.neck.layer_norm2."),
    (r"^image_encoder\.patch_embed\.proj\.", "vision_encoder.patch_embed.projection."),
    (r"^image_encoder\.blocks\.", "vision_encoder.layers."),
    (r"^image_encoder\.", "vision_encoder."),
)
# SAM's prompts and decoder behind our own encoder, which keeps the published names; what is
# left out classified ImageNet.
MOBILE_SAM_RULES: Rules = (
    *_PROMPTS_AND_DECODER,
    (r"^image_encoder\.(norm_head|head)\.", None),
    (r"^image_encoder\.", "vision_encoder."),
)
# What SAM 2 needs only to track objects through a video.
_VIDEO = r"^(memory_|maskmem_|mask_downsample\.|obj_ptr_|no_obj_|no_mem_pos_enc$)"
SAM2_RULES: Rules = (
    (_VIDEO, None),
    (r"^sam_(prompt_encoder|mask_decoder)\.", r"\1."),
    *_PROMPTS_AND_DECODER,
    (r"^no_mem_embed$", "no_memory_embedding"),
    (r"^image_encoder\.neck\.convs\.(\d)\.conv\.", r"vision_encoder.neck.convs.\1."),
    (r"^image_encoder\.trunk\.patch_embed\.proj\.", "image_encoder.trunk.patch_embed.projection."),
    (r"^image_encoder\.trunk\.", "vision_encoder.backbone."),
    (r"\.mlp\.layers\.0\.", ".mlp.proj_in."),
    (r"\.mlp\.layers\.1\.", ".mlp.proj_out."),
    (r"\.out_proj\.", ".o_proj."),
)
POINT_KINDS = 4  # background, foreground, a box's first and second corner


@dataclass(frozen=True, slots=True, kw_only=True)
class SamForm:
    """Which network a checkpoint fits.

    Attributes:
        vision: What differs from the defaults of its vision encoder's configuration.
        backbone: The same for the trunk inside; None = SAM, which has no separate trunk.
        rules: How the checkpoint's names become the network's.
        encoder: Replaces transformers' vision encoder, where it has none that fits.
    """

    vision: Mapping[str, Any]
    backbone: Mapping[str, Any] | None = None
    rules: Rules = SAM_RULES
    encoder: Callable[[], nn.Module] | None = None


def _hiera(dim: int, blocks: list[int], global_blocks: list[int], **more: object) -> SamForm:
    """SAM 2's trunk: widths double from stage to stage (sam2/configs/sam2.1)."""
    widths = [dim * 2**stage for stage in range(4)]
    trunk = {"hidden_size": dim, "embed_dim_per_stage": widths, "blocks_per_stage": blocks}
    return SamForm(
        vision={"backbone_channel_list": widths[::-1]},
        backbone={**trunk, "global_attention_blocks": global_blocks, **more},
        rules=SAM2_RULES,
    )


_TWO_HEADS = [2, 4, 8, 16]
FORMS: dict[str, SamForm] = {
    "sam-vit-b": SamForm(vision={}),
    "sam-vit-l": SamForm(
        vision={
            "hidden_size": 1024,
            "num_hidden_layers": 24,
            "num_attention_heads": 16,
            "global_attn_indexes": [5, 11, 17, 23],
        }
    ),
    "sam-vit-h": SamForm(
        vision={
            "hidden_size": 1280,
            "num_hidden_layers": 32,
            "num_attention_heads": 16,
            "global_attn_indexes": [7, 15, 23, 31],
        }
    ),
    # Without layers: transformers' encoder is replaced anyway.
    "mobile-sam": SamForm(vision={"num_hidden_layers": 0}, rules=MOBILE_SAM_RULES, encoder=TinyVit),
    "sam2.1-tiny": _hiera(96, [1, 2, 7, 2], [5, 7, 9]),
    "sam2.1-small": _hiera(96, [1, 2, 11, 2], [7, 10, 13]),
    "sam2.1-base": _hiera(
        112,
        [2, 3, 16, 3],
        [12, 16, 20],
        num_attention_heads_per_stage=_TWO_HEADS,
        window_positional_embedding_background_size=[14, 14],
    ),
    "sam2.1-large": _hiera(
        144,
        [2, 6, 36, 4],
        [23, 33, 43],
        num_attention_heads_per_stage=_TWO_HEADS,
        window_size_per_stage=[8, 4, 16, 8],
    ),
}


def load(settings: Settings, device: str) -> AutomaticSegmenter:
    """Load the segmenter that the settings name.

    Raises:
        WeightsError: The weights are missing, damaged or of another network.
        SettingsError: transformers is missing or cannot be imported.
    """
    path = require([settings.segmenter])[settings.segmenter]
    form = FORMS[settings.segmenter]
    with torch.device("meta"):  # skips initialisation: ViT-H has 641 million numbers
        model = build(form)
    tensors = converted(read_tensors(path), form, source=str(path))
    load_strictly(model, tensors, source=str(path))
    return wrap(model.to(device), settings)


def build(form: SamForm) -> Any:  # noqa: ANN401 - transformers' classes carry no usable types
    """Return the network with random weights, in evaluation mode.

    Raises:
        SettingsError: transformers is missing or cannot be imported.
    """
    transformers = import_transformers()
    if form.backbone is None:
        vision = transformers.SamVisionConfig(**form.vision)
        model = transformers.SamModel(transformers.SamConfig(vision_config=vision))
        if form.encoder is not None:
            model.vision_encoder = form.encoder()
        return model.eval()
    trunk = transformers.Sam2HieraDetConfig(**form.backbone)
    vision = transformers.Sam2VisionConfig(backbone_config=trunk, **form.vision)
    return transformers.Sam2Model(transformers.Sam2Config(vision_config=vision)).eval()


def converted(tensors: Mapping[str, Tensor], form: SamForm, *, source: str) -> dict[str, Tensor]:
    """Rename a published checkpoint's tensors as the network names them.

    Raises:
        WeightsError: Two tensors would get the same name.
    """
    result = renamed(tensors, form.rules, source=source)
    if "positions" in result:  # transformers keeps two copies of the one random matrix
        positions = result.pop("positions")
        result["shared_image_embedding.positional_embedding"] = positions
        result["prompt_encoder.shared_embedding.positional_embedding"] = positions
    kinds = [f"prompt_encoder.point_embed.{kind}.weight" for kind in range(POINT_KINDS)]
    if form.backbone is not None and all(kind in result for kind in kinds):
        joint = torch.cat([result.pop(kind) for kind in kinds])
        result["prompt_encoder.point_embed.weight"] = joint
    return result


def wrap(model: Any, settings: Settings) -> AutomaticSegmenter:  # noqa: ANN401
    """Wrap a model that is on its device in a segmenter."""
    return AutomaticSegmenter(
        name=settings.segmenter, network=network_of(model, settings), settings=settings.segment
    )


def network_of(model: Any, settings: Settings) -> SamNetwork | Sam2Network:  # noqa: ANN401
    """Wrap a model that is on its device in a promptable network."""
    kind = SamNetwork if FORMS[settings.segmenter].backbone is None else Sam2Network
    return kind(model=model, bf16=settings.precision == "bf16")
