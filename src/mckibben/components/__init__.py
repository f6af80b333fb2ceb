"""Interfaces that the rooms above share, and nothing that computes physics.

JAX is used through `mckibben._jax`, which switches it to float64 and loads it when it is first needed.
"""

from typing import TYPE_CHECKING

from .._lazy import lazy_submodules
from .element import Advanced as Advanced
from .element import ForceElement as ForceElement
from .element import Hysteresis as Hysteresis
from .element import MemoryElement as MemoryElement
from .flow import Environment as Environment
from .flow import FlowElement as FlowElement
from .flow import GasState as GasState
from .flow import TwoPort as TwoPort
from .module import AbstractVar as AbstractVar
from .module import Module as Module
from .module import Scalar as Scalar
from .module import derivative as derivative
from .module import field as field
from .module import jit_arrays as jit_arrays

if TYPE_CHECKING:
    from . import paths as paths


lazy_submodules(__name__)
