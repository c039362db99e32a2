"""A `zeroscd serve` of our own for `serve.py`: started, watched, killed."""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


class Server:
    """A `zeroscd serve` of our own."""

    def __init__(self, state: Path) -> None:
        """Start it, and return once it answers."""
        self.state = state
        self.scratch = state.parent / "tmp"
        self.scratch.mkdir(exist_ok=True)
        self._log = state.parent / "log"
        entry = "from zeroscd.cli.main import main; main()"
        command = [sys.executable, "-c", entry, "serve", "--port", "0", "--state", str(state)]
        environment = {**os.environ, "TMPDIR": str(self.scratch)}
        self.process = subprocess.Popen(  # noqa: S603 - our own command
            command, stdout=subprocess.PIPE, stderr=self._log.open("wb"), text=True, env=environment
        )
        assert self.process.stdout is not None  # noqa: S101 - it is a pipe
        line = self.process.stdout.readline()
        found = re.search(r"http://\S+", line)
        if found is None:
            sys.exit(f"the server did not start: {line}")
        self.url = found[0]
        self.max_bytes = 0
        self._watching = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def memory(self) -> int:
        """Resident bytes now."""
        text = Path(f"/proc/{self.process.pid}/status").read_text()
        return 1024 * int(re.findall(r"VmRSS:\s+(\d+)", text)[0])

    def log(self) -> str:
        """What it wrote about its errors since it was started."""
        return self._log.read_text()

    def left_over(self) -> list[str]:
        """Temporary files that have a name."""
        folders = (self.state / "spool", self.scratch)
        return [str(path) for folder in folders for path in folder.rglob("*") if path.is_file()]

    def kill(self) -> None:
        """End it as a power cut would."""
        self._watching.set()
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self) -> None:
        """Ask it to stop."""
        self._watching.set()
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(60)

    def _watch(self) -> None:
        while not self._watching.wait(0.05):
            try:
                self.max_bytes = max(self.max_bytes, self.memory())
            except OSError:
                return


class BusyCores:
    """How many of the machine's cores other programs used since this was made."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self._before = self._seconds_of_others()

    def of_others(self) -> float:
        """Return a mean over the time that passed; this program and what it ended do not count."""
        used = self._seconds_of_others() - self._before
        return round(max(0.0, used / (time.monotonic() - self._start)), 2)

    @staticmethod
    def _seconds_of_others() -> float:
        user, nice, system = map(int, Path("/proc/stat").read_text().split()[1:4])
        ours = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        all_programs = (user + nice + system) / os.sysconf("SC_CLK_TCK")
        return all_programs - sum(each.ru_utime + each.ru_stime for each in ours)


@contextmanager
def running() -> Iterator[Server]:
    """Run a server with an empty folder, and stop it."""
    with tempfile.TemporaryDirectory() as folder:
        server = Server(Path(folder) / "state")
        try:
            yield server
        finally:
            server.stop()
