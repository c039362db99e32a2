"""Load named tensors into a network: none missing, none left over, all of the right shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.errors import WeightsError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from torch import Tensor, nn

MAX_NAMES = 12  # in a message; a wrong file lacks hundreds


def load_strictly(network: nn.Module, tensors: Mapping[str, Tensor], *, source: str) -> None:
    """Load tensors into a network by name.

    Args:
        network: Takes the tensors without a copy where the data type fits, so it may have been
            built on torch's "meta" device, which costs neither time nor memory. Buffers outside of
            its state dict are left alone.
        tensors: By the network's own names.
        source: What to call the file in messages.

    Raises:
        WeightsError: Names are missing or left over, or a shape differs; each one is named.
    """
    expected = network.state_dict()
    faults = [
        *_named("missing", sorted(expected.keys() - tensors.keys())),
        *_named("left over", sorted(tensors.keys() - expected.keys())),
        *_named("of wrong shape", _misfits(expected, tensors)),
    ]
    if faults:
        message = f"{source} does not fit the network: {'; '.join(faults)}"
        raise WeightsError(message)
    fitting = {name: tensor.to(expected[name].dtype) for name, tensor in tensors.items()}
    network.load_state_dict(fitting, strict=True, assign=True)


def _misfits(expected: Mapping[str, Tensor], tensors: Mapping[str, Tensor]) -> list[str]:
    return [
        f"{name} {tuple(tensors[name].shape)} instead of {tuple(expected[name].shape)}"
        for name in sorted(expected.keys() & tensors.keys())
        if tensors[name].shape != expected[name].shape
    ]


def _named(fault: str, names: list[str]) -> list[str]:
    if not names:
        return []
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return [f"{fault}: {', '.join(names[:MAX_NAMES])}{more}"]
