from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch

from zeroscd.encoders import placeformer
from zeroscd.encoders.vit import VisionTransformer, VitShape
from zeroscd.errors import SettingsError
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SMALL = VitShape(dim=64, depth=12, heads=2, grid_hw=(6, 8), distilled=True, head_dim=16)


@pytest.fixture
def network(randomise: Callable[..., Any]) -> Any:
    return randomise(VisionTransformer(SMALL))


@pytest.fixture
def photo() -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (96, 128, 3), dtype=np.uint8)


@pytest.mark.parametrize(
    ("name", "chosen", "layer"),
    [("placeformer", None, 12), ("r2former", None, 11), ("r2former", 4, 4)],
)
@torch.inference_mode()
def test_each_encoder_compares_its_own_layer_unless_told_otherwise(
    name: str, chosen: int | None, layer: int, network: Any, photo: np.ndarray
) -> None:
    settings = Settings(encoder=name, layer=chosen, side_px=111)
    ((found,),) = placeformer.wrap(network, settings, device="cpu").encode([photo])
    pixels = (torch.from_numpy(photo).permute(2, 0, 1)[None] / 255).float()
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    _, tokens = network.tokens((pixels - mean[:, None, None]) / std[:, None, None], layer=layer)
    expected = tokens[0] / tokens[0].norm(dim=2, keepdim=True)
    np.testing.assert_allclose(found.descriptors, expected, atol=1e-5)


def test_the_place_descriptor_comes_from_the_heads(network: Any, photo: np.ndarray) -> None:
    encoder = placeformer.wrap(network, Settings(encoder="r2former", side_px=111), device="cpu")
    places = encoder.places([photo, photo[:, ::-1].copy()])
    assert places is not None
    assert places.shape == (2, 16)
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 1.0, atol=1e-5)
    assert np.linalg.norm(places[0] - places[1]) > 1e-3


def test_a_layer_beyond_the_last_is_refused(network: Any) -> None:
    with pytest.raises(SettingsError, match="layers 1 to 12"):
        placeformer.wrap(network, Settings(encoder="r2former", layer=13), device="cpu")


def test_an_imported_file_is_loaded_from_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, randomise: Callable[..., Any]
) -> None:
    monkeypatch.setenv("ZEROSCD_HOME", str(tmp_path))
    network = randomise(VisionTransformer(VitShape()))
    (tmp_path / "weights").mkdir()
    torch.save({"model": network.state_dict()}, tmp_path / "weights" / "placeformer.pth")
    encoder = placeformer.load(Settings(encoder="placeformer", side_px=64), "cpu")
    assert (encoder.name, encoder.tau, encoder.patch_px) == ("placeformer", 0.65, 16)
    photo = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    wrapped = placeformer.wrap(network, Settings(encoder="placeformer", side_px=64), device="cpu")
    ((found,),), ((expected,),) = encoder.encode([photo]), wrapped.encode([photo])
    np.testing.assert_array_equal(found.descriptors, expected.descriptors)
