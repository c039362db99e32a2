"""The program `zeroscd`, also as `python -m zeroscd`."""

from __future__ import annotations

import sys

from zeroscd.cli import INTERRUPTED


def main() -> None:
    """Run the command line of this process and exit, without a traceback if Ctrl-C comes early."""
    try:
        from zeroscd.cli.main import main as run  # noqa: PLC0415 - a quarter of a second

        run()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
