"""Parts of the user's own in a sizing: a valve from the numbers of its catalogue, a battery, a tank.

    valve      "Cv=0.3, switching_time=8 ms"      any of the six ways to state a size, with the usual keys of an element
    battery    "100 Wh"                           feeds the small compressor, and the valve
    tank       "2 l at 200 bar"                   air, filled at the temperature of the room

What is left out is a usual number with a range, marked as inferred. Range of a tank: up to 300 bar; the air in it is
Z(P) times rarer than an ideal gas, Z = 1.04 at 200 and 1.11 at 300 bar and 20 degC, as for the shipped bottles.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ...components import Environment
from ...components.gas import AIR
from ...documents import JsonValue
from ...errors import InputError
from ...pneumatics.build import known_keys
from ...quantities import in_si, parse, with_unit
from ...schema import FileTable
from ...specimens import KNOWN_PROPERTIES, Specimen, SpecimenNumber, specimen, specimen_ids
from ...specimens.parts import CataloguePart, parts

OWN_TITLE = "valve of one's own, from its catalogue"
OWN_VALVE, OWN_BATTERY, OWN_TANK = "own-valve", "own-battery", "own-tank"
TANK_PRESSURES = (1e5, 300e5)  # gauge [Pa]
COMPRESSIBILITY = ((0.0, 100e5, 200e5, 300e5), (1.0, 1.0, 1.04, 1.11))  # Z over gauge pressure [Pa]
# What a catalogue leaves out, of every valve and of a kind: value, unit, range, and why.
USUAL: dict[str, dict[str, tuple[float, str, tuple[float, float], str]]] = {
    "": {
        "mass": (100.0, "g", (20.0, 500.0), "usual for a small valve"),
        "length": (60.0, "mm", (30.0, 150.0), "usual for a small valve"),
        "width": (15.0, "mm", (10.0, 30.0), "usual for a small valve"),
        "height": (35.0, "mm", (20.0, 60.0), "usual for a small valve"),
        "critical_ratio": (0.35, "1", (0.2, 0.5), "usual for valves of this size"),
        "voltage": (24.0, "V", (5.0, 24.0), "usual"),
    },
    "three_way_valve": {
        "power": (2.0, "W", (0.5, 10.0), "usual for a small solenoid"),
        "switching_time": (10.0, "ms", (2.0, 30.0), "usual for a small solenoid"),
    },
    "spool_valve": {
        "power": (5.0, "W", (1.0, 20.0), "usual for a proportional valve"),
        "lag": (3.0, "ms", (1.0, 10.0), "usual for a proportional valve"),
    },
    "pressure_regulator": {
        "power": (10.0, "W", (1.0, 20.0), "usual for an electric regulator"),
        "lag": (5.0, "ms", (2.0, 30.0), "usual for an electric regulator"),
        "band": (0.2, "bar", (0.05, 0.5), "usual for an electric regulator"),
    },
}
# What a catalogue states beside the element, in the order of a page; a switching time is one for opening and closing.
ALSO = ("switching_time", "power", "mass", "current", "voltage", "length", "width", "height")
HALVES = ("opening_dead_time", "opening_time", "closing_dead_time", "closing_time")  # of a switching time
EXAMPLE = "'Cv=0.3, switching_time=8 ms', a name of mckibben parts valves, or a .toml file"


def valve_of(words: str) -> Specimen:
    """A valve by its name or file, or from the numbers of its catalogue.

    Args:
        words: id, ``.toml`` file, or numbers such as ``"nominal_flow=300 l/min, switching_time=8 ms, mass=60 g"``; the key
            ``kind`` states the element (a 3/2 valve by default), ``name`` the name in the tables.

    Raises:
        InputError: there is none of that name, or a number is unknown or out of bounds.
    """
    if "=" not in words:
        if not words.lower().endswith(".toml") and words.lower() not in (v.lower() for v in specimen_ids("valve")):
            raise InputError(
                "valve", words, "give numbers such as 'Cv=0.3', a .toml file, or one of", known=specimen_ids("valve")
            )
        spec = specimen(words)
        if spec.kind != "valve":
            raise InputError("valve", words, f"must be a valve; it is a {spec.kind} muscle")
        return spec
    stated: dict[str, str] = {}
    for pair in filter(None, (w.strip() for w in re.split(r"[,;](?!\d)", words))):
        key, equals, value = (w.strip() for w in pair.partition("="))
        if not equals or not key or not value:
            raise InputError("valve", pair, f"must be KEY=VALUE, as in {EXAMPLE}")
        stated[key] = value
    kind = stated.pop("kind", "three_way_valve")
    if kind not in USUAL or not kind:
        raise InputError("valve.kind", kind, known=[k for k in USUAL if k])
    name = stated.pop("name", OWN_VALVE)
    return _specimen(kind, name, stated)


def _specimen(kind: str, name: str, stated: dict[str, str]) -> Specimen:
    keys = known_keys(kind)
    sides = [key for key in stated if key in ALSO and key in KNOWN_PROPERTIES]
    element = {key: stated[key] for key in stated if key in keys}
    more = {key: stated[key] for key in stated if key not in keys and key not in sides}
    usual = {**USUAL[""], **USUAL[kind]}
    unknown = [key for key in more if key not in ("power", "switching_time")]
    if unknown or ("switching_time" in more and kind != "three_way_valve"):
        wrong = unknown[0] if unknown else "switching_time"
        own = [key for key in keys if not key.startswith(("fill_", "vent_", "relief_"))]
        raise InputError(f"valve.{wrong}", None, f"{kind} has", known=[*own, *ALSO])
    valve: dict[str, dict[str, Any]] = {
        key: {"value": _plain(key, value, keys[key].unit), "unit": keys[key].unit} for key, value in element.items()
    }
    properties: dict[str, dict[str, Any]] = {
        key: {"value": _plain(key, stated[key], KNOWN_PROPERTIES[key]), "unit": KNOWN_PROPERTIES[key]} for key in sides
    }
    for key in ("mass", "length", "width", "height", "voltage"):
        if key not in properties:
            properties[key] = _usual(usual[key])
    if not {"critical_ratio", "b", "fill_b", "fill_critical_ratio"} & set(valve):
        valve["critical_ratio"] = _usual(usual["critical_ratio"])
    for key in ("lag", "band"):
        if key in usual and key not in valve:
            valve[key] = _usual(usual[key])
    if kind == "three_way_valve":
        whole: dict[str, Any] = (
            {"value": _plain("switching_time", more["switching_time"], "s"), "unit": "s"}
            if "switching_time" in more
            else _usual(usual["switching_time"])
        )
        note = "half of the switching time"
        for key in HALVES:
            if key not in valve:
                valve[key] = _scaled(whole, 0.5, whole["unit"], note)
    if "current" not in properties:
        power = (
            {"value": _plain("power", more["power"], "W"), "unit": "W"} if "power" in more else _usual(usual["power"])
        )
        properties["current"] = _scaled(
            power, 1.0 / float(properties["voltage"]["value"]), "A", "of its power and voltage"
        )
    table = {
        "schema": 1, "id": name, "kind": "valve", "element": kind, "title": OWN_TITLE,
        "sources": [], "valve": valve, "properties": properties,
    }  # fmt: skip
    return Specimen.read(FileTable(table, "", "valve").values, where="valve")


def not_stated(valve: Specimen) -> tuple[str, ...]:
    """Of a valve of one's own, which of mass and power nobody gave: usual ones rank it, but are no answer."""
    if valve.title != OWN_TITLE:
        return ()

    def usual(key: str) -> bool:  # a usual number has a range; one computed from what was given has none
        number = valve.properties[key]
        return number.inferred and number.range is not None

    power = usual("current") or (usual("voltage") and not valve.properties["current"].inferred)
    return ("mass",) * usual("mass") + ("power",) * power


