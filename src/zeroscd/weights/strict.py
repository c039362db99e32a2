"""Fill a network with named tensors: every one needed, none left over, all of the right shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.errors import WeightsError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from torch import Tensor, nn

MAX_NAMES = 12  # in one message; a wrong file lacks hundreds, and a line must stay a line


def load_strictly(network: nn.Module, tensors: Mapping[str, Tensor], *, source: str) -> None:
    """Give a network its tensors by name.

    Args:
        network: Takes the tensors over as they are, without a copy where the number format fits;
            so it may have been built on torch's "meta" device, which costs neither time nor memory.
            Buffers that are not part of its saved state are left alone.
        tensors: By the network's own names.
        source: What to call the file in messages.

    Raises:
        WeightsError: Names are missing or left over, or a shape differs; each one is named.
    """
    wanted = network.state_dict()
    faults = [
        *_named("missing", sorted(wanted.keys() - tensors.keys())),
        *_named("left over", sorted(tensors.keys() - wanted.keys())),
        *_named("of wrong shape", _misfits(wanted, tensors)),
    ]
    if faults:
        message = f"{source} does not fit the network: {'; '.join(faults)}"
        raise WeightsError(message)
    fitting = {name: tensor.to(wanted[name].dtype) for name, tensor in tensors.items()}
    network.load_state_dict(fitting, strict=True, assign=True)


def _misfits(wanted: Mapping[str, Tensor], tensors: Mapping[str, Tensor]) -> list[str]:
    return [
        f"{name} {tuple(tensors[name].shape)} instead of {tuple(wanted[name].shape)}"
        for name in sorted(wanted.keys() & tensors.keys())
        if tensors[name].shape != wanted[name].shape
    ]


def _named(fault: str, names: list[str]) -> list[str]:
    if not names:
        return []
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return [f"{fault}: {', '.join(names[:MAX_NAMES])}{more}"]
