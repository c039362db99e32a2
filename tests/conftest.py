"""Models without networks, scenes that are drawn, and the measuring data beside the checkout."""

from __future__ import annotations

import functools
import importlib.util
import shutil
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import cv2
import hypothesis
import numpy as np
import pytest

from zeroscd.images.grid import PatchGrid
from zeroscd.records import FeatureMap
from zeroscd.segments import Segment, Segments
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import ModuleType

    from zeroscd.arrays import Homography, Mask, Rgb

# The same examples every time, and no clock: machines are shared. To search with fresh ones:
# pytest --hypothesis-profile=search
hypothesis.settings.register_profile("suite", deadline=None, derandomize=True)
hypothesis.settings.register_profile("search", deadline=None, max_examples=1000)
hypothesis.settings.load_profile("suite")

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
PATCH_PX = 16
BLOCK_PX = PATCH_PX // 2  # of one colour in a drawn texture: a quarter of a patch
BIAS = 8.0  # keeps the descriptor of a mid-grey patch from vanishing
GREY = 127.5


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of measuring data; its photos may not be part of the project."""
    if not SHARED.is_dir():
        pytest.skip("the measuring data (shared/data beside the checkout) is not here")
    return SHARED


@pytest.fixture(scope="module")  # for a session, Playwright's event loop would run on under others
def browser() -> Iterator[Any]:
    """A Chromium without a window; needs Playwright and a Chromium on the PATH."""
    sync_api = pytest.importorskip(
        "playwright.sync_api", reason="the browser test needs Playwright"
    )
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("the browser test needs Chromium")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def load_module() -> Callable[[str, Path], ModuleType]:
    """Import a file that is in no package, such as a script, under a name; once a session."""
    return _load_module


@functools.cache
def _load_module(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up, and scripts import each other
    spec.loader.exec_module(module)
    return module


@dataclass(frozen=True)
class QuarterEncoder:
    """Describes a patch by the mean colours of its four quarters: light and exact, no network."""

    patch_px: int = PATCH_PX
    name: str = "toy"
    tau: float = 0.65

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        return [(self._describe(photo),) for photo in photos]

    def _describe(self, photo: Rgb) -> FeatureMap:
        rows, cols = (side // self.patch_px for side in photo.shape[:2])
        half = self.patch_px // 2
        blocks = photo.astype(np.float32).reshape(rows, 2, half, cols, 2, half, 3)
        means = blocks.mean(axis=(2, 5)).transpose(0, 2, 1, 3, 4).reshape(rows, cols, 12)
        biased = np.concatenate([means - GREY, np.full((rows, cols, 1), BIAS)], axis=2)
        unit = biased / np.linalg.norm(biased, axis=2, keepdims=True)
        return FeatureMap(
            descriptors=unit.astype(np.float32),
            grid=PatchGrid.covering(photo.shape[:2], size_hw=(rows, cols)),
            source="toy",
        )


@dataclass
class ScriptedSegmenter:
    """Answers with the outlines that were written down for a photo, and notes what was asked."""

    name: str = "scripted"
    script: dict[bytes, Sequence[Mask]] = field(default_factory=dict)
    asked: list[Mask | None] = field(default_factory=list)

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> ScriptedStudy:
        del features
        return ScriptedStudy(self, photo)


@dataclass
class ScriptedStudy:
    """A photo whose outlines are read from the script each time."""

    segmenter: ScriptedSegmenter
    photo: Rgb
    size_bytes: int = 0

    def segments(self, roi: Mask | None) -> Segments:
        self.segmenter.asked.append(roi)
        masks = self.segmenter.script[self.photo.tobytes()]
        outlines = (Segment.from_mask(mask) for mask in masks)
        found = tuple(outline for outline in outlines if outline is not None)
        return Segments(size_hw=self.photo.shape[:2], items=found)


@dataclass(frozen=True)
class SizeSegmenter:
    """Cuts photos of one size alike: only size and wanted place decide."""

    outlines_of: Callable[[tuple[int, int], Mask | None], tuple[Segment, ...]]
    name: str = "by size"

    def proposals(self, photo: Rgb, features: tuple[FeatureMap, ...]) -> SizeStudy:
        del features
        return SizeStudy(self.outlines_of, photo.shape[:2])


@dataclass(frozen=True)
class SizeStudy:
    """A photo of which only the size counts."""

    outlines_of: Callable[[tuple[int, int], Mask | None], tuple[Segment, ...]]
    size_hw: tuple[int, int]
    size_bytes: int = 0

    def segments(self, roi: Mask | None) -> Segments:
        return Segments(size_hw=self.size_hw, items=self.outlines_of(self.size_hw, roi))


@pytest.fixture(scope="session")
def cut_by_size() -> type[SizeSegmenter]:
    """Make a segmenter of a function of size and wanted place."""
    return SizeSegmenter


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Two drawn photos of one place, and everything that is true about them.

    `outlines_t0` and `outlines_t1` hold the changed things of their photo, each background tile,
    and the whole photo.
    """

    before: Rgb
    after: Rgb
    t1_from_t0: Homography
    removed_t0: Mask
    added_t1: Mask
    outlines_t0: tuple[Mask, ...]
    outlines_t1: tuple[Mask, ...]

    def segmenter(self) -> ScriptedSegmenter:
        """A segmenter that knows these photos."""
        return ScriptedSegmenter(
            script={
                self.before.tobytes(): self.outlines_t0,
                self.after.tobytes(): self.outlines_t1,
            }
        )

    def swapped(self) -> Scene:
        """The same place with time running backwards."""
        return Scene(
            before=self.after,
            after=self.before,
            t1_from_t0=np.asarray(np.linalg.inv(self.t1_from_t0), dtype=np.float64),
            removed_t0=self.added_t1,
            added_t1=self.removed_t0,
            outlines_t0=self.outlines_t1,
            outlines_t1=self.outlines_t0,
        )


