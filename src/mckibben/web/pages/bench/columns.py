"""The seven channels of the web interface, from those of a run or a session, and what they say of its last whole cycle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....analysis.loops import closed_area
from ....analysis.shortening import shortening_power
from ....bench.rig import Rig
from ....documents import JsonValue
from ....errors import MckibbenError
from ....pneumatics.gas import AIR
from ....quantities import from_si, shown_unit
from ....recordings.recording import Channel, Recording

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


LEAST_SAMPLES = 16  # samples of a cycle


def of_cycle(columns: dict[str, np.ndarray], period: float, frequency: float) -> list[dict[str, JsonValue]]:
    """Compute work, power and air of the last cycle.

    Args:
        columns: columns of the last two cycles and some samples, (n,) each [SI].
        period: period of the samples [s].
        frequency: frequency of the cycles [Hz].

    Returns:
        Name, value, unit and places of each number that could be had; nothing if the cycle has too few samples. The
        work is positive where the muscle does it.
    """
    n = round(1.0 / (frequency * period))
    length, tension = columns["length"].astype(float), columns["tension"].astype(float)
    if n < LEAST_SAMPLES or len(length) < n or not (np.isfinite(length).all() and np.isfinite(tension).all()):
        return []
    work = -closed_area(length[-n:], tension[-n:])
    rows = [_row("Work per cycle", work, "J", 2)]
    try:
        record = Recording(
            period * np.arange(len(length)),
            {"length": Channel(length, "m", "measured"), "tension": Channel(tension, "N", "measured")},
            {},
        )
        power = shortening_power(record, length="length", tension="tension", frequency=frequency)
        rows += [
            _row("Mean power while shortening", power.mean_power, "W", 2),
            _row("Peak power", power.largest_power, "W", 2),
        ]
    except MckibbenError:
        pass  # not yet two turns of a kind
    flow = columns["flow"][-n:].astype(float)
    if np.isfinite(flow).all():
        air = from_si(float(np.sum(np.maximum(flow, 0.0)) * period), "m^3", "cm^3")
        rows.append(_row("Air per cycle, as in the room", air, "cm\u00b3", 1))
    rows.append(_row("Highest tension", float(tension[-n:].max()), "N", 1))
    return rows


def _row(name: str, value: float, unit: str, places: int) -> dict[str, JsonValue]:
    return {"name": name, "value": value, "unit": unit, "places": places}
