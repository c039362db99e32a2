"""What others have published on the same data sets, with the protocol behind each number.

Source of every row of the paper: Kannan and Min, "ZeroSCD: Zero-Shot Street Scene Change
Detection", ICRA 2025 (arXiv 2409.15255), its table of F1 scores, its ablation of tau and its
ablation of backbones. It states neither how F1 was averaged nor which pairs of PCD2015 its
baselines were tested on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Average: TypeAlias = Literal["macro", "harmonic", "unstated"]
Training: TypeAlias = Literal["zero-shot", "trained", "not stated"]

VL_CMU_CD, TSUNAMI, GSV = "vl-cmu-cd", "pcd2015-tsunami", "pcd2015-gsv"
PSCD = "pscd"


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """One published number.

    Attributes:
        method: As its authors call it.
        dataset: As typed on our command line.
        f1: 0..1.
        training: Whether the method saw change labels.
        average: How F1 was averaged over pairs.
        source: Where the number stands.
        protocol: What differs from evaluating every pair at the data set's size; may be empty.
    """

    method: str
    dataset: str
    f1: float
    training: Training
    average: Average
    source: str
    protocol: str = ""


PAPER = "ZeroSCD, ICRA 2025"
FIVE_FOLDS = "trained and tested in five folds"
# method -> F1 in percent on VL-CMU-CD, TSUNAMI, GSV, as printed in the paper
PAPER_TABLE: dict[str, tuple[float, float, float]] = {
    "CNN-Feat": (40.3, 72.4, 63.9),
    "CDNet": (58.2, 77.4, 61.4),
    "CosimNet": (70.6, 80.6, 69.2),
    "SimUNet": (71.4, 82.9, 68.1),
    "DOF-CDNet": (68.8, 83.8, 70.3),
    "DASNet": (72.2, 84.1, 74.5),
    "CSCDNet": (71.0, 85.9, 73.8),
    "HPCFNet": (75.2, 86.8, 77.6),
    "SimSaC": (75.6, 86.5, 78.2),
    "ZeroSCD": (75.4, 90.6, 82.1),
}
# All others of the table learn from change labels.
TRAINING: dict[str, Training] = {"CNN-Feat": "not stated", "ZeroSCD": "zero-shot"}

# The paper's ablations on VL-CMU-CD, F1 0..1.
PAPER_TAU: dict[float, float] = {0.50: 0.709, 0.55: 0.724, 0.60: 0.745, 0.65: 0.754, 0.70: 0.749}
PAPER_ENCODER: dict[str, float] = {"dinov2-s": 0.708, "dinov2-b": 0.740, "placeformer": 0.754}

ARGOS = "table of Argos, 2026"
LATER: tuple[Published, ...] = (
    Published(
        method="GeSCF",
        dataset=VL_CMU_CD,
        f1=0.754,
        training="zero-shot",
        average="harmonic",
        source="CVPR 2025",
        protocol="only t0 segments; black borders are zeroed",
    ),
    Published(
        method="FastGeSCF",
        dataset=VL_CMU_CD,
        f1=0.760,
        training="trained",
        average="harmonic",
        source="IROS 2026",
        protocol="mask network trained on pseudo-labels",
    ),
    Published(
        method="ZSSCD",
        dataset=VL_CMU_CD,
        f1=0.516,
        training="zero-shot",
        average="macro",
        source="AAAI 2025",
        protocol="tracks a video, not a pair",
    ),
    Published(
        method="GOLDILOCS",
        dataset=VL_CMU_CD,
        f1=0.618,
        training="zero-shot",
        average="unstated",
        source="ICLR 2026",
        protocol="reconstructs the scene in 3-D",
    ),
    Published(
        method="Robust-SCD",
        dataset=VL_CMU_CD,
        f1=0.7948,
        training="trained",
        average="macro",
        source="ICRA 2025",
        protocol="504 x 504",
    ),
    Published(
        method="C-3PO (VGG16)",
        dataset=VL_CMU_CD,
        f1=0.80,
        training="trained",
        average="macro",
        source="Pattern Recognition 2023",
    ),
    Published(
        method="DR-TANet",
        dataset=VL_CMU_CD,
        f1=0.7398,
        training="trained",
        average="macro",
        source=ARGOS,
    ),
    Published(
        method="TERDNet",
        dataset=VL_CMU_CD,
        f1=0.8343,
        training="trained",
        average="unstated",
        source="ICRA 2026",
    ),
    Published(
        method="Argos",
        dataset=VL_CMU_CD,
        f1=0.863,
        training="trained",
        average="macro",
        source=ARGOS,
    ),
    Published(
        method="C-3PO (R18)",
        dataset=TSUNAMI,
        f1=0.88,
        training="trained",
        average="macro",
        source="Pattern Recognition 2023",
        protocol="fold 0 only",
    ),
    Published(
        method="C-3PO (R18)",
        dataset=GSV,
        f1=0.80,
        training="trained",
        average="macro",
        source="Pattern Recognition 2023",
        protocol="fold 0 only",
    ),
    Published(
        method="GeSCF",
        dataset=PSCD,
        f1=0.540,
        training="zero-shot",
        average="harmonic",
        source="CVPR 2025",
        protocol="test split",
    ),
    Published(
        method="FastGeSCF",
        dataset=PSCD,
        f1=0.526,
        training="trained",
        average="harmonic",
        source="IROS 2026",
        protocol="test split, 224 px crops",
    ),
    Published(
        method="ZSSCD",
        dataset=PSCD,
        f1=0.440,
        training="zero-shot",
        average="macro",
        source="AAAI 2025",
        protocol="test split",
    ),
    Published(
        method="TERDNet",
        dataset=PSCD,
        f1=0.6581,
        training="trained",
        average="unstated",
        source="ICRA 2026",
        protocol="test split",
    ),
    Published(
        method="Argos",
        dataset=PSCD,
        f1=0.6965,
        training="trained",
        average="macro",
        source=ARGOS,
        protocol="test split",
    ),
)


def published_for(dataset: str) -> tuple[Published, ...]:
    """Return every published number on a data set, best first; empty for your own folders."""
    rows = [row for row in (*_paper_rows(), *LATER) if row.dataset == dataset]
    return tuple(sorted(rows, key=lambda row: (-row.f1, row.method)))


def _paper_rows() -> list[Published]:
    return [
        Published(
            method=method,
            dataset=dataset,
            f1=percent / 100,
            training=TRAINING.get(method, "trained"),
            average="unstated",
            source=PAPER,
            protocol=_paper_protocol(method, dataset),
        )
        for method, row in PAPER_TABLE.items()
        for dataset, percent in zip((VL_CMU_CD, TSUNAMI, GSV), row, strict=True)
    ]


def _paper_protocol(method: str, dataset: str) -> str:
    if dataset == VL_CMU_CD or method == "CNN-Feat":
        return ""
    if method == "ZeroSCD":
        return "every pair; the paper counts 200 for TSUNAMI and 92 for GSV"
    return FIVE_FOLDS