Box = tuple[int, int, int, int]  # left, top, width, height in pixels


class DrawScene(Protocol):
    """Draws a scene; see `draw_scene`."""

    def __call__(
        self,
        t1_from_t0: Homography | None = None,
        *,
        removed: Sequence[Box] = (),
        added: Sequence[Box] = (),
        sizes_hw: tuple[tuple[int, int], tuple[int, int]] = ((192, 256), (192, 256)),
        smooth: bool = False,
        seed: int = 0,
    ) -> Scene: ...


@pytest.fixture(scope="session")
def draw_scene() -> DrawScene:
    """Draw a wall of coloured blocks twice, the second time moved by a homography.

    Removed things are painted on the photo before only, added things on the photo after only,
    boxes in pixels of their own photo. Smooth walls suit motions that are no whole patches.
    """
    return _draw_scene


def _draw_scene(
    t1_from_t0: Homography | None = None,
    *,
    removed: Sequence[Box] = (),
    added: Sequence[Box] = (),
    sizes_hw: tuple[tuple[int, int], tuple[int, int]] = ((192, 256), (192, 256)),
    smooth: bool = False,
    seed: int = 0,
) -> Scene:
    rng = np.random.default_rng(seed)
    moved: Homography = np.eye(3) if t1_from_t0 is None else t1_from_t0.astype(np.float64)
    size_t0_hw, size_t1_hw = sizes_hw
    margin = 2 * max(*size_t0_hw, *size_t1_hw)
    wall = texture((size_t0_hw[0] + 2 * margin, size_t0_hw[1] + 2 * margin), rng, smooth=smooth)
    wall_from_t0 = np.array([[1.0, 0, margin], [0, 1, margin], [0, 0, 1]])
    before = wall[margin : margin + size_t0_hw[0], margin : margin + size_t0_hw[1]].copy()
    after = cv2.warpPerspective(
        wall, moved @ np.linalg.inv(wall_from_t0), size_t1_hw[::-1], flags=cv2.INTER_LINEAR
    )
    things_t0, things_t1 = _paint(before, removed, rng), _paint(np.asarray(after), added, rng)
    return Scene(
        before=before,
        after=np.asarray(after, dtype=np.uint8),
        t1_from_t0=moved,
        removed_t0=_union(things_t0, size_t0_hw),
        added_t1=_union(things_t1, size_t1_hw),
        outlines_t0=(*things_t0, *_tiles(size_t0_hw), np.ones(size_t0_hw, dtype=bool)),
        outlines_t1=(*things_t1, *_tiles(size_t1_hw), np.ones(size_t1_hw, dtype=bool)),
    )


def texture(size_hw: tuple[int, int], rng: np.random.Generator, *, smooth: bool) -> Rgb:
    """Colour blocks; smooth ones are larger and run into each other."""
    block = 2 * PATCH_PX if smooth else BLOCK_PX
    rows, cols = (-(-side // block) for side in size_hw)
    colours = rng.integers(0, 256, (rows, cols, 3)).astype(np.uint8)
    kind = cv2.INTER_CUBIC if smooth else cv2.INTER_NEAREST
    grown = cv2.resize(colours, (cols * block, rows * block), interpolation=kind)
    return np.asarray(grown[: size_hw[0], : size_hw[1]], dtype=np.uint8)


def _paint(photo: Rgb, boxes: Sequence[Box], rng: np.random.Generator) -> list[Mask]:
    masks = []
    for left, top, width, height in boxes:
        window = (slice(top, top + height), slice(left, left + width))
        photo[window] = texture((height, width), rng, smooth=False)
        mask = np.zeros(photo.shape[:2], dtype=bool)
        mask[window] = True
        masks.append(mask)
    return masks


def _union(masks: Sequence[Mask], size_hw: tuple[int, int]) -> Mask:
    union = np.zeros(size_hw, dtype=bool)
    for mask in masks:
        union |= mask
    return union


def _tiles(size_hw: tuple[int, int]) -> list[Mask]:
    """Background outlines: the photo cut into tiles of eight by eight patches."""
    tiles = []
    side = 8 * PATCH_PX
    for top in range(0, size_hw[0], side):
        for left in range(0, size_hw[1], side):
            tile = np.zeros(size_hw, dtype=bool)
            tile[top : top + side, left : left + side] = True
            tiles.append(tile)
    return tiles


@pytest.fixture(scope="session")
def plain_settings() -> Settings:
    """Rules under which a drawn scene's truth is plain."""
    return Settings().override(
        {
            "threshold": "encoder",
            "search_radius": 0,
            "alpha": 0.6,
            "verify": "off",
            "kinds": "frame",
        }
    )


@pytest.fixture(scope="session")
def toy_encoder() -> QuarterEncoder:
    """An encoder without a network: equal patches are equal, unrelated ones about sqrt(2) apart."""
    return QuarterEncoder()


@pytest.fixture(scope="session")
def iou() -> Callable[[Mask, Mask], float]:
    """Intersection over union of two masks; two empty ones agree."""

    def compare(a: Mask, b: Mask) -> float:
        union = np.count_nonzero(a | b)
        return float(np.count_nonzero(a & b) / union) if union else 1.0

    return compare


@pytest.fixture(scope="session")
def unit_grid() -> Callable[..., np.ndarray]:
    """Make (rows, cols, d) random unit descriptors."""

    def make(rng: np.random.Generator, rows: int, cols: int, d: int) -> np.ndarray:
        raw = rng.normal(size=(rows, cols, d))
        unit = raw / np.linalg.norm(raw, axis=2, keepdims=True)
        return np.asarray(unit, dtype=np.float32)

    return make
