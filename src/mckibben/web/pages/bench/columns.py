"""Conversion of the channels of a run or a session to the seven of the web interface."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....bench.rig import Rig
from ....documents import JsonValue
from ....pneumatics.gas import AIR
from ....quantities import from_si, shown_unit

TUBE = "tube.mass_flow"
# Of every channel: SI unit of the stream, and the unit and factor of the screen.
UNITS = {"pressure": "Pa", "tension": "N", "length": "m", "flow": "m^3/s", "valve": "1"}
SHOWN = {"flow": "L/min", "valve": "%"}


class Columns:
    """Conversion of a rig's channels to those of the web interface.

    Args:
        rig: whose machine it is.
    """

    def __init__(self, rig: Rig) -> None:
        self.top = float(rig.valve_out.high)
        room = rig.environment
        self.density = float(AIR.density(room.pressure_abs, room.temperature))

    def of(self, arrays: Mapping[str, JsonValue]) -> dict[str, np.ndarray]:
        """Return columns (n,) by the names of `stream.CHANNELS` [SI]; the flow is in terms of ambient air [m^3/s]."""
        names = {
            "pressure": "pressure",
            "tension": "tension",
            "length": "span",
            "set_pressure": "command.pressure",
            "set_length": "command.span",
        }
        columns = {shown: np.asarray(arrays[name], float) for shown, name in names.items() if name in arrays}
        if "valve.command" in arrays:
            columns["valve"] = np.asarray(arrays["valve.command"], float) / self.top
        flow = self._flow(arrays)
        if flow is not None:
            columns["flow"] = flow / self.density
        return columns

    def _flow(self, arrays: Mapping[str, JsonValue]) -> np.ndarray | None:
        """Return the mass flow towards the muscle [kg/s]; None if no channel contains it."""
        if TUBE in arrays:
            return np.asarray(arrays[TUBE], float)
        into = [n for n in arrays if n.endswith("supply_to_outlet.mass_flow")]
        out = [n for n in arrays if n.endswith("outlet_to_exhaust.mass_flow")]
        if not into or not out:
            return None
        flow: np.ndarray | None = np.asarray(arrays[into[0]], float) - np.asarray(arrays[out[0]], float)
        return flow


def factors() -> dict[str, dict[str, JsonValue]]:
    """Return the displayed unit of every quantity, and its factor from SI."""
    units = {}
    for name, si in UNITS.items():
        unit = SHOWN.get(name, shown_unit(si))
        factor = 100.0 if unit == "%" else from_si(1.0, si, "l/min" if unit == "L/min" else unit)
        units[name] = {"unit": unit, "factor": factor}
    return units
