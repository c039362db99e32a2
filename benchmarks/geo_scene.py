"""A made-up aerial pair whose truth is known: fields, roads, trees, houses, built and torn down.

Every window of it can be drawn alone, so that a pair of any size is written without being held in
memory. Light, colours and sensor noise differ between the two dates; the ground does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

CELL_PX = 512  # a field with its houses and trees; roads run between
ROAD_PX = 14
HOUSES, TREES = 14, 30  # of a cell
CHANGES = 2  # of a cell on average: houses that only one date shows
SIDES_PX = (24, 60)  # of a house
MARGIN_PX = 40  # of a cell that holds no middle of a house, so that most houses lie in one cell
ROOFS = ((150, 90, 75), (110, 105, 100), (175, 170, 165), (95, 70, 60), (130, 120, 140))
GROUNDS = ((96, 118, 74), (126, 122, 88), (142, 128, 104), (84, 104, 72), (120, 130, 96))
NOISE = 5.0  # grey levels, standard deviation
LIGHT = ((1.0, 1.0, 1.0), (0.86, 0.94, 1.02))  # gain of each colour, before and after
OFFSET = (0.0, 9.0)


@dataclass(frozen=True, slots=True)
class House:
    """A rectangle with a roof.

    Attributes:
        box_xywh: In pixels of the pair.
        roof: RGB.
        when: The dates that show it.
    """

    box_xywh: tuple[int, int, int, int]
    roof: tuple[int, int, int]
    when: Literal["both", "before", "after"] = "both"


@dataclass(frozen=True, slots=True)
class Scene:
    """A made-up pair.

    Attributes:
        size_hw: Height and width of both rasters.
        seed: Of everything that is drawn by lot.
        extra: Houses beside those by lot, such as one across a border of tiles.
        changes: Houses of a cell that only one date shows, on average.
    """

    size_hw: tuple[int, int]
    seed: int = 0
    extra: tuple[House, ...] = ()
    changes: float = CHANGES

    def draw(
        self, x: int, y: int, width: int, height: int, *, date: Literal["before", "after"]
    ) -> NDArray[np.uint8]:
        """Draw a window, (height, width, 3) uint8; windows that overlap agree."""
        at = 0 if date == "before" else 1
        found = np.zeros((height, width, 3), np.uint8)
        for row, col in self._cells(x, y, width, height):
            left, top = col * CELL_PX - x, row * CELL_PX - y
            cell = self._cell(row, col, at)
            x0, x1 = max(0, left), min(width, left + CELL_PX)
            y0, y1 = max(0, top), min(height, top + CELL_PX)
            found[y0:y1, x0:x1] = cell[y0 - top : y1 - top, x0 - left : x1 - left]
        return found

    def truth(self, x: int, y: int, width: int, height: int) -> NDArray[np.bool_]:
        """Mark what changed in a window, (height, width)."""
        found = np.zeros((height, width), bool)
        for house in self.changed(x, y, width, height):
            left, top, across, down = house.box_xywh
            rows = slice(max(0, top - y), max(0, top + down - y))
            found[rows, max(0, left - x) : max(0, left + across - x)] = True
        return found

    def changed(self, x: int, y: int, width: int, height: int) -> list[House]:
        """Return the houses that only one date shows, of all cells that a window touches."""
        near = (self._houses(*cell) for cell in self._cells(x, y, width, height))
        by_lot = [house for houses in near for house in houses]
        return [house for house in (*by_lot, *self.extra) if house.when != "both"]

    def _cells(self, x: int, y: int, width: int, height: int) -> Iterator[tuple[int, int]]:
        for row in range(y // CELL_PX, (y + height - 1) // CELL_PX + 1):
            for col in range(x // CELL_PX, (x + width - 1) // CELL_PX + 1):
                yield row, col

    def _houses(self, row: int, col: int) -> list[House]:
        lot = np.random.default_rng((self.seed, row, col, 1))
        houses: list[House] = []
        changed = lot.poisson(self.changes)
        for number in range(HOUSES):
            across, down = (int(side) for side in lot.integers(*SIDES_PX, 2))
            last = CELL_PX - MARGIN_PX
            left, top = (int(lot.integers(MARGIN_PX, last - side)) for side in (across, down))
            roof = ROOFS[int(lot.integers(len(ROOFS)))]
            once: Literal["before", "after"] = "after" if lot.integers(2) else "before"
            box = (col * CELL_PX + left, row * CELL_PX + top, across, down)
            if any(_touch(box, other.box_xywh) for other in (*houses, *self.extra)):
                continue
            houses.append(House(box, roof, once if number < changed else "both"))
        return houses

    def _cell(self, row: int, col: int, at: int) -> NDArray[np.uint8]:
        lot = np.random.default_rng((self.seed, row, col, 2))
        ground = np.array(GROUNDS[int(lot.integers(len(GROUNDS)))], np.float32)
        canvas = np.repeat(_texture(lot)[:, :, None], 3, axis=2) + ground
        tilt = int(lot.integers(0, 2))
        canvas += _furrows(lot, tilt)[:, :, None]
        canvas[:ROAD_PX], canvas[:, :ROAD_PX] = (
            np.float32(128) + 0.3 * (part - ground)
            for part in (canvas[:ROAD_PX], canvas[:, :ROAD_PX])
        )
        for x, y, radius in lot.integers(
            (ROAD_PX + 10, ROAD_PX + 10, 4), (500, 500, 10), (TREES, 3)
        ):
            cv2.circle(canvas, (int(x), int(y)), int(radius), (50, 74, 44), -1)
        self._build(canvas, row, col, at)
        noise = np.random.default_rng((self.seed, row, col, 3 + at))
        canvas = canvas * np.array(LIGHT[at], np.float32) + np.float32(OFFSET[at])
        canvas += noise.normal(0, NOISE, canvas.shape).astype(np.float32)
        return np.asarray(canvas.clip(0, 255), np.uint8)

    def _build(self, canvas: NDArray[np.float32], row: int, col: int, at: int) -> None:
        """Draw the houses of one date, with a shadow and a ridge each."""
        absent = "after" if at == 0 else "before"
        for house in (*self._houses(row, col), *self.extra):
            if house.when == absent:
                continue
            left, top, across, down = house.box_xywh
            x, y = left - col * CELL_PX, top - row * CELL_PX
            if x + across + 6 < 0 or y + down + 6 < 0 or x > CELL_PX or y > CELL_PX:
                continue
            roof = np.array(house.roof, np.float64)
            ends = (x + across - 1, y + down - 1)
            dark = tuple((roof * 0.8).tolist())
            cv2.rectangle(canvas, (x + 5, y + 5), (ends[0] + 5, ends[1] + 5), (45, 48, 50), -1)
            cv2.rectangle(canvas, (x, y), ends, tuple(roof.tolist()), -1)
            cv2.rectangle(canvas, (x, y + down // 2), ends, dark, -1)


def _touch(one: tuple[int, int, int, int], other: tuple[int, int, int, int]) -> bool:
    """Tell whether two boxes are less than a few pixels apart."""
    gap = 12
    apart_x = one[0] > other[0] + other[2] + gap or other[0] > one[0] + one[2] + gap
    apart_y = one[1] > other[1] + other[3] + gap or other[1] > one[1] + one[3] + gap
    return not (apart_x or apart_y)


def _texture(lot: np.random.Generator) -> NDArray[np.float32]:
    """Smooth noise of several widths, so that no place looks like another."""
    found = np.zeros((CELL_PX, CELL_PX), np.float32)
    for step, strength in ((64, 9.0), (24, 8.0), (8, 7.0)):
        count = CELL_PX // step + 2
        coarse = lot.normal(0, strength, (count, count)).astype(np.float32)
        found += cv2.resize(coarse, (CELL_PX, CELL_PX), interpolation=cv2.INTER_CUBIC)
    return found


def _furrows(lot: np.random.Generator, tilt: int) -> NDArray[np.float32]:
    phase = np.arange(CELL_PX, dtype=np.float32) * (2 * np.pi / float(lot.integers(14, 30)))
    wave = np.float32(5.0) * np.sin(phase)
    return np.broadcast_to(wave if tilt else wave[:, None], (CELL_PX, CELL_PX))
