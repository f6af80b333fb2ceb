"""Joining: muscle, circuit, load and joint become one state equation; nothing here integrates."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from . import check as check
    from .build import AirLine as AirLine
    from .build import several as several
    from .build import unit_from_specimen as unit_from_specimen
    from .circuit_file import read_circuit as read_circuit
    from .loads import PlateLoad as PlateLoad
    from .machine import Machine as Machine

lazy_submodules(__name__)
lazy_names(__name__)
