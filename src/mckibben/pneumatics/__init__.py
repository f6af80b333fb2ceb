"""Pneumatics: gas, orifices, valves, tubes, volumes, and circuits of them."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from ..components.gas import AIR as AIR
    from ..components.gas import Gas as Gas
    from .build import ELEMENTS as ELEMENTS
    from .build import build_element as build_element
    from .build import size_as as size_as
    from .build import valve_from_specimen as valve_from_specimen
    from .circuit import Branch as Branch
    from .circuit import Circuit as Circuit
    from .orifice import Orifice as Orifice
    from .tubes import InertialTube as InertialTube
    from .tubes import LumpedTube as LumpedTube
    from .volume import MovingVolume as MovingVolume
    from .volume import Reservoir as Reservoir

lazy_submodules(__name__)
lazy_names(__name__)
