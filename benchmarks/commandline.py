"""Files whose headers take long, on the command line: how it ends, and after how long."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from attacks import AFTER
from hostile import slow_headers

ENTRY = "from zeroscd.__main__ import main; main()"
RUNS = 3  # of each command


async def commandline() -> dict[str, Any]:
    """Compare each file with a sound photo, beside the start of the program alone."""
    start = _figures("--version")
    found: dict[str, Any] = {"start": start, "files": {}}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bad, good = folder / "before.jpg", folder / "after.jpg"
        good.write_bytes(AFTER)
        for kind, data in slow_headers(AFTER).items():
            bad.write_bytes(data)
            each = _figures("detect", str(bad), str(good), "-o", str(folder / "out"))
            for clock in ("wall_s", "cpu_s"):
                each[f"{clock}_beyond_start"] = round(each[clock] - start[clock], 2)
            found["files"][kind] = each
    return found


def _figures(*words: str) -> dict[str, Any]:
    """Run a command some times; the times are the median ones."""
    runs = [_run(words) for _ in range(RUNS)]
    times = {clock: round(median(run[clock] for run in runs), 2) for clock in ("wall_s", "cpu_s")}
    return {**runs[-1], **times}


def _run(words: tuple[str, ...]) -> dict[str, Any]:
    start = time.monotonic()
    process = subprocess.Popen(  # noqa: S603 - our own command
        [sys.executable, "-c", ENTRY, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None  # noqa: S101 - it is a pipe
    said = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return {
        "exit_code": process.returncode,
        "lines": said.count("\n"),
        "wall_s": time.monotonic() - start,
        "cpu_s": usage.ru_utime + usage.ru_stime,
    }
