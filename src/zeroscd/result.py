"""What users hold: what changed between two photos, how to look at it, and how to save it."""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from zeroscd import records
from zeroscd.errors import OutputError
from zeroscd.export.changes import changes
from zeroscd.export.files import save_result
from zeroscd.export.names import photo_name
from zeroscd.export.overlay import draw_overlay
from zeroscd.export.report import render_report
from zeroscd.export.summary import summary
from zeroscd.export.supervision import detections
from zeroscd.records import Changes
from zeroscd.renamed import moved_names

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from matplotlib.axes import Axes
    from supervision import Detections

    from zeroscd.arrays import Rgb
    from zeroscd.records import Region

MAX_NAME = 60  # characters of a photo's name in the text of a result
FRAME_HEIGHT_PX = 720  # of the report in a notebook


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ChangeResult(Changes):
    """What changed between two photos; its attributes are those of `Changes`.

    Going through a result goes through its regions, most certain first.
    """

    def __repr__(self) -> str:
        """Say in two lines what was found, and between which photos."""
        height, width = self.mask.shape
        names = (
            photo_name(self, one, otherwise="array")[-MAX_NAME:]
            for one in (self.before, self.after)
        )
        aligned = "aligned" if isinstance(self.alignment, records.Alignment) else "not aligned"
        return (
            f"<ChangeResult: {summary(self)}\n"
            f" {' -> '.join(names)}, {width} x {height}, frame {self.frame}, "
            f"preset {self.preset}, {aligned}>"
        )

    def _repr_html_(self) -> str:
        """Return the report for a notebook, in a frame that reaches nothing outside of it."""
        return (
            f'<iframe sandbox="allow-scripts" title="{html.escape(summary(self))}" '
            f'style="width:100%;height:{FRAME_HEIGHT_PX}px;border:0" '
            f'srcdoc="{html.escape(render_report(self))}"></iframe>'
        )

    def __iter__(self) -> Iterator[Region]:
        """Go through the regions, most certain first."""
        return iter(self.regions)

    def overlay(self) -> Rgb:
        """Draw what changed on the frame's photo, with a legend below: (H + strip, W, 3) uint8."""
        return draw_overlay(self)

    def plot(self, axes: Axes | None = None) -> Axes:
        """Show the overlay with matplotlib.

        Args:
            axes: Where to draw; a new figure if None.

        Raises:
            OutputError: matplotlib is not installed.
        """
        if axes is None:
            axes = _new_axes()
        axes.imshow(self.overlay())
        axes.set_title(summary(self))
        axes.set_axis_off()
        return axes

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `changes.json` as plain values."""
        return changes(self)

    def to_supervision(self) -> Detections:
        """Return the regions that lie in the frame's photo for the package supervision.

        Returns:
            Boxes, masks, scores as confidence, class 0 for removed and 1 for added; the name of the
            class in `data["class_name"]`. Regions of the other kind are carried to the frame.

        Raises:
            OutputError: supervision is not installed.
        """
        return detections(self)

    def save(self, folder: str | Path, *, also: Iterable[str] = ()) -> None:
        """Write the mask, the pictures, `changes.json` and the report into a folder.

        Either all files appear or none: they are written elsewhere first. `zeroscd.load` reads
        them again.

        Args:
            folder: Where to; missing folders are made.
            also: Files for other tools to write beside them: "coco", "csv", "geojson" or
                "label-studio".

        Raises:
            SettingsError: An unknown file.
            OutputError: The folder cannot be written.
        """
        save_result(self, folder, also=also)


def _new_axes() -> Axes:
    try:
        from matplotlib import pyplot as plt  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        message = "plotting needs matplotlib; run: pip install 'zeroscd[figures]'"
        raise OutputError(message) from error
    return plt.figure(layout="constrained").add_subplot()


if not TYPE_CHECKING:  # or mypy would believe that every name exists
    __getattr__ = moved_names(
        __name__,
        {
            "Alignment": "zeroscd.records.Alignment",
            "NotAligned": "zeroscd.records.NotAligned",
            "Photo": "zeroscd.images.photo.Photo",
            "Region": "zeroscd.records.Region",
        },
    )
