"""What a reviewer said about proposals: read from an export of the page."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias, get_args

from zeroscd.errors import DatasetError
from zeroscd.text import one_line, shown

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Verdict: TypeAlias = Literal["accepted", "rejected"]
REMEDY = "give a file that the page of `zeroscd refine-masks` exported"


class Decision(NamedTuple):
    """What was said about one proposal.

    Attributes:
        pair: Name of the pair.
        proposal: Digest of the proposed outline: said about this one, it holds for no other.
        review: Whether the outline, or what was drawn, is right.
    """

    pair: str
    proposal: str
    review: Verdict


def read_decisions(path: Path) -> tuple[Decision, ...]:
    """Read the reviewed proposals of an export; those without a review are left out.

    Raises:
        DatasetError: The file cannot be read, or is no such export.
    """
    name = one_line(str(path))
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
        blobs = [one for one in content["blobs"] if one["review"] is not None]
        return tuple(_decision(one) for one in blobs)
    except OSError as error:
        message = f"cannot read {name}: {error.strerror or error}; {REMEDY}"
    except (ValueError, RecursionError, KeyError, TypeError) as error:
        message = f"cannot read {name}: it holds no reviewed outlines ({_why(error)}); {REMEDY}"
    raise DatasetError(message)


def _decision(values: Mapping[str, Any]) -> Decision:
    if values["review"] not in get_args(Verdict):
        message = f"{shown(values['review'])} is no review"
        raise ValueError(message)
    return Decision(str(values["pair"]), str(values["proposal"]), values["review"])


def _why(error: Exception) -> str:
    return f"there is no {error}" if isinstance(error, KeyError) else one_line(str(error))
