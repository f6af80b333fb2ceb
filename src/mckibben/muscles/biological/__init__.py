"""Biological muscle as a reference: one file per effect, and the muscle that puts them together.

All curves are relative: lengths to the rest (optimal) length L0, velocities to the largest shortening velocity,
tensions to the largest isometric tension. Only the muscle knows metres and newtons.
"""

from .muscle import BiologicalMuscle

__all__ = ["BiologicalMuscle"]
