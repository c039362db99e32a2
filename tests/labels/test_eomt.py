"""EoMT from a file as transformers writes it, and photos labelled as transformers labels them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

pytest.importorskip("transformers", reason="needs zeroscd[models]")

from zeroscd.errors import WeightsError
from zeroscd.labels import eomt
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.arrays import Rgb

TINY: dict[str, Any] = {
    "hidden_size": 64,
    "num_hidden_layers": 3,
    "num_attention_heads": 2,
    "patch_size": 16,
    "num_blocks": 2,
}
SIDE, QUERIES = 64, 12
# Of the photo, and where its classes are decided.
SIZES = {
    (64, 64): (64, 64),
    (64, 160): (64, 160),
    (150, 64): (150, 64),
    (50, 120): (50, 120),
    (97, 101): (64, 67),
    (199, 331): (64, 106),
}


@pytest.fixture
def published(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """A tiny network of random weights as transformers saves it, where the catalogue looks."""
    from transformers import EomtConfig, EomtForUniversalSegmentation

    torch.manual_seed(3)
    config: Any = EomtConfig(**TINY, image_size=SIDE, num_queries=QUERIES)
    config.num_labels = 150
    whole: Any = EomtForUniversalSegmentation(config)
    whole.eval()
    with torch.no_grad():  # fresh weights are so small that one class wins everywhere
        for one in (whole.query, whole.class_predictor, *whole.mask_head.children()):
            if hasattr(one, "weight"):
                one.weight.mul_(30)
    whole.attn_mask_probs.zero_()  # as training leaves it
    path = tmp_path / "model.safetensors"
    save_file({name: tensor.contiguous() for name, tensor in whole.state_dict().items()}, path)
    monkeypatch.setattr(eomt, "LARGE", TINY)
    monkeypatch.setattr(eomt, "require", lambda names: dict.fromkeys(names, path))
    return whole, path


def photo_of(size_hw: tuple[int, int]) -> Rgb:
    small = np.random.default_rng(5).integers(0, 256, (8, 8, 3), dtype=np.uint8)
    rows, cols = (np.arange(side) * 8 // side for side in size_hw)
    return small[np.ix_(rows, cols)]


@pytest.mark.parametrize(("size_hw", "decided"), SIZES.items())
def test_a_photo_is_labelled_as_the_publishers_library_does(
    published: Any, size_hw: tuple[int, int], decided: tuple[int, int]
) -> None:
    from transformers.models.eomt.image_processing_pil_eomt import EomtImageProcessorPil

    whole, _ = published
    edges: Any = {"shortest_edge": SIDE, "longest_edge": None}
    processor = EomtImageProcessorPil(size=edges, do_split_image=True)
    photo = photo_of(size_hw)
    inputs = processor(photo, return_tensors="pt")
    with torch.inference_mode():
        found = whole(**inputs)
        (expected,) = processor.post_process_semantic_segmentation(found, target_sizes=[decided])
    labels = eomt.load(Settings(), "cpu").label(photo)
    assert labels.shape == size_hw
    assert len(np.unique(expected)) > 1, "one class everywhere would hide a wrong place"
    # Pixel (x, y) of a larger photo has the class of the network's pixel that covers it.
    rows, cols = (
        ((np.arange(side) + 0.5) * small / side).astype(int)
        for side, small in zip(size_hw, decided, strict=True)
    )
    np.testing.assert_array_equal(labels, expected.numpy()[np.ix_(rows, cols)])


def test_queries_and_input_size_are_read_from_the_file(published: Any) -> None:
    config = eomt.load(Settings(), "cpu").network.config
    assert (config.num_queries, config.image_size) == (QUERIES, SIDE)


def test_a_file_without_the_tensors_of_training_fits_too(published: Any) -> None:
    whole, path = published
    kept = {
        name: tensor.contiguous()
        for name, tensor in whole.state_dict().items()
        if not name.startswith("criterion.") and name != "attn_mask_probs"
    }
    save_file(kept, path)
    labeller = eomt.load(Settings(), "cpu")
    assert labeller.network.attn_mask_probs.tolist() == [0.0, 0.0]


def test_another_file_is_refused(published: Any) -> None:
    _, path = published
    save_file({"query.weight": torch.zeros(3, 64)}, path)
    with pytest.raises(WeightsError, match="does not fit the network: missing"):
        eomt.load(Settings(), "cpu")
