"""Sweeps: variants of a protocol on a rig, in lanes of one compiled function, on one machine or a cluster."""

from typing import TYPE_CHECKING

from .._lazy import lazy_submodules
from .outputs import Output, VariantOutcome
from .variants import Variants, crossed, grid, latin, listed

if TYPE_CHECKING:
    from . import drive as drive
    from . import sweep_file as sweep_file
    from . import workers as workers

__all__ = ["Output", "VariantOutcome", "Variants", "crossed", "grid", "latin", "listed"]

lazy_submodules(__name__)
