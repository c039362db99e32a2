from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from zeroscd.export.names import photo_name, short_names
from zeroscd.records import FurtherPhoto

if TYPE_CHECKING:
    from zeroscd.result import ChangeResult


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["a/b/c.jpg"], ["c.jpg"]),
        (["C:\\x\\y.png", "C:\\z\\y.png"], ["x/y.png", "z/y.png"]),
        (["old/7/n.jpg", "new/7/n.jpg"], ["old/7/n.jpg", "new/7/n.jpg"]),
        (["n.jpg", "new/n.jpg"], ["n.jpg", "new/n.jpg"]),
        (["a/n.jpg", "b/n.jpg", "b/m.jpg"], ["a/n.jpg", "b/n.jpg", "m.jpg"]),
        (["s3://old/n.jpg", "s3://new/n.jpg"], ["old/n.jpg", "new/n.jpg"]),
        (["a/n.jpg", "a/n.jpg"], ["n.jpg"]),
    ],
)
def test_names_have_no_more_folders_than_tell_them_apart(
    paths: list[str], names: list[str]
) -> None:
    assert list(short_names(paths).values()) == names


def test_a_photo_is_told_from_all_photos_of_its_result(result: ChangeResult) -> None:
    old, new = (replace(result.before, path=f"{folder}/7.jpg") for folder in ("old", "new"))
    other = replace(old, path="old/b/7.jpg")
    further = FurtherPhoto(photo=other, frame="t0")
    several = replace(result, before=old, after=new, further_photos=(further,))
    names = [photo_name(several, one, otherwise="") for one in (old, new, other)]
    assert names == ["old/7.jpg", "new/7.jpg", "b/7.jpg"]
    unnamed = replace(old, path=None)
    assert photo_name(replace(result, before=unnamed), unnamed, otherwise="before") == "before"
