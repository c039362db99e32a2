from __future__ import annotations

from math import floor
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch

from zeroscd.encoders import dino, placeformer
from zeroscd.encoders.checkpoint import read_vit
from zeroscd.encoders.positions import bicubic_positions, dinov2_positions, r2former_positions
from zeroscd.encoders.vit import VisionTransformer, VitShape
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

# --- The publishers' procedures, written from their description, one position at a time ---------


def cubic(t: float) -> float:
    """Keys' kernel with a = -0.75, as torch uses it."""
    a, t = -0.75, abs(t)
    if t <= 1:
        return (a + 2) * t**3 - (a + 3) * t**2 + 1
    return a * t**3 - 5 * a * t**2 + 8 * a * t - 4 * a if t < 2 else 0.0


def plain_bicubic(
    trained: np.ndarray, size_hw: tuple[int, int], step_yx: tuple[float, float]
) -> np.ndarray:
    """Interpolate; step_yx is how far apart two new positions lie in the trained grid."""
    height, width, _ = trained.shape
    fitted = np.zeros((*size_hw, trained.shape[2]))
    for row in range(size_hw[0]):
        for col in range(size_hw[1]):
            y, x = ((at + 0.5) * step - 0.5 for at, step in zip((row, col), step_yx, strict=True))
            for i in range(floor(y) - 1, floor(y) + 3):
                for j in range(floor(x) - 1, floor(x) + 3):
                    value = trained[min(max(i, 0), height - 1), min(max(j, 0), width - 1)]
                    fitted[row, col] += cubic(y - i) * cubic(x - j) * value
    return fitted


