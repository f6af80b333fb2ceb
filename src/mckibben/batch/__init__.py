"""Sweeps: variants of a protocol on a rig, in lanes of one compiled function, on one machine or a cluster."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules
from .outputs import Output, VariantOutcome
from .variants import Variants, crossed, grid, latin, listed

if TYPE_CHECKING:
    from . import drive as drive
    from . import posterior as posterior
    from . import sweep as sweep
    from .store import read_results as read_results

__all__ = ["Output", "VariantOutcome", "Variants", "crossed", "grid", "latin", "listed", "read_results"]

lazy_submodules(__name__)
lazy_names(__name__)
