"""Names, units and meanings of the channels of circuits and test machines."""

from __future__ import annotations

from collections.abc import Iterable

from .sensors import SENSORS

# Outputs by the last part of their name: unit and meaning.
OUTPUTS = {
    "pressure_abs": ("Pa", "absolute pressure"),
    "pressure": ("Pa", "gauge pressure"),
    "temperature": ("K", "temperature of the gas"),
    "mass": ("kg", "mass of the gas"),
    "mass_flow": ("kg/s", "mass flow, positive from the first port to the second"),
    "set_pressure": ("Pa", "set-point after its lag"),
    "sensed_pressure": ("Pa", "pressure that the piston senses"),
    "shaft_power": ("W", "power of the shaft"),
    "span": ("m", "span, from the anchor to the load"),
    "span_velocity": ("m/s", "rate of the span"),
    "length": ("m", "length of the braid"),
    "velocity": ("m/s", "velocity, positive lengthening"),
    "tension": ("N", "tension at the muscle"),
    "load_tension": ("N", "tension at the load"),
    "friction": ("N", "friction and creep, positive against lengthening"),
    "volume": ("m^3", "volume of the gas"),
    "slack": ("1", "1 while it is slack"),
    "current": ("A", "current of the motor"),
    "deflection": ("m", "what the frame yields"),
}
# Outputs whose last part is called the same elsewhere, by their whole name.
OWN = {"motor.position": ("m", "position of the pulley's rim, motor")}
RENAMED = {
    "load.position": "motor.position",
    "load.velocity": "motor.velocity",
    "load.current": "motor.current",
    "load.deflection": "frame.deflection",
}
CONSTANT = ("supply.", "room.")  # of nodes whose state is given; not recorded

MEASURED = {name: (kind.unit, kind.meaning) for name, kind in SENSORS.items()}
MEASURED["span"] = ("m", "span by the encoder, measured")
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


def described(name: str) -> tuple[str, str]:
    """Return unit and meaning of a true channel by its dotted name."""
    if name in OWN:
        return OWN[name]
    owner, _, last = name.rpartition(".")
    unit, meaning = OUTPUTS.get(last, ("1", last.replace("_", " ")))
    return unit, f"{meaning}, {owner}"


def kinds(names: Iterable[str]) -> dict[str, tuple[str, str, str]]:
    """Return unit, kind and meaning of the channels of a test machine, by name."""
    found = {}
    for name in names:
        if name in MEASURED:
            found[name] = (*MEASURED[name][:1], "measured", MEASURED[name][1])
        elif name in COMMANDS:
            found[name] = (*COMMANDS[name][:1], "command", COMMANDS[name][1])
        else:
            unit, meaning = described(name)
            found[name] = (unit, "true", meaning)
    return found
