from __future__ import annotations

import math
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch

from zeroscd.encoders import efficientnet
from zeroscd.encoders.efficientnet import Trunk
from zeroscd.encoders.lite import STRIDES_PX, WEIGHTS_FILE, WEIGHTS_PACKAGE

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from torch import Tensor, nn

# EfficientNet-B0 as published: kernel, stride, expansion, channels, repeats (Tan & Le, table 1).
B0 = (
    (3, 1, 1, 16, 1),
    (3, 2, 6, 24, 2),
    (5, 2, 6, 40, 2),
    (3, 2, 6, 80, 3),
    (5, 1, 6, 112, 3),
    (5, 2, 6, 192, 4),
    (3, 1, 6, 320, 1),
)
WIDTH, DEPTH = 1.1, 1.2  # of Lite2


@pytest.fixture(scope="module")
def checkpoint() -> dict[str, Tensor]:
    """The published state, as the package ships it."""
    with (resources.files(WEIGHTS_PACKAGE) / WEIGHTS_FILE).open("rb") as stream:
        state = torch.load(stream, map_location="cpu", weights_only=True)
    return dict(state)


def lite2_blocks() -> list[tuple[int, int, int, int]]:
    """Kernel, stride, expansion and channels of every block, by the published scaling rules.

    Widths go to the nearest multiple of eight, never down by more than a tenth; depths up to a
    whole number, but the first and the last stage of a Lite keep their single block.
    """
    blocks = []
    for stage, (kernel, stride, expansion, channels, repeats) in enumerate(B0):
        width = max(8, int(channels * WIDTH + 4) // 8 * 8)
        width += 8 if width < 0.9 * channels * WIDTH else 0
        depth = repeats if stage in (0, len(B0) - 1) else math.ceil(DEPTH * repeats)
        for index in range(depth):
            blocks.append((kernel, stride if index == 0 else 1, expansion, width))
    return blocks


def norm(state: Mapping[str, Tensor], name: str, x: Tensor) -> Tensor:
    """Batch norm as in the paper: (x - mean) / sqrt(variance + 0.001) * gamma + beta."""

    def column(part: str) -> Tensor:
        return state[f"{name}.{part}"].reshape(1, -1, 1, 1)

    spread = (column("running_var") + 1e-3).sqrt()
    return (x - column("running_mean")) / spread * column("weight") + column("bias")


def convolve(x: Tensor, weight: Tensor, *, stride: int) -> Tensor:
    """Sum over the window, kernel // 2 zeros around; a kernel with one input is for its channel.

    By shifted copies, so that nothing here knows about the library's padding or groups.
    """
    kernel = weight.shape[-1]
    rim = kernel // 2
    padded = torch.zeros(*x.shape[:2], x.shape[2] + 2 * rim, x.shape[3] + 2 * rim, dtype=x.dtype)
    padded[:, :, rim : rim + x.shape[2], rim : rim + x.shape[3]] = x
    depthwise = weight.shape[1] == 1 and x.shape[1] > 1
    result = None
    for dy in range(kernel):
        for dx in range(kernel):
            window = padded[:, :, dy : dy + x.shape[2] : stride, dx : dx + x.shape[3] : stride]
            part = (
                window * weight[:, 0, dy, dx].reshape(1, -1, 1, 1)
                if depthwise
                else torch.einsum("bchw,oc->bohw", window, weight[:, :, dy, dx])
            )
            result = part if result is None else result + part
    assert result is not None
    return result


def relu6(x: Tensor) -> Tensor:
    return x.clamp(0, 6)


def plain_lite2(state: Mapping[str, Tensor], x: Tensor) -> list[Tensor]:
    """Outputs of the stem and of every block."""
    x = relu6(norm(state, "_bn0", convolve(x, state["_conv_stem.weight"], stride=2)))
    outputs = [x]
    for index, (_, stride, expansion, channels) in enumerate(lite2_blocks()):
        name = f"_blocks.{index}"
        y = x
        if expansion > 1:
            y = convolve(y, state[f"{name}._expand_conv.weight"], stride=1)
            y = relu6(norm(state, f"{name}._bn0", y))
        y = convolve(y, state[f"{name}._depthwise_conv.weight"], stride=stride)
        y = relu6(norm(state, f"{name}._bn1", y))
        y = norm(
            state, f"{name}._bn2", convolve(y, state[f"{name}._project_conv.weight"], stride=1)
        )
        x = x + y if stride == 1 and x.shape[1] == channels else y
        outputs.append(x)
    return outputs


@pytest.mark.parametrize("strip_bytes", [efficientnet.STRIP_BYTES, 100_000, 0])
@pytest.mark.parametrize("size_hw", [(64, 96), (32, 32)])
def test_every_block_computes_what_the_published_architecture_says(
    checkpoint: dict[str, Tensor],
    size_hw: tuple[int, int],
    strip_bytes: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(efficientnet, "STRIP_BYTES", strip_bytes)
    state = {key: value.double() for key, value in checkpoint.items() if value.is_floating_point()}
    trunk = Trunk().double().eval()
    trunk.load_checkpoint(checkpoint)
    photo = torch.rand(2, 3, *size_hw, generator=torch.Generator().manual_seed(0)).double() * 2 - 1
    with torch.inference_mode():
        ours = trunk(photo, range(-1, len(lite2_blocks())))
        plain = plain_lite2(state, photo)
    assert len(ours) == len(plain) == 22
    for found, expected in zip(ours, plain, strict=True):
        np.testing.assert_allclose(found.numpy(), expected.numpy(), atol=1e-9)


def test_only_the_asked_for_depths_come_back_and_do_not_depend_on_the_others(
    checkpoint: dict[str, Tensor],
) -> None:
    trunk = Trunk().eval()
    trunk.load_checkpoint(checkpoint)
    photo = torch.rand(1, 3, 64, 64, generator=torch.Generator().manual_seed(0))
    with torch.inference_mode():
        every = trunk(photo, range(-1, 21))
        some = trunk(photo, (2, 14))
    assert len(some) == 2
    assert torch.equal(some[0], every[3])
    assert torch.equal(some[1], every[15])


def damage(kind: str, state: dict[str, Tensor], key: str) -> dict[str, Tensor]:
    changed = dict(state)
    tensor = changed.pop(key)
    if kind == "renamed":
        changed[f"{key}_old"] = tensor
    if kind == "reshaped":
        changed[key] = tensor[..., None]
    return changed


@pytest.mark.parametrize("kind", ["removed", "renamed", "reshaped"])
@pytest.mark.parametrize(
    "key",
    [
        "_conv_stem.weight",
        "_bn0.running_mean",
        "_blocks.7._depthwise_conv.weight",
        "_blocks.13._bn2.running_var",
        "_blocks.20._project_conv.weight",
    ],
)
def test_a_key_that_does_not_fit_is_named(
    checkpoint: dict[str, Tensor], kind: str, key: str
) -> None:
    with pytest.raises(RuntimeError, match=key.replace(".", r"\.")):
        Trunk().load_checkpoint(damage(kind, checkpoint, key))


def test_an_unknown_key_is_named(checkpoint: dict[str, Tensor]) -> None:
    with pytest.raises(RuntimeError, match=r"_blocks\.21\._bn0\.weight"):
        Trunk().load_checkpoint({**checkpoint, "_blocks.21._bn0.weight": torch.zeros(3)})


def test_every_key_of_the_trunk_is_taken_and_no_number_is_left_to_chance(
    checkpoint: dict[str, Tensor],
) -> None:
    trunk = Trunk()
    trunk.load_checkpoint(checkpoint)
    loaded = trunk.state_dict()
    assert all(torch.equal(loaded[key], checkpoint[key]) for key in loaded)
    left = {key for key in checkpoint if key not in loaded}
    assert {key.split(".")[0] for key in left} == {"_conv_head", "_bn1", "_fc"}


@pytest.fixture(scope="module")
def even_trunk() -> nn.Module:
    """A trunk whose every weight is equal: what it looks at is as even as its geometry."""
    trunk = Trunk().double().eval()
    with torch.no_grad():
        for name, tensor in trunk.state_dict().items():
            if tensor.ndim == 4:
                tensor.fill_(1 / tensor[0].numel())
            elif name.endswith(("weight", "running_var")):
                tensor.fill_(1.0)
            else:
                tensor.fill_(0)
    return trunk


@pytest.mark.parametrize("axis", ["rows", "columns"])
def test_a_cell_looks_at_the_pixel_of_its_number_times_the_stride(
    even_trunk: Callable[..., list[Tensor]], axis: str
) -> None:
    # The deepest cell sees 560 pixels to each side: no rim cuts its view.
    length, middle = 1280, 640
    size_hw = (length, 32) if axis == "rows" else (32, length)
    photo = torch.full((1, 3, *size_hw), 0.1, dtype=torch.float64, requires_grad=True)
    strides = {-1: 2, **STRIDES_PX}
    for stride, tap in zip(strides.values(), even_trunk(photo, tuple(strides)), strict=True):
        assert tap.shape[2:] == (size_hw[0] // stride, size_hw[1] // stride)
        line = tap[0, 0, :, 0] if axis == "rows" else tap[0, 0, 0]
        (gradient,) = torch.autograd.grad(line[middle // stride], photo, retain_graph=True)
        view = gradient[0].sum(dim=0).sum(dim=1 if axis == "rows" else 0)
        pixels = torch.arange(length, dtype=torch.float64)
        assert float((view * pixels).sum() / view.sum()) == pytest.approx(middle, abs=1e-6)
        # Not only on average: the view is a mirror image of itself around that pixel.
        np.testing.assert_allclose(
            view[middle - 600 : middle].flip(0), view[middle + 1 : middle + 601], atol=1e-12
        )


def test_a_bright_spot_lights_up_the_cell_that_looks_at_it(
    even_trunk: Callable[..., list[Tensor]],
) -> None:
    photo = torch.zeros(1, 3, 192, 192, dtype=torch.float64)
    photo[:, :, 64, 104] = 1.0
    fine = {block: stride for block, stride in STRIDES_PX.items() if stride <= 8}
    with torch.inference_mode():
        taps = even_trunk(photo, tuple(fine))
    for stride, tap in zip(fine.values(), taps, strict=True):
        row, col = divmod(int(tap[0, 0].argmax()), tap.shape[3])
        assert (row, col) == (64 // stride, 104 // stride)
