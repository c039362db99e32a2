"""Re-render composite pairs under harder conditions and score the detector on each.

    python benchmarks/robustness.py COMPOSITES -o OUT [--limit N] [--preset lite]

COMPOSITES has t0/ t1/ mask/ removed/ added/ with equal names and pairs.json with the true
homographies. OUT gets one data set a condition, its scores, and the table as robustness.json and
robustness.md. The same input gives the same pictures: random numbers of a
pair depend on its name only.
"""

from __future__ import annotations

import argparse
import json
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import cv2
import numpy as np

from zeroscd.detector import Detector
from zeroscd.evaluation.datasets.folder import open_root
from zeroscd.evaluation.report.tables import Table
from zeroscd.evaluation.run import Run, evaluate
from zeroscd.evaluation.truth import load_pair
from zeroscd.output import write_json, write_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from zeroscd.arrays import Homography, Mask, Rgb
    from zeroscd.evaluation.datasets.port import Dataset
    from zeroscd.evaluation.scores import Scores

Rng: TypeAlias = np.random.Generator

GAMMA = (1.3, 1.7)  # exponent, or its inverse: dusk against noon
GAIN = (0.85, 1.15)  # of each colour channel: another white balance
HAZE = (0.05, 0.2)  # share of the light that comes from the air
AIR = 215.0  # grey level of hazy air
SHADOW = (0.55, 0.75)  # what a shadow leaves of the light
SHADOW_BLUR = 0.02  # softness of its edge, as a share of the photo's longer side
VIEW_SHIFT = 0.12  # how far a corner of the new view moves inwards, as a share of the side
NOISE_SIGMA = 10.0  # grey levels
JPEG_QUALITY = 30
HALF_WHITE = 127


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One composite pair.

    Attributes:
        before: (H, W, 3) the t0 photo.
        after: (H, W, 3) the t1 photo.
        changed: (H, W) t1 frame.
        removed: (H, W) t0 frame.
        added: (H, W) t1 frame.
        t1_from_t0: The true homography.
    """

    before: Rgb
    after: Rgb
    changed: Mask
    removed: Mask
    added: Mask
    t1_from_t0: Homography


def restyle(scene: Scene, rng: Rng) -> Scene:
    """Change the light of the photo after: gamma, colour, haze and a soft shadow."""
    gamma = rng.uniform(*GAMMA) ** rng.choice([-1, 1])
    light = (scene.after / 255.0) ** gamma * 255.0 * rng.uniform(*GAIN, size=3)
    light *= _shadow(scene.after.shape[:2], rng)[..., None]
    haze = rng.uniform(*HAZE)
    return replace(scene, after=_pixels(light * (1 - haze) + AIR * haze))


def move(scene: Scene, rng: Rng) -> Scene:
    """Move the camera: a second homography, whose whole view lies inside t1."""
    height, width = scene.changed.shape
    size_xy = np.array([width, height])
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size_xy - 0.5
    inwards = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * size_xy
    seen = corners + inwards * rng.uniform(0, VIEW_SHIFT, size=(4, 2))
    there_from_t1 = np.asarray(
        cv2.getPerspectiveTransform(seen.astype(np.float32), corners.astype(np.float32)),
        dtype=np.float64,
    )
    # Replicated, or a view that reaches the border would show half a pixel of black.
    after = cv2.warpPerspective(
        scene.after, there_from_t1, (width, height), borderMode=cv2.BORDER_REPLICATE
    )
    whole = there_from_t1 @ scene.t1_from_t0
    return replace(
        scene,
        after=_pixels(after),
        changed=_warped(scene.changed, there_from_t1),
        added=_warped(scene.added, there_from_t1),
        t1_from_t0=whole / whole[2, 2],
    )


def add_noise(scene: Scene, rng: Rng) -> Scene:
    """Add Gaussian noise to both photos, independent in every value."""
    before, after = (
        _pixels(photo + rng.normal(0, NOISE_SIGMA, photo.shape))
        for photo in (scene.before, scene.after)
    )
    return replace(scene, before=before, after=after)


def leave(scene: Scene, rng: Rng) -> Scene:
    """Change nothing."""
    del rng
    return scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A way to make pairs harder.

    Attributes:
        meaning: For readers of the table.
        render: From a scene and a random generator to another scene.
        quality: JPEG quality of the written photos; None keeps every bit.
    """

    meaning: str
    render: Callable[[Scene, Rng], Scene] = leave
    quality: int | None = None


CONDITIONS: Mapping[str, Condition] = {
    "original": Condition(meaning="as the composites are"),
    "style": Condition(meaning="gamma 1.3 to 1.7, colour, haze, shadow on t1", render=restyle),
    "view": Condition(meaning="corners of t1 moved inwards by up to 12 %", render=move),
    "noise": Condition(meaning="Gaussian noise of 10 grey levels on both", render=add_noise),
    "jpeg30": Condition(meaning="both photos as JPEG of quality 30", quality=JPEG_QUALITY),
}


