from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO

from zeroscd.export.coco import coco, coco_json, marked_photos

if TYPE_CHECKING:
    from pathlib import Path

    import pytest

    from zeroscd.result import ChangeResult


def test_pycocotools_reads_the_file_and_finds_the_masks(
    encoded: ChangeResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "coco.json").write_bytes(coco_json(encoded))
    data = COCO(str(tmp_path / "coco.json"))
    capsys.readouterr()  # it talks
    for kind, photo, mask in (
        ("removed", encoded.before, encoded.removed),
        ("added", encoded.after, encoded.added),
    ):
        (category,) = data.getCatIds(catNms=[kind])
        (annotation,) = data.loadAnns(data.getAnnIds(catIds=[category]))
        (image,) = data.loadImgs([annotation["image_id"]])
        assert image["file_name"] == photo.path
        assert (image["height"], image["width"]) == photo.size_hw
        assert (data.annToMask(annotation).astype(bool) == mask).all()
        assert annotation["area"] == mask.sum()
        assert annotation["bbox"] == coco_mask.toBbox(annotation["segmentation"]).tolist()


def test_every_region_keeps_its_score_and_no_crowd(encoded: ChangeResult) -> None:
    content: dict[str, Any] = json.loads(coco_json(encoded))
    found = [(a["category_id"], a["score"], a["iscrowd"]) for a in content["annotations"]]
    assert found == [(1, 0.91, 0), (2, 0.75, 0)]
    assert [(c["id"], c["name"]) for c in content["categories"]] == [(1, "removed"), (2, "added")]


def test_a_photo_of_two_pairs_is_one_image(encoded: ChangeResult) -> None:
    earlier = replace(encoded, after=encoded.before, before=replace(encoded.before, path="0.jpg"))
    content = coco([*marked_photos(earlier), *marked_photos(encoded)])
    assert [image["file_name"] for image in content["images"]] == [
        "0.jpg",
        "photos/old street.jpg",
        "photos/new.jpg",
    ]
    assert [image["id"] for image in content["images"]] == [1, 2, 3]
    assert [note["id"] for note in content["annotations"]] == [1, 2, 3, 4]
    # removed before and added after in the first pair, then the same in the second.
    assert [note["image_id"] for note in content["annotations"]] == [1, 2, 2, 3]


def test_photos_from_memory_are_told_apart(encoded: ChangeResult) -> None:
    anonymous = replace(
        encoded,
        before=replace(encoded.before, path=None),
        after=replace(encoded.after, path=None),
    )
    names = [photo.file_name for photo in marked_photos(anonymous, unnamed="pair-7/")]
    assert names == ["pair-7/t0", "pair-7/t1"]


def test_photos_without_change_are_images_without_annotations(nothing: ChangeResult) -> None:
    content = coco(marked_photos(nothing))
    assert len(content["images"]) == 2
    assert content["annotations"] == []
    assert np.shape(content["categories"]) == (2,)
