"""`zeroscd bench`: how fast is this machine?"""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import TYPE_CHECKING, Annotated

import typer

from zeroscd.cli.console import busy, say
from zeroscd.cli.options import Device, Overrides, Preset, parse_overrides

if TYPE_CHECKING:
    from zeroscd.bench import Measurement

MEGABYTE = 1e6


def bench(
    preset: Preset = "lite",
    size: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WxH", help="Size of the photos; may be repeated.  [default: 512x512]"
        ),
    ] = None,
    runs: Annotated[int, typer.Option(min=1, help="Timed comparisons after a warm-up.")] = 5,
    busy_cores: Annotated[
        int,
        typer.Option(
            "--busy", metavar="N", min=0, help="Time it again beside N processes that compute."
        ),
    ] = 0,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE.json", help="Also write JSON here.")
    ] = None,
    settings: Overrides = None,
    device: Device = "auto",
) -> None:
    """Time one pair on this machine: every stage, import, loading and peak memory.

    The pair is the demo's, brought to each size; every size gets a fresh process.

    Example: zeroscd bench --size 512x512 --size 1920x1080 -o bench.json
    """
    from dataclasses import replace

    from zeroscd.bench import Plan, measure, parse_size, to_json
    from zeroscd.output import write_json
    from zeroscd.settings import preset as named

    plan = Plan(preset=preset, overrides=parse_overrides(settings), device=device, runs=runs)
    named(plan.preset).override(plan.overrides)
    sizes = [parse_size(text) for text in size or ["512x512"]]
    loads = [0, busy_cores] if busy_cores else [0]
    measurements = []
    for one in (replace(plan, size_wh=wh, busy=load) for wh in sizes for load in loads):
        with busy(f"timing {one.size_wh[0]} x {one.size_wh[1]}"):
            measurements.append(measure(one))
        typer.echo(table(measurements[-1]))
    if out is not None:
        write_json(to_json(plan, measurements), out)
        say(f"written: {out}")


def table(found: Measurement) -> str:
    """Lay a measurement out for a terminal: seconds of each stage, then what surrounds them."""
    rows = [*found.stages.items(), ("total", found.total)]
    width = max(len(name) for name, _ in rows)
    beside = f", beside {found.busy} busy processes" if found.busy else ""
    lines = [
        f"{found.size_wh[0]} x {found.size_wh[1]}{beside}, "
        f"median (least to most) of {found.runs} runs"
    ]
    for name, spread in rows:
        lines.append(
            f"  {name.ljust(width)}  {spread.median:6.3f} s  "
            f"({spread.least:.3f} to {spread.most:.3f})"
        )
    lines.append(
        f"import {found.import_seconds:.1f} s, load {found.load_seconds:.1f} s, "
        f"first comparison {found.first_seconds:.2f} s"
    )
    memory = "unknown" if found.peak_bytes is None else f"{found.peak_bytes / MEGABYTE:.0f} MB"
    threads = ", ".join(f"{name} {count}" for name, count in found.threads.items())
    lines.append(f"peak memory {memory}; threads: {threads}")
    return "\n".join(lines)
