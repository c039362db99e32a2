from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch

from zeroscd.encoders import dino
from zeroscd.errors import WeightsError
from zeroscd.settings import Settings
from zeroscd.weights.strict import load_strictly

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor

pytest.importorskip("transformers", reason="needs zeroscd[models]")

SMALL = {"hidden_size": 48, "num_attention_heads": 2, "num_hidden_layers": 2}


def form_of(name: str) -> dino.DinoForm:
    """The real form, with a tiny network."""
    form = dino.FORMS[name]
    image = {"image_size": 56} if name.startswith("dinov2") else {"intermediate_size": 192}
    return replace(form, config={**form.config, **SMALL, **image})


# What each piece of transformers' names is called in Meta's files, written independently of the
# rules under test: from the modules of the dinov2 and dinov3 repositories.
BACK_V2 = [
    (r"^encoder\.layer\.", "blocks."),
    (r"^embeddings\.patch_embeddings\.projection\.", "patch_embed.proj."),
    (r"^embeddings\.position_embeddings$", "pos_embed"),
    (r"^embeddings\.", ""),
    (r"^layernorm\.", "norm."),
]
BACK_V3 = [
    (r"^model\.layer\.", "blocks."),
    (r"^embeddings\.patch_embeddings\.", "patch_embed.proj."),
    (r"^embeddings\.register_tokens$", "storage_tokens"),
    (r"^embeddings\.", ""),
    (r"\.up_proj\.", ".fc1."),
    (r"\.down_proj\.", ".fc2."),
]
BACK_BOTH = [
    (r"\.layer_scale(\d)\.lambda1$", r".ls\1.gamma"),
    (r"\.attention\.o_proj\.", ".attn.proj."),
]


def published(network: Any, name: str) -> dict[str, Tensor]:
    """Write a network's tensors as Meta's file has them."""
    theirs = network.state_dict()
    rules = (BACK_V3 if name == "dinov3-s" else BACK_V2) + BACK_BOTH
    result: dict[str, Tensor] = {}
    for key, tensor in theirs.items():
        if re.search(r"\.[qkv]_proj\.", key):
            continue
        result[rewritten(key, rules)] = tensor
    for index in range(SMALL["num_hidden_layers"]):
        for part in ("weight", "bias"):
            stem = "model" if name == "dinov3-s" else "encoder"
            at = f"{stem}.layer.{index}.attention"
            value = theirs[f"{at}.v_proj.{part}"]
            key = theirs.get(f"{at}.k_proj.{part}", torch.zeros_like(value))
            joint = torch.cat([theirs[f"{at}.q_proj.{part}"], key, value])
            result[f"blocks.{index}.attn.qkv.{part}"] = joint
    if name == "dinov3-s":
        result["rope_embed.periods"] = torch.ones(6)
        result["mask_token"] = result["mask_token"].flatten(0, 1)  # (1, dim) in Meta's code
        for index in range(SMALL["num_hidden_layers"]):
            result[f"blocks.{index}.attn.qkv.bias_mask"] = torch.ones(144)
    return result


def rewritten(name: str, rules: list[tuple[str, str]]) -> str:
    for pattern, replacement in rules:
        name = re.sub(pattern, replacement, name)
    return name


@pytest.mark.parametrize("name", sorted(dino.FORMS))
def test_a_published_file_loads_every_number(name: str, randomise: Callable[..., Any]) -> None:
    form = form_of(name)
    wanted = randomise(dino.build(form))
    file = published(wanted, name)
    assert any(key == "blocks.1.attn.qkv.weight" for key in file)
    assert not any("layer." in key for key in file)
    network = dino.build(form)
    load_strictly(network, dino.converted(file, form, source="file"), source="file")
    found = network.state_dict()
    assert all(torch.equal(found[key], value) for key, value in wanted.state_dict().items())


@pytest.mark.parametrize("name", sorted(dino.FORMS))
def test_a_tensor_that_is_missing_or_left_over_is_named(
    name: str, randomise: Callable[..., Any]
) -> None:
    form = form_of(name)
    file = published(randomise(dino.build(form)), name)
    file["blocks.1.ls3.gamma"] = file.pop("blocks.1.ls2.gamma")
    with pytest.raises(WeightsError, match=r"missing: \S+layer_scale2\S+; left over: \S+scale3"):
        load_strictly(dino.build(form), dino.converted(file, form, source="file"), source="file")


@pytest.mark.parametrize("name", sorted(dino.FORMS))
@torch.inference_mode()
def test_descriptors_are_the_features_that_transformers_gives(
    name: str, randomise: Callable[..., Any]
) -> None:
    network = randomise(dino.build(form_of(name)))
    patch = network.config.patch_size
    rows, cols = 3, 6
    photo = np.random.default_rng(0).integers(0, 256, (rows * patch, cols * patch, 3), np.uint8)
    settings = Settings(encoder=name, side_px=round((rows * cols) ** 0.5 * patch))
    ((found,),) = dino.wrap(network, settings, device="cpu").encode([photo])
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    pixels = ((torch.from_numpy(photo) / 255 - mean) / std).permute(2, 0, 1)[None]
    tokens = network(pixels).last_hidden_state[0, -rows * cols :]
    expected = (tokens / tokens.norm(dim=1, keepdim=True)).reshape(rows, cols, -1)
    assert expected.std() > 0.05
    np.testing.assert_allclose(found.descriptors, expected, atol=1e-5)
    assert found.grid.patch_px == patch


@torch.inference_mode()
def test_an_earlier_layer_can_be_compared(randomise: Callable[..., Any]) -> None:
    network = randomise(dino.build(form_of("dinov2-s-reg")))
    photo = np.random.default_rng(0).integers(0, 256, (56, 56, 3), np.uint8)
    maps = {
        layer: dino.wrap(
            network, Settings(encoder="dinov2-s-reg", side_px=56, layer=layer), device="cpu"
        ).encode([photo])[0][0]
        for layer in (1, 2)
    }
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    pixels = ((torch.from_numpy(photo) / 255 - mean) / std).permute(2, 0, 1)[None]
    hidden = network(pixels, output_hidden_states=True).hidden_states[1][0, 5:]
    expected = (hidden / hidden.norm(dim=1, keepdim=True)).reshape(4, 4, -1)
    np.testing.assert_allclose(maps[1].descriptors, expected, atol=1e-5)
    assert np.abs(maps[1].descriptors - maps[2].descriptors).max() > 0.01


def test_the_real_forms_have_the_published_sizes() -> None:
    with torch.device("meta"):
        millions = {
            name: dino.build(form).num_parameters() / 1e6 for name, form in dino.FORMS.items()
        }
    assert millions["dinov2-s"] == pytest.approx(22.06, abs=0.01)
    assert millions["dinov2-b"] == pytest.approx(86.58, abs=0.01)
    assert millions["dinov2-s-reg"] - millions["dinov2-s"] == pytest.approx(4 * 384 / 1e6, abs=1e-5)
    assert millions["dinov3-s"] == pytest.approx(21.6, abs=0.05)
