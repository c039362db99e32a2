"""A public name, field or parameter cannot vanish unnoticed: api_surface.json must change too."""

from __future__ import annotations

import dataclasses
import inspect
import json
from pathlib import Path
from typing import Any

import pytest

import zeroscd

SURFACE = json.loads(Path(__file__).with_name("api_surface.json").read_text())


def members(thing: Any) -> list[str]:
    """Parameters of a function; parameters or fields, and public methods, of a class."""
    if not inspect.isclass(thing):
        return list(inspect.signature(thing).parameters) if callable(thing) else sorted(thing)
    if issubclass(thing, Exception):
        return [thing.__mro__[1].__name__]
    fields = (
        [field.name for field in dataclasses.fields(thing)]
        if dataclasses.is_dataclass(thing)
        else list(inspect.signature(thing).parameters)
    )
    every = {n: v for base in thing.__mro__[-2::-1] for n, v in vars(base).items()}
    own = {n for n in every if not n.startswith("_") and callable(getattr(thing, n))}
    own |= {n for n, v in every.items() if isinstance(v, property)}
    return [*fields, *sorted(f"{name}()" for name in own - set(fields))]


def test_the_public_names_are_those_written_down() -> None:
    assert sorted(zeroscd.__all__) == sorted(SURFACE)


@pytest.mark.parametrize("name", SURFACE)
def test_a_public_name_keeps_its_fields_and_parameters(name: str) -> None:
    now = members(getattr(zeroscd, name))
    gone = [member for member in SURFACE[name] if member not in now]
    new = [member for member in now if member not in SURFACE[name]]
    assert not gone, f"{name} lost {gone}"
    assert not new, f"{name} gained {new}: add it to tests/api_surface.json"


@pytest.mark.parametrize("name", SURFACE)
def test_a_public_name_says_what_it_is(name: str) -> None:
    thing = getattr(zeroscd, name)
    if not isinstance(thing, dict):
        assert inspect.getdoc(thing)
        assert thing.__module__.startswith("zeroscd.")


def test_dir_shows_the_public_names_only() -> None:
    assert set(dir(zeroscd)) == {*zeroscd.__all__, "__version__"}


def test_an_unknown_name_is_an_attribute_error_that_names_it() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'detekt'"):
        zeroscd.detekt  # noqa: B018


def test_every_error_of_a_user_is_a_zeroscd_error() -> None:
    for name in SURFACE:
        if name.endswith("Error"):
            assert issubclass(getattr(zeroscd, name), zeroscd.ZeroscdError)
