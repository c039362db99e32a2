"""What the choices of `zeroscd geo` are worth on made-up pairs: borders, threshold, settings.

    python benchmarks/geo_choices.py -o OUT.json [--pairs 3] [--side 2500]

Every tile is compared once and weighed in several ways: who draws a region at a border of tiles;
a threshold fitted to all tiles or to each; other settings. Beside them, the pair as one photo, as
`zeroscd detect` would take it. Truth and tiles are those of `geo.py`.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pair import commit
from pycocotools import mask as coco

from geo import make_scene
from zeroscd.bench import machine
from zeroscd.detector import Detector
from zeroscd.evaluation.metrics import count, pool
from zeroscd.geo.registration import fitted_tau
from zeroscd.geo.tiling import Box, tiles
from zeroscd.output import write_json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from geo_scene import Scene

    from zeroscd.arrays import Mask
    from zeroscd.evaluation.metrics import Counts
    from zeroscd.geo.tiling import Tile
    from zeroscd.records import Region

TILE_PX = 1024
FOUND_SHARE = 0.5  # of a house that must be in the mask
CUT, WHOLE = "cut at the core", "one photo"
# Share of a region that must lie in the core of a tile for it to be drawn, whole.
SHARES = {"any": 0.0, "0.1": 0.1, "0.2": 0.2, "0.33": 0.33, "0.5": 0.5}
SETTINGS: dict[str, dict[str, object]] = {
    "tau of each tile": {"tau": None},
    "judge=all": {"judge": "all"},
    "judge=sure": {"judge": "sure"},
    "min_peak=0": {"min_peak": 0},
    "gap_width=0.01": {"gap_width": 0.01},
}
DEFAULT = "0.2"


class Scored(NamedTuple):
    """One mask against the truth.

    Attributes:
        counts: Pixels.
        houses, found: Houses that changed, and those of which most is in the mask.
        at_borders, everywhere: Edges of the mask for each pixel along the lines where tiles and
            cores end, and along all lines.
    """

    counts: Counts
    houses: int
    found: int
    at_borders: float
    everywhere: float


def main(arguments: Sequence[str]) -> None:
    """Compare the pairs and write what each choice gives."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--pairs", type=int, default=3)
    parser.add_argument("--side", type=int, default=2500)
    given = parser.parse_args(arguments)
    detector = Detector.from_preset("lite")
    scored: dict[str, list[Scored]] = {}
    for seed in range(given.pairs):
        scene = replace(make_scene(given.side, TILE_PX, None), seed=seed)
        for name, mask in masks_of(scene, detector).items():
            scored.setdefault(name, []).append(score(scene, mask))
    rows = {name: summarise(every) for name, every in scored.items()}
    write_json(
        {"schema": 1, "commit": commit(), "pairs": given.pairs, "side_px": given.side}
        | {"choices": rows, "machine": machine()},
        given.out,
    )
    for name, row in rows.items():
        print(f"{name:18}", row)


def masks_of(scene: Scene, detector: Detector) -> dict[str, Mask]:
    """Return the mask of a pair under every choice."""
    whole = Box(0, 0, *scene.size_hw[::-1])
    before, after = (scene.draw(whole, date=date) for date in ("before", "after"))
    flat = list(chain(*tiles(whole, TILE_PX)))
    names = [*SHARES, CUT, *SETTINGS]
    found = {name: np.zeros(scene.size_hw, bool) for name in names}
    every = {
        tile: detector.compare(
            *detector.encode([before[tile.box.within(whole)], after[tile.box.within(whole)]]),
            t1_from_t0="none",
        )
        for tile in flat
    }
    tau = float(np.median([fitted_tau(evidence, detector) for evidence in every.values()]))
    own = detector.settings.override({"tau": tau})
    for tile, evidence in every.items():
        place = tile.box.within(whole)
        regions = detector.decide(evidence, own).regions
        for name, least in SHARES.items():
            found[name][place] |= drawn(regions, tile, least)
        core = tile.core.within(whole)
        found[CUT][core] = drawn(regions, tile, 0.0)[tile.core.within(tile.box)]
        for name, changed in SETTINGS.items():
            other = detector.decide(evidence, own.override(changed)).regions
            found[name][place] |= drawn(other, tile, SHARES[DEFAULT])
    return found | {WHOLE: detector.detect(before, after, t1_from_t0="none").mask}


def drawn(regions: Sequence[Region], tile: Tile, least: float) -> Mask:
    """Draw the regions of a tile of which enough lies in its core."""
    found = np.zeros(tile.box.size_hw, bool)
    for region in regions:
        mask = coco.decode(region.rle).astype(bool)
        inside = np.count_nonzero(mask[tile.core.within(tile.box)])
        if inside and inside >= least * region.area_px:
            found |= mask
    return found


def score(scene: Scene, mask: Mask) -> Scored:
    """Compare a mask with the truth."""
    height, width = scene.size_hw
    whole = Box(0, 0, width, height)
    boxes = {one.box_xywh for one in scene.changed(whole)}
    houses = [
        mask[y : y + h, x : x + w] for x, y, w, h in boxes if x + w < width and y + h < height
    ]
    flat = list(chain(*tiles(whole, TILE_PX)))
    lines_x = {x for tile in flat for x in (*tile.core[::2], *tile.box[::2])} - {0, width}
    lines_y = {y for tile in flat for y in (*tile.core[1::2], *tile.box[1::2])} - {0, height}
    across, down = mask[:, 1:] != mask[:, :-1], mask[1:] != mask[:-1]
    at = [across[:, x - 1].mean() for x in lines_x] + [down[y - 1].mean() for y in lines_y]
    return Scored(
        count(mask, scene.truth(whole)),
        len(houses),
        sum(bool(house.mean() >= FOUND_SHARE) for house in houses),
        float(np.mean(at)),
        float((across.mean() + down.mean()) / 2),
    )


def summarise(every: Sequence[Scored]) -> dict[str, float]:
    """Add up the pairs."""
    total = pool([one.counts for one in every])
    return {
        "precision": round(total.precision, 3),
        "recall": round(total.recall, 3),
        "f1": round(total.f1, 3),
        "houses": sum(one.houses for one in every),
        "found": sum(one.found for one in every),
        "edges_at_borders": round(float(np.mean([one.at_borders for one in every])), 5),
        "edges_everywhere": round(float(np.mean([one.everywhere for one in every])), 5),
    }


if __name__ == "__main__":
    main(sys.argv[1:])
