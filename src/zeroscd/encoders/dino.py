"""DINOv2 and DINOv3 through transformers, from the files that Meta publishes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import isqrt
from typing import TYPE_CHECKING, Any

import torch

from zeroscd.encoders.positions import dinov2_positions
from zeroscd.encoders.taus import TAUS
from zeroscd.encoders.transformer import TransformerEncoder, checked_layer
from zeroscd.weights.backend import import_transformers
from zeroscd.weights.rename import renamed, split_in_three
from zeroscd.weights.safe import read_tensors
from zeroscd.weights.store import require
from zeroscd.weights.strict import load_strictly

if TYPE_CHECKING:
    from collections.abc import Mapping

    from torch import Tensor

    from zeroscd.settings import Settings
    from zeroscd.weights.rename import Rules

# From Meta's names to those of transformers' networks. Mask tokens matter in training only.
_SHARED: Rules = (
    (r"\.ls(\d)\.gamma$", r".layer_scale\1.lambda1"),
    (r"\.attn\.proj\.", ".attention.o_proj."),
    (r"\.attn\.", ".attention."),
    (r"^(cls_token|mask_token)$", r"embeddings.\1"),
)
DINOV2_RULES: Rules = (
    *_SHARED,
    (r"^blocks\.", "encoder.layer."),
    (r"^register_tokens$", "embeddings.register_tokens"),
    (r"^pos_embed$", "embeddings.position_embeddings"),
    (r"^patch_embed\.proj\.", "embeddings.patch_embeddings.projection."),
    (r"^norm\.", "layernorm."),
)
# DINOv3 masks the bias of its keys to nothing and computes its rotary periods from the config.
DINOV3_RULES: Rules = (
    (r"\.(bias_mask|k_proj\.bias)$|^rope_embed\.", None),
    *_SHARED,
    (r"^blocks\.", "model.layer."),
    (r"^storage_tokens$", "embeddings.register_tokens"),
    (r"^patch_embed\.proj\.", "embeddings.patch_embeddings."),
    (r"\.mlp\.fc1\.", ".mlp.up_proj."),
    (r"\.mlp\.fc2\.", ".mlp.down_proj."),
)

MASKED_PATCH = "embeddings.mask_token"


@dataclass(frozen=True, slots=True, kw_only=True)
class DinoForm:
    """The transformers network that a checkpoint fits.

    Attributes:
        family: Name of its classes: family + "Config" and family + "Model".
        config: What differs from the family's defaults.
        rules: From the publisher's names to the network's.
    """

    family: str
    config: Mapping[str, Any]
    rules: Rules


_SMALL = {"hidden_size": 384, "num_attention_heads": 6}
_DINOV2 = {"image_size": 518, "patch_size": 14}

FORMS: dict[str, DinoForm] = {
    "dinov2-s": DinoForm(family="Dinov2", config=_DINOV2 | _SMALL, rules=DINOV2_RULES),
    "dinov2-s-reg": DinoForm(
        family="Dinov2WithRegisters", config=_DINOV2 | _SMALL, rules=DINOV2_RULES
    ),
    "dinov2-b": DinoForm(family="Dinov2", config=_DINOV2, rules=DINOV2_RULES),
    "dinov2-b-reg": DinoForm(family="Dinov2WithRegisters", config=_DINOV2, rules=DINOV2_RULES),
    "dinov3-s": DinoForm(family="DINOv3ViT", config={"num_register_tokens": 4}, rules=DINOV3_RULES),
}


def load(settings: Settings, device: str) -> TransformerEncoder:
    """Load the encoder that the settings name.

    Raises:
        WeightsError: The weights are missing, damaged or of another network.
        SettingsError: transformers is missing or cannot be imported, or there is no such layer.
    """
    path = require([settings.encoder])[settings.encoder]
    form = FORMS[settings.encoder]
    network = build(form)
    load_strictly(network, converted(read_tensors(path), form, source=str(path)), source=str(path))
    return wrap(network, settings, device=device)


def build(form: DinoForm) -> Any:  # noqa: ANN401 - transformers' classes carry no usable types
    """Return the network with random weights, in evaluation mode.

    Raises:
        SettingsError: transformers is missing or cannot be imported.
    """
    transformers = import_transformers()
    config = getattr(transformers, f"{form.family}Config")(**form.config)
    network = getattr(transformers, f"{form.family}Model")(config).eval()
    if form.family == "Dinov2":  # transformers leaves out Meta's offset
        embeddings = network.embeddings
        embeddings.interpolate_pos_encoding = partial(_dinov2_positions, embeddings)
    return network


def _dinov2_positions(embeddings: Any, tokens: Tensor, height: int, width: int) -> Tensor:  # noqa: ANN401
    """Stand in for transformers' interpolate_pos_encoding, (1, 1 + rows * cols, dim)."""
    trained: Tensor = embeddings.position_embeddings
    patch_px = embeddings.config.patch_size
    side = isqrt(trained.shape[1] - 1)
    grid_hw = height // patch_px, width // patch_px
    if grid_hw == (side, side):
        return trained
    fitted = dinov2_positions(trained[0, 1:].reshape(side, side, -1), grid_hw)
    return torch.cat([trained[:, :1], fitted.reshape(1, -1, tokens.shape[2])], dim=1)


def converted(tensors: Mapping[str, Tensor], form: DinoForm, *, source: str) -> dict[str, Tensor]:
    """Rename a published checkpoint's tensors as the network names them.

    Raises:
        WeightsError: Two tensors would get the same name.
    """
    cut = split_in_three(tensors, joint=".qkv.", parts=(".q_proj.", ".k_proj.", ".v_proj."))
    result = renamed(cut, form.rules, source=source)
    if form.rules is DINOV3_RULES and MASKED_PATCH in result:
        result[MASKED_PATCH] = result[MASKED_PATCH].reshape(1, 1, -1)  # Meta writes it flat
    return result


def wrap(network: Any, settings: Settings, *, device: str) -> TransformerEncoder:  # noqa: ANN401
    """Wrap a network in an encoder.

    Raises:
        SettingsError: The network has no such layer.
    """
    config = network.config
    depth = config.num_hidden_layers
    layer = checked_layer(settings.layer or depth, depth=depth)
    prefix = 1 + getattr(config, "num_register_tokens", 0)

    def patches(pixels: Tensor) -> Tensor:
        rows, cols = (side // config.patch_size for side in pixels.shape[2:])
        if layer == depth:
            tokens: Tensor = network(pixels).last_hidden_state
        else:
            tokens = network(pixels, output_hidden_states=True).hidden_states[layer]
        return tokens[:, prefix:].reshape(len(pixels), rows, cols, config.hidden_size)

    network.to(device)
    return TransformerEncoder(
        name=settings.encoder,
        tau=TAUS[settings.encoder].value,
        patch_px=config.patch_size,
        side_px=settings.side_px,
        network=patches,
        device=device,
        bf16=settings.precision == "bf16",
    )
