"""Compare two photos, list what changed, and write masks and report.

python examples/compare_two_photos.py before.jpg after.jpg changes
"""

import sys

import zeroscd


def main(before: str, after: str, out: str) -> None:
    """Detect, print one line a region, save."""
    result = zeroscd.detect(before, after)
    if isinstance(result.alignment, zeroscd.NotAligned):
        print(f"compared without alignment: {result.alignment.reason}")
    print(f"{result.changed_fraction:.1%} of the photo changed")
    for region in result.regions:
        x, y, width, height = region.bbox_xywh
        print(f"{region.kind:8} {width:4} x {height:<4} at ({x}, {y}), score {region.score:.2f}")
    result.save(out)


if __name__ == "__main__":
    main(*sys.argv[1:])
