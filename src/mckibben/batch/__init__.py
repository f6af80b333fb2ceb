"""Many at once: variants of a protocol on a rig, in lanes of one compiled function, on one machine or on many."""

from .outputs import Output, VariantOutcome
from .variants import Variants, crossed, grid, latin, listed

__all__ = ["Output", "VariantOutcome", "Variants", "crossed", "grid", "latin", "listed"]
