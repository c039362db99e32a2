"""Import the transformers package, or explain in one line why that fails."""

from __future__ import annotations

import importlib
from importlib.util import find_spec
from typing import TYPE_CHECKING

from zeroscd.errors import SettingsError
from zeroscd.extras import require_extra

if TYPE_CHECKING:
    from types import ModuleType


def import_transformers() -> ModuleType:
    """Import transformers.

    Raises:
        SettingsError: It is not installed, or an installed torchvision breaks it (one that was
            built for another torch).
    """
    require_extra("models", by="this model")
    if find_spec("torchvision") is not None:
        _check_torchvision()
    return importlib.import_module("transformers")


def _check_torchvision() -> None:
    try:
        importlib.import_module("torchvision")
    except (ImportError, RuntimeError, OSError, AttributeError) as why:
        message = (
            f"the installed torchvision cannot be imported ({str(why).splitlines()[0]}), and "
            "transformers fails with it; run: pip uninstall torchvision (zeroscd needs none)"
        )
        raise SettingsError(message) from why
