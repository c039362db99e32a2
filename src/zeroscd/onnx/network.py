"""A network that can be written as an ONNX file: what goes in, what comes out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from torch import Tensor, nn


@dataclass(frozen=True, slots=True, kw_only=True)
class OnnxNetwork:
    """A network with its inputs and outputs by name.

    Attributes:
        network: Takes the inputs in their order and returns a tuple of tensors, in evaluation mode.
        inputs: An example of each input.
        outputs: Names of the outputs, in their order.
        free: Axes of inputs that may have any length, or any multiple of a number: input -> axis ->
            the number.
    """

    network: nn.Module
    inputs: Mapping[str, Tensor]
    outputs: tuple[str, ...]
    free: Mapping[str, Mapping[int, int]] = field(default_factory=dict)
