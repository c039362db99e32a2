"""`zeroscd export-onnx`: a network as an ONNX file, for programs that run it without torch."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from zeroscd.cli.console import busy, say


def export_onnx(
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL", help="lite, dinov2-s, sam-vit-b-encoder, sam-vit-b-decoder, ..."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="OUT.onnx", help="File to write.")],
    size: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Size of the photos; DINOv2 only.  [default: 518x518]"),
    ] = None,
) -> None:
    """Write a network as an ONNX file and compare it with torch; docs/onnx.md tells how to use it.

    Example: zeroscd export-onnx lite -o lite.onnx
    """
    from zeroscd.bench import parse_size
    from zeroscd.extras import require_extra

    size_wh = None if size is None else parse_size(size)
    require_extra("onnx", by="export-onnx")
    from zeroscd.onnx.catalogue import check_name, load
    from zeroscd.onnx.write import difference, random_inputs, to_onnx
    from zeroscd.output import write_whole

    size_hw = None if size_wh is None else size_wh[::-1]
    check_name(model, size_hw=size_hw)
    with busy(f"exporting {model}"):
        network = load(model, size_hw=size_hw)
        content = to_onnx(network)
        off = difference(network, content, random_inputs(network))
    write_whole(out, content)
    say(f"written: {out} ({len(content) / 1e6:.0f} MB); largest difference to torch {off:.1e}")
