"""Start a server: take its address and folder, load the models, answer requests."""

from __future__ import annotations

import shutil
import socket
import tempfile
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import uvicorn
from filelock import FileLock, Timeout

from zeroscd.detector import Detector
from zeroscd.errors import OutputError, SettingsError
from zeroscd.serve.app import make_app
from zeroscd.serve.connection import TimedConnection
from zeroscd.serve.service import Service

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from zeroscd.serve.limits import Limits

BACKLOG = 256  # connections that the system holds while the event loop is busy
GRACE_SECONDS = 10  # for open requests when the server is asked to stop


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Options of a server.

    Attributes:
        host: Address to listen at.
        port: 0 takes any free one.
        presets: Which are loaded; the first one is the default.
        device: "auto", "cpu", "cuda" or "mps".
        keys: If any, every request must bring one.
        state: Folder for jobs and temporary files.
        limits: Of every request.
        root_path: Path prefix under which a proxy publishes the server; "" for none.
        allowed_hosts: Names under which it may be asked, beside localhost and IP addresses.
        overrides: Settings that differ from the presets', by name; requests may change thresholds.
    """

    host: str
    port: int
    presets: Sequence[str]
    device: str
    keys: Sequence[str]
    state: Path
    limits: Limits
    root_path: str = ""
    allowed_hosts: Sequence[str] = ()
    overrides: Mapping[str, object] = field(default_factory=dict)


def serve(plan: Plan, *, ready: Callable[[str], None]) -> None:
    """Answer requests until the process is asked to stop.

    Args:
        plan: What to serve, and where.
        ready: Called with the server's address once it takes requests.

    Raises:
        OutputError: The folder cannot be used, or another server uses it.
        SettingsError: The address is taken, or a preset is unknown.
        WeightsError: A preset's weights are missing or damaged.
    """
    listening = listen(plan.host, plan.port)
    with listening, _owned(plan.state):
        # The parser of forms writes its temporary files here.
        tempfile.tempdir = str(clean_spool(plan.state))
        detectors = {
            name: Detector.from_preset(name, device=plan.device, overrides=plan.overrides)
            for name in plan.presets
        }
        service = Service(detectors, plan.limits)
        app = make_app(
            service,
            plan.state,
            keys=plan.keys,
            root_path=plan.root_path,
            allowed_hosts=plan.allowed_hosts,
        )
        config = uvicorn.Config(
            app,
            http=TimedConnection,
            ws="none",
            log_level="warning",
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=GRACE_SECONDS,
        )
        host, port = listening.getsockname()[:2]
        ready(f"http://{f'[{host}]' if ':' in host else host}:{port}")
        uvicorn.Server(config).run(sockets=[listening])


def listen(host: str, port: int) -> socket.socket:
    """Take an address before anything slow is done.

    Raises:
        SettingsError: It is taken, or not this machine's.
    """
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        return socket.create_server((host, port), family=family, backlog=BACKLOG)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        message = f"cannot listen at {host} port {port} ({reason}); give another --port or --host"
        raise SettingsError(message) from error


def clean_spool(state: Path) -> Path:
    """Return an empty folder for temporary files, whatever a crash left in it.

    Raises:
        OutputError: It cannot be made.
    """
    spool = state / "spool"
    try:
        shutil.rmtree(spool, ignore_errors=True)
        spool.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise _unusable(state, error) from error
    return spool


def _owned(state: Path) -> FileLock:
    """Make a folder this process's own until it ends."""
    lock = FileLock(state / "lock")
    try:
        state.mkdir(mode=0o700, parents=True, exist_ok=True)
        lock.acquire(blocking=False)
    except Timeout:
        message = f"another server uses {state}; give this one another --state folder"
        raise OutputError(message) from None
    except OSError as error:
        raise _unusable(state, error) from error
    return lock


def _unusable(state: Path, error: OSError) -> OutputError:
    message = f"cannot write {state}: {error.strerror or error}; give another --state folder"
    return OutputError(message)
