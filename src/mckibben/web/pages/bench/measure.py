"""Work, power and air of the last whole cycle of a run, from the displayed samples."""

from __future__ import annotations

import numpy as np

from ....analysis.loops import closed_area
from ....analysis.shortening import shortening_power
from ....documents import JsonValue
from ....errors import MckibbenError
from ....quantities import from_si
from ....recordings.recording import Channel, Recording

LEAST = 16  # samples of a cycle


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
    if n < LEAST or len(length) < n or not (np.isfinite(length).all() and np.isfinite(tension).all()):
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
