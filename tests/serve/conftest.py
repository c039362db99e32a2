"""A server with toy models: in the process, or on a real socket."""

from __future__ import annotations

import io
import threading
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("fastapi", reason="the server needs zeroscd[serve]")

import uvicorn
from fastapi.testclient import TestClient

from zeroscd.detector import Detector
from zeroscd.models import Models
from zeroscd.segments import Segment
from zeroscd.serve.app import make_app
from zeroscd.serve.connection import TimedConnection
from zeroscd.serve.limits import Limits
from zeroscd.serve.run import listen
from zeroscd.serve.service import Service
from zeroscd.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from zeroscd.arrays import Mask, Rgb
    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.records import FeatureMap

TILE_PX = 32
GONE, COME = (64, 64, 64, 64), (160, 96, 64, 64)  # left, top, width, height
PLAIN: dict[str, object] = {
    "threshold": "encoder",
    "search_radius": 0,
    "alpha": 0.6,
    "verify": "off",
    "kinds": "frame",
    "min_peak": 0.0,
}
# Small enough to be met in a test.
TIGHT = Limits(
    photo_bytes=400_000,
    photo_pixels=300_000,
    waiting=2,
    upload_seconds=1.0,
    answer_seconds=20.0,
    job_pairs=3,
    stored_pairs=5,
)


@dataclass
class HeldEncoder:
    """The toy encoder, which can be told to wait."""

    inner: PatchEncoder
    name: str = "toy"
    tau: float = 0.65
    go: threading.Event = field(default_factory=threading.Event)
    busy: threading.Event = field(default_factory=threading.Event)
    calls: int = 0

    def encode(self, photos: Sequence[Rgb]) -> list[tuple[FeatureMap, ...]]:
        self.calls += 1
        self.busy.set()
        assert self.go.wait(20)
        return self.inner.encode(photos)


def tiles(size_hw: tuple[int, int], where: Mask | None) -> tuple[Segment, ...]:
    """Cut every photo into the same tiles."""
    del where
    height, width = size_hw
    tile = np.ones((TILE_PX, TILE_PX), dtype=bool)
    found = [
        Segment.from_mask(tile[: height - top, : width - left], offset_xy=(left, top))
        for top in range(0, height, TILE_PX)
        for left in range(0, width, TILE_PX)
    ]
    return tuple(s for s in found if s is not None)


class Pair(NamedTuple):
    """Two photos as PNG files, and their pixels."""

    before: bytes
    after: bytes
    scene: Any

    def files(self) -> dict[str, tuple[str, bytes, str]]:
        return {
            "before": ("before.png", self.before, "image/png"),
            "after": ("after.png", self.after, "image/png"),
        }


class Served(NamedTuple):
    """A running toy server and what stands behind it."""

    client: TestClient
    service: Service
    encoder: HeldEncoder


@pytest.fixture(scope="session")
def pair(draw_scene: Callable[..., Any]) -> Pair:
    """A wall where one thing went and another came."""
    scene = draw_scene(removed=[GONE], added=[COME])
    return Pair(as_png(scene.before), as_png(scene.after), scene)


@pytest.fixture(scope="session")
def png_of() -> Callable[[Rgb], bytes]:
    """Write pixels as a PNG file."""
    return as_png


def as_png(pixels: Rgb) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


@pytest.fixture(scope="session")
def make_service(
    toy_encoder: PatchEncoder, cut_by_size: Any
) -> Callable[..., tuple[Service, HeldEncoder]]:
    """Build a service with toy models that do not wait."""

    def make(limits: Limits = TIGHT) -> tuple[Service, HeldEncoder]:
        encoder = HeldEncoder(toy_encoder)
        encoder.go.set()
        settings = Settings().override(PLAIN)
        detector = Detector(settings, Models(encoder, cut_by_size(tiles)), preset="toy")
        return Service({"toy": detector}, limits), encoder

    return make


@pytest.fixture
def start(
    make_service: Callable[..., tuple[Service, HeldEncoder]],
    tmp_path: Path,
) -> Iterator[Callable[..., Served]]:
    """Start a toy server in this process; its state survives a second start."""
    running: list[tuple[TestClient, HeldEncoder]] = []

    def begin(limits: Limits = TIGHT, **options: Any) -> Served:
        service, encoder = make_service(limits)
        app = make_app(service, tmp_path, **options)
        client = TestClient(app, raise_server_exceptions=False)
        client.__enter__()
        running.append((client, encoder))
        return Served(client, service, encoder)

    yield begin
    for client, encoder in running:
        encoder.go.set()
        client.__exit__(None, None, None)


@pytest.fixture
def served(start: Callable[..., Served]) -> Served:
    """A toy server with tight limits."""
    return start()


class Live(NamedTuple):
    """A toy server on a real socket and what stands behind it."""

    url: str
    service: Service
    encoder: HeldEncoder


@contextmanager
def listening_server(service: Service, encoder: HeldEncoder, folder: Path) -> Iterator[Live]:
    config = uvicorn.Config(
        make_app(service, folder),
        http=TimedConnection,
        ws="none",
        log_level="error",
        access_log=False,
    )
    server = uvicorn.Server(config)
    with listen("127.0.0.1", 0) as listening:  # connections wait in its backlog from now on
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        yield Live(f"http://127.0.0.1:{listening.getsockname()[1]}", service, encoder)
        encoder.go.set()
        server.should_exit = True
        thread.join(20)


@pytest.fixture(scope="session")
def live(
    make_service: Callable[..., tuple[Service, HeldEncoder]],
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[str]:
    """The address of a toy server on a real socket."""
    limits = replace(TIGHT, photo_pixels=500_000)  # the sample photos have as many
    with listening_server(*make_service(limits), tmp_path_factory.mktemp("live")) as server:
        yield server.url


@pytest.fixture
def held_live(
    make_service: Callable[..., tuple[Service, HeldEncoder]], tmp_path: Path
) -> Iterator[Live]:
    """A toy server on a real socket whose encoder waits until it is told to go."""
    service, encoder = make_service()
    encoder.go.clear()
    with listening_server(service, encoder, tmp_path) as server:
        yield server


@pytest.fixture(scope="session")
def tight() -> Limits:
    """Limits that a test can meet."""
    return TIGHT
