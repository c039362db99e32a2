"""Does this program still describe photos as the index has them? A known photo is asked."""

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
DESCRIBING = ("encoder", "side_px", "layer", "precision")  # settings that decide a description
PHOTO = "before.jpg"
# Another processor or library moves a description by less, another network by far more.
MIN_COSINE, MIN_SCORE = 0.99, 0.8


def describe_reference(encoder: PatchEncoder) -> Place:
    """Describe the photo that comes with the package."""
    content = files("zeroscd").joinpath("samples", PHOTO).read_bytes()
    return describe(read_photo(content), encoder)


def about(settings: Settings) -> dict[str, Any]:
    """Return what an index remembers of how its photos are described, as plain values."""
    everything = asdict(settings)
    return {
        "format": FORMAT,
        "settings": {name: everything[name] for name in DESCRIBING},
        "versions": versions(),
    }


def settings_from(remembered: Mapping[str, Any], *, wanted: Settings | None = None) -> Settings:
    """Return the settings under which an index describes photos.

    Args:
        remembered: What `about` returned when the index was made.
        wanted: Settings that somebody asks for; None = whatever the index has.

    Raises:
        SettingsError: They would describe photos in another way, or the index has another format.
    """
    if remembered.get("format") != FORMAT:
        message = (
            f"the place index has format {remembered.get('format')}, this version reads {FORMAT}; "
            "build it again in another folder"
        )
        raise SettingsError(message)
    found = remembered["settings"]
    for name in DESCRIBING:
        asked = found[name] if wanted is None else getattr(wanted, name)
        if asked != found[name]:
            message = (
                f"the place index was built with {name} {found[name]}, not {asked}; "
                f"ask with --set {name}={found[name]}, or build another index"
            )
            raise SettingsError(message)
    return Settings().override(found)


def check_compatibility(before: Place, today: Place, remembered: Mapping[str, Any]) -> None:
    """Compare the known photo's description with the one made when the index was.

    Raises:
        SettingsError: They differ: this program's descriptions cannot be compared with the index.
    """
    same = before.vector.shape == today.vector.shape and len(before.patches) == len(today.patches)
    if same and float(before.vector @ today.vector) >= MIN_COSINE:
        sizes_hw = (before.size_hw, today.size_hw)
        if geometric_score(before.patches, today.patches, sizes_hw=sizes_hw).score >= MIN_SCORE:
            return
    version = remembered["versions"].get("zeroscd")
    message = (
        f"the place index was built by zeroscd {version}, whose encoder describes photos in "
        "another way than this one's; build it again in another folder"
    )
    raise SettingsError(message)
