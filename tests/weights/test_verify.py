from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from zeroscd.errors import WeightsError
from zeroscd.weights.verify import digest_of, fault_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from zeroscd.weights.catalogue import WeightFile

# FIPS 180-2, appendix B.1
SHA256_OF_ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_the_digest_is_the_standard_one(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"abc")
    assert digest_of(tmp_path / "file") == SHA256_OF_ABC


def test_a_fault_says_what_was_found_and_what_was_expected(
    tmp_path: Path, row_of: Callable[..., WeightFile]
) -> None:
    path = tmp_path / "file"
    row = row_of(b"abc")
    assert fault_of(path, row) == "is missing"
    assert fault_of(tmp_path, row) == "is a folder"
    path.write_bytes(b"abcd")
    assert fault_of(path, row) == "has 4 bytes, expected 3"
    path.write_bytes(b"abd")
    assert f"expected {SHA256_OF_ABC}" in str(fault_of(path, row))
    path.write_bytes(b"abc")
    assert fault_of(path, row) is None


def test_a_file_that_vanishes_is_our_own_error(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match=r"cannot read .*No such file"):
        digest_of(tmp_path / "nothing")
