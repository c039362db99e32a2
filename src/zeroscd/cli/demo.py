"""`zeroscd demo`: see the method at work on a pair of photos that comes with the package."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

from zeroscd.cli.detect import check_request, compare, save_and_tell
from zeroscd.cli.options import OutFolder  # noqa: TC001 - typer reads the annotations


def demo(out: OutFolder = Path("zeroscd-demo")) -> None:
    """Compare two photos that come with zeroscd; nothing is downloaded.

    Example: zeroscd demo -o demo
    """
    check_request("lite", {}, out=out)
    with as_file(files("zeroscd") / "samples") as samples:
        pair = [samples / "before.jpg"], [samples / "after.jpg"]
        result = compare(*pair, preset="lite", device="auto", overrides={})
    save_and_tell(result, out)
