"""Sizing of muscle, valve, tube and gas source for a force and a stroke.

found = size(Requirements(force=50.0, stroke=0.03, pressure=5e5, length=0.2, diameter=0.03))
found.muscles[0].margins, found.lines[0].to_force, found.gas_sources[0].cycles
"""

from ..._lazy import lazy_submodules
from .as_files import circuit_of as circuit_of
from .as_files import specimen_of as specimen_of
from .as_files import toml_of as toml_of
from .braid import OBJECTIVES as OBJECTIVES
from .braid import design as design
from .braid_law import BRAID_LAWS as BRAID_LAWS
from .braid_law import INFERRED as INFERRED
from .braid_law import LawError as LawError
from .braid_law import braid_law as braid_law
from .braid_law import error_of_braid as error_of_braid
from .braid_law import error_of_specimen as error_of_specimen
from .candidate import VERDICTS as VERDICTS
from .candidate import Candidate as Candidate
from .candidate import Judged as Judged
from .candidate import judged as judged
from .candidate import unit_of as unit_of
from .catalogue import of_size as of_size
from .catalogue import of_sizes as of_sizes
from .catalogue import of_specimen as of_specimen
from .catalogue import of_specimens as of_specimens
from .lines import WEIGHED as WEIGHED
from .lines import LineResult as LineResult
from .lines import lines_for as lines_for
from .lines import rank as rank
from .own_parts import battery_of as battery_of
from .own_parts import tank_of as tank_of
from .own_parts import valve_of as valve_of
from .requirements import Requirements as Requirements
from .requirements import Shortfall as Shortfall
from .size import size as size
from .size import stages as stages
from .sources import DailyUse as DailyUse
from .sources import SourceResult as SourceResult
from .sources import sources_for as sources_for
from .spread import InferredRanges as InferredRanges
from .spread import spread_of as spread_of
from .tables import Sizing as Sizing

lazy_submodules(__name__)
