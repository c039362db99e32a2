"""Attacks on a server for `serve.py`: headers, jobs, idle connections, other sites, a full disk."""

from __future__ import annotations

import asyncio
import re
import resource
import threading
import time
from collections import Counter
from contextlib import contextmanager
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import httpx
from hostile import slow_headers
from server import Server, running

if TYPE_CHECKING:
    from collections.abc import Iterator

SAMPLES = files("zeroscd") / "samples"
BEFORE, AFTER = (SAMPLES.joinpath(f"{when}.jpg").read_bytes() for when in ("before", "after"))
AT_ONCE = 16
CLIENTS, JOB_PAIRS, PHOTO_BYTES = 10, 50, 1_990_000  # 199 MB a job
IDLE = 300
IDLE_SECONDS = 45  # no connection may be kept longer
FILE_BYTES = 20_000_000  # the largest file on the disk that is "full"
FORM = "multipart/form-data; boundary=b"
NO_LIMITS = httpx.Limits(max_connections=None)


class Probe(threading.Thread):
    """Asks /healthz again and again, as a watchdog does, and keeps the slowest answer.

    In a thread: the event loop of the attackers is busy itself.
    """

    def __init__(self, url: str) -> None:
        super().__init__(daemon=True)
        self.slowest = 0.0
        self.failed = 0
        self.ended = threading.Event()
        self._url = url

    def run(self) -> None:
        """Ask until it is ended, each time by a new connection."""
        no_reuse = httpx.Limits(max_keepalive_connections=0)
        with httpx.Client(base_url=self._url, timeout=30, limits=no_reuse) as client:
            while not self.ended.wait(0.05):
                start = time.monotonic()
                try:
                    self.failed += client.get("/healthz").status_code != httpx.codes.OK
                except httpx.HTTPError:
                    self.failed += 1
                self.slowest = max(self.slowest, time.monotonic() - start)


@contextmanager
def probed(server: Server) -> Iterator[dict[str, Any]]:
    """Fill in how /healthz and memory fared while something went on."""
    probe, found = Probe(server.url), dict[str, Any]()
    server.max_bytes = server.memory()
    probe.start()
    yield found
    probe.ended.set()
    probe.join()
    found["healthz"] = {"slowest_seconds": round(probe.slowest, 2), "failed": probe.failed}
    found["most_bytes"] = server.max_bytes


async def headers() -> dict[str, Any]:
    """Send files whose headers take long: each alone, and 16 at once."""
    found: dict[str, Any] = {}
    with running() as server:
        async with httpx.AsyncClient(base_url=server.url, timeout=300, limits=NO_LIMITS) as client:
            await client.post("/v1/detect", files=_form(BEFORE))
            for kind, data in slow_headers(AFTER).items():
                for count in (1, AT_ONCE):
                    with probed(server) as figures:
                        answers = await asyncio.gather(
                            *(_timed_post(client, data) for _ in range(count))
                        )
                    figures["statuses"] = dict(Counter(status for status, _ in answers))
                    figures["slowest_seconds"] = round(max(s for _, s in answers), 2)
                    found[f"{kind}, {count} at once"] = figures
    return found


async def _timed_post(client: httpx.AsyncClient, data: bytes) -> tuple[str, float]:
    start = time.monotonic()
    try:
        answer = await client.post("/v1/detect", files=_form(data))
    except httpx.HTTPError as error:
        return type(error).__name__, time.monotonic() - start
    return str(answer.status_code), time.monotonic() - start


async def jobs() -> dict[str, Any]:
    """Ten clients send a job of 200 MB each at the same time."""
    with running() as server:
        before = server.memory()
        with probed(server) as figures:
            answers = await asyncio.gather(*(_send_job(server.url) for _ in range(CLIENTS)))
        async with httpx.AsyncClient(base_url=server.url, timeout=60) as client:
            for _, _, address in answers:
                if address:
                    await client.delete(address)
            alive = (await client.post("/v1/detect", files=_form(BEFORE))).status_code
        refused = [seconds for status, seconds, _ in answers if status != "202"]
        return {
            "clients": CLIENTS,
            "megabytes_each": 2 * JOB_PAIRS * PHOTO_BYTES // 1_000_000,
            "statuses": dict(Counter(status for status, _, _ in answers)),
            "slowest_refusal_seconds": round(max(refused, default=0.0), 2),
            "before_bytes": before,
            **figures,
            "alive_afterwards": alive == httpx.codes.OK,
        }


async def _send_job(url: str) -> tuple[str, float, str]:
    """Send a job piece by piece, listening meanwhile; return status, seconds and address."""
    start, (reader, writer) = time.monotonic(), await _dial(url)
    names = [name for _ in range(JOB_PAIRS) for name in ("before", "after")]
    heads = [
        f'--b\r\nContent-Disposition: form-data; name="{name}"; filename="x"\r\n\r\n'.encode()
        for name in names
    ]
    photo = AFTER + bytes(PHOTO_BYTES - len(AFTER))
    size = sum(len(head) + PHOTO_BYTES + 2 for head in heads) + len(b"--b--\r\n")
    writer.write(_head("/v1/jobs", size))
    answer = asyncio.create_task(reader.readuntil(b"\r\n\r\n"))
    try:
        for head in heads:
            if answer.done():
                break
            writer.write(head + photo + b"\r\n")
            await writer.drain()
        writer.write(b"--b--\r\n")
        text = (await answer).decode()
    except (OSError, asyncio.IncompleteReadError) as error:
        answer.cancel()
        return type(error).__name__, time.monotonic() - start, ""
    finally:
        writer.close()
    address = re.search(r"(?i)location: (\S+)", text)
    return text.split()[1], time.monotonic() - start, address[1] if address else ""


