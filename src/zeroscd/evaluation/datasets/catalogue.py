"""The data sets by name."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from zeroscd.errors import DatasetError
from zeroscd.text import unknown

if TYPE_CHECKING:
    from pathlib import Path

    from zeroscd.evaluation.datasets.port import Dataset

# name -> module with a function open_root(root, name)
DATASETS: dict[str, str] = {
    "folder": "zeroscd.evaluation.datasets.folder",
    "vl-cmu-cd": "zeroscd.evaluation.datasets.vl_cmu_cd",
    "pcd2015-tsunami": "zeroscd.evaluation.datasets.pcd2015",
    "pcd2015-gsv": "zeroscd.evaluation.datasets.pcd2015",
    "pscd": "zeroscd.evaluation.datasets.pscd",
    "changesim": "zeroscd.evaluation.datasets.changesim",
    "levir-cd": "zeroscd.evaluation.datasets.levir_cd",
}


def open_dataset(name: str, root: Path) -> Dataset:
    """Find a data set on disk and which of its known layouts this is.

    Raises:
        DatasetError: An unknown name, or the root is not laid out as expected.
    """
    if name not in DATASETS:
        raise DatasetError(unknown("data set", name, DATASETS))
    dataset: Dataset = import_module(DATASETS[name]).open_root(root, name)
    return dataset
