"""Compare every photo of one folder with that of the same name in another; CSV on stdout.

    python examples/many_pairs.py old_photos new_photos > changes.csv

The networks are loaded once. A photo that cannot be read is reported and skipped.
"""

import csv
import sys
from pathlib import Path

from zeroscd import Detector, ImageError


def main(folder_t0: str, folder_t1: str) -> None:
    """Write a row for each region that was removed or added."""
    detector = Detector.from_preset("lite")
    table = csv.writer(sys.stdout)
    table.writerow(["photo", "kind", "score", "area_px", "left", "top", "width", "height"])
    for before in sorted(Path(folder_t0).iterdir()):
        after = Path(folder_t1) / before.name
        try:
            result = detector.detect(before, after)
        except ImageError as why:
            print(f"skipped: {why}", file=sys.stderr)
            continue
        for region in result.regions:
            row = [before.name, region.kind, f"{region.score:.3f}", region.area_px]
            table.writerow([*row, *region.bbox_xywh])


if __name__ == "__main__":
    main(*sys.argv[1:])
