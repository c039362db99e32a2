"""The shapes of requests and answers, as the OpenAPI document shows them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue

Fraction = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=0)]
FrameName = Literal["t0", "t1"]
Point = Annotated[list[int], Field(min_length=2, max_length=2)]

EXAMPLE: dict[str, JsonValue] = {
    "schema": 1,
    "before": {"path": None, "width": 768, "height": 640},
    "after": {"path": None, "width": 768, "height": 640},
    "frame": "t1",
    "preset": "lite",
    "settings": {"frame": "t1", "refine": {"alpha": 0.7}},
    "alignment": {
        "t1_from_t0": [[1.0, 0.0, 3.5], [0.0, 1.0, -2.0], [0.0, 0.0, 1.0]],
        "inliers": 410,
        "matches": 560,
        "reason": None,
    },
    "changed_fraction": 0.031,
    "judged_fraction": 0.87,
    "regions": [
        {
            "id": 1,
            "kind": "removed",
            "score": 0.93,
            "area_px": 6,
            "bbox_xywh": [10, 20, 3, 2],
            "polygon_xy": [[[10, 20], [10, 22], [13, 22], [13, 20]]],
            "rle": {"size": [640, 768], "counts": "d^<2\\e0:0"},
            "frame": "t0",
            "support": 0.84,
            "at_border": False,
        }
    ],
    "seconds": {"read": 0.02, "encode": 0.3, "align": 0.1},
}


class ProblemDocument(BaseModel):
    """Why a request has no result (RFC 9457)."""

    type: str = Field(examples=["urn:zeroscd:problem:bad-photo"])
    title: str = Field(examples=["The photo cannot be used"])
    status: int = Field(ge=400, le=599, examples=[422])
    detail: str = Field(examples=["the photo before is damaged or cut short; copy it again"])


class PhotoSize(BaseModel):
    """A photo that was compared."""

    path: None = Field(description="Always null: the name of an uploaded file is ignored.")
    width: int = Field(ge=1, examples=[768])
    height: int = Field(ge=1, examples=[640])


class FurtherPhotoShown(PhotoSize):
    """A further photo of the place."""

    side: Literal["before", "after"]
    left_out: str | None = Field(description="Why it says nothing about the place, or null.")


class AlignmentFound(BaseModel):
    """How pixels of one photo map to the other."""

    t1_from_t0: list[list[float]] | None = Field(
        description="3 x 3 homography in pixels, or null where none can be trusted."
    )
    inliers: Count
    matches: Count
    reason: str | None = Field(description="Why the photos could not be aligned, or null.")
    given: bool = Field(default=False, description="The request said it; nothing was matched.")


class RunLengths(BaseModel):
    """A mask as COCO writes it: compressed run lengths."""

    size: list[int] = Field(min_length=2, max_length=2, examples=[[640, 768]])
    counts: str


class ChangedRegion(BaseModel):
    """One changed object or part of one."""

    id: int = Field(ge=1)
    kind: Literal["removed", "added"]
    score: Fraction
    area_px: int = Field(ge=1)
    bbox_xywh: list[int] = Field(min_length=4, max_length=4)
    polygon_xy: list[list[Point]]
    rle: RunLengths
    frame: FrameName = Field(description="The photo in whose pixels the geometry is given.")
    support: Fraction = Field(description="How well its surroundings support the change.")
    at_border: bool = Field(description="It lies along what the other photo does not show.")
    seen_by: int = Field(
        default=1, ge=1, description="Views that show its place, where a side has several photos."
    )
    agreed_by: Count = Field(default=1, description="Of them, those that see the change.")


class Changes(BaseModel):
    """What changed between two photos, as in `changes.json`."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    schema_version: Literal[1] = Field(alias="schema")
    before: PhotoSize
    after: PhotoSize
    frame: FrameName
    preset: str
    settings: dict[str, Any]
    alignment: AlignmentFound
    changed_fraction: Fraction = Field(description="Of what was judged.")
    judged_fraction: Fraction = Field(description="Of the frame's photo: changed or unchanged.")
    ignored_fraction: Fraction = Field(
        default=0.0, description="Of the frame's photo: left out by the request."
    )
    regions: list[ChangedRegion]
    further_photos: list[FurtherPhotoShown] = Field(
        default=[], description="Beyond the first photo of a side, where there are several."
    )
    seconds: dict[str, Annotated[float, Field(ge=0)]]


class PresetShown(BaseModel):
    """A bundle of models and settings that this server has loaded."""

    name: str = Field(examples=["lite"])
    default: bool
    settings: dict[str, Any]


class Presets(BaseModel):
    """What `preset` and `settings` of a request may name."""

    presets: list[PresetShown]
    thresholds: list[str] = Field(
        description="Settings that a request may change.", examples=[["alpha", "tau"]]
    )


class ResultShown(BaseModel):
    """One result of a comparison: what one choice of thresholds makes of the photos."""

    number: int = Field(ge=1, description="Counts the results; only the latest is kept.")
    summary: str = Field(examples=["2 regions added, 1 removed; 3.1 % of the scene changed"])
    regions: Count
    files: dict[str, str] = Field(
        description="Addresses by file name.",
        examples=[
            {"changes.json": "/v1/comparisons/Vv3nO1kq0iE9yq0xU7bN3w/results/1/changes.json"}
        ],
    )


class ComparisonShown(BaseModel):
    """The status of a comparison."""

    id: str = Field(examples=["Vv3nO1kq0iE9yq0xU7bN3w"])
    preset: str = Field(examples=["lite"])
    status: Literal["waiting", "running", "done", "failed"]
    step: Literal["wait", "read", "encode", "compare", "decide", "draw"]
    percent: int = Field(ge=0, le=100, description="Progress, roughly.")
    ahead: Count = Field(description="How many requests are served before this one starts.")
    problem: str | None = Field(description="Why it failed, or null.")
    result: ResultShown | None = Field(description="The latest one, or null.")


class PairShown(BaseModel):
    """The status of one pair of a job."""

    number: Count
    status: Literal["waiting", "running", "done", "failed"]
    problem: str | None = Field(description="Why it failed, or null.")
    result: str | None = Field(description="Address of the result once it is done, or null.")


class JobShown(BaseModel):
    """The status of a job."""

    id: str = Field(examples=["Vv3nO1kq0iE9yq0xU7bN3w"])
    status: Literal["waiting", "running", "done"] = Field(
        description="done: every pair is done or failed."
    )
    preset: str = Field(examples=["lite"])
    created: str = Field(description="UTC.", examples=["2026-11-22T09:30:00Z"])
    expires: str = Field(description="UTC; then job and results are deleted.")
    pairs: list[PairShown]


class Health(BaseModel):
    """The server works."""

    status: Literal["ok"]
