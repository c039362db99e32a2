"""Outlines of the regions in the common frame, those at the edge of what both photos show last."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from zeroscd.pages import Shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from zeroscd.arrays import Mask
    from zeroscd.export.frame import CommonFrame
    from zeroscd.pages import Ring
    from zeroscd.records import Changes, Region

EDGE_WIDTH = 0.01  # of the view's longer side, our choice: about the precision of an outline
EDGE_SHARE = 0.15  # of an outline along the edge, our choice: less only touches it


def to_shapes(result: Changes, view: CommonFrame) -> list[Shape]:
    """Carry the outlines of a result's regions into the view.

    Returns:
        In the order of the regions, but those at the edge of what both photos show come last.
    """
    edge = _edge(view)
    shapes = [_shape(region, view, edge) for region in result.regions]
    return sorted(shapes, key=lambda shape: shape.at_edge)


def _shape(region: Region, view: CommonFrame, edge: Mask) -> Shape:
    rings = [
        # Corners of pixels are whole numbers; homographies count from their centres.
        (view.carry(np.array(ring) - 0.5, frame=region.frame) + 0.5).tolist()
        for ring in region.polygon_xy
    ]
    at_edge = region.at_border or _share(rings, edge) > EDGE_SHARE
    return Shape(id=region.id, kind=region.kind, rings_xy=rings, at_edge=at_edge)


def _edge(view: CommonFrame) -> Mask:
    """Mark what both photos show and lies close to where one of them ends, (H, W)."""
    both = np.pad((~view.unseen).astype(np.uint8), 1)  # nothing is seen beyond the view
    away_px = cv2.distanceTransform(both, cv2.DIST_L2, cv2.DIST_MASK_3)[1:-1, 1:-1]
    return np.asarray(away_px <= max(1.0, EDGE_WIDTH * max(view.size_hw)), np.bool_)


def _share(rings: Sequence[Ring], edge: Mask) -> float:
    """Return which share of an outline lies on the edge, or beyond the view."""
    line, last_xy = np.zeros(edge.shape, np.uint8), np.array(edge.shape[::-1]) - 1
    corners = [np.clip(np.floor(ring), 0, last_xy).astype(np.int32) for ring in rings]
    cv2.polylines(line, corners, isClosed=True, color=1)
    return float(edge[line > 0].mean())
