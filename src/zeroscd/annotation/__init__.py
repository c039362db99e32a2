"""Masks that people drew: their outlines snapped to the things in the photos, for review."""

from zeroscd.annotation.refine import Refinement, refine_masks
from zeroscd.annotation.review import Decision, read_decisions

__all__ = ["Decision", "Refinement", "read_decisions", "refine_masks"]
