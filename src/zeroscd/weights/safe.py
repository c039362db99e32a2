"""Read tensors from a weight file without executing anything in it."""

from __future__ import annotations

import pickle
import re
import struct
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from zeroscd.errors import WeightsError
from zeroscd.weights.pickles import MOST, largest_size_in
from zeroscd.weights.verify import stand_in_of

if TYPE_CHECKING:
    from pathlib import Path

    from torch import Tensor

# What torch may raise on files that are truncated, altered or something else.
DAMAGED = (
    RuntimeError,
    EOFError,
    OSError,
    ValueError,
    LookupError,
    AssertionError,
    TypeError,
    AttributeError,
    MemoryError,
    struct.error,
    zipfile.BadZipFile,
)
WRAPPERS = ("model_state_dict", "state_dict", "model")  # where training scripts put the tensors

# Training scripts save their best scores beside the weights, often as NumPy numbers, which are safe
# to unpickle; NumPy 1 and 2 have two names for the same functions.
_SCALAR, _RECONSTRUCT = np.float64(0).__reduce__()[0], np.zeros(0).__reduce__()[0]
_NUMPY: list[Any] = [
    np.ndarray,
    np.dtype,
    *(type(np.dtype(code)) for code in "?bBhHiIlLqQefd"),
    *((_SCALAR, f"numpy.{core}.multiarray.scalar") for core in ("core", "_core")),
    *((_RECONSTRUCT, f"numpy.{core}.multiarray._reconstruct") for core in ("core", "_core")),
]


def read_tensors(path: Path) -> dict[str, Tensor]:
    """Read the named tensors of a checkpoint: safetensors, or a PyTorch file of data only.

    A dictionary around the tensors (`model_state_dict`, `state_dict`, `model`) is unwrapped.

    Raises:
        WeightsError: The file is damaged, carries anything but data, or holds no named tensors.
    """
    if stand_in := stand_in_of(path):
        message = f"{path} {stand_in}"
        raise WeightsError(message)
    loaded = _read_safetensors(path) if _is_safetensors(path) else _read_pytorch(path)
    for wrapper in WRAPPERS:
        if isinstance(loaded, dict) and isinstance(loaded.get(wrapper), dict):
            loaded = loaded[wrapper]
    if not isinstance(loaded, dict) or not loaded or not all(map(torch.is_tensor, loaded.values())):
        message = f"{path} holds no table of named tensors; it is not a checkpoint of weights"
        raise WeightsError(message)
    return {str(key): value for key, value in loaded.items()}


def _is_safetensors(path: Path) -> bool:
    """Recognise the format by content: eight bytes of length, then JSON."""
    with path.open("rb") as source:
        return source.read(9)[8:] == b"{"


def _read_safetensors(path: Path) -> dict[str, Tensor]:
    try:
        from safetensors import SafetensorError  # noqa: PLC0415 - an extra, only this needs it
        from safetensors.torch import load_file  # noqa: PLC0415
    except ModuleNotFoundError as why:
        message = f"{path} is a safetensors file; run: pip install 'zeroscd[models]'"
        raise WeightsError(message) from why
    try:
        return load_file(path)
    except SafetensorError as why:
        message = f"{path} is damaged ({why})"
        raise WeightsError(message) from why


def _read_pytorch(path: Path) -> Any:  # noqa: ANN401 - whatever data the file holds
    size = largest_size_in(path)
    if size > MOST:
        message = f"{path} is refused: it asks for {size} numbers at once, which no checkpoint has"
        raise WeightsError(message)
    try:
        with torch.serialization.safe_globals(_NUMPY):
            mapped = zipfile.is_zipfile(path)  # the old format cannot be mapped
            return torch.load(path, map_location="cpu", weights_only=True, mmap=mapped)
    except pickle.UnpicklingError as why:
        found = re.search(r"GLOBAL (\S+)", str(why))
        what = f"it names {found[1]}" if found else "not a file of data only"
        message = f"{path} is refused: {what}; weights must be tensors, nothing that runs"
        raise WeightsError(message) from why
    except DAMAGED as why:
        message = f"{path} is damaged or not a weight file ({str(why)[:120].split(chr(10))[0]})"
        raise WeightsError(message) from why
