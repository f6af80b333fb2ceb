"""Tension of every shipped McKibben muscle where something holds it, beside that of its law; run it for a table."""

import sys
import tempfile
from pathlib import Path

import numpy as np

import mckibben as mk
from mckibben.muscles.plausible import highest_pressure
from mckibben.specimens import specimen, specimen_ids
from mckibben_hosts import Part

SHARES = (0.8, 0.85, 0.9, 0.95, 1.0)  # of the rest length
PRESSURES = (0.25, 0.5, 0.75, 1.0)  # of the rated one
HIGHEST = 8e5  # of muscles that state none, and of those that state more than the supply gives [Pa]
G = 9.80665
AIR = mk.Air(supply=10e5, valve="regulator")  # the most that is usual
CIRCUIT = """
schema = 1
title = "A muscle behind a tube"
[nodes.regulator]
kind = "reservoir"
signal = "feed"
[nodes.muscle]
kind = "muscle"
specimen = "{muscle}"
length = "{span} m"
heat = {{ kind = "wall", conductance = "0.1 W/K" }}
start_pressure = "1 bar"
[elements.tube]
kind = "lumped_tube"
from = "regulator"
to = "muscle"
length = "2 m"
diameter = "4 mm"
[signals.feed]
kind = "constant"
value = "1 bar"
[run]
duration = "1 s"
period = "10 ms"
"""


def shipped():
    """Ids of the McKibben muscles."""
    return [one for one in specimen_ids() if specimen(one).kind == "mckibben"]


def points(name):
    """Spans [m] and gauge pressures [Pa] of a muscle, and the tension of its law there [N]."""
    spec, law = specimen(name), mk.muscle(name).law
    highest = min(highest_pressure(spec)[0], HIGHEST)
    spans, pressures = spec.property_si("rest_length", "m") * np.array(SHARES), highest * np.array(PRESSURES)
    return [(float(x), float(p), float(law.tension(float(x), float(p)))) for x in spans for p in pressures]


def in_a_plate(name):
    """Tensions between two plates, each at rest and held for a tenth of a second [N], and moved by."""
    sim = mk.Simulation(mk.Plate(name), AIR, period="10 ms")
    for span, pressure, _ in points(name):
        sim.reset(pressure=pressure, span=span)
        for _ in range(10):
            seen = sim.step(muscle=pressure, span=span)
        yield seen.tension, 0.0


def in_a_circuit(name):
    """Tensions between two plates, with the air of a circuit file [N]."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "circuit.toml"
        path.write_text(CIRCUIT.format(muscle=name, span=points(name)[0][0]))
        sim = mk.Simulation(mk.Plate(name), path, period="10 ms")
    for span, pressure, _ in points(name):
        sim.reset(pressure=pressure, span=span, feed=pressure)
        for _ in range(10):
            seen = sim.step(span=span, feed=pressure)
        yield seen.tension, 0.0


def under_a_weight(name):
    """Tensions under the weight that the law carries, after a tenth of a second; it must stay where it hung [N]."""
    sim = mk.Simulation(mk.Weight(name, mass="1 kg"), AIR, period="10 ms")
    for span, pressure, tension in points(name):
        if tension == 0.0:
            yield 0.0, 0.0
            continue
        # below 10 g a mass can hardly be meant; at rest it does nothing
        one = sim.with_parameters({"load.mass": max(tension / G, 0.01), "load.weight": tension, "load.start": span})
        one.reset(pressure=pressure, muscle=pressure)
        for _ in range(10):
            seen = one.step(muscle=pressure)
        yield seen.tension, (seen.position - span) / span


def on_a_joint(name):
    """Tensions of a flexor whose moment an outside moment balances, beside an extensor without pressure [N]."""
    arm, law = 0.02, mk.muscle(name).law
    sim = mk.Simulation(mk.Joint(name, arm=arm, inertia=0.05), AIR, period="10 ms")
    arms = {side: sim.machine.load.arms[side] for side in ("flexor", "extensor")}
    for span, pressure, tension in points(name):
        other = float(law.tension(span, 0.0))
        one = sim.with_parameters({f"load.arms.{side}.span": span for side in arms})
        moment = -arm * (tension - other)
        one.reset(pressure={"flexor": pressure, "extensor": 0.0}, moment=moment)
        for _ in range(10):
            seen = one.step(flexor=pressure, extensor=0.0, moment=moment)
        yield seen.flexor_tension, arm * seen.angle / span


def in_a_part(name):
    """Mean tensions that a part gives another program in a step at rest [N]."""
    parts = {pressure: Part(name, AIR, pressure=pressure) for _, pressure, _ in points(name)}
    for span, pressure, _ in points(name):
        state = parts[pressure].rest(span)
        for _ in range(10):
            state, seen = parts[pressure].step(state, span=span, period=1e-2)
        yield seen.tension, 0.0


HOLDERS = {f.__name__: f for f in (in_a_plate, in_a_circuit, under_a_weight, on_a_joint, in_a_part)}


def difference(name, holder):
    """The largest difference to the law: of the tension, as a share of its own or of 1 N, or of the span where it hung."""
    law = np.array([tension for _, _, tension in points(name)])
    tension, moved = np.array(list(HOLDERS[holder](name))).T
    return float(max(np.abs((tension - law) / np.maximum(law, 1.0)).max(), np.abs(moved).max()))


if __name__ == "__main__":
    for muscle in sys.argv[1:] or shipped():
        rows = [f"{holder} {100.0 * difference(muscle, holder):.2g} %" for holder in HOLDERS]
        print(f"{muscle:12} {max(t for _, _, t in points(muscle)):6.0f} N  " + ", ".join(rows), flush=True)
