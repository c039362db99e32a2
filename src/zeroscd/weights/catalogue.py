"""The weight files that zeroscd knows: source, digest, licence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from zeroscd.errors import WeightsError
from zeroscd.text import unknown

FULL_SHA256 = 64  # hexadecimal digits of a whole digest


@dataclass(frozen=True, slots=True, kw_only=True)
class WeightFile:
    """One published file of weights.

    Attributes:
        name: Its name in commands and settings.
        kind: Encoder, segmenter or labeller; or the first two in one network.
        file: The publisher's file name.
        address: URL that needs no account; None = there is none.
        page: Web page about it.
        hub: The same model on the Hugging Face hub, for reference; None = not there.
        sha256: Hexadecimal digest; only its beginning where no more is published, "" where none.
        size_bytes: Length of the file; None = not published.
        licence: Of the weights.
        paper: Where the model is described.
        note: What a user must know before choosing it, in a sentence; may be empty.
    """

    name: str
    kind: Literal["encoder", "segmenter", "encoder, segmenter", "labeller"]
    file: str
    address: str | None
    page: str
    hub: str | None
    sha256: str
    size_bytes: int | None
    licence: str
    paper: str
    note: str = ""

    @property
    def fetchable(self) -> bool:
        """It has an address, and a full digest to check the download."""
        return self.address is not None and len(self.sha256) == FULL_SHA256

    @property
    def fetch_command(self) -> str:
        """The command that gets it."""
        how = "" if self.fetchable else f" --from {self.file}"
        return f"zeroscd models fetch {self.name}{how}"


_META = "https://dl.fbaipublicfiles.com"
_SAM = "arXiv 2304.02643"
_SAM2 = "arXiv 2408.00714"
_DINOV2 = "arXiv 2304.07193"
_REGISTERS = "arXiv 2309.16588"


def _sam(name: str, file: str, *, hub: str, sha256: str, size_bytes: int) -> WeightFile:
    return WeightFile(
        name=name,
        kind="segmenter",
        file=file,
        address=f"{_META}/segment_anything/{file}",
        page="https://github.com/facebookresearch/segment-anything",
        hub=f"facebook/{hub}",
        sha256=sha256,
        size_bytes=size_bytes,
        licence="Apache-2.0",
        paper=_SAM,
    )


def _sam2(name: str, file: str, *, hub: str, sha256: str, size_bytes: int) -> WeightFile:
    return WeightFile(
        name=name,
        kind="encoder, segmenter",
        file=file,
        address=f"{_META}/segment_anything_2/092824/{file}",
        page="https://github.com/facebookresearch/sam2",
        hub=f"facebook/{hub}",
        sha256=sha256,
        size_bytes=size_bytes,
        licence="Apache-2.0",
        paper=_SAM2,
    )


def _dinov2(name: str, file: str, *, hub: str, sha256: str, size_bytes: int | None) -> WeightFile:
    folder = file.removesuffix("_pretrain.pth").removesuffix("_reg4")
    return WeightFile(
        name=name,
        kind="encoder",
        file=file,
        address=f"{_META}/dinov2/{folder}/{file}",
        page="https://github.com/facebookresearch/dinov2",
        hub=f"facebook/{hub}",
        sha256=sha256,
        size_bytes=size_bytes,
        licence="Apache-2.0",
        paper=_REGISTERS if "reg4" in file else _DINOV2,
        note="" if sha256 else "no digest published: only with --from",
    )


_ROWS = (
    WeightFile(
        name="placeformer",
        kind="encoder",
        file="placeformer.pth",
        address=None,
        page="https://arxiv.org/abs/2401.13082",
        hub=None,
        sha256="",
        size_bytes=None,
        licence="none published",
        paper="arXiv 2401.13082",
        note="no public weights; instead: r2former (nearest relative) or dinov2-b (open)",
    ),
    WeightFile(
        name="r2former",
        kind="encoder",
        file="CVPR23_DeitS_Rerank.pth",
        address=None,
        page="https://github.com/bytedance/R2Former",
        hub=None,
        sha256="",
        size_bytes=None,
        licence="Apache-2.0 (code)",
        paper="arXiv 2304.03410",
        note="on a shared drive without a digest: download by hand, then --from",
    ),
    _dinov2(
        "dinov2-s",
        "dinov2_vits14_pretrain.pth",
        hub="dinov2-small",
        sha256="b938bf1bc15cd2ec0feacfe3a1bb553fe8ea9ca46a7e1d8d00217f29aef60cd9",
        size_bytes=88283115,
    ),
    _dinov2(
        "dinov2-s-reg",
        "dinov2_vits14_reg4_pretrain.pth",
        hub="dinov2-with-registers-small",
        sha256="f433177089a681826f849f194ece3bb48f4d63fb38d32fc837e3dc7a4e5641fb",
        size_bytes=None,
    ),
    _dinov2(
        "dinov2-b",
        "dinov2_vitb14_pretrain.pth",
        hub="dinov2-base",
        sha256="0b8b82f85de91b424aded121c7e1dcc2b7bc6d0adeea651bf73a13307fad8c73",
        size_bytes=346378731,
    ),
    _dinov2(
        "dinov2-b-reg",
        "dinov2_vitb14_reg4_pretrain.pth",
        hub="dinov2-with-registers-base",
        sha256="",
        size_bytes=None,
    ),
    WeightFile(
        name="dinov3-s",
        kind="encoder",
        file="dinov3_vits16_pretrain_lvd1689m-08c60483.pth",
        address=None,
        page="https://github.com/facebookresearch/dinov3",
        hub="facebook/dinov3-vits16-pretrain-lvd1689m",
        sha256="08c60483",
        size_bytes=None,
        licence="DINOv3 licence (custom)",
        paper="arXiv 2508.10104",
        note="gated: accept its licence on the page, download by hand, then --from",
    ),
    _sam(
        "sam-vit-b",
        "sam_vit_b_01ec64.pth",
        hub="sam-vit-base",
        sha256="ec2df62732614e57411cdcf32a23ffdf28910380d03139ee0f4fcbe91eb8c912",
        size_bytes=375042383,
    ),
    _sam(
        "sam-vit-l",
        "sam_vit_l_0b3195.pth",
        hub="sam-vit-large",
        sha256="3adcc4315b642a4d2101128f611684e8734c41232a17c648ed1693702a49a622",
        size_bytes=1249524607,
    ),
    _sam(
        "sam-vit-h",
        "sam_vit_h_4b8939.pth",
        hub="sam-vit-huge",
        sha256="a7bf3b02f3ebf1267aba913ff637d9a2d5c33d3173bb679e46d9f338c26f262e",
        size_bytes=2564550879,
    ),
    WeightFile(
        name="mobile-sam",
        kind="segmenter",
        file="mobile_sam.pt",
        address="https://raw.githubusercontent.com/ChaoningZhang/MobileSAM/master/weights/mobile_sam.pt",
        page="https://github.com/ChaoningZhang/MobileSAM",
        hub="dhkim2810/MobileSAM",
        sha256="6dbb90523a35330fedd7f1d3dfc66f995213d81b29a5ca8108dbcdd4e37d6c2f",
        size_bytes=40728226,
        licence="Apache-2.0",
        paper="arXiv 2306.14289",
    ),
    _sam2(
        "sam2.1-tiny",
        "sam2.1_hiera_tiny.pt",
        hub="sam2.1-hiera-tiny",
        sha256="7402e0d864fa82708a20fbd15bc84245c2f26dff0eb43a4b5b93452deb34be69",
        size_bytes=156008466,
    ),
    _sam2(
        "sam2.1-small",
        "sam2.1_hiera_small.pt",
        hub="sam2.1-hiera-small",
        sha256="6d1aa6f30de5c92224f8172114de081d104bbd23dd9dc5c58996f0cad5dc4d38",
        size_bytes=184416285,
    ),
    _sam2(
        "sam2.1-base",
        "sam2.1_hiera_base_plus.pt",
        hub="sam2.1-hiera-base-plus",
        sha256="a2345aede8715ab1d5d31b4a509fb160c5a4af1970f199d9054ccfb746c004c5",
        size_bytes=323606802,
    ),
    _sam2(
        "sam2.1-large",
        "sam2.1_hiera_large.pt",
        hub="sam2.1-hiera-large",
        sha256="2647878d5dfa5098f2f8649825738a9345572bae2d4350a2468587ece47dd318",
        size_bytes=898083611,
    ),
    WeightFile(
        name="eomt-l",
        kind="labeller",
        file="model.safetensors",
        address=None,
        page="https://huggingface.co/tue-mps/ade20k_semantic_eomt_large_512",
        hub="tue-mps/ade20k_semantic_eomt_large_512",
        sha256="",
        size_bytes=None,
        licence="MIT",
        paper="arXiv 2503.19108",
        note="its digest is not known here: download by hand, then --from",
    ),
)

CATALOGUE: dict[str, WeightFile] = {row.name: row for row in _ROWS}


def find(name: str) -> WeightFile:
    """Return the row of a name.

    Raises:
        WeightsError: No row has this name.

    Example:
        >>> find("sam-vit-b").file
        'sam_vit_b_01ec64.pth'
    """
    if name not in CATALOGUE:
        raise WeightsError(unknown("weights", name, CATALOGUE))
    return CATALOGUE[name]
