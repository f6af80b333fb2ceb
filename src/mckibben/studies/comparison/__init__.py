"""Comparison of McKibben and biological muscles: Table 1, equal protocols, and matching by added elements.

Everything is relative to the muscle: lengths to its rest length L0, tensions to F0, what it pulls at L0 fully driven, and
the drive to the full one. A pressure set-point over the full pressure is what an activation is to a biological muscle.
"""

from ..._lazy import lazy_submodules
from .side_by_side import MuscleTable as MuscleTable
from .side_by_side import compare as compare
from .side_by_side import stages as stages
from .table import FULL_PRESSURE as FULL_PRESSURE
from .table import PROPERTIES as PROPERTIES
from .table import ComparedMuscle as ComparedMuscle
from .table import MuscleColumn as MuscleColumn
from .table import Property as Property
from .table import PropertyRow as PropertyRow
from .table import subject as subject

lazy_submodules(__name__)
