"""A server under load, killed, and fed with hostile uploads.

    python benchmarks/serve.py [NAME] [--only SCENARIO] [--seconds 120]

Scenarios: together, load, page, kill, hostile, headers, commandline, jobs, idle, crosssite, disk.
Starts `zeroscd serve` itself, on a free port of this machine. Writes
benchmarks/results/serve/NAME.json, which benchmarks/README.md describes, and NAME.md: what was
tried, and what was survived.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import platform
import random
import tempfile
import time
from collections import Counter
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import httpx
from attacks import crosssite, disk, headers, idle, jobs, probed
from commandline import commandline
from hostile import QUICKLY, SEED, SLOW, uploads
from serve_table import table
from server import BusyCores, Server, running

from zeroscd.output import write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine

RESULTS = Path(__file__).parent / "results" / "serve"
SAMPLES = files("zeroscd") / "samples"
BEFORE, AFTER = (SAMPLES.joinpath(f"{when}.jpg").read_bytes() for when in ("before", "after"))
WARM_UP = 10  # requests before memory is looked at
CALM_SECONDS = 75  # after the load: the server returns freed memory once a minute
ROUNDS = 10  # of killing
FORWARD_RUNS = 2
MEGABYTE = 1e6


def pair_files() -> dict[str, tuple[str, bytes]]:
    """The demo pair as a form."""
    return {"before": ("b.jpg", BEFORE), "after": ("a.jpg", AFTER)}


async def load(clients: int, seconds: float) -> dict[str, Any]:
    """Many clients that come back as they are told; times of answers and memory."""
    with running() as server:
        async with httpx.AsyncClient(base_url=server.url, timeout=120, limits=NO_LIMITS) as client:
            for _ in range(WARM_UP):
                await client.post("/v1/detect", files=pair_files())
            start_bytes = server.memory()
            statuses: Counter[str] = Counter()
            times: list[float] = []
            end = time.monotonic() + seconds
            with probed(server) as figures:
                await asyncio.gather(
                    *(_visitor(client, n, end, statuses, times) for n in range(clients))
                )
        spent = time.monotonic() - end + seconds  # the last answers come after the end
        await asyncio.sleep(CALM_SECONDS)
        times.sort()
        return {
            "clients": clients,
            "seconds": seconds,
            "photos_wh": [768, 640],
            "statuses": dict(sorted(statuses.items())),
            "pairs_per_second": round(statuses["200"] / spent, 3),
            "p50_seconds": round(median(times), 2),
            "p95_seconds": round(times[int(0.95 * len(times))], 2),
            **figures,
            "memory_bytes": {"before": start_bytes, "after": server.memory()},
            "left_over_files": len(server.left_over()),
        }


async def _visitor(
    client: httpx.AsyncClient, number: int, end: float, statuses: Counter[str], times: list[float]
) -> None:
    rng = random.Random(number)  # noqa: S311 - for pauses
    await asyncio.sleep(rng.random())
    while time.monotonic() < end:
        start = time.monotonic()
        try:
            answer = await client.post("/v1/detect", files=pair_files())
        except httpx.HTTPError as error:
            statuses[type(error).__name__] += 1
            continue
        statuses[str(answer.status_code)] += 1
        if answer.status_code == httpx.codes.OK:
            times.append(time.monotonic() - start)
        else:
            pause = float(answer.headers.get("Retry-After", 1))
            await asyncio.sleep(
                min(pause * rng.uniform(0.5, 1.5), max(0.0, end - time.monotonic()))
            )


async def page(visitors: int, seconds: float) -> dict[str, Any]:
    """Many visitors of the page: each compares, moves a threshold, and starts again."""
    with running() as server:
        async with httpx.AsyncClient(base_url=server.url, timeout=120, limits=NO_LIMITS) as client:
            start_bytes = server.memory()
            statuses: Counter[str] = Counter()
            times: dict[str, list[float]] = {"compared": [], "moved": []}
            end = time.monotonic() + seconds
            with probed(server) as figures:
                await asyncio.gather(
                    *(_page_visitor(client, n, end, statuses, times) for n in range(visitors))
                )
        return {
            "visitors": visitors,
            "seconds": seconds,
            "statuses": dict(sorted(statuses.items())),
            **{
                f"{what}_seconds": {"p50": round(median(found), 2), "most": round(max(found), 2)}
                for what, found in times.items()
            },
            **figures,
            "memory_bytes": {"before": start_bytes, "after": server.memory()},
        }


async def _page_visitor(
    client: httpx.AsyncClient,
    number: int,
    end: float,
    statuses: Counter[str],
    times: dict[str, list[float]],
) -> None:
    """Do what the page's script does; come back when it is told to."""
    rng = random.Random(number)  # noqa: S311 - for pauses and sliders
    while time.monotonic() < end:
        start = time.monotonic()
        answer = await client.post("/v1/comparisons", files=pair_files())
        statuses[str(answer.status_code)] += 1
        if answer.status_code != httpx.codes.ACCEPTED:
            pause = float(answer.headers.get("Retry-After", 1)) * rng.uniform(0.5, 1.5)
            await asyncio.sleep(min(pause, max(0.0, end - time.monotonic())))
            continue
        address = answer.headers["Location"]
        while (answer := await client.get(address)).json().get("status") in ("waiting", "running"):
            await asyncio.sleep(0.3)  # as the page does
        statuses[str(answer.status_code)] += 1
        times["compared"].append(time.monotonic() - start)
        start = time.monotonic()
        moved = {"sensitivity": str(rng.randrange(101))}
        answer = await client.post(f"{address}/results", data=moved)
        statuses[str(answer.status_code)] += 1
        if answer.status_code == httpx.codes.CREATED:
            times["moved"].append(time.monotonic() - start)