def _plain(key: str, words: str, unit: str) -> float:
    bare = key in ("Kv", "fill_Kv", "vent_Kv") and re.fullmatch(r"[\d.]+", words) is not None
    return parse(f"{words} m^3/h" if bare else words, unit, field=f"valve.{key}")


def _usual(one: tuple[float, str, tuple[float, float], str]) -> dict[str, JsonValue]:
    value, unit, span, note = one
    return {"value": value, "unit": unit, "inferred": True, "range": list(span), "note": note}


def _scaled(whole: dict[str, JsonValue], share: float, unit: str, note: str) -> dict[str, JsonValue]:
    scaled = {**whole, "value": whole["value"] * share, "unit": unit}
    if "range" in whole:
        scaled["range"] = [end * share for end in whole["range"]]
    return {**scaled, "note": whole.get("note", note), "inferred": True}


def battery_of(words: str | float) -> CataloguePart:
    """The small compressor with a battery of the user's own.

    Args:
        words: energy of the battery, such as ``"100 Wh"`` [J].

    Raises:
        InputError: it is no energy, or not above zero.
    """
    energy = float(in_si(words, "J", field="battery"))
    if not (0.0 < energy < 1e12):
        raise InputError("battery", with_unit(energy, "J"), "must be an energy above 0 J, such as '100 Wh'")
    base = next(p for p in parts("gas_source") if p.id == "compressor-small")
    values = {k: v for k, v in base.values.items() if k != "mass"} | {"stored_energy": energy}
    stated = {k: v for k, v in base.stated.items() if k in values} | {
        "stored_energy": SpecimenNumber(value=energy, unit="J")
    }
    title = f"own battery of {energy / 3600.0:.4g} W h with the small compressor"
    return base._replace(id=OWN_BATTERY, title=title, values=values, stated=stated)


