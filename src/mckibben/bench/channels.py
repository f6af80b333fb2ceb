"""Names, units and meanings of the channels of circuits and test machines."""

from __future__ import annotations

from collections.abc import Iterable

from ..assembly.output_names import output_meaning
from .sensors import SENSORS

# Outputs whose last part is called the same elsewhere, by their whole name.
OWN = {"motor.position": ("m", "position of the pulley's rim, motor")}
RENAMED = {
    "load.position": "motor.position",
    "load.velocity": "motor.velocity",
    "load.current": "motor.current",
    "load.deflection": "frame.deflection",
}

COMMANDS = {
    "command.pressure": ("Pa", "set-point of the pressure"),
    "command.span": ("m", "set-point of the span"),
    "command.velocity": ("m/s", "set-point of the velocity"),
    "command.tension": ("N", "set-point of the tension"),
    "valve.command": ("Pa", "pressure asked of the valve"),
    "motor.command": ("N", "force asked of the motor"),
    "shut_off.command": ("1", "1 while the shut-off is asked to be open"),
}
INPUTS = {"valve": "valve.command", "motor": "motor.command", "open": "shut_off.command"}


def measured() -> dict[str, tuple[str, str]]:
    """Return unit and meaning of every measured channel: those of the sensors, and the span of the encoder."""
    sensors = {name: (kind.unit, kind.meaning) for name, kind in SENSORS.items()}
    return sensors | {"span": ("m", "span by the encoder, measured")}


def described(name: str) -> tuple[str, str]:
    """Return unit and meaning of a true channel by its dotted name."""
    return OWN[name] if name in OWN else output_meaning(name)


def kinds(names: Iterable[str]) -> dict[str, tuple[str, str, str]]:
    """Return unit, kind and meaning of the channels of a test machine, by name."""
    channel_kinds, sensed = {}, measured()
    for name in names:
        kind = "measured" if name in sensed else "command" if name in COMMANDS else "true"
        unit, meaning = sensed.get(name) or COMMANDS.get(name) or described(name)
        channel_kinds[name] = (unit, kind, meaning)
    return channel_kinds
