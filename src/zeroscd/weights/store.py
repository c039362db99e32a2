"""Where weight files are on this computer, and which of them are present."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from platformdirs import user_cache_path

from zeroscd.errors import WeightsError
from zeroscd.weights.catalogue import find

if TYPE_CHECKING:
    from collections.abc import Iterable

    from zeroscd.weights.catalogue import WeightFile

HOME_VARIABLE = "ZEROSCD_HOME"


def weights_folder() -> Path:
    """Return the folder of weight files, which need not exist.

    It is `weights` in the folder that ZEROSCD_HOME names, else in the user's cache folder.

    Raises:
        WeightsError: The variable names no folder.
    """
    home = os.environ.get(HOME_VARIABLE)
    try:
        root = Path(home).expanduser() if home else user_cache_path("zeroscd", appauthor=False)
    except RuntimeError as why:
        message = f"{HOME_VARIABLE}={home} names a user without a home; set it to a folder"
        raise WeightsError(message) from why
    return root / "weights"


def path_of(row: WeightFile) -> Path:
    """Return where the file is, or will be."""
    return weights_folder() / row.file


def is_present(row: WeightFile) -> bool:
    """Tell whether the file is there with its published length; its digest is not computed.

    Only verified files get their final name; `zeroscd models verify` computes digests again.
    """
    path = path_of(row)
    return path.is_file() and row.size_bytes in (None, path.stat().st_size)


def require(names: Iterable[str]) -> dict[str, Path]:
    """Return the paths of weight files that must be there.

    Raises:
        WeightsError: Some are missing; the message names every command that fetches them.
    """
    rows = [find(name) for name in names]
    missing = [row for row in rows if not is_present(row)]
    if missing:
        raise WeightsError(_missing_message(missing))
    return {row.name: path_of(row) for row in rows}


def _missing_message(missing: list[WeightFile]) -> str:
    direct = " ".join(row.name for row in missing if row.fetchable)
    commands = [f"`zeroscd models fetch {direct}`"] if direct else []
    commands += [f"`{row.fetch_command}`" for row in missing if not row.fetchable]
    notes = "".join(f" ({row.name}: {row.note})" for row in missing if row.note)
    names = ", ".join(f"{row.name}{_megabytes(row)}" for row in missing)
    return f"weights are missing: {names}; run {' and '.join(commands)}{notes}"


def _megabytes(row: WeightFile) -> str:
    return "" if row.size_bytes is None else f" ({row.size_bytes / 1e6:.0f} MB)"
