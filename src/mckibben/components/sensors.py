"""Analogue sensors of rigs: measured quantity, labels in figures and web interface, declared once.

A rig's file has a table ``[sensors.NAME]`` for each of them, which may say when its reading stops the machine. The recording
has a channel of that name, and a step of a protocol can end by a test on it. An installed package adds one by an entry
point of the group ``mckibben.sensors``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from ..registry import Registry
from .module import Scalar

# What a sensor is put to [its unit], of the instrumented plant, its machine's state, memory and inputs.
TrueValue = Callable[[Any, Any, Any, Any], Scalar]


@dataclass(frozen=True, kw_only=True)
class SensorKind:
    """A kind of sensor: the quantity it measures, and where.

    Attributes:
        unit: SI unit of its channel.
        quantity: kind of value, which decides its colour: ``pressure``, ``tension``, ``length`` or ``valve``.
        label: in figures and in the web interface, such as ``pressure, muscle``.
        symbol: as the field writes it.
        meaning: meaning of its channel in a recording.
        true_value: what it is put to; straight-line, for it is compiled with the machine.
        set_point: name of the set-point that stands beside it; empty if there is none.
    """

    unit: str
    quantity: str
    label: str
    symbol: str
    meaning: str
    true_value: TrueValue
    set_point: str = ""


SENSORS: Registry[SensorKind] = Registry(
    "mckibben.sensors",
    "sensor",
    {
        "pressure": "mckibben.bench.sensors:PRESSURE",
        "valve_pressure": "mckibben.bench.sensors:VALVE_PRESSURE",
        "tension": "mckibben.bench.sensors:TENSION",
    },
)


def sensor_units(names: Iterable[str]) -> dict[str, str]:
    """SI units of the channels, by sensor."""
    return {name: SENSORS[name].unit for name in names}
