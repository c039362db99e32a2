from __future__ import annotations

import re
from pathlib import Path

import pytest

from zeroscd.errors import WeightsError
from zeroscd.weights.catalogue import CATALOGUE, WeightFile, find

ROWS = list(CATALOGUE.values())


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_every_row_says_licence_paper_and_where_to_get_it(row: WeightFile) -> None:
    assert row.licence
    assert row.paper.startswith("arXiv ")
    assert row.page.startswith("https://")
    assert re.fullmatch(r"[0-9a-f]*", row.sha256)
    assert row.fetchable or "from" in row.note or "no public weights" in row.note


@pytest.mark.parametrize("row", [row for row in ROWS if row.fetchable], ids=lambda row: row.name)
def test_an_address_is_encrypted_and_ends_in_the_file_name(row: WeightFile) -> None:
    assert row.address is not None
    assert row.address.startswith("https://")
    assert row.address.endswith(f"/{row.file}")


def test_the_addresses_of_dinov2_name_the_architecture_as_folder() -> None:
    assert find("dinov2-s-reg").address == (
        "https://dl.fbaipublicfiles.com/dinov2/dinov2_vits14/dinov2_vits14_reg4_pretrain.pth"
    )


def test_no_two_rows_share_a_file_or_a_digest() -> None:
    digests = [row.sha256 for row in ROWS if row.sha256]
    assert len({row.file for row in ROWS}) == len(ROWS)
    assert len(set(digests)) == len(digests)


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(WeightsError, match=r"unknown weights 'sam'; choose one of: .*sam-vit-h"):
        find("sam")


def test_the_page_about_models_mentions_every_name() -> None:
    page = (Path(__file__).parents[2] / "docs" / "models.md").read_text()
    assert [name for name in CATALOGUE if f"`{name}`" not in page] == []
