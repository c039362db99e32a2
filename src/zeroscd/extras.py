"""The packages that not everyone has installed, by the extra that brings them."""

from __future__ import annotations

from importlib.util import find_spec

from zeroscd.errors import SettingsError

# extra -> the modules that it is for; those that bring their own words are not among them.
EXTRAS = {
    "geo": ("rasterio", "pyogrio"),
    "models": ("transformers",),
    "onnx": ("onnx", "onnxscript", "onnxruntime"),
    "places": ("lancedb",),
    "serve": ("fastapi", "uvicorn", "python_multipart", "prometheus_client"),
}


def require_extra(extra: str, *, by: str) -> None:
    """Check that the packages of an extra are installed, without importing them.

    Args:
        extra: A name of `EXTRAS`.
        by: What needs them, for the message.

    Raises:
        SettingsError: One is not installed.
    """
    missing = [name.replace("_", "-") for name in EXTRAS[extra] if find_spec(name) is None]
    if missing:
        message = f"{by} needs {', '.join(missing)}; run: pip install 'zeroscd[{extra}]'"
        raise SettingsError(message)
