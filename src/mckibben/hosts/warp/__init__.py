"""A part for NVIDIA Warp: MuJoCo Warp and Newton, on processors and GPUs."""

from __future__ import annotations

from .export import export_warp

__all__ = ["export_warp"]