async def kill() -> dict[str, Any]:
    """Kill under load and start again; what was acknowledged must be there."""
    acknowledged: list[str] = []
    stale: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(ROUNDS):
            server = Server(Path(folder) / "state")
            stale += server.left_over()
            async with httpx.AsyncClient(base_url=server.url, timeout=60) as client:
                sending = [asyncio.create_task(_send(client, acknowledged)) for _ in range(4)]
                await asyncio.sleep(1.5 + 0.3 * number)
                server.kill()
                await asyncio.gather(*sending)
        server = Server(Path(folder) / "state")
        stale += server.left_over()
        async with httpx.AsyncClient(base_url=server.url, timeout=60) as client:
            states = [await _finished(client, job) for job in acknowledged]
        server.stop()
    return {
        "kills": ROUNDS,
        "jobs_acknowledged": len(acknowledged),
        "jobs_lost": sum(state is None for state in states),
        "pairs": dict(Counter(status for state in states if state for status in state)),
        "stale_files_after_start": len(stale),
    }


async def _send(client: httpx.AsyncClient, acknowledged: list[str]) -> None:
    """Send jobs and single pairs in turn until the server is gone."""
    photos = [
        (name, (f"{name}.jpg", data))
        for _ in range(2)
        for name, data in (("before", BEFORE), ("after", AFTER))
    ]
    try:
        while True:
            answer = await client.post("/v1/jobs", files=photos)
            if answer.status_code == httpx.codes.ACCEPTED:
                acknowledged.append(answer.json()["id"])
            await client.post("/v1/detect", files=pair_files())
    except httpx.TransportError:
        return


async def _finished(client: httpx.AsyncClient, job: str) -> list[str] | None:
    while True:
        answer = await client.get(f"/v1/jobs/{job}")
        if answer.status_code != httpx.codes.OK:
            return None
        if answer.json()["status"] == "done":
            return [pair["status"] for pair in answer.json()["pairs"]]
        await asyncio.sleep(0.5)


async def together() -> dict[str, Any]:
    """Processor seconds a pair takes when several pairs share a forward pass of the encoder."""
    from zeroscd.detector import Detector  # noqa: PLC0415 - the other scenarios need no networks
    from zeroscd.images.read import read_photo  # noqa: PLC0415

    detector = Detector.from_preset("lite")
    photos = [read_photo(data).pixels for data in (BEFORE, AFTER)]
    detector.detect(*photos)

    def encode_seconds(pairs: int) -> float:
        found = []
        for _ in range(FORWARD_RUNS):
            start = time.process_time()  # of all threads: it compares even on a busy machine
            detector.models.encoder.encode(photos * pairs)
            found.append((time.process_time() - start) / pairs)
        return round(median(found), 3)

    return {
        "encode_processor_seconds_per_pair": {
            str(pairs): encode_seconds(pairs) for pairs in (1, 2, 4, 8)
        },
        "whole_pair_seconds": detector.detect(*photos).seconds,
    }


