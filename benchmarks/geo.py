"""A large made-up aerial pair through `zeroscd geo`: seconds, memory, seams, and what is found.

    python benchmarks/geo.py WORK -o OUT.json [--side 20000] [--tile 2048] [--shift 4.8 -3.6]

WORK gets the pair (3 bytes a pixel and date) and the results. The raster after says that it lies
`--shift` pixels from where it does; its light and noise are its own. Houses are built and torn down
by lot, and some stand across borders of tiles on purpose. The command runs in a process of its own,
whose peak memory is what counts. With `--tile 1024` a pixel is half a metre, with 2048 a quarter,
so that a tile shows as many houses. With `--crs N` the raster after is brought to EPSG:N, at a
resolution of its own. With `--renewed N` only N squares of it are new and the rest is a copy, as
in a mosaic that was updated in part; tiles that are equal cost little. The same arguments give the
same pair; `--written` takes it as it is in WORK.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np
import rasterio
from geo_scene import CELL_PX, House, Scene
from pair import commit
from rasterio.enums import Resampling
from rasterio.transform import Affine, from_origin
from rasterio.vrt import WarpedVRT
from rasterio.windows import Window

from zeroscd.bench import machine
from zeroscd.evaluation.metrics import count, pool
from zeroscd.geo.strips import CHANGED, UNKNOWN
from zeroscd.geo.tiling import Box, tiles
from zeroscd.output import write_json

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray
    from rasterio.io import DatasetReader

CRS, CORNER = "EPSG:32632", (500_000.0, 5_400_000.0)
TILE_M = 512  # on the ground
STRIP_PX = 512
ACROSS = 20  # corners of tiles where a house is put on the corner and on both borders beside it
HOUSE_WH, ASIDE_PX, ROOF = (52, 44), 300, (165, 90, 70)
NEW_CELLS = 4  # side of what is new in a raster that was updated in part
FOUND_SHARE = 0.5  # of a house that must be in the mask
AROUND_PX = 64  # of a house, where its polygon is looked for
KIB = 1024
# Of summary.json: nothing that names files.
SAID = (
    *("preset", "tile_px", "tiles", "tiles_skipped", "registration", "tau"),
    *("changes", "area_m2", "changed_fraction", "judged_fraction"),
)
# Threads that wait for each other on a busy machine count as work.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


class Looked(NamedTuple):
    """What the mask shows of a house that changed.

    Attributes:
        found: Most of it is in the mask.
        parts: Connected parts of the mask that touch it.
        offset_px: From its middle to that of the largest of them; None if there is none.
        across: It stands across a border of tiles.
    """

    found: bool
    parts: int
    offset_px: float | None
    across: bool


def main(arguments: Sequence[str]) -> None:
    """Write the pair, compare it, and write the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("work", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--side", type=int, default=20_000)
    parser.add_argument("--tile", type=int, choices=(1024, 2048), default=1024)
    parser.add_argument("--shift", type=float, nargs=2, default=(4.8, -3.6))
    parser.add_argument("--crs", type=int)
    parser.add_argument("--renewed", type=int)
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--written", action="store_true")
    given = parser.parse_args(arguments)
    scene = make_scene(given.side, given.tile, given.renewed)
    paths = given.work / "before.tif", given.work / "after.tif"
    if not given.written:
        given.work.mkdir(parents=True, exist_ok=True)
        write_pair(scene, paths, tuple(given.shift))
    if given.crs is not None:
        paths = paths[0], reproject(paths[1], f"EPSG:{given.crs}")
    print("written", flush=True)
    run = compare(paths, given.work / "out", tile_px=given.tile, settings=given.set)
    summary = json.loads((given.work / "out" / "summary.json").read_text())
    figures = {
        "schema": 1,
        "name": given.out.stem,
        "commit": commit(),
        "side_px": given.side,
        "shift_px": list(given.shift),
        "crs_after": given.crs or CRS,
        "renewed": given.renewed,
        "set": given.set,
        **run,
        **score(scene, given.work / "out" / "mask.tif", given.tile),
        "summary": {key: summary[key] for key in SAID},
        "machine": machine() | {"load_average": os.getloadavg()},
    }
    write_json(figures, given.out)
    print(json.dumps({k: v for k, v in figures.items() if k not in ("summary", "machine")}))


def make_scene(side_px: int, tile_px: int, renewed: int | None) -> Scene:
    """Return a scene with changed houses on borders between tiles, in what is new."""
    rows, scale = tiles(Box(0, 0, side_px, side_px), tile_px), tile_px // (2 * CELL_PX)
    new = None if renewed is None else squares(side_px, scale * CELL_PX, renewed)
    corners = [
        (tile.core.right, tile.core.bottom)
        for row in rows[:-1]
        for tile in row[:-1]
        if new is None or any(_well_inside(tile.core.right, tile.core.bottom, box) for box in new)
    ]
    chosen = corners[:: max(1, len(corners) // ACROSS)][:ACROSS]
    across, down = (scale * side for side in HOUSE_WH)
    aside = scale * ASIDE_PX
    middles = [(x + dx, y + dy) for x, y in chosen for dx, dy in ((0, -aside), (-aside, 0), (0, 0))]
    extra = tuple(
        House((x - across // 2, y - down // 2, across, down), ROOF, ("before", "after")[at % 2])
        for at, (x, y) in enumerate(middles)
    )
    return Scene((side_px, side_px), side_px, extra, scale=scale, renewed=new)


def squares(side_px: int, cell_px: int, number: int) -> tuple[Box, ...]:
    """Draw squares of some cells by lot."""
    wide = NEW_CELLS * cell_px
    lot, most = np.random.default_rng(side_px), (side_px - wide) // cell_px
    corners = cell_px * lot.integers(0, most + 1, (number, 2))
    return tuple(Box(x, y, x + wide, y + wide) for x, y in corners.tolist())


def _well_inside(x: int, y: int, box: Box) -> bool:
    far = ASIDE_PX + max(HOUSE_WH)
    return box.left + far < x < box.right - far and box.top + far < y < box.bottom - far


def write_pair(scene: Scene, paths: tuple[Path, Path], shift_px: tuple[float, float]) -> None:
    """Write both dates strip by strip; the later one's georeference is off."""
    height, width = scene.size_hw
    pixel_m = TILE_M / (2 * CELL_PX * scene.scale)
    own = from_origin(*CORNER, pixel_m, pixel_m)
    wrong = own * Affine.translation(*shift_px)
    profile = {"driver": "GTiff", "width": width, "height": height, "count": 3, "dtype": "uint8"}
    for path, transform, date in zip(paths, (own, wrong), ("before", "after"), strict=True):
        with rasterio.open(
            path, "w", crs=CRS, transform=transform, tiled=True, photometric="RGB", **profile
        ) as raster:
            for top in range(0, height, scene.cell_px):
                rows = min(scene.cell_px, height - top)
                pixels = scene.draw(Box(0, top, width, top + rows), date=date)
                raster.write(np.moveaxis(pixels, 2, 0), window=Window(0, top, width, rows))


def reproject(path: Path, crs: str) -> Path:
    """Copy a raster to another CRS, at GDAL's choice of resolution, with alpha."""
    target = path.with_name(f"after_{crs.partition(':')[2]}.tif")
    with (
        rasterio.open(path) as source,
        WarpedVRT(source, crs=crs, resampling=Resampling.bilinear, add_alpha=True) as warped,
        rasterio.open(target, "w", **{**warped.profile, "driver": "GTiff"}) as raster,
    ):
        for _, window in raster.block_windows(1):
            raster.write(warped.read(window=window), window=window)
    return target


def compare(
    paths: tuple[Path, Path], out: Path, *, tile_px: int, settings: Sequence[str]
) -> dict[str, Any]:
    """Run the command in a process of its own."""
    start = time.perf_counter()
    command = ["geo", *map(str, paths), "-o", str(out), "--tile", str(tile_px)]
    subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-m", "zeroscd", *command, *(f"--set={one}" for one in settings)],
        check=True,
        env={**os.environ, **ONE_THREAD},
    )
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "seconds": round(time.perf_counter() - start, 1),
        "processor_seconds": round(used.ru_utime + used.ru_stime, 1),
        "peak_bytes": used.ru_maxrss * KIB,
    }


def score(scene: Scene, path: Path, tile_px: int) -> dict[str, Any]:
    """Compare a mask with the truth: pixels, houses, houses across borders, and seams."""
    height, width = scene.size_hw
    rows = tiles(Box(0, 0, width, height), tile_px)
    with rasterio.open(path) as raster:
        counts = [
            count(mask == CHANGED, scene.truth(box), valid=mask != UNKNOWN)
            for box, mask in strips(raster)
        ]
        edges = edges_of(raster)
        houses = list(looked_at(scene, raster, tile_px))
    total = pool(counts)
    across = [one for one in houses if one.across]
    found = [one for one in houses if one.found]
    return {
        "pixels": {k: round(getattr(total, k), 4) for k in ("precision", "recall", "f1", "iou")},
        "houses": len(houses),
        "houses_found": len(found),
        "median_offset_px": round(float(np.median([one.offset_px for one in found])), 2),
        "across": len(across),
        "across_found": sum(one.found for one in across),
        "across_in_one_polygon": sum(one.found and one.parts == 1 for one in across),
        "seams": {
            **seams(edges, [{*row[0].core[1::2], *row[0].box[1::2]} for row in rows], 0),
            **seams(edges, [{*tile.core[::2], *tile.box[::2]} for tile in rows[0]], 1),
        },
    }


def strips(raster: DatasetReader) -> Iterator[tuple[Box, NDArray[np.uint8]]]:
    """Read a mask from top to bottom."""
    for top in range(0, raster.height, STRIP_PX):
        box = Box(0, top, raster.width, min(raster.height, top + STRIP_PX))
        yield box, raster.read(1, window=Window(0, top, raster.width, box.size_hw[0]))


def edges_of(raster: DatasetReader) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Count how often the mask changes below each row, and to the right of each column."""
    down, right = np.zeros(raster.height, np.intp), np.zeros(raster.width, np.intp)
    above = np.zeros((1, raster.width), bool)
    for box, mask in strips(raster):
        changed = np.concatenate([above, mask == CHANGED])
        steps = np.count_nonzero(changed[1:] != changed[:-1], axis=1)
        down[np.arange(box.top, box.bottom) - 1] += steps  # the first is above all: the last
        right[:-1] += np.count_nonzero(changed[1:, 1:] != changed[1:, :-1], axis=0)
        above = changed[-1:]
    return down[:-1], right[:-1]


def seams(
    edges: tuple[NDArray[np.intp], NDArray[np.intp]], lines: Sequence[set[int]], axis: int
) -> dict[str, float]:
    """Return how often the mask ends where tiles or their cores do, and how often elsewhere.

    Both for each pixel along a line; a seam would make the first larger.
    """
    length, name = len(edges[1 - axis]) + 1, ("rows", "columns")[axis]
    every = sorted(set().union(*lines) - {0, len(edges[axis]) + 1})
    at = edges[axis][np.array(every, dtype=np.intp) - 1] / length
    return {
        f"{name}_at_borders": round(float(at.mean()), 5),
        f"{name}_everywhere": round(float(edges[axis].mean() / length), 5),
    }


def looked_at(scene: Scene, raster: DatasetReader, tile_px: int) -> Iterator[Looked]:
    """Look for each house that changed and lies wholly in the raster."""
    whole = Box(0, 0, raster.width, raster.height)
    rows = tiles(whole, tile_px)
    lines_x = [tile.core.right for tile in rows[0][:-1]]
    lines_y = [row[0].core.bottom for row in rows[:-1]]
    for left, top, across, down in sorted({one.box_xywh for one in scene.changed(whole)}):
        right, bottom = left + across, top + down
        if right <= whole.right and bottom <= whole.bottom:
            is_across = any(left < x < right for x in lines_x) or any(
                top < y < bottom for y in lines_y
            )
            yield _look(raster, Box(left, top, right, bottom), across=is_across)


def _look(raster: DatasetReader, house: Box, *, across: bool) -> Looked:
    x, y = max(0, house.left - AROUND_PX), max(0, house.top - AROUND_PX)
    around = Box(
        x,
        y,
        min(raster.width, house.right + AROUND_PX),
        min(raster.height, house.bottom + AROUND_PX),
    )
    height, width = around.size_hw
    mask = raster.read(1, window=Window(x, y, width, height)) == CHANGED
    _, labels, _, middles = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    inside = labels[house.within(around)]
    parts, sizes = np.unique(inside[inside > 0], return_counts=True)
    own = np.array([(house.left + house.right - 1) / 2 - x, (house.top + house.bottom - 1) / 2 - y])
    offset = np.hypot(*(middles[parts[sizes.argmax()]] - own)) if len(parts) else None
    return Looked(
        bool((inside > 0).mean() >= FOUND_SHARE),
        len(parts),
        None if offset is None else float(offset),
        across,
    )


if __name__ == "__main__":
    main(sys.argv[1:])
