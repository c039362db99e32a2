"""Whether this version describes photos as the index does, checked with a reference photo."""

from __future__ import annotations

from dataclasses import asdict
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from zeroscd.errors import SettingsError
from zeroscd.fingerprint import versions
from zeroscd.images.read import read_photo
from zeroscd.retrieval.describe import describe
from zeroscd.retrieval.rerank import geometric_score
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Mapping

    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.retrieval.describe import Place

FORMAT = 1  # of the tables
# Settings that decide a photo's descriptors.
DESCRIPTOR_SETTINGS = ("encoder", "side_px", "layer", "precision")
REFERENCE_PHOTO = "before.jpg"
# Another processor or library version moves the descriptors by less, another network by far more.
MIN_COSINE, MIN_SCORE = 0.99, 0.8


def describe_reference(encoder: PatchEncoder) -> Place:
    """Describe the reference photo, which comes with the package."""
    content = files("zeroscd").joinpath("samples", REFERENCE_PHOTO).read_bytes()
    return describe(read_photo(content), encoder)


def about(settings: Settings) -> dict[str, Any]:
    """Return the metadata of an index, as plain values: format, settings, versions."""
    values = asdict(settings)
    return {
        "format": FORMAT,
        "settings": {name: values[name] for name in DESCRIPTOR_SETTINGS},
        "versions": versions(),
    }


def settings_from(metadata: Mapping[str, Any], *, wanted: Settings | None = None) -> Settings:
    """Return the settings that an index was built with.

    Args:
        metadata: What `about` returned when the index was made.
        wanted: Settings asked for; None = the index's own.

    Raises:
        SettingsError: The settings asked for differ from the index's own in what decides a
            descriptor, or the index has another format.
    """
    if metadata.get("format") != FORMAT:
        message = (
            f"the place index has format {metadata.get('format')}, this version reads {FORMAT}; "
            "build it again in another folder"
        )
        raise SettingsError(message)
    stored = metadata["settings"]
    for name in DESCRIPTOR_SETTINGS:
        asked = stored[name] if wanted is None else getattr(wanted, name)
        if asked != stored[name]:
            message = (
                f"the place index was built with {name} {stored[name]}, not {asked}; "
                f"ask with --set {name}={stored[name]}, or build another index"
            )
            raise SettingsError(message)
    return Settings().override(stored)


def check_compatibility(before: Place, today: Place, metadata: Mapping[str, Any]) -> None:
    """Compare the reference photo's descriptors with those stored when the index was made.

    Raises:
        SettingsError: They differ, so that photos described now cannot be found in the index.
    """
    same = before.vector.shape == today.vector.shape and len(before.patches) == len(today.patches)
    if same and float(before.vector @ today.vector) >= MIN_COSINE:
        sizes_hw = (before.size_hw, today.size_hw)
        if geometric_score(before.patches, today.patches, sizes_hw=sizes_hw).score >= MIN_SCORE:
            return
    version = metadata["versions"].get("zeroscd")
    message = (
        f"the place index was built by zeroscd {version}, whose encoder describes photos in "
        "another way than this one's; build it again in another folder"
    )
    raise SettingsError(message)
