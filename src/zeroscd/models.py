"""Which encoder and segmenter a setting's name stands for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

from zeroscd.device import pick_device, pick_precision
from zeroscd.errors import SettingsError
from zeroscd.extras import require_extra
from zeroscd.segmenters.old_port import by_new_names
from zeroscd.text import unknown
from zeroscd.weights.catalogue import find
from zeroscd.weights.store import require

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.labels.port import Labeller
    from zeroscd.segmenters.port import Segmenter
    from zeroscd.settings import Settings
    from zeroscd.weights.catalogue import WeightFile


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """How a model is made when it is asked for.

    Attributes:
        module: Has a function load(settings, device); imported only then.
        weights: Name of its row in the catalogue of weights; None = it brings its own.
        extra: It needs the packages of zeroscd[models].
        segmenter: It looks through the network of this segmenter: its module has a function
            wrap(network, settings) instead. Both are loaded once.
    """

    module: str
    weights: str | None = None
    extra: bool = False
    segmenter: Recipe | None = None


def _recipes(module: str, *names: str, extra: bool = True) -> dict[str, Recipe]:
    return {name: Recipe(module=module, weights=name, extra=extra) for name in names}


SEGMENTERS: dict[str, Recipe] = {
    "lite": Recipe(module="zeroscd.segmenters.lite"),
    **_recipes("zeroscd.segmenters.sam", "sam-vit-b", "sam-vit-l", "sam-vit-h"),
    **_recipes("zeroscd.segmenters.sam", "mobile-sam", "sam2.1-tiny", "sam2.1-small"),
    **_recipes("zeroscd.segmenters.sam", "sam2.1-base", "sam2.1-large"),
}
ENCODERS: dict[str, Recipe] = {
    "lite": Recipe(module="zeroscd.encoders.lite"),
    **_recipes("zeroscd.encoders.placeformer", "placeformer", "r2former", extra=False),
    **_recipes("zeroscd.encoders.dino", "dinov2-s", "dinov2-s-reg", "dinov2-b", "dinov2-b-reg"),
    **_recipes("zeroscd.encoders.dino", "dinov3-s"),
    **{
        name: replace(segmenter, module="zeroscd.encoders.sam", segmenter=segmenter)
        for name, segmenter in SEGMENTERS.items()
        if name.startswith("sam2.1")
    },
}

LABELLER = Recipe(module="zeroscd.labels.eomt", weights="eomt-l", extra=True)


@dataclass(frozen=True, slots=True)
class Models:
    """The two networks of the method, loaded and on their device; maybe one that labels pixels."""

    encoder: PatchEncoder
    segmenter: Segmenter
    labeller: Labeller | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "segmenter", by_new_names(self.segmenter))


def weight_files(settings: Settings) -> list[WeightFile]:
    """Return the catalogued weights of some settings; models that bring their own have none.

    Raises:
        SettingsError: An unknown encoder or segmenter.
    """
    return [find(name) for name in _weights_of(_recipes_of(settings))]


def check_models(settings: Settings) -> None:
    """Look for everything that the models of some settings need, without loading them.

    Raises:
        SettingsError: An unknown encoder or segmenter, or packages that are missing.
        WeightsError: Weights are missing.
    """
    _require(_recipes_of(settings))


def load_models(settings: Settings, *, device: str = "auto", labels: bool = False) -> Models:
    """Load the encoder and the segmenter that the settings name, and a labeller if wanted.

    What is missing is noticed first, by looking at files and packages: nothing heavy is imported
    for an answer that says what to install.

    Raises:
        SettingsError: An unknown encoder, segmenter or device, a device that is not there, or
            packages that are missing.
        WeightsError: Their weights are missing or damaged.
    """
    recipes = [*_recipes_of(settings), *([LABELLER] if labels else [])]
    return Models(*_load(recipes, settings, device=device))


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


def _recipe(table: dict[str, Recipe], kind: str, name: str) -> Recipe:
    if name not in table:
        raise SettingsError(unknown(kind, name, table))
    return table[name]


def _recipes_of(settings: Settings) -> list[Recipe]:
    return [
        _recipe(ENCODERS, "encoder", settings.encoder),
        _recipe(SEGMENTERS, "segmenter", settings.segmenter),
    ]


def _weights_of(recipes: Sequence[Recipe]) -> list[str]:
    """Return the names of all weights, each once."""
    return list(dict.fromkeys(recipe.weights for recipe in recipes if recipe.weights))


def _require(recipes: Sequence[Recipe]) -> None:
    require(_weights_of(recipes))
    if any(recipe.extra for recipe in recipes):
        require_extra("models", by="this model")


def _load(recipes: Sequence[Recipe], settings: Settings, *, device: str) -> list[Any]:
    """Make models for a device, after everything that any of them needs was looked for."""
    _require(recipes)
    target = pick_device(device)
    decided = settings.override({"precision": pick_precision(settings.precision, device=target)})
    loaded: dict[Recipe, Any] = {}

    def load(recipe: Recipe, chosen: Settings) -> Any:  # noqa: ANN401 - any kind of model
        if recipe not in loaded:
            module = import_module(recipe.module)
            if recipe.segmenter is None:
                loaded[recipe] = module.load(chosen, target)
            else:
                # The settings may name another segmenter, whose network is another.
                own = chosen.override({"segmenter": recipe.weights})
                loaded[recipe] = module.wrap(load(recipe.segmenter, own).network, chosen)
        return loaded[recipe]

    return [load(recipe, decided) for recipe in recipes]
