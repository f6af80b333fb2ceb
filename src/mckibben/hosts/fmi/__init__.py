"""Parts as functional mock-up units of FMI 3.0 and 2.0, from the same C source as all other exports."""

from __future__ import annotations

from .archive import export_fmu, fmu_cautions

__all__ = ["export_fmu", "fmu_cautions"]
