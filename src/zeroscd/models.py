"""Which encoder and segmenter a setting's name stands for, and on which device they run."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from zeroscd.errors import SettingsError
from zeroscd.weights.backend import require_installed
from zeroscd.weights.store import require

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.segmenters.port import Segmenter
    from zeroscd.settings import Settings


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """How a model is made when it is asked for.

    Attributes:
        module: Has a function load(settings, device); imported only then.
        weights: Name of its row in the catalogue of weights; None = it brings its own.
        extra: It needs the packages of zeroscd[models].
        reads_features: A segmenter that looks at the encoder's maps, not at the photo alone.
    """

    module: str
    weights: str | None = None
    extra: bool = False
    reads_features: bool = False


def _recipes(module: str, *names: str, extra: bool = True) -> dict[str, Recipe]:
    return {name: Recipe(module=module, weights=name, extra=extra) for name in names}


ENCODERS: dict[str, Recipe] = {
    "lite": Recipe(module="zeroscd.encoders.lite"),
    **_recipes("zeroscd.encoders.placeformer", "placeformer", "r2former", extra=False),
    **_recipes("zeroscd.encoders.dino", "dinov2-s", "dinov2-s-reg", "dinov2-b", "dinov2-b-reg"),
    **_recipes("zeroscd.encoders.dino", "dinov3-s"),
}
SEGMENTERS: dict[str, Recipe] = {
    "lite": Recipe(module="zeroscd.segmenters.lite", reads_features=True),
    **_recipes("zeroscd.segmenters.sam", "sam-vit-b", "sam-vit-l", "sam-vit-h"),
    **_recipes("zeroscd.segmenters.sam", "mobile-sam", "sam2.1-tiny", "sam2.1-small"),
    **_recipes("zeroscd.segmenters.sam", "sam2.1-base", "sam2.1-large"),
}


@dataclass(frozen=True, slots=True)
class Models:
    """The two networks of the method, loaded and on their device."""

    encoder: PatchEncoder
    segmenter: Segmenter


def check_models(settings: Settings) -> None:
    """Look for everything that the models of some settings need, without loading them.

    Raises:
        SettingsError: An unknown encoder or segmenter, or packages that are missing.
        WeightsError: Weights are missing.
    """
    _require(_recipes_of(settings))


def load_models(settings: Settings, *, device: str = "auto") -> Models:
    """Load the encoder and the segmenter that the settings name.

    What is missing is noticed first, by looking at files and packages: nothing heavy is imported
    for an answer that says what to install.

    Raises:
        SettingsError: An unknown encoder, segmenter or device, a device that is not there, or
            packages that are missing.
        WeightsError: Their weights are missing or damaged.
    """
    return Models(*_load(_recipes_of(settings), settings, device=device))


def load_encoder(settings: Settings, *, device: str = "auto") -> PatchEncoder:
    """Load the encoder alone, for work that needs no outlines.

    Raises:
        SettingsError: An unknown encoder or device, a device that is not there, or packages that
            are missing.
        WeightsError: Its weights are missing or damaged.
    """
    encoder: PatchEncoder
    (encoder,) = _load([_recipe(ENCODERS, "encoder", settings.encoder)], settings, device=device)
    return encoder


def pick_device(name: str) -> str:
    """Turn "auto", "cpu" or "cuda" into the device that torch shall use.

    Raises:
        SettingsError: An unknown device, or one that this machine does not have.
    """
    if name not in ("auto", "cpu", "cuda"):
        message = f"unknown device {name!r}; choose one of: auto, cpu, cuda"
        raise SettingsError(message)
    if name == "cpu":
        return name
    import torch  # noqa: PLC0415 - seconds to import, not needed to refuse a name

    if torch.cuda.is_available():
        return "cuda"
    if name == "cuda":
        message = "device cuda is not available on this machine; use --device cpu"
        raise SettingsError(message)
    return "cpu"


def pick_precision(name: str, *, device: str) -> str:
    """Turn "auto" into the precision that transformers compute in: "fp32" or "bf16".

    Graphics cards that know bfloat16 use it: published runs of SAM lose nothing by it (docs/
    models.md). Processors stay with single precision, the same numbers on every machine, until
    someone asks for bf16; with AMX it doubles the speed.
    """
    if name != "auto":
        return name
    if device == "cpu":
        return "fp32"
    import torch  # noqa: PLC0415 - loaded already when the device is not the processor

    return "bf16" if torch.cuda.is_bf16_supported() else "fp32"


def thread_count() -> int:
    """Return how many threads torch gives to one step of a network: the cores, if not told else."""
    import torch  # noqa: PLC0415 - as above

    return torch.get_num_threads()


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let each step of the networks, of OpenCV and of NumPy's algebra use this many threads inside.

    All three, as the last bit of a product depends on how many threads shared it, and one bit can
    decide between two matches that are equally good.
    """
    import cv2  # noqa: PLC0415 - names of models are looked up without it
    import torch  # noqa: PLC0415 - as above
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - as above

    before = torch.get_num_threads(), cv2.getNumThreads()
    torch.set_num_threads(count)
    cv2.setNumThreads(count)
    try:
        with threadpool_limits(count, user_api="blas"):
            yield
    finally:
        torch.set_num_threads(before[0])
        cv2.setNumThreads(before[1])


def _recipe(table: dict[str, Recipe], kind: str, name: str) -> Recipe:
    if name not in table:
        message = f"unknown {kind} {name!r}; choose one of: {', '.join(table)}"
        raise SettingsError(message)
    return table[name]


def _recipes_of(settings: Settings) -> list[Recipe]:
    return [
        _recipe(ENCODERS, "encoder", settings.encoder),
        _recipe(SEGMENTERS, "segmenter", settings.segmenter),
    ]


def _require(recipes: Sequence[Recipe]) -> None:
    require(recipe.weights for recipe in recipes if recipe.weights)
    if any(recipe.extra for recipe in recipes):
        require_installed()


def _load(recipes: Sequence[Recipe], settings: Settings, *, device: str) -> list[Any]:
    """Make models for a device, after everything that any of them needs was looked for."""
    _require(recipes)
    target = pick_device(device)
    decided = settings.override({"precision": pick_precision(settings.precision, device=target)})
    return [import_module(recipe.module).load(decided, target) for recipe in recipes]
