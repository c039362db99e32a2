"""One call for one pair of photos."""

from __future__ import annotations

from typing import TYPE_CHECKING

from zeroscd.detector import Detector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.alignment.known import KnownGeometry
    from zeroscd.images.areas import AreaSource
    from zeroscd.images.read import PhotoSource
    from zeroscd.result import ChangeResult


def detect(  # noqa: PLR0913 - each says something else
    before: PhotoSource | Sequence[PhotoSource],
    after: PhotoSource | Sequence[PhotoSource],
    *,
    preset: str = "lite",
    device: str = "auto",
    ignore: AreaSource | None = None,
    ignore_before: AreaSource | None = None,
    roi: AreaSource | None = None,
    roi_before: AreaSource | None = None,
    ignore_all: AreaSource | None = None,
    t1_from_t0: KnownGeometry | None = None,
    labels: bool = False,
    ignore_classes: Sequence[str] = (),
    **settings: object,
) -> ChangeResult:
    """Find what changed between two photos of one place.

    Loads the models each time; for many pairs make a `Detector` once.

    Args:
        before: The t0 photo: a path, bytes, a PIL image or an (H, W, 3) uint8 RGB array; or a list
            of photos of the place, see `Detector.detect`.
        after: The t1 photo, or a list.
        preset: Name of a bundle of models and settings (`zeroscd.PRESETS`).
        device: "auto", "cpu", "cuda" or "mps".
        ignore: What does not count in the photo after; all of these as in `Detector.detect`.
        ignore_before: What does not count in the photo before.
        roi: Where to look only, in the photo after.
        roi_before: Where to look only, in the photo before.
        ignore_all: What does not count in any photo.
        t1_from_t0: The geometry of the photos, where it is known.
        labels: Whether a further network says what each region shows; this and the next as in
            `Detector.from_preset`.
        ignore_classes: What does not count, such as "person" and "vehicle".
        settings: Settings that differ from the preset's, by name: `tau=0.9`, `frame="t0"`.

    Raises:
        ImageError: A photo cannot be read.
        SettingsError: An unknown preset, setting or device.
        WeightsError: The preset's weights are missing or damaged.
    """
    detector = Detector.from_preset(
        preset, device=device, overrides=settings, labels=labels, ignore_classes=ignore_classes
    )
    return detector.detect(
        before,
        after,
        ignore=ignore,
        ignore_before=ignore_before,
        roi=roi,
        roi_before=roi_before,
        ignore_all=ignore_all,
        t1_from_t0=t1_from_t0,
    )
