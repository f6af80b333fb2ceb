"""Analogue sensors of rigs: measured quantity, labels in figures and web interface, declared once.

A rig's file has a table ``[sensors.NAME]`` for each of them, and the recording a channel of that name. An installed package
adds one by an entry point of the group ``mckibben.sensors``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from .._jax import jnp
from ..components import Scalar
from ..registry import Registry
from .hardware.pneumatics import PORT

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


def _tested_pressure(plant: Any, state: Any, memory: Any, inputs: Any) -> Scalar:
    return state["circuit"]["pressure"][plant.tested] - plant.machine.environment.pressure_abs


def _port_pressure(plant: Any, state: Any, memory: Any, inputs: Any) -> Scalar:
    return state["circuit"]["pressure"][PORT] - plant.machine.environment.pressure_abs


def _load_tension(plant: Any, state: Any, memory: Any, inputs: Any) -> Scalar:
    """Tension at the load, beyond any surface that the muscle lies over."""
    if not plant.machine.units:
        return jnp.zeros(())
    _, _, felt = plant.machine.pulls(state, memory, inputs)
    return sum(felt.values(), start=jnp.zeros(()))


SENSORS: Registry[SensorKind] = Registry(
    "mckibben.sensors",
    "sensor",
    {
        "pressure": SensorKind(
            unit="Pa", quantity="pressure", label="pressure, muscle", symbol="P'", true_value=_tested_pressure,
            meaning="gauge pressure at the muscle, measured", set_point="pressure",
        ),
        "valve_pressure": SensorKind(
            unit="Pa", quantity="pressure", label="pressure, valve", symbol="Pv'", true_value=_port_pressure,
            meaning="gauge pressure at the valve, measured", set_point="pressure",
        ),
        "tension": SensorKind(
            unit="N", quantity="tension", label="tension", symbol="F", true_value=_load_tension,
            meaning="tension, measured", set_point="tension",
        ),
    },
)  # fmt: skip


def sensor_units(names: Iterable[str]) -> dict[str, str]:
    """SI units of the channels, by sensor."""
    return {name: SENSORS[name].unit for name in names}
