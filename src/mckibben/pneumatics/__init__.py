"""What air does: gas, orifices, valves, tubes, volumes, and the circuit that joins them."""

from .gas import AIR, Gas

__all__ = ["AIR", "Gas"]
