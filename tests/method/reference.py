"""ZeroSCD in plain loops, written from the paper's text (docs/method.md) and not from our code.

Slow on purpose: one number at a time, every patch and every pixel in turn, nothing to get wrong
but the formula itself. Points are (x, y) and pixel centres whole numbers; a photo's patches lie
edge to edge. Where the paper is silent the reading is said beside the line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Bits = NDArray[np.bool_]
    Point = tuple[float, float]

Descriptor = list[float]
Photo = list[list[Descriptor]]  # [row][column] of patches


# Step 2: similarity and matches -----------------------------------------------------------------


def dot(p: Descriptor, q: Descriptor) -> float:
    return sum(a * b for a, b in zip(p, q, strict=True))


def cosine(p: Descriptor, q: Descriptor) -> float:
    return dot(p, q) / math.sqrt(dot(p, p) * dot(q, q))


def similarity(patches_t0: Photo, patches_t1: Photo) -> list[list[float]]:
    """S_ij of patch i of t0 and patch j of t1, both counted row by row."""
    flat_t1 = [q for row in patches_t1 for q in row]
    return [[cosine(p, q) for q in flat_t1] for row in patches_t0 for p in row]


def row_argmax(s: list[list[float]]) -> list[tuple[int, int]]:
    matches = []
    for i, row in enumerate(s):
        best = 0
        for j, value in enumerate(row):
            if value > row[best]:
                best = j
        matches.append((i, best))
    return matches


def mutual(s: list[list[float]]) -> list[tuple[int, int]]:
    columns = [[row[j] for row in s] for j in range(len(s[0]))]
    back = dict(row_argmax(columns))
    return [(i, j) for i, j in row_argmax(s) if back[j] == i]


# Step 3: homography -----------------------------------------------------------------------------


def centre(index: int, columns: int, patch_px: float) -> Point:
    """Centre of a patch: half a patch from its left edge, which lies at -0.5."""
    row, column = divmod(index, columns)
    return (column + 0.5) * patch_px - 0.5, (row + 0.5) * patch_px - 0.5


def carry(h: Array, point: Point) -> Point:
    """(x', y', 1) ~ H (x, y, 1); a point on the horizon goes to infinity."""
    x, y = point
    w = float(h[2, 0] * x + h[2, 1] * y + h[2, 2])
    if w == 0:
        return math.inf, math.inf
    return (
        (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / w,
        (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / w,
    )


def fit(points_a: Sequence[Point], points_b: Sequence[Point]) -> Array:
    """The homography through four pairs, or nearest to more: the direct linear transform."""
    largest = max(abs(value) for point in [*points_a, *points_b] for value in point)
    scale = np.diag([largest, largest, 1.0])  # keeps the equations well conditioned
    rows = []
    for (xa, ya), (xb, yb) in zip(points_a, points_b, strict=True):
        x, y, u, v = xa / largest, ya / largest, xb / largest, yb / largest
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y, -u])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y, -v])
    h = np.linalg.svd(np.array(rows))[2][-1].reshape(3, 3)
    h = scale @ h @ np.linalg.inv(scale)
    return np.asarray(h / h[2, 2])


def ransac(
    points_a: Sequence[Point], points_b: Sequence[Point], *, tolerance_px: float, tries: int
) -> tuple[Array, list[int]]:
    """Draw four pairs many times; the homography that most pairs agree with, refitted to them."""
    rng = np.random.default_rng(0)
    best: list[int] = []
    for _ in range(tries):
        drawn = rng.choice(len(points_a), 4, replace=False)
        h = fit([points_a[k] for k in drawn], [points_b[k] for k in drawn])
        agree = []
        for k, (a, b) in enumerate(zip(points_a, points_b, strict=True)):
            x, y = carry(h, a)
            if math.hypot(x - b[0], y - b[1]) <= tolerance_px:
                agree.append(k)
        if len(agree) > len(best):
            best = agree
    return fit([points_a[k] for k in best], [points_b[k] for k in best]), best


# Step 4: coarse change --------------------------------------------------------------------------


def distance(p: Descriptor, q: Descriptor) -> float:
    return math.sqrt(sum((a - b) ** 2 for a, b in zip(p, q, strict=True)))


def clamp(value: float, highest: int) -> float:
    return min(max(value, 0.0), float(highest))


def nearest(patches: Photo, column: float, row: float) -> Descriptor:
    column, row = clamp(column, len(patches[0]) - 1), clamp(row, len(patches) - 1)
    return patches[math.floor(row + 0.5)][math.floor(column + 0.5)]


def bilinear(patches: Photo, column: float, row: float) -> Descriptor:
    """Mix the four patches around a place; the mixture gets unit length again."""
    column, row = clamp(column, len(patches[0]) - 1), clamp(row, len(patches) - 1)
    mixed = [0.0] * len(patches[0][0])
    for r in (math.floor(row), math.floor(row) + 1):
        for c in (math.floor(column), math.floor(column) + 1):
            weight = max(0.0, 1 - abs(row - r)) * max(0.0, 1 - abs(column - c))
            if weight > 0:
                for k, value in enumerate(patches[r][c]):
                    mixed[k] += weight * value
    length = math.sqrt(dot(mixed, mixed))
    return [value / length for value in mixed]


def patch_distances(
    here: Photo,
    there: Photo,
    carried: Callable[[int, int], Point],
    *,
    read: Callable[[Photo, float, float], Descriptor] = nearest,
    radius: int = 0,
) -> list[list[float | None]]:
    """P_diff: for every patch the distance to what it is carried to; None = outside the photo.

    Args:
        here: Patches of the photo whose frame the answer is in.
        there: Patches of the other photo.
        carried: From (column, row) to fractional (column, row) of the other grid.
        read: How a descriptor is read between patches.
        radius: The smallest distance in the neighbourhood counts.
    """
    rows, columns = len(there), len(there[0])
    result: list[list[float | None]] = []
    for v, patches in enumerate(here):
        line: list[float | None] = []
        for u, p in enumerate(patches):
            column, row = carried(u, v)
            if not (-0.5 <= column <= columns - 0.5 and -0.5 <= row <= rows - 0.5):
                line.append(None)
                continue
            around = [
                distance(p, read(there, column + dx, row + dy))
                for dy in range(-radius, radius + 1)
                for dx in range(-radius, radius + 1)
            ]
            line.append(min(around))
        result.append(line)
    return result


def to_pixels(p_diff: list[list[float | None]], size_hw: tuple[int, int], patch_px: float) -> Array:
    """The heat map drawn at the photo's size: bilinear between patch centres (the paper is silent).

    Outside the outer centres the rim's value holds; places not seen count as distance 0.
    """
    rows, columns = len(p_diff), len(p_diff[0])
    heat = np.zeros(size_hw)
    for y in range(size_hw[0]):
        for x in range(size_hw[1]):
            row = clamp((y + 0.5) / patch_px - 0.5, rows - 1)
            column = clamp((x + 0.5) / patch_px - 0.5, columns - 1)
            for r in (math.floor(row), math.floor(row) + 1):
                for c in (math.floor(column), math.floor(column) + 1):
                    weight = max(0.0, 1 - abs(row - r)) * max(0.0, 1 - abs(column - c))
                    if weight > 0:
                        heat[y, x] += weight * (p_diff[r][c] or 0.0)
    return heat


def threshold(heat: Array, tau: float) -> Bits:
    coarse = np.zeros(heat.shape, dtype=bool)
    for y in range(heat.shape[0]):
        for x in range(heat.shape[1]):
            coarse[y, x] = heat[y, x] > tau
    return coarse


def warp(mask_a: Bits, a_from_b: Array, size_b_hw: tuple[int, int]) -> Bits:
    """Carry a mask: every pixel of b looks up the pixel of a that it comes from."""
    height, width = mask_a.shape
    carried = np.zeros(size_b_hw, dtype=bool)
    for y in range(size_b_hw[0]):
        for x in range(size_b_hw[1]):
            from_x, from_y = carry(a_from_b, (x, y))
            column, row = round(from_x), round(from_y)
            if 0 <= column < width and 0 <= row < height:
                carried[y, x] = mask_a[row, column]
    return carried


def cells(p_diff: list[list[float | None]], size_hw: tuple[int, int], tau: float) -> Bits:
    """I_coarse: the whole square of every changed patch; patches not seen are not counted."""
    rows, columns = len(p_diff), len(p_diff[0])
    coarse = np.zeros(size_hw, dtype=bool)
    for y in range(size_hw[0]):
        for x in range(size_hw[1]):
            value = p_diff[y * rows // size_hw[0]][x * columns // size_hw[1]]
            coarse[y, x] = value is not None and value > tau
    return coarse


# Step 5: refinement -----------------------------------------------------------------------------


def area(mask: Bits) -> int:
    return int(np.count_nonzero(mask))


def gamma(segment: Bits, coarse: Bits) -> float:
    """Area(s and I_coarse) / area(s)."""
    return area(segment & coarse) / area(segment)


def overlap(warped: Bits, other: Bits) -> float:
    return area(warped & other) / area(warped)


def iou(warped: Bits, other: Bits) -> float:
    return area(warped & other) / area(warped | other)


def confirmed(
    warped: Bits, flagged_there: Sequence[Bits], *, beta: float, verify: str = "overlap"
) -> bool:
    """s_flag' is the flagged segment of the other photo that covers s_flag best.

    Low overlap confirms. A segment that leaves the other photo has no counterpart.
    """
    if area(warped) == 0:
        return True
    compare = overlap if verify == "overlap" else iou
    return all(compare(warped, other) < beta for other in flagged_there)


@dataclass(frozen=True)
class PaperInput:
    """What the paper's pipeline starts from."""

    patches_t0: Photo
    patches_t1: Photo
    sizes_hw: tuple[tuple[int, int], tuple[int, int]]
    segments_t0: Sequence[Bits]
    segments_t1: Sequence[Bits]
    patch_px: float = 16
    tau: float = 0.65
    alpha: float = 0.8
    beta: float = 0.7
    tolerance_patches: float = 1.25


