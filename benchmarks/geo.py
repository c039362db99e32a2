"""A large made-up aerial pair through `zeroscd geo`: seconds, memory, seams, and what is found.

    python benchmarks/geo.py WORK -o OUT.json [--side 20000] [--shift 4.8 -3.6] [--set KEY=VALUE]

WORK gets the pair (3 bytes a pixel and date) and the results. The raster after says that it lies
`--shift` pixels from where it does; its light and noise are its own. Houses are built and torn down
by lot, and some stand across borders of tiles on purpose. The command runs in a process of its own,
whose peak memory is what counts. With `--crs N` the raster after is then brought to EPSG:N, at a
resolution of its own. The same arguments give the same pair.
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
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import rasterio
from geo_scene import House, Scene
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

CRS, PIXEL_M, CORNER = "EPSG:32632", 0.5, (500_000.0, 5_400_000.0)
STRIP_PX = 512
TILE_PX = 1024  # the command's own default
ACROSS = 60  # houses that stand across a border of tiles, at most
FOUND_SHARE = 0.5  # of a house that must be in the mask
AROUND_PX = 64  # of a house, where its polygon is looked for
KIB = 1024
# Threads that wait for each other on a busy machine count as work.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def main(arguments: Sequence[str]) -> None:
    """Write the pair, compare it, and write the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("work", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--side", type=int, default=20_000)
    parser.add_argument("--shift", type=float, nargs=2, default=(4.8, -3.6))
    parser.add_argument("--crs", type=int)
    parser.add_argument("--set", action="append", default=[])
    given = parser.parse_args(arguments)
    scene = make_scene(given.side)
    paths = write_pair(scene, given.work, tuple(given.shift))
    if given.crs is not None:
        paths = paths[0], reproject(paths[1], f"EPSG:{given.crs}")
    print("written", flush=True)
    run = compare(paths, given.work / "out", given.set)
    summary = json.loads((given.work / "out" / "summary.json").read_text())
    figures = {
        "schema": 1,
        "name": given.out.stem,
        "commit": commit(),
        "side_px": given.side,
        "shift_px": list(given.shift),
        "crs_after": given.crs,
        "set": given.set,
        **run,
        "summary": {k: v for k, v in summary.items() if k not in ("settings", "versions")},
        **score(scene, given.work / "out" / "mask.tif"),
        "machine": machine() | {"load_average": os.getloadavg()},
    }
    write_json(figures, given.out)
    print(json.dumps({k: v for k, v in figures.items() if k not in ("summary", "machine")}))


def make_scene(side_px: int) -> Scene:
    """Return a scene with changed houses in the middle of borders between tiles."""
    rows = tiles(Box(0, 0, side_px, side_px), TILE_PX)
    corners = [(tile.core.right, tile.core.bottom) for row in rows[:-1] for tile in row[:-1]]
    chosen = corners[:: max(1, len(corners) // (ACROSS // 3))][: ACROSS // 3]
    middles = [(x + dx, y + dy) for x, y in chosen for dx, dy in ((0, -300), (-300, 0), (0, 0))]
    extra = tuple(
        House((x - 26, y - 22, 52, 44), (165, 90, 70), "after" if at % 2 else "before")
        for at, (x, y) in enumerate(middles)
    )
    return Scene((side_px, side_px), seed=side_px, extra=extra)


def write_pair(scene: Scene, work: Path, shift_px: tuple[float, float]) -> tuple[Path, Path]:
    """Write both dates strip by strip; the later one's georeference is off."""
    work.mkdir(parents=True, exist_ok=True)
    height, width = scene.size_hw
    own = from_origin(*CORNER, PIXEL_M, PIXEL_M)
    # What lies at pixel p says that it lies at p less the shift, so that it is found at p + shift.
    wrong = own * Affine.translation(-shift_px[0], -shift_px[1])
    paths = work / "before.tif", work / "after.tif"
    profile = {"driver": "GTiff", "width": width, "height": height, "count": 3, "dtype": "uint8"}
    for path, transform in zip(paths, (own, wrong), strict=True):
        with rasterio.open(
            path, "w", crs=CRS, transform=transform, tiled=True, photometric="RGB", **profile
        ) as raster:
            for top in range(0, height, STRIP_PX):
                rows = min(STRIP_PX, height - top)
                date: Any = path.stem
                pixels = scene.draw(0, top, width, rows, date=date)
                raster.write(np.moveaxis(pixels, 2, 0), window=Window(0, top, width, rows))
    return paths


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


def compare(paths: tuple[Path, Path], out: Path, settings: Sequence[str]) -> dict[str, Any]:
    """Run the command in a process of its own."""
    start = time.perf_counter()
    options = [word for one in settings for word in ("--set", one)]
    subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-m", "zeroscd", "geo", *map(str, paths), "-o", str(out), *options],
        check=True,
        env={**os.environ, **ONE_THREAD},
    )
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "seconds": round(time.perf_counter() - start, 1),
        "processor_seconds": round(used.ru_utime + used.ru_stime, 1),
        "peak_bytes": used.ru_maxrss * KIB,
    }


def score(scene: Scene, path: Path) -> dict[str, Any]:
    """Compare a mask with the truth: pixels, houses, houses across borders, and seams."""
    height, width = scene.size_hw
    with rasterio.open(path) as raster:
        counts, edges_x, edges_y = [], np.zeros(width - 1, int), np.zeros(height - 1, int)
        last = None
        for top in range(0, height, STRIP_PX):
            rows = min(STRIP_PX, height - top)
            mask = raster.read(1, window=Window(0, top, width, rows))
            truth = scene.truth(0, top, width, rows)
            counts.append(count(mask == CHANGED, truth, valid=mask != UNKNOWN))
            changed = mask == CHANGED if last is None else np.concatenate([last, mask == CHANGED])
            edges_x += (changed[-rows:, 1:] != changed[-rows:, :-1]).sum(axis=0)
            steps = (changed[1:] != changed[:-1]).sum(axis=1)
            edges_y[top + rows - 1 - len(steps) : top + rows - 1] = steps
            last = changed[-1:]
        houses = list(looked_at(scene, raster))
    total = pool(counts)
    across = [one for one in houses if one["across"]]
    found = [one for one in houses if one["found"]]
    return {
        "pixels": {k: round(getattr(total, k), 4) for k in ("precision", "recall", "f1", "iou")},
        "houses": len(houses),
        "houses_found": len(found),
        "median_offset_px": round(float(np.median([one["offset_px"] for one in found])), 2),
        "across": len(across),
        "across_found": sum(one["found"] for one in across),
        "across_in_one_polygon": sum(one["found"] and one["polygons"] == 1 for one in across),
        "seams": seams(scene.size_hw, edges_x, edges_y),
    }


def looked_at(scene: Scene, raster: DatasetReader) -> Iterator[dict[str, Any]]:
    """Say of each house that changed whether it is in the mask, and in how many parts."""
    height, width = scene.size_hw
    rows = tiles(Box(0, 0, width, height), TILE_PX)
    lines_x = [tile.core.right for tile in rows[0][:-1]]
    lines_y = [row[0].core.bottom for row in rows[:-1]]
    seen = {one.box_xywh for one in scene.changed(0, 0, width, height)}
    for left, top, across, down in sorted(seen):
        x, y = max(0, left - AROUND_PX), max(0, top - AROUND_PX)
        window = Window(
            x, y, min(width, left + across + AROUND_PX) - x, min(height, top + down + AROUND_PX) - y
        )
        if left + across > width or top + down > height:
            continue
        mask = (raster.read(1, window=window) == CHANGED).astype(np.uint8)
        _, labels, _, middles = cv2.connectedComponentsWithStats(mask, connectivity=4)
        inside = labels[top - y : top - y + down, left - x : left - x + across]
        parts = np.unique(inside[inside > 0])
        found = bool((inside > 0).mean() >= FOUND_SHARE)
        own = np.array([left - x + (across - 1) / 2, top - y + (down - 1) / 2])
        largest = max(parts, key=lambda part: (inside == part).sum()) if len(parts) else 0
        yield {
            "found": found,
            "polygons": len(parts),
            "offset_px": float(np.hypot(*(middles[largest] - own))) if found else None,
            "across": any(left < line < left + across for line in lines_x)
            or any(top < line < top + down for line in lines_y),
        }


def seams(
    size_hw: tuple[int, int], edges_x: NDArray[Any], edges_y: NDArray[Any]
) -> dict[str, float]:
    """Return how often the mask ends at a line where tiles or their cores do, and elsewhere.

    Both are edges of the mask a pixel of line; a seam would make the first larger.
    """
    rows = tiles(Box(0, 0, size_hw[1], size_hw[0]), TILE_PX)
    every_x = {x for tile in rows[0] for x in (*tile.core[::2], *tile.box[::2])}
    every_y = {y for row in rows for y in (*row[0].core[1::2], *row[0].box[1::2])}
    at = [edges_x[x - 1] / size_hw[0] for x in every_x if 0 < x < size_hw[1]]
    at += [edges_y[y - 1] / size_hw[1] for y in every_y if 0 < y < size_hw[0]]
    everywhere = np.concatenate([edges_x / size_hw[0], edges_y / size_hw[1]])
    return {
        "edges_at_borders": round(float(np.mean(at)), 5),
        "edges_everywhere": round(float(everywhere.mean()), 5),
    }


if __name__ == "__main__":
    main(sys.argv[1:])
