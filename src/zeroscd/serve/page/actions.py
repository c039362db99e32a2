"""What happens when a visitor of the page presses Compare or moves a slider."""

from __future__ import annotations

import concurrent.futures
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from zeroscd.errors import ZeroscdError
from zeroscd.serve.page.cached_result import CachedResult, weigh
from zeroscd.serve.page.viewer import render
from zeroscd.serve.problems import Problem
from zeroscd.serve.service import PhotoPair
from zeroscd.serve.worker import CancelToken

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from zeroscd.serve.service import DetectRequest, Service
    from zeroscd.serve.shelf import Shelf

LOOK_SECONDS = 0.15  # between two looks how far the work is
FIRST_PERCENT = 3
HALF = 50.0  # per cent of sensitivity at which the preset's own threshold applies
# What a step is called, and how much of the way lies before it in per cent.
STEPS = {
    "read": ("Reading the photos", 10),
    "look": ("Looking at both photos", 20),
    "compare": ("Comparing them", 55),
    "decide": ("Drawing outlines", 75),
    "draw": ("Preparing the pictures", 92),
}


@dataclass(frozen=True, slots=True)
class PageControls:
    """What the page's controls say.

    Attributes:
        preset: Name of a preset.
        frame: "t0" or "t1".
        sensitivity: 0..100; 50 is the preset's own threshold.
        alpha: 0..1, share of an outline that must differ.
        min_area_px: Smaller regions are left out.
    """

    preset: str
    frame: str
    sensitivity: float
    alpha: float
    min_area_px: float


@dataclass(frozen=True, slots=True)
class Shown:
    """What the page is to show now; None leaves a part as it is.

    Attributes:
        status: HTML that says how things stand.
        viewer: HTML of a comparison.
        name: Under which it is kept.
    """

    status: str
    viewer: str | None = None
    name: str | None = None


class Actions:
    """Compares for the page.

    Args:
        service: Does the work.
        photos: What visitors have sent.
        results: What was compared for them.
    """

    def __init__(
        self, service: Service, photos: Shelf[bytes], results: Shelf[CachedResult]
    ) -> None:
        self._service = service
        self._photos = photos
        self._results = results

    def ask(self, wish: PageControls) -> DetectRequest:
        """Turn the page's controls into settings.

        Raises:
            SettingsError: A control was tampered with.
        """
        service = self._service
        preset = service.ask(wish.preset, {})
        change = preset.settings.change
        factor = 2 - min(max(wish.sensitivity, 0), 100) / HALF
        if change.threshold == "pair" and change.tau is None:
            threshold = {"tau_share": min(1.0, change.tau_share * factor)}
        else:
            own = change.tau or service.detectors[preset.preset].models.encoder.tau
            threshold = {"tau": min(2.0, own * factor)}
        values = {"frame": wish.frame, "alpha": wish.alpha, "min_area_px": wish.min_area_px}
        return service.ask(wish.preset, {**values, **threshold})

    def compare(self, before: str, after: str, wish: PageControls) -> Iterator[Shown]:
        """Compare two photos that were sent, and say how far that is; an older result goes."""
        yield Shown(status("Waiting", percent=FIRST_PERCENT), viewer="", name="")
        first, second = self._photos.get(before), self._photos.get(after)
        if first is None or second is None:
            missing = "before" if first is None else "after"
            text = f"Choose the photo {missing} first"
            yield failure(f"{text}; a photo that was not used for a while must be chosen again.")
            return
        photos = PhotoPair(first, second)
        yield from self._run(
            lambda cancel_token, tell: self._gathered(photos, wish, cancel_token, tell)
        )

    def decide(self, name: str, wish: PageControls) -> Iterator[Shown]:
        """Apply other thresholds to a comparison that is kept."""
        kept = self._results.get(name)
        if kept is None or kept.ask.preset != wish.preset:
            yield Shown(status("Press Compare to see the photos with these settings."))
            return
        yield from self._run(lambda _, tell: self._decided(kept, name, wish, tell))

    def _run(
        self, work: Callable[[CancelToken, Callable[[str], None]], tuple[str, CachedResult]]
    ) -> Iterator[Shown]:
        cancel_token, steps = CancelToken(), ["wait"]
        try:
            task = self._service.worker.submit(lambda: work(cancel_token, steps.append))
        except Problem as problem:
            yield failure(str(problem.detail))
            return
        try:
            shown = ""
            while not concurrent.futures.wait([task], LOOK_SECONDS).done:
                now = self._progress(steps[-1], self._service.worker.ahead_of(task))
                if now != shown:
                    yield Shown(now)
                shown = now
            name, kept = task.result()
            yield Shown(status(_done(kept)), render(kept, name), name)
        except ZeroscdError as error:
            yield failure(f"{error}.")
        finally:
            cancel_token.give_up()
            task.cancel()

    def _gathered(
        self,
        photos: PhotoPair,
        wish: PageControls,
        cancel_token: CancelToken,
        tell: Callable[[str], None],
    ) -> tuple[str, CachedResult]:
        ask = self.ask(wish)
        evidence = self._service.gather(photos, ask, cancel_token, tell)
        tell("decide")
        result = self._service.decide(evidence, ask)
        tell("draw")
        kept = CachedResult.of(ask, evidence, result, version=0)
        return self._results.put(kept, weight=weigh(kept)), kept

    def _decided(
        self, kept: CachedResult, name: str, wish: PageControls, tell: Callable[[str], None]
    ) -> tuple[str, CachedResult]:
        tell("decide")
        ask = self.ask(wish)
        result = self._service.decide(kept.evidence, ask)
        tell("draw")
        renewed = CachedResult.of(ask, kept.evidence, result, version=kept.version + 1)
        return self._results.put(renewed, weight=weigh(renewed), name=name), renewed

    def _progress(self, step: str, ahead: int) -> str:
        if step not in STEPS:
            return status(
                f"Waiting: {ahead} before you" if ahead else "Waiting", percent=FIRST_PERCENT
            )
        text, percent = STEPS[step]
        return status(text, percent=percent)


def status(text: str, *, percent: int | None = None) -> str:
    """Write a line that says how things stand, with a bar while something goes on."""
    bar = "" if percent is None else f'<progress max="100" value="{percent}"></progress>'
    return f'<p class="z-status" role="status">{escape(text)}</p>{bar}'


def failure(text: str) -> Shown:
    """Say what went wrong and what to do."""
    sentence = text[:1].upper() + text[1:]
    return Shown(f'<p class="z-status z-failure" role="alert">{escape(sentence)}</p>')


def _done(kept: CachedResult) -> str:
    count = len(kept.result.regions)
    return "Done: no change found." if not count else f"Done: {count} changed regions, shown below."
