"""Analogue sensors of rigs that this package has; `components.system` defines what a sensor declares."""

from __future__ import annotations

from typing import Any

from .._jax import jnp
from ..components import Scalar
from ..components.system import SENSORS, SensorKind, sensor_units

MUSCLE, VESSEL, PORT, LINE = "muscle", "accumulator", "port", "line"  # names of nodes of a rig's circuit

__all__ = ["PRESSURE", "SENSORS", "TENSION", "VALVE_PRESSURE", "SensorKind", "sensor_units"]


def _tested_pressure(plant: Any, state: Any, memory: Any, inputs: Any) -> Scalar:
    tested_pressure: Scalar = state["circuit"]["pressure"][plant.tested] - plant.machine.environment.pressure_abs
    return tested_pressure


def _port_pressure(plant: Any, state: Any, memory: Any, inputs: Any) -> Scalar:
    port_pressure: Scalar = state["circuit"]["pressure"][PORT] - plant.machine.environment.pressure_abs
    return port_pressure


def _load_tension(plant: Any, state: Any, memory: Any, inputs: Any) -> Scalar:
    """Tension at the load, beyond any surface that the muscle lies over."""
    if not plant.machine.units:
        return jnp.zeros(())
    _, _, felt = plant.machine.pulls(state, memory, inputs)
    return sum(felt.values(), start=jnp.zeros(()))


PRESSURE = SensorKind(
    unit="Pa", quantity="pressure", label="pressure, muscle", symbol="P'", true_value=_tested_pressure,
    meaning="gauge pressure at the muscle, measured", set_point="pressure",
)  # fmt: skip
VALVE_PRESSURE = SensorKind(
    unit="Pa", quantity="pressure", label="pressure, valve", symbol="Pv'", true_value=_port_pressure,
    meaning="gauge pressure at the valve, measured", set_point="pressure",
)  # fmt: skip
TENSION = SensorKind(
    unit="N", quantity="tension", label="tension", symbol="F", true_value=_load_tension,
    meaning="tension, measured", set_point="tension",
)  # fmt: skip
