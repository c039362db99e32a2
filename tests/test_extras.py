from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from zeroscd import extras
from zeroscd.errors import SettingsError

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]


@pytest.mark.parametrize("extra", extras.EXTRAS)
def test_an_extra_brings_what_it_is_asked_for(extra: str) -> None:
    brought = " ".join(PROJECT["optional-dependencies"][extra])
    assert all(name.replace("_", "-") in brought for name in extras.EXTRAS[extra])


def test_all_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda name: None if "multi" in name else "there")
    extras.require_extra("geo", by="geo")
    with pytest.raises(SettingsError) as error:
        extras.require_extra("serve", by="serve")
    assert str(error.value) == ("serve needs python-multipart; run: pip install 'zeroscd[serve]'")
