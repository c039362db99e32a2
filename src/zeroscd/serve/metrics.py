"""Counters and times for Prometheus."""

from __future__ import annotations

from typing import TYPE_CHECKING

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from starlette.types import Scope

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"
SECONDS = (0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60)  # upper ends of the histogram


class Metrics:
    """The metrics of one server; with its own registry, so that one process may run several."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        self._answers = Counter(
            "zeroscd_answers",
            "HTTP answers by route and status",
            ("method", "route", "status"),
            registry=self._registry,
        )
        self._stages = Histogram(
            "zeroscd_stage_seconds",
            "Wall time of a stage of one comparison",
            ("stage",),
            buckets=SECONDS,
            registry=self._registry,
        )

    def count(self, scope: Scope, status: int) -> None:
        """Count one answer; unknown paths share one label, so that their number is bounded."""
        route = getattr(scope.get("route"), "path", None) or "other"
        method = scope["method"] if scope["method"] in ("GET", "POST", "DELETE") else "other"
        self._answers.labels(method, route, status).inc()

    def time(self, seconds: Mapping[str, float]) -> None:
        """Record how long the stages of one comparison took."""
        for stage, spent in seconds.items():
            self._stages.labels(stage).observe(spent)

    def watch(self, name: str, meaning: str, value: Callable[[], float]) -> None:
        """Add a gauge whose value is computed each time the metrics are read."""
        Gauge(name, meaning, registry=self._registry).set_function(value)

    def text(self) -> bytes:
        """Return all metrics in Prometheus' text format."""
        return generate_latest(self._registry)
