"""Sizing of muscle, valve, tube and gas source for a force and a stroke.

found = size(Requirements(force=50.0, stroke=0.03, pressure=5e5, length=0.2, diameter=0.03))
found.muscles[0].margins, found.lines[0].to_force, found.gas_sources[0].cycles
"""

from ..._lazy import lazy_submodules
from .as_files import circuit_of, specimen_of, toml_of
from .braid import OBJECTIVES, design
from .braid_law import BRAID_LAWS, INFERRED, LawError, braid_law, error_of_braid, error_of_specimen
from .candidate import VERDICTS, Candidate, Judged, judged, unit_of
from .catalogue import of_size, of_sizes, of_specimen, of_specimens
from .lines import WEIGHED, LineResult, lines_for, rank
from .own_parts import battery_of, tank_of, valve_of
from .requirements import Requirements, Shortfall
from .size import size, stages
from .sources import DailyUse, SourceResult, sources_for
from .spread import InferredRanges, spread_of
from .tables import Sizing

__all__ = [
    "BRAID_LAWS",
    "INFERRED",
    "OBJECTIVES",
    "VERDICTS",
    "WEIGHED",
    "Candidate",
    "DailyUse",
    "Judged",
    "LawError",
    "LineResult",
    "Shortfall",
    "Sizing",
    "SourceResult",
    "Requirements",
    "InferredRanges",
    "battery_of",
    "braid_law",
    "circuit_of",
    "design",
    "error_of_braid",
    "error_of_specimen",
    "judged",
    "lines_for",
    "of_size",
    "of_sizes",
    "of_specimen",
    "of_specimens",
    "rank",
    "size",
    "stages",
    "sources_for",
    "specimen_of",
    "spread_of",
    "tank_of",
    "toml_of",
    "unit_of",
    "valve_of",
]

lazy_submodules(__name__)