def tank_of(words: str, room: Environment) -> CataloguePart:
    """A tank of air of the user's own.

    Args:
        words: volume and gauge pressure, such as ``"2 l at 200 bar"``.
        room: temperature at which it is filled.

    Raises:
        InputError: they are not a volume and a pressure, or out of bounds.
    """
    size, at, pressure = words.partition(" at ")
    if not at:
        raise InputError("tank", words, "must be a volume and a gauge pressure, such as '2 l at 200 bar'")
    volume, gauge = parse(size, "m^3", field="tank"), parse(pressure, "Pa", field="tank")
    low, high = TANK_PRESSURES
    if not 0.0 < volume < 1e3:
        raise InputError("tank", with_unit(volume, "m^3"), "must have a volume above 0 l")
    if not low <= gauge <= high:
        raise InputError(
            "tank", with_unit(gauge, "Pa"), f"must be filled to {with_unit(low, 'Pa')} to {with_unit(high, 'Pa')}"
        )
    warm, absolute = float(room.temperature), gauge + float(room.pressure_abs)
    filling = float(AIR.mass(absolute, volume, warm)) / float(np.interp(gauge, *COMPRESSIBILITY))
    gas = float(AIR.gas_constant)
    work = gas * warm * float(np.log(absolute / float(room.pressure_abs)))
    values = {
        "gas_constant": gas, "volume": volume, "filling": filling, "pressure": gauge, "filling_work": work,
    }  # fmt: skip
    stated = {
        "volume": SpecimenNumber(value=volume, unit="m^3"),
        "pressure": SpecimenNumber(value=gauge, unit="Pa"),
        "filling": SpecimenNumber(
            value=filling, unit="kg", inferred=True, range=(0.97 * filling, 1.03 * filling),
            note="by volume and pressure, with a compressibility",
        ),
        "filling_work": SpecimenNumber(
            value=work, unit="J/kg", inferred=True, range=(work, 2.0 * work),
            note="isothermal, without losses; twice that of a compressor with an efficiency of one half",
        ),
    }  # fmt: skip
    title = f"own tank of {1e3 * volume:.4g} l at {gauge / 1e5:.4g} bar"
    return CataloguePart(OWN_TANK, title, ("iso6358",), values, stated, form="bottle")
