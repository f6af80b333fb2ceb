"""Units and meanings of the outputs of circuits and machines, by the last part of their dotted names."""

from __future__ import annotations

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
    "slip": ("m", "span that the clamp has lost"),
    "current": ("A", "current of the motor"),
    "deflection": ("m", "what the frame yields"),
}
CONSTANT = ("supply.", "room.")  # of nodes whose state is given; not recorded


def output_meaning(name: str) -> tuple[str, str]:
    """Return unit and meaning of an output by its dotted name."""
    owner, _, last = name.rpartition(".")
    unit, meaning = OUTPUTS.get(last, ("1", last.replace("_", " ")))
    return unit, f"{meaning}, {owner}"
