"""Two muscles, of which one has learned, on a small tank that is not filled again: what one takes the other has not."""

from pathlib import Path

from learned_muscle import learned_muscle
from mckibben_hosts import Part

CIRCUIT = """schema = 1
title = "two muscles on a tank"
nodes.room = { kind = "atmosphere" }
nodes.tank = { kind = "volume", volume = "60 ml", start_pressure = "6 bar", heat = "isothermal" }
[elements]
left_valve = { VALVE, work = "left", command = "left" }
right_valve = { VALVE, work = "right", command = "right" }
[nodes.left]
kind = "muscle"
specimen = "nylon"
length = "14 cm"
dead_volume = "1 cm^3"
heat = "isothermal"
[nodes.right]
kind = "muscle"
specimen = "LEARNED"
length = "14 cm"
dead_volume = "1 cm^3"
heat = "isothermal"
[signals]
left = 0.0
right = 0.0
[run]
duration = "1 s"
""".replace("VALVE", 'kind = "spool_valve", supply = "tank", exhaust = "room", specimen = "MPYE-5-1-8-LF"')


def tank_part(folder: Path) -> Part:
    """The part, from a circuit file in a folder."""
    path = folder / "tank.toml"
    path.write_text(CIRCUIT.replace("LEARNED", str(learned_muscle(folder))), encoding="utf-8")
    return Part.from_circuit(path)
