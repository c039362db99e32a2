"""Rename the tensors of a checkpoint to the names of another implementation."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, TypeAlias

from zeroscd.errors import WeightsError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from torch import Tensor

Rules: TypeAlias = (
    "Sequence[tuple[str, str | None]]"  # pattern, replacement; None = drop the tensor
)


def renamed(tensors: Mapping[str, Tensor], rules: Rules, *, source: str) -> dict[str, Tensor]:
    r"""Rename tensors by regular expressions, each applied to the result of the one before.

    Raises:
        WeightsError: Two tensors would get the same name.

    Example:
        >>> sorted(renamed({"a.x": 1, "b": 2}, [(r"^a\.", "c."), (r"^b$", None)], source="demo"))
        ['c.x']
    """
    result: dict[str, Tensor] = {}
    for old, tensor in tensors.items():
        name = _new_name(old, rules)
        if name is None:
            continue
        if name in result:
            message = f"{source} has two tensors for {name}, the second is {old}"
            raise WeightsError(message)
        result[name] = tensor
    return result


def _new_name(name: str, rules: Rules) -> str | None:
    for pattern, replacement in rules:
        if replacement is None:
            if re.search(pattern, name):
                return None
        else:
            name = re.sub(pattern, replacement, name)
    return name


def split_in_three(
    tensors: Mapping[str, Tensor], *, joint: str, parts: tuple[str, str, str]
) -> dict[str, Tensor]:
    """Split joint query-key-value tensors into three, along their first axis.

    Args:
        tensors: By name.
        joint: The part of a name that marks a joint tensor, as ".qkv.".
        parts: Its replacements in the three new names.
    """
    result: dict[str, Tensor] = {}
    for name, tensor in tensors.items():
        if joint in name:
            thirds = tensor.chunk(3)
            result |= {
                name.replace(joint, part): third for part, third in zip(parts, thirds, strict=True)
            }
        else:
            result[name] = tensor
    return result
