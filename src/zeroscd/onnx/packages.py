"""What writes and runs ONNX files, which not everyone has installed."""

from __future__ import annotations

from importlib.util import find_spec

from zeroscd.errors import SettingsError

PACKAGES = ("onnx", "onnxscript", "onnxruntime")


def require_packages() -> None:
    """Check that all are installed, without importing them.

    Raises:
        SettingsError: One is not.
    """
    missing = [name for name in PACKAGES if find_spec(name) is None]
    if missing:
        message = f"export-onnx needs {', '.join(missing)}; run: pip install 'zeroscd[onnx]'"
        raise SettingsError(message)
