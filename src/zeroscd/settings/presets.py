"""Bundles of models and settings by name."""

from __future__ import annotations

from zeroscd.errors import SettingsError
from zeroscd.settings.tree import PAPER_RULES, ChangeSettings, RefineSettings, Settings
from zeroscd.text import unknown


def _literally(encoder: str, *, side_px: int) -> Settings:
    """Combine an encoder with SAM ViT-H and the paper's rules."""
    models = Settings(encoder=encoder, segmenter="sam-vit-h", side_px=side_px)
    return models.override(PAPER_RULES)


PRESETS: dict[str, Settings] = {
    "lite": Settings(
        judge="likely",
        change=ChangeSettings(threshold="pair", tau_share=0.475, search_radius=2),
        refine=RefineSettings(
            alpha=0.75,
            verify="off",
            gap_width=0.04,
            min_width=0.3,
            min_peak=0.8,
            kinds="novelty",
            min_area_px=150,
        ),
    ),
    # The paper's literal reading; VL-CMU-CD at its own size, DINOv2 as it is trained.
    "paper": _literally("placeformer", side_px=512),
    "dinov2-s": _literally("dinov2-s", side_px=518),
    "dinov2-b": _literally("dinov2-b", side_px=518),
    "robust": Settings(encoder="dinov2-b", segmenter="sam2.1-base", side_px=518),
    # SAM 2.1 sees any photo as a square of 1024 x 1024, whatever side_px says.
    "single": Settings(
        encoder="sam2.1-base",
        segmenter="sam2.1-base",
        side_px=1024,
        change=ChangeSettings(threshold="pair"),
    ),
}


def preset(name: str) -> Settings:
    """Return the settings of a preset.

    Raises:
        SettingsError: No preset has this name.
    """
    if name not in PRESETS:
        raise SettingsError(unknown("preset", name, PRESETS))
    return PRESETS[name]
