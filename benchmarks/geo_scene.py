"""A made-up aerial pair whose truth is known: fields, roads, trees, houses, built and torn down.

Every window of it can be drawn alone, so that a pair of any size is written without being held in
memory. Light, colours and sensor noise differ between the two dates; the ground does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from zeroscd.geo.tiling import Box

# Lengths are pixels of half a metre; a scene of finer pixels has as many times more of them.
CELL_PX = 512  # a field with its houses and trees; roads run between
ROAD_PX = 14
HOUSES, TREES = 14, 30  # of a cell
CHANGES = 2  # of a cell on average: houses that only one date shows
SIDES_PX = (24, 60)  # of a house
MARGIN_PX = 40  # of a cell that holds no middle of a house, so that most houses lie in one cell
ROOFS = ((150, 90, 75), (110, 105, 100), (175, 170, 165), (95, 70, 60), (130, 120, 140))
GROUNDS = ((96, 118, 74), (126, 122, 88), (142, 128, 104), (84, 104, 72), (120, 130, 96))
TREE_PX = (4, 10)  # radius
SHADOW_PX = 5
ASPHALT, LEAVES, SHADE = 128, (50, 74, 44), (45, 48, 50)
DARK = 0.8  # the side of a roof that turns away from the sun
GAP_PX = 12  # between houses, at least
DATES = ("before", "after")
NOISE = 5.0  # grey levels, standard deviation
LIGHT = ((1.0, 1.0, 1.0), (0.86, 0.94, 1.02))  # gain of each colour, before and after
OFFSET = (0.0, 9.0)


@dataclass(frozen=True, slots=True)
class House:
    """A rectangle with a roof.

    Attributes:
        box_xywh: In pixels of the pair.
        roof: RGB.
        when: "before", "after" or "both".
    """

    box_xywh: tuple[int, int, int, int]
    roof: tuple[int, int, int]
    when: str = "both"


@dataclass(frozen=True, slots=True)
class Scene:
    """A made-up pair.

    Attributes:
        size_hw: Height and width of both rasters.
        seed: Of everything that is drawn by lot.
        extra: Houses beside those by lot, such as one across a border of tiles.
        changes: Houses of a cell that only one date shows, on average.
        scale: How many times finer than half a metre a pixel is.
        renewed: What was flown again; elsewhere the raster after is a copy. None for all of it.
    """

    size_hw: tuple[int, int]
    seed: int = 0
    extra: tuple[House, ...] = ()
    changes: float = CHANGES
    scale: int = 1
    renewed: tuple[Box, ...] | None = None

    @property
    def cell_px(self) -> int:
        """Side of a cell."""
        return self.scale * CELL_PX

    def draw(self, box: Box, *, date: str) -> NDArray[np.uint8]:
        """Draw a window, (height, width, 3) uint8; windows that overlap agree.

        Args:
            box: In pixels of the pair.
            date: "before" or "after".
        """
        at = DATES.index(date)
        height, width = box.size_hw
        found = np.zeros((height, width, 3), np.uint8)
        for row, col in self._cells(box):
            left, top = col * self.cell_px - box.left, row * self.cell_px - box.top
            cell = self._cell(row, col, at)
            x0, x1 = max(0, left), min(width, left + self.cell_px)
            y0, y1 = max(0, top), min(height, top + self.cell_px)
            found[y0:y1, x0:x1] = cell[y0 - top : y1 - top, x0 - left : x1 - left]
        return found

    def truth(self, box: Box) -> NDArray[np.bool_]:
        """Mark what changed in a window, (height, width)."""
        found = np.zeros(box.size_hw, bool)
        for house in self.changed(box):
            left, top, across, down = house.box_xywh
            rows = slice(max(0, top - box.top), max(0, top + down - box.top))
            found[rows, max(0, left - box.left) : max(0, left + across - box.left)] = True
        return found

    def changed(self, box: Box) -> list[House]:
        """Return the houses that only one date shows, of all cells that a window touches."""
        near = (self._houses(*cell) for cell in self._cells(box))
        by_lot = [house for houses in near for house in houses]
        return [house for house in (*by_lot, *self.extra) if house.when != "both"]

    def _cells(self, box: Box) -> Iterator[tuple[int, int]]:
        for row in range(box.top // self.cell_px, (box.bottom - 1) // self.cell_px + 1):
            for col in range(box.left // self.cell_px, (box.right - 1) // self.cell_px + 1):
                yield row, col

    def _is_renewed(self, row: int, col: int) -> bool:
        x, y = col * self.cell_px, row * self.cell_px
        return self.renewed is None or any(
            box.left <= x < box.right and box.top <= y < box.bottom for box in self.renewed
        )

    def _houses(self, row: int, col: int) -> list[House]:
        lot = np.random.default_rng((self.seed, row, col, 1))
        houses: list[House] = []
        changed = lot.poisson(self.changes) if self._is_renewed(row, col) else 0
        for number in range(HOUSES):
            across, down = (self.scale * int(side) for side in lot.integers(*SIDES_PX, 2))
            margin, last = self.scale * MARGIN_PX, self.cell_px - self.scale * MARGIN_PX
            left, top = (int(lot.integers(margin, last - side)) for side in (across, down))
            roof = ROOFS[int(lot.integers(len(ROOFS)))]
            once = DATES[int(lot.integers(2))]
            box = (col * self.cell_px + left, row * self.cell_px + top, across, down)
            if any(_touch(box, other.box_xywh) for other in (*houses, *self.extra)):
                continue
            houses.append(House(box, roof, once if number < changed else "both"))
        return houses

    def _cell(self, row: int, col: int, at: int) -> NDArray[np.uint8]:
        lot = np.random.default_rng((self.seed, row, col, 2))
        ground = np.array(GROUNDS[int(lot.integers(len(GROUNDS)))], np.float32)
        canvas = np.repeat(_texture(lot, self.cell_px)[:, :, None], 3, axis=2) + ground
        canvas += _furrows(lot, self.cell_px)[:, :, None]
        road = self.scale * ROAD_PX
        canvas[:road], canvas[:, :road] = (
            np.float32(ASPHALT) + 0.3 * (part - ground)
            for part in (canvas[:road], canvas[:, :road])
        )
        last = CELL_PX - 2 * TREE_PX[1]
        low, high = (2 * ROAD_PX, 2 * ROAD_PX, TREE_PX[0]), (last, last, TREE_PX[1])
        for x, y, radius in self.scale * lot.integers(low, high, (TREES, 3)):
            cv2.circle(canvas, (int(x), int(y)), int(radius), LEAVES, -1)
        self._build(canvas, row, col, at)
        at *= self._is_renewed(row, col)
        noise = np.random.default_rng((self.seed, row, col, 3 + at))
        canvas = canvas * np.array(LIGHT[at], np.float32) + np.float32(OFFSET[at])
        canvas += NOISE * noise.standard_normal(canvas.shape, np.float32)
        return np.asarray(canvas.clip(0, 255), np.uint8)

    def _build(self, canvas: NDArray[np.float32], row: int, col: int, at: int) -> None:
        """Draw the houses of one date, with a shadow and a ridge each."""
        absent = DATES[1 - at]
        for house in (*self._houses(row, col), *self.extra):
            left, top, across, down = house.box_xywh
            x, y = left - col * self.cell_px, top - row * self.cell_px
            last = self.cell_px
            near = -across < x + 2 * SHADOW_PX and -down < y + 2 * SHADOW_PX
            if house.when == absent or not near or x > last or y > last:
                continue
            roof, fall = np.array(house.roof, np.float64), self.scale * SHADOW_PX
            end = (x + across - 1, y + down - 1)
            cv2.rectangle(canvas, (x + fall, y + fall), (end[0] + fall, end[1] + fall), SHADE, -1)
            cv2.rectangle(canvas, (x, y), end, tuple(roof.tolist()), -1)
            cv2.rectangle(canvas, (x, y + down // 2), end, tuple((DARK * roof).tolist()), -1)


def _touch(one: tuple[int, int, int, int], other: tuple[int, int, int, int]) -> bool:
    """Tell whether two boxes are less than a gap apart."""
    apart_x = max(one[0] - other[0] - other[2], other[0] - one[0] - one[2]) > GAP_PX
    apart_y = max(one[1] - other[1] - other[3], other[1] - one[1] - one[3]) > GAP_PX
    return not (apart_x or apart_y)


def _texture(lot: np.random.Generator, side_px: int) -> NDArray[np.float32]:
    """Smooth noise of several widths, so that no place looks like another."""
    found = np.zeros((side_px, side_px), np.float32)
    for cells, strength in ((10, 9.0), (23, 8.0), (66, 7.0)):
        coarse = lot.normal(0, strength, (cells, cells)).astype(np.float32)
        found += cv2.resize(coarse, (side_px, side_px), interpolation=cv2.INTER_CUBIC)
    return found


def _furrows(lot: np.random.Generator, side_px: int) -> NDArray[np.float32]:
    along = lot.integers(2)
    phase = np.arange(side_px, dtype=np.float32) * np.float32(
        2 * np.pi * lot.integers(17, 36) / side_px
    )
    wave = np.float32(5.0) * np.sin(phase)
    return np.broadcast_to(wave if along else wave[:, None], (side_px, side_px))
