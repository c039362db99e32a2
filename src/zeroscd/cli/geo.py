"""`zeroscd geo`: what changed between two georeferenced rasters."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from zeroscd.cli.console import answer, busy, say, set_audience, warn
from zeroscd.cli.options import (
    AsJson,
    Device,
    OutFolder,
    Overrides,
    Preset,
    Quiet,
    parse_overrides,
)
from zeroscd.output import check_target


def geo(
    before: Annotated[Path, typer.Argument(metavar="BEFORE", help="The earlier GeoTIFF.")],
    after: Annotated[
        Path,
        typer.Argument(metavar="AFTER", help="The later one; its grid and CRS may differ."),
    ],
    out: OutFolder,
    bands: Annotated[
        str | None,
        typer.Option(
            metavar="N[,N,N]",
            help="One band or three, from 1, to show as red, green and blue; the files' own if "
            "not given.",
        ),
    ] = None,
    bands_after: Annotated[
        str | None,
        typer.Option(metavar="N[,N,N]", help="The same of the raster after, where they differ."),
    ] = None,
    stretch: Annotated[
        str,
        typer.Option(
            metavar="auto|none|percentile|LOW,HIGH",
            help="Values that become black and white; auto = bytes as they are, others from the "
            "2nd to the 98th percentile of the whole raster.",
        ),
    ] = "auto",
    tile: Annotated[
        int,
        typer.Option(
            min=256,
            max=4096,
            metavar="PX",
            help="Side of what is compared at once: larger for large things.",
        ),
    ] = 1024,
    cog: Annotated[
        bool, typer.Option("--cog", help="Write the mask as a cloud-optimised GeoTIFF.")
    ] = False,
    preset: Preset = "lite",
    settings: Overrides = None,
    device: Device = "auto",
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Find what changed between two georeferenced rasters of any size, such as aerial photos.

    Writes mask.tif, changes.gpkg, changes.geojson and summary.json into OUT, in the CRS of BEFORE.

    Example: zeroscd geo 2019.tif 2024.tif -o changes
    """
    set_audience(quiet=quiet, as_json=as_json)
    from zeroscd.extras import require_extra
    from zeroscd.settings import preset as named

    overrides = parse_overrides(settings)
    named(preset).override(overrides)
    check_target(out)
    require_extra("geo", by="geo")
    from zeroscd.cli.progress import Bar
    from zeroscd.geo.bands import parse_bands, parse_stretch
    from zeroscd.geo.files import GEOPACKAGE
    from zeroscd.geo.rasters import RasterOptions, open_pair
    from zeroscd.geo.run import compare_rasters
    from zeroscd.geo.summary import sentences

    options = RasterOptions(
        bands=parse_bands(bands),
        bands_after=parse_bands(bands_after),
        stretch=parse_stretch(stretch),
        tile_px=tile,
        cog=cog,
    )
    with busy("reading the rasters"), open_pair(before, after, options):
        pass  # what is no good is refused before the networks are loaded
    with busy("loading the networks"):
        from zeroscd.detector import Detector

        detector = Detector.from_preset(preset, device=device, overrides=overrides)
    with Bar("matching") as bar:
        result = compare_rasters(
            before, after, out, detector=detector, options=options, progress=bar
        )
    for text in sentences(result.summary):
        say(text)
    for name in result.summary["left_out"]:
        warn(f"left out: {name}")
    say(f"polygons: {out / GEOPACKAGE}")
    if as_json:
        answer(result.summary)