def plain_r2former(trained: np.ndarray, rows: int, cols: int) -> np.ndarray:
    height, width, _ = trained.shape
    side = max(rows, cols)
    if height >= side and width >= side:
        top, left = height // 2 - side // 2, width // 2 - side // 2
        square = trained[top : top + side, left : left + side]
    else:
        square = plain_bicubic(trained, (side, side), (height / side, width / side))
        middle = square[side // 2, side // 2].copy()
        before = ((trained[0, width // 2] - trained[height // 2, width // 2]) ** 2).sum()
        after = ((square[side // 2 - height // 2, side // 2] - middle) ** 2).sum()
        for row in range(side):
            for col in range(side):
                square[row, col] = middle + (square[row, col] - middle) * (before / after) ** 0.5
    top, left = side // 2 - rows // 2, side // 2 - cols // 2
    return square[top : top + rows, left : left + cols]


def plain_dinov2(trained: np.ndarray, rows: int, cols: int) -> np.ndarray:
    height, width, _ = trained.shape
    return plain_bicubic(
        trained, (rows, cols), (1 / ((rows + 0.1) / height), 1 / ((cols + 0.1) / width))
    )


GRIDS = [(6, 6), (3, 15), (4, 15), (15, 4), (8, 6), (5, 4), (4, 5), (3, 2), (7, 9)]


@pytest.mark.parametrize("grid_hw", GRIDS)
@pytest.mark.parametrize(
    ("fit", "plain"),
    [(r2former_positions, plain_r2former), (dinov2_positions, plain_dinov2)],
    ids=["R2Former", "DINOv2"],
)
def test_positions_equal_a_plain_reading_of_the_publishers_procedure(
    fit: Callable[..., Any], plain: Callable[..., np.ndarray], grid_hw: tuple[int, int]
) -> None:
    trained = np.random.default_rng(sum(grid_hw)).normal(size=(6, 8, 5))
    found = fit(torch.from_numpy(trained), grid_hw).numpy()
    assert found.shape == (*grid_hw, 5)
    np.testing.assert_allclose(found, plain(trained, *grid_hw), atol=1e-9)


def test_plain_interpolation_has_neither_spread_nor_offset() -> None:
    trained = np.random.default_rng(0).normal(size=(6, 8, 5))
    found = bicubic_positions(torch.from_numpy(trained), (7, 9)).numpy()
    np.testing.assert_allclose(found, plain_bicubic(trained, (7, 9), (6 / 7, 8 / 9)), atol=1e-9)
    for other in (r2former_positions, dinov2_positions):
        assert np.abs(found - other(torch.from_numpy(trained), (7, 9)).numpy()).max() > 0.01


# --- The publishers' own numbers ----------------------------------------------------------------


def waves(height: int, width: int, dim: int) -> torch.Tensor:
    """Positions of the trained grid as the golden file's README defines them."""
    y, x = np.linspace(0, 1, height)[:, None, None], np.linspace(0, 1, width)[None, :, None]
    c = np.arange(dim)
    return torch.from_numpy(0.5 * np.sin(y * (1 + c % 7) + x * (1 + c % 5) + c)).float()


@pytest.fixture
def golden(shared_data: Path) -> dict[str, np.ndarray]:
    with np.load(shared_data / "golden" / "position_embeddings.npz") as file:
        return dict(file)


@pytest.mark.data
def test_r2formers_positions_equal_those_of_its_own_code(golden: dict[str, np.ndarray]) -> None:
    network = VisionTransformer(VitShape(distilled=True), fit_positions=r2former_positions)
    with torch.no_grad():
        network.pos_embed[0, 2:] = waves(30, 40, 384).flatten(0, 1)
    names = [name for name in golden if name.startswith("r2former_")]
    assert len(names) == 6
    for name in names:
        rows, cols = (int(side) // 16 for side in name.partition("_")[2].split("x"))
        found = network.positions((rows, cols))[0, 2:].reshape(rows, cols, 384)[..., :8]
        np.testing.assert_allclose(found.detach(), golden[name], atol=1e-5)


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "prefix"), [("dinov2-s", "dinov2_"), ("dinov2-s-reg", "dinov2reg_")]
)
def test_dinov2s_positions_equal_those_of_metas_code(
    name: str, prefix: str, golden: dict[str, np.ndarray]
) -> None:
    pytest.importorskip("transformers", reason="needs zeroscd[models]")
    embeddings = dino.build(dino.FORMS[name]).embeddings
    with torch.no_grad():
        embeddings.position_embeddings[0, 1:] = waves(37, 37, 384).flatten(0, 1)
    names = [name for name in golden if name.startswith(prefix)]
    assert len(names) == 4
    for key in names:
        rows, cols = (int(side) for side in key.partition("_")[2].split("x"))
        tokens = torch.zeros(1, 1 + rows * cols, 384)
        fitted = embeddings.interpolate_pos_encoding(tokens, rows * 14, cols * 14)
        found = fitted[0, 1:].reshape(rows, cols, 384)[..., :8]
        np.testing.assert_allclose(found.detach(), golden[key], atol=1e-5)


# --- They reach the descriptors -----------------------------------------------------------------


def test_on_a_panorama_r2formers_descriptors_differ_from_plainly_interpolated_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, randomise: Callable[..., Any]
) -> None:
    monkeypatch.setenv("ZEROSCD_HOME", str(tmp_path))
    network = randomise(VisionTransformer(VitShape(distilled=True)))
    (tmp_path / "weights").mkdir()
    torch.save(network.state_dict(), tmp_path / "weights" / "CVPR23_DeitS_Rerank.pth")
    photo = np.random.default_rng(0).integers(0, 256, (240, 1088, 3), dtype=np.uint8)
    settings = Settings(encoder="r2former", side_px=512)
    ((found,),) = placeformer.load(settings, "cpu").encode([photo])
    assert found.grid.size_hw == (15, 68)
    own = read_vit(network.state_dict(), source="file", fit_positions=r2former_positions)
    ((expected,),) = placeformer.wrap(own, settings, device="cpu").encode([photo])
    np.testing.assert_array_equal(found.descriptors, expected.descriptors)
    plain = placeformer.wrap(network, settings, device="cpu")
    ((other,),) = plain.encode([photo])
    assert np.linalg.norm(found.descriptors - other.descriptors, axis=2).mean() > 0.05


@torch.inference_mode()
def test_dinov2_computes_with_metas_positions(randomise: Callable[..., Any]) -> None:
    pytest.importorskip("transformers", reason="needs zeroscd[models]")
    form = dino.DinoForm(
        family="Dinov2",
        config={
            "image_size": 70,
            "patch_size": 14,
            "hidden_size": 24,
            "num_attention_heads": 2,
            "num_hidden_layers": 1,
        },
        rules=(),
    )
    network = randomise(dino.build(form))
    pixels = torch.randn(1, 3, 42, 98, generator=torch.Generator().manual_seed(0))
    found = network.embeddings(pixels)[0, 1:]
    trained = network.embeddings.position_embeddings[0, 1:].reshape(5, 5, 24).numpy()
    patches = network.embeddings.patch_embeddings(pixels)[0]
    expected = patches + torch.from_numpy(plain_dinov2(trained, 3, 7)).float().flatten(0, 1)
    torch.testing.assert_close(found, expected, rtol=0, atol=1e-5)
