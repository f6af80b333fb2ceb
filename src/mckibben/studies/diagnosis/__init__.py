"""Faults of a rig, found from recordings of its normal operation."""

from typing import TYPE_CHECKING

from ..._lazy import lazy_submodules

if TYPE_CHECKING:
    from . import fault_fit as fault_fit
    from . import observer as observer

lazy_submodules(__name__)
