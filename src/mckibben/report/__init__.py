"""Figures and reports: what people would rather see than read. Only `report.figures` draws."""

from .._lazy import lazy_submodules

lazy_submodules(__name__)
