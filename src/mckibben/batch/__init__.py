"""Many at once: variants of a protocol on a rig, in lanes of one compiled function, on one machine or on many."""

from .outcome import Outcome
from .outputs import Output
from .variants import Variants, crossed, grid, latin, listed

__all__ = ["Outcome", "Output", "Variants", "crossed", "grid", "latin", "listed"]
