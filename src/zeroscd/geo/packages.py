"""What reads rasters and writes layers, which not everyone has installed."""

from __future__ import annotations

from importlib.util import find_spec

from zeroscd.errors import SettingsError

PACKAGES = ("rasterio", "pyogrio")


def require_packages() -> None:
    """Check that all are installed, without importing them.

    Raises:
        SettingsError: One is not.
    """
    missing = [name for name in PACKAGES if find_spec(name) is None]
    if missing:
        message = f"georeferenced pairs need {', '.join(missing)}; run: pip install 'zeroscd[geo]'"
        raise SettingsError(message)
