"""Turn a network into the bytes of an ONNX file, and compare them with the network."""

from __future__ import annotations

import logging
import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from torch import Tensor

    from zeroscd.onnx.network import OnnxNetwork

OPSET = 18  # the lowest that torch's exporter writes


def to_onnx(network: OnnxNetwork) -> bytes:
    """Write a network, its weights included."""
    with _quiet_exporter(), torch.no_grad():
        program = torch.onnx.export(
            network.network,
            tuple(network.inputs.values()),
            input_names=list(network.inputs),
            output_names=list(network.outputs),
            dynamic_shapes=_dynamic_shapes(network),
            opset_version=OPSET,
            verbose=False,
            dynamo=True,
        )
    content: bytes = program.model_proto.SerializeToString()  # type: ignore[union-attr]
    return content


def difference(network: OnnxNetwork, content: bytes, inputs: Mapping[str, Tensor]) -> float:
    """Run a file and its network; return the largest difference of any of their outputs.

    Each output counts as a share of its largest value: logits are tens, descriptors below 1.
    """
    import onnxruntime  # noqa: PLC0415 - of an extra

    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    found = session.run(None, {name: tensor.numpy() for name, tensor in inputs.items()})
    with torch.inference_mode():
        expected = [one.numpy() for one in network.network(*inputs.values())]
    return max(
        float(np.abs(one - other).max() / np.abs(other).max())
        for one, other in zip(found, expected, strict=True)
    )


def random_inputs(network: OnnxNetwork) -> dict[str, Tensor]:
    """Make inputs like the examples, of random numbers."""
    generator = torch.Generator().manual_seed(0)
    return {
        name: torch.randint(0, 256, example.shape, dtype=torch.uint8, generator=generator)
        if example.dtype == torch.uint8
        else torch.rand(example.shape, generator=generator)
        for name, example in network.inputs.items()
    }


def _dynamic_shapes(network: OnnxNetwork) -> Any:  # noqa: ANN401 - as torch.export types it
    """One entry an input, in their order."""
    shapes = []
    for name in network.inputs:
        axes = {}
        for axis, multiple in network.free.get(name, {}).items():
            count = torch.export.Dim(f"{name}_{axis}", min=1, max=4096)
            axes[axis] = multiple * count if multiple > 1 else count
        shapes.append(axes)
    return tuple(shapes)


@contextmanager
def _quiet_exporter() -> Iterator[None]:
    """Keep back what the exporter tells its own developers."""
    log = logging.getLogger("torch.onnx")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(level)
