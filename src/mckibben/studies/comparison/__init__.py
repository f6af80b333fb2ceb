"""Comparison of McKibben and biological muscles: Table 1, equal protocols, and matching by added elements.

Everything is relative to the muscle: lengths to its rest length L0, tensions to F0, what it pulls at L0 fully driven, and
the drive to the full one. A pressure set-point over the full pressure is what an activation is to a biological muscle.
"""

from ..._lazy import lazy_submodules
from .side_by_side import MuscleTable, compare, stages
from .table import (
    FULL_PRESSURE,
    PROPERTIES,
    ComparedMuscle,
    MuscleColumn,
    Property,
    PropertyRow,
    subject,
)

__all__ = [
    "FULL_PRESSURE",
    "PROPERTIES",
    "MuscleColumn",
    "Property",
    "PropertyRow",
    "ComparedMuscle",
    "MuscleTable",
    "compare",
    "stages",
    "subject",
]

lazy_submodules(__name__)
