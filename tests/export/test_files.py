from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from zeroscd.errors import SettingsError
from zeroscd.export.files import FILES, PROMISED, check_wanted, file_names, render

if TYPE_CHECKING:
    from zeroscd.result import ChangeResult

START = {".png": b"\x89PNG", ".json": b"{", ".html": b"<!"}


def test_every_file_has_the_content_that_its_suffix_says(result: ChangeResult) -> None:
    found = render(result, FILES)
    assert list(found) == list(file_names(FILES))
    for name, content in found.items():
        assert content.lstrip().startswith(START["." + name.split(".")[1]]), name


def test_only_the_wanted_files_are_drawn(result: ChangeResult) -> None:
    found = render(result, ["json", "removed"])
    assert list(found) == ["changes.json", "removed.png"]
    assert json.loads(found["changes.json"])["frame"] == "t1"
    assert render(result, []) == {}
    assert len(render(result)) == len(PROMISED)


def test_an_unknown_file_is_refused_with_the_known_ones() -> None:
    check_wanted(FILES)
    with pytest.raises(SettingsError, match=r"cannot write 'masks'; choose from: mask, .*coco"):
        check_wanted(["json", "masks"])
