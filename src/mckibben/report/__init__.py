"""Figures and reports. Only `report.figures` draws."""

from .._lazy import lazy_submodules

lazy_submodules(__name__)