@dataclass(frozen=True)
class PaperOutput:
    """What the paper's pipeline ends with, and what it went through."""

    t1_from_t0: Array
    matches: list[tuple[int, int]]
    inliers: int
    p_diff: list[list[float | None]]
    unknown_t0: Bits
    unknown_t1: Bits
    removed: Bits
    added: Bits
    refuted: int


def detect(given: PaperInput, t1_from_t0: Array | None = None) -> PaperOutput:
    """Steps 2 to 5 with the literal reading of every open point; RANSAC's result may be given."""
    size_t0_hw, size_t1_hw = given.sizes_hw
    columns_t0, columns_t1 = len(given.patches_t0[0]), len(given.patches_t1[0])
    matches = row_argmax(similarity(given.patches_t0, given.patches_t1))
    points_t0 = [centre(i, columns_t0, given.patch_px) for i, _ in matches]
    points_t1 = [centre(j, columns_t1, given.patch_px) for _, j in matches]
    tolerance_px = given.tolerance_patches * given.patch_px
    h, inliers = t1_from_t0, 0
    if h is None:
        h, agree = ransac(points_t0, points_t1, tolerance_px=tolerance_px, tries=60)
        inliers = len(agree)
    t0_from_t1 = np.linalg.inv(h)

    def carried(u: int, v: int) -> Point:
        x, y = carry(h, centre(v * columns_t0 + u, columns_t0, given.patch_px))
        return (x + 0.5) / given.patch_px - 0.5, (y + 0.5) / given.patch_px - 0.5

    p_diff = patch_distances(given.patches_t0, given.patches_t1, carried)
    coarse_t0 = cells(p_diff, size_t0_hw, given.tau)
    coarse_t1 = warp(coarse_t0, t0_from_t1, size_t1_hw)
    flagged_t0 = [s for s in given.segments_t0 if gamma(s, coarse_t0) > given.alpha]
    flagged_t1 = [s for s in given.segments_t1 if gamma(s, coarse_t1) > given.alpha]
    removed, added = np.zeros(size_t0_hw, dtype=bool), np.zeros(size_t1_hw, dtype=bool)
    refuted = 0
    for s in flagged_t0:
        if confirmed(warp(s, t0_from_t1, size_t1_hw), flagged_t1, beta=given.beta):
            removed |= s
        else:
            refuted += 1
    for s in flagged_t1:
        if confirmed(warp(s, h, size_t0_hw), flagged_t0, beta=given.beta):
            added |= s
        else:
            refuted += 1
    return PaperOutput(
        t1_from_t0=h,
        matches=matches,
        inliers=inliers,
        p_diff=p_diff,
        unknown_t0=~warp(np.ones(size_t1_hw, dtype=bool), h, size_t0_hw),
        unknown_t1=~warp(np.ones(size_t0_hw, dtype=bool), t0_from_t1, size_t1_hw),
        removed=removed,
        added=added,
        refuted=refuted,
    )
