"""Seconds for each stage of one pair at three sizes, and peak memory, as JSON with machine facts.

    python benchmarks/pair.py [NAME] [--runs 5]        # writes benchmarks/results/NAME.json

benchmarks/README.md describes the file.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

from zeroscd.bench import Plan, measure, parse_size, to_json
from zeroscd.cli.bench import table
from zeroscd.output import write_json

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results"
SIZES = ("512x512", "1920x1080", "4000x3000")


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", nargs="?", default="lite")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--busy", type=int, default=0, help="again beside N computing processes")
    options = parser.parse_args()
    plan = Plan(runs=options.runs)
    measurements = []
    loads = [0, options.busy] if options.busy else [0]
    for size, load in ((size, load) for size in SIZES for load in loads):
        measurements.append(measure(replace(plan, size_wh=parse_size(size), busy=load)))
        print(table(measurements[-1]), flush=True)
    out = RESULTS / f"{options.name}.json"
    content = to_json(plan, measurements)
    write_json({"schema": content["schema"], "name": out.stem, "commit": commit(), **content}, out)
    print(f"written: {out}")


def commit() -> str | None:
    """Name the code that runs; None outside a checkout."""
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        return None
    described = subprocess.run(  # noqa: S603 - fixed words
        [git, "describe", "--always", "--dirty=+"],
        check=False,
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    return described.stdout.strip() or None


if __name__ == "__main__":
    main()