async def idle() -> dict[str, Any]:
    """Open 300 connections that send nothing, half a head, or half a body."""
    found: dict[str, Any] = {}
    begun = {
        "nothing sent": b"",
        "half a head": b"GET / HTTP/1.1\r\nHost: localhost\r\nX: ",
        "half a body": _head("/v1/detect", 5000) + b"--b",
    }
    with running() as server:
        for kind, sent in begun.items():
            with probed(server) as figures:
                ages = await asyncio.gather(*(_hold(server.url, sent) for _ in range(IDLE)))
            figures |= {"connections": IDLE, "oldest_seconds": round(max(ages), 1)}
            found[kind] = figures
    return found


async def _hold(url: str, sent: bytes) -> float:
    """Return how long a connection is kept on which nothing more comes."""
    start, (reader, writer) = time.monotonic(), await _dial(url)
    try:
        writer.write(sent)
        async with asyncio.timeout(IDLE_SECONDS):
            await reader.read()
    except OSError:  # also when it is kept too long
        pass
    finally:
        writer.close()
    return time.monotonic() - start


async def crosssite() -> dict[str, Any]:
    """Ask as pages of other sites do, and as our own page and programs do."""
    with running() as server:
        own = server.url
        asked: dict[str, dict[str, str]] = {
            "curl": {},
            "our own page": {"Origin": own, "Sec-Fetch-Site": "same-origin"},
            "a proxy's name": {"X-Forwarded-Host": "a.example", "Origin": "https://a.example"},
            "foreign Origin": {"Origin": "https://evil.example"},
            "Origin null": {"Origin": "null"},
            "another port": {"Origin": "http://127.0.0.1:1"},
            "Sec-Fetch-Site: cross-site": {"Sec-Fetch-Site": "cross-site"},
            "rebound name": {"Host": "evil.example", "Sec-Fetch-Site": "same-origin"},
        }
        found: dict[str, Any] = {}
        async with httpx.AsyncClient(base_url=own, timeout=60) as client:
            for kind, given in asked.items():
                answers = [
                    await client.get("/v1/presets", headers=given),
                    await client.post("/v1/detect", files=_form(BEFORE), headers=given),
                ]
                found[kind] = {
                    "statuses": [answer.status_code for answer in answers],
                    "readable_elsewhere": any(
                        "access-control-allow-origin" in answer.headers for answer in answers
                    ),
                }
        return found


async def disk() -> dict[str, Any]:
    """Fill the disk during uploads and jobs, then make room again."""
    with running() as server:
        resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE, (FILE_BYTES, -1))
        statuses: Counter[str] = Counter()
        taken: list[str] = []
        async with httpx.AsyncClient(base_url=server.url, timeout=120) as client:
            with probed(server) as figures:
                large = {"before": ("b", AFTER + bytes(FILE_BYTES)), "after": ("a", AFTER)}
                statuses[str((await client.post("/v1/detect", files=large)).status_code)] += 1
                for _ in range(4):  # the database's log holds one of them, not two
                    answer = await client.post("/v1/jobs", files=_form(AFTER + bytes(15_000_000)))
                    statuses[str(answer.status_code)] += 1
                    taken += [answer.headers["location"]] if answer.is_success else []
            resource.prlimit(server.process.pid, resource.RLIMIT_FSIZE, (-1, -1))
            after = await client.post("/v1/jobs", files=_form(BEFORE))
            taken.append(after.headers["location"])
            pairs = [await _outcome(client, address) for address in taken]
        log = server.log()
        return {
            **figures,
            "statuses": dict(statuses),
            "status_with_room_again": after.status_code,
            "jobs_acknowledged": len(taken),
            "pairs": dict(Counter(pairs)),
            "log_lines": log.count("\n"),
            "tracebacks": log.count("Traceback"),
        }


async def _outcome(client: httpx.AsyncClient, address: str) -> str:
    while (found := (await client.get(address)).json()).get("status") != "done":
        await asyncio.sleep(0.5)
    return str(found["pairs"][0]["status"])


def _form(data: bytes) -> dict[str, tuple[str, bytes]]:
    return {"before": ("b.jpg", data), "after": ("a.jpg", AFTER)}


def _head(path: str, size: int) -> bytes:
    return (
        f"POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Type: {FORM}\r\n"
        f"Content-Length: {size}\r\n\r\n"
    ).encode()


async def _dial(url: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    host, port = url.removeprefix("http://").split(":")
    return await asyncio.open_connection(host, int(port))
