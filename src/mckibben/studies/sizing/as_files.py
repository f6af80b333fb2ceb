"""The chosen combination of a sizing as files: the muscle as a specimen, and with valve and tube as a circuit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ...assembly.build import INFERRED as ASSEMBLED
from ...documents import JsonValue
from ...errors import InputError
from ...muscles.law import TensionLaw
from ...pneumatics.build import ELEMENTS
from ...quantities import declared
from ...specimens import Specimen, SpecimenNumber
from ...specimens.model import KNOWN_PROPERTIES
from ...specimens.parts import parts
from .candidate import Candidate, Judged
from .lines import LineResult
from .requirements import Requirements

BRAID_FROM = "nylon"  # the muscle whose inferred numbers a braid has
OPENS = "20 ms"  # after the start of a circuit's run
LEAST_RUN = 0.3  # [s]


def specimen_of(muscle: Candidate, pressure: float) -> Specimen:
    """A candidate as a specimen: the one that it is, or its law with the range of each number.

    Args:
        muscle: which.
        pressure: gauge pressure for which it was sized [Pa].
    """
    if muscle.kind == "specimen" and muscle.spec is not None:
        return muscle.spec
    ends = muscle.law_ends().pairs
    note = "computed for requirements; nothing measured"
    numbers = {}
    for name, quantity in declared(muscle.law).items():
        value = _parameter(muscle.law, name)
        if value is None:
            continue
        low = high = value
        for pair in ends.values():
            changes = [(_parameter(law, name) or 0.0) - value for law in pair]
            low, high = low + min(0.0, *changes), high + max(0.0, *changes)
        span = (low, high) if low < high else None
        numbers[name] = SpecimenNumber(value=value, unit=quantity.unit, inferred=True, note=note, range=span)
    made = {"upper_length": muscle.longest} | {
        name: muscle.dimensions[name] for name in ("rest_length", "thread_length", "turns") if name in muscle.dimensions
    }
    friction = SpecimenNumber(
        value=muscle.friction, unit="N", inferred=True, note=f"share of the largest tension at {pressure / 1e5:g} bar"
    )
    return Specimen(
        id=muscle.id,
        kind="mckibben",
        title=muscle.title,
        sources=list(muscle.sources),
        law=muscle.law_name,
        note=f"Sized for {pressure / 1e5:g} bar; error of the law {muscle.error.share:.1%} of the largest force.",
        properties={
            **{n: SpecimenNumber(value=v, unit=KNOWN_PROPERTIES[n], inferred=True, note=note) for n, v in made.items()},
            "coulomb_friction": friction,
        },
        laws={muscle.law_name: numbers},
        errors={
            muscle.law_name: {
                "largest": SpecimenNumber(value=muscle.error.share, unit="1", inferred=True, note=muscle.error.source)
            }
        },
    )


def _parameter(law: TensionLaw, name: str) -> float | None:
    value = getattr(law, name)
    return None if value is None or isinstance(value, tuple) else float(value)


def circuit_of(
    muscle: Judged, wish: Requirements, line: LineResult | None, valves: Mapping[str, Specimen]
) -> dict[str, JsonValue]:
    """A muscle, valve and tube as the tables of a circuit's file.

    Args:
        muscle: which, held at the end of its stroke.
        wish: pressure and stroke.
        line: valve and tube.
        valves: valves of the user's own by name, whose numbers are written out.

    Raises:
        InputError: there is no line.
    """
    if line is None:
        raise InputError(
            "circuit", None, "needs a valve and a tube that reach the force: none was looked for, or none does"
        )
    m = muscle.muscle
    node: dict[str, Any] = {
        "kind": "muscle",
        "specimen": m.spec.id if m.spec is not None else BRAID_FROM,
        "law": m.law_name,
    }
    if m.kind != "specimen":
        known = declared(m.law)
        values = {name: _parameter(m.law, name) for name in known}
        node["parameters"] = {n: _words(v, known[n].unit) for n, v in values.items() if v is not None}
    node |= {"length": _words(m.longest - wish.stroke, "m")}
    kind = line.element
    ends = {"supply": "supply", "exhaust": "room"}
    valve: dict[str, Any] = {"kind": kind, **{port: ends.get(port, "port") for port in ELEMENTS[kind].ports}}
    if line.valve in valves:
        stated = valves[line.valve].valve
        valve |= {name: _words(float(n.value), n.unit) for name, n in stated.items() if not isinstance(n.value, list)}
    else:
        valve["specimen"] = line.valve
    valve["command"] = "command"
    regulated = ELEMENTS[kind].command_unit == "Pa"
    closed = "0 bar" if regulated else -1.0 if kind == "spool_valve" else 0.0
    opened = _words(wish.pressure, "Pa") if regulated else 1.0
    inner = next(p for p in parts("tube") if p.id == line.tube).values["inner_diameter"]
    longest = max(LEAST_RUN, 4.0 * max(line.to_force or 0.0, line.rise or 0.0))
    return {
        "schema": 1,
        "title": f"{m.id} behind {line.valve} and {line.tube}",
        "nodes": {
            "supply": {"kind": "reservoir", "pressure": _words(line.supply, "Pa")},
            "room": {"kind": "atmosphere"},
            "port": {"kind": "junction", "volume": _words(ASSEMBLED["port_volume"].value, "m^3")},
            "muscle": node,
        },
        "elements": {
            "valve": valve,
            "tube": {
                "kind": "lumped_tube",
                "from": "port",
                "to": "muscle",
                "length": _words(line.tube_length, "m"),
                "diameter": _words(inner, "m"),
            },
        },
        "signals": {"command": {"kind": "steps", "times": ["0 s", OPENS], "values": [closed, opened]}},
        "run": {"duration": f"{math.ceil(10.0 * longest) / 10.0:g} s"},
    }


def _words(value: float, unit: str) -> str | float:
    return float(value) if unit == "1" else f"{float(value)!r} {unit}"


def toml_of(document: Mapping[str, JsonValue]) -> str:
    """Text of a circuit's file."""
    import tomlkit

    return tomlkit.dumps(document)