def main() -> None:
    """Render, score and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("composites", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--limit", type=int)
    parser.add_argument("--preset", default="lite")
    options = parser.parse_args()
    source = open_root(options.composites).first(options.limit)
    truth = true_homographies(options.composites)
    detector = Detector.from_preset(options.preset, overrides={"frame": source.frame})
    scores = {}
    for name, condition in CONDITIONS.items():
        root = options.out / "pairs" / name
        render(source, truth, condition, root)
        run = Run(detector=detector, out=options.out / "scores" / name)
        scores[name] = evaluate(open_root(root, name), run)
        print(f"{name}: f1_macro {scores[name].summary.f1_macro}", flush=True)
    table = tabulate(scores)
    write_whole(options.out / "robustness.md", table.to_markdown().encode())
    write_json({name: _figures(found) for name, found in scores.items()}, _json(options.out))
    print(table.to_text())


def true_homographies(root: Path) -> dict[str, Homography]:
    """Read pairs.json: t1_from_t0 of every pair by its name."""
    rows = json.loads((root / "pairs.json").read_text())
    return {row["stem"]: np.array(row["t1_from_t0"], dtype=np.float64) for row in rows}


def render(
    source: Dataset, truth: Mapping[str, Homography], condition: Condition, root: Path
) -> None:
    """Write a data set under a condition; a pair's random numbers depend on its name only."""
    rows = []
    for files in source.pairs:
        pair = load_pair(files, source)
        assert pair.truth.removed is not None  # noqa: S101 - composites say what was removed
        assert pair.truth.added is not None  # noqa: S101
        scene = Scene(
            before=pair.before,
            after=pair.after,
            changed=pair.truth.changed,
            removed=pair.truth.removed,
            added=pair.truth.added,
            t1_from_t0=truth[files.stem],
        )
        made = condition.render(scene, np.random.default_rng(zlib.crc32(files.stem.encode())))
        write_scene(made, root, files.stem, quality=condition.quality)
        rows.append({"stem": files.stem, "t1_from_t0": made.t1_from_t0.tolist()})
    write_json(rows, root / "pairs.json")
    write_json({"mask_frame": source.frame}, root / "dataset.json")


def write_scene(scene: Scene, root: Path, stem: str, *, quality: int | None) -> None:
    """Write the five pictures of a pair; masks always keep every bit."""
    for folder, photo in (("t0", scene.before), ("t1", scene.after)):
        if quality is None:
            write_whole(root / folder / f"{stem}.png", _encoded(".png", photo[..., ::-1]))
        else:
            options = [cv2.IMWRITE_JPEG_QUALITY, quality]
            coded = _encoded(".jpg", photo[..., ::-1], options)
            write_whole(root / folder / f"{stem}.jpg", coded)
    masks = {"mask": scene.changed, "removed": scene.removed, "added": scene.added}
    for folder, mask in masks.items():
        white = mask.astype(np.uint8) * 255
        write_whole(root / folder / f"{stem}.png", _encoded(".png", white))


def tabulate(scores: Mapping[str, Scores]) -> Table:
    """Lay out F1, false alarms and kinds of each condition."""
    columns = ("condition", "F1 macro", "no-change false positives", "right kind", "not aligned")
    rows = []
    for name, found in scores.items():
        figures = _figures(found)
        rows.append(
            (
                f"{name}: {CONDITIONS[name].meaning}",
                _shown(figures["f1_macro"], ".3f"),
                _shown(figures["false_positive_rate"], ".4f"),
                _shown(figures["kind_accuracy"], ".2f"),
                f"{figures['not_aligned']} of {figures['pairs']}",
            )
        )
    return Table(title="Robustness of composite pairs", columns=columns, rows=tuple(rows))


def _figures(scores: Scores) -> dict[str, float | int | None]:
    values = scores.to_dict()
    return {
        "pairs": values["pairs"],
        "f1_macro": values["f1_macro"],
        "precision_macro": values["precision_macro"],
        "recall_macro": values["recall_macro"],
        "false_positive_rate": values["no_change"]["false_positive_rate"],
        "kind_accuracy": values["kind_accuracy"],
        "not_aligned": len(values["not_aligned"]),
    }


def _json(out: Path) -> Path:
    return out / "robustness.json"


def _shown(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def _shadow(size_hw: tuple[int, ...], rng: Rng) -> np.ndarray:
    """1 in the light, less on one side of a random line; (H, W)."""
    height, width = size_hw[:2]
    rows, cols = np.indices((height, width))
    angle, share = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 0.7)
    across = cols * np.cos(angle) + rows * np.sin(angle)
    dark = (across < np.quantile(across, share)).astype(np.float32)
    soft = cv2.GaussianBlur(dark, (0, 0), SHADOW_BLUR * max(height, width))
    return np.asarray(1 - soft * (1 - rng.uniform(*SHADOW)))


def _warped(mask: Mask, matrix: Homography) -> Mask:
    size_wh = mask.shape[::-1]
    grey = cv2.warpPerspective(mask.astype(np.uint8) * 255, matrix, size_wh)
    return np.asarray(grey > HALF_WHITE, dtype=np.bool_)


def _pixels(values: np.ndarray) -> Rgb:
    return np.asarray(np.clip(np.round(values), 0, 255), dtype=np.uint8)


def _encoded(kind: str, picture: np.ndarray, options: list[int] | None = None) -> bytes:
    _, content = cv2.imencode(kind, np.ascontiguousarray(picture), options or [])
    return content.tobytes()


if __name__ == "__main__":
    main()