async def hostile(count: int) -> dict[str, Any]:
    """Send what nobody should; who answered how, how long it took, and what memory did."""
    with running() as server:
        async with httpx.AsyncClient(base_url=server.url, timeout=120, limits=NO_LIMITS) as client:
            await client.post("/v1/detect", files=pair_files())
            start_bytes, slots = server.memory(), asyncio.Semaphore(8)
            with probed(server) as figures:
                found = await asyncio.gather(
                    *(_attack(client, server.url, slots, *one) for one in uploads(count, AFTER))
                )
            alive = (await client.post("/v1/detect", files=pair_files())).status_code
        by_kind: dict[str, Counter[str]] = {}
        for kind, status, _ in found:
            by_kind.setdefault(kind, Counter())[status] += 1
        return {
            "uploads": len(found),
            "seed": SEED,
            "by_kind": {kind: dict(counts) for kind, counts in sorted(by_kind.items())},
            "not_4xx": sum(not status.startswith("4") for _, status, _ in found),
            "slowest_seconds": {
                "slow_senders": round(max(s for k, _, s in found if k in SLOW), 2),
                "others": round(max(s for k, _, s in found if k not in SLOW), 2),
            },
            **figures,
            "memory_bytes": {"before": start_bytes, "after": server.memory()},
            "left_over_files": len(server.left_over()),
            "alive_afterwards": alive == httpx.codes.OK,
        }


async def _attack(
    client: httpx.AsyncClient,
    url: str,
    slots: asyncio.Semaphore,
    kind: str,
    form: Any,  # noqa: ANN401 - whatever httpx takes as files; bytes of slow senders
) -> tuple[str, str, float]:
    if kind in SLOW:
        start = time.monotonic()
        return kind, await _trickle(url, form), time.monotonic() - start
    async with slots:
        start = time.monotonic()
        try:
            answer = await client.post("/v1/detect", files=form)
        except httpx.HTTPError as error:
            return kind, type(error).__name__, time.monotonic() - start
        return kind, str(answer.status_code), time.monotonic() - start


async def _trickle(url: str, request: bytes) -> str:
    """Send a request a letter at a time and return the status of the answer."""
    host, port = url.removeprefix("http://").split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    answer = asyncio.create_task(reader.readline())
    head, _, rest = request.rpartition(QUICKLY)
    writer.write(head)
    for letter in rest:
        if answer.done():
            break
        writer.write(bytes([letter]))
        await asyncio.sleep(0.2)
    status = (await answer).split()
    writer.close()
    return status[1].decode() if len(status) > 1 else "closed"


NO_LIMITS = httpx.Limits(max_connections=None)


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("name", nargs="?", default=f"cpu-{os.cpu_count()}-cores")
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--clients", type=int, default=64)
    parser.add_argument("--count", type=int, default=200)
    scenarios: dict[str, Callable[[], Coroutine[None, None, dict[str, Any]]]] = {
        "together": together,
        "load": lambda: load(arguments.clients, arguments.seconds),
        "page": lambda: page(arguments.clients, arguments.seconds),
        "kill": kill,
        "hostile": lambda: hostile(arguments.count),
        "headers": headers,
        "commandline": commandline,
        "jobs": jobs,
        "idle": idle,
        "crosssite": crosssite,
        "disk": disk,
    }
    parser.add_argument("--only", choices=list(scenarios))
    arguments = parser.parse_args()
    path = RESULTS / f"{arguments.name}.json"
    found = json.loads(path.read_text()) if path.exists() else {}
    found |= {"schema": 1, "name": arguments.name, "system": platform.platform(terse=True)}
    found.setdefault("measured", {})
    for name, scenario in scenarios.items():
        if arguments.only in (None, name):
            busy = BusyCores()
            found[name] = asyncio.run(scenario())
            today = datetime.now(UTC).date().isoformat()
            found["measured"][name] = {"date": today, "cores_of_others": busy.of_others()}
            print(name, json.dumps(found[name], indent=1), flush=True)
    write_json(found, path)
    path.with_suffix(".md").write_text(table(found))


if __name__ == "__main__":
    main()
