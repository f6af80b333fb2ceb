"""Fields of the selected part, from declarations; a refused value is shown with the message of the command line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ....assembly.circuit_file import TIME, CircuitPlan
from ....assembly.circuit_parts import HEATS
from ....components import paths
from ....muscles.build import rest_length_of
from ....pneumatics import build
from ....pneumatics.orifice import Orifice
from ....pneumatics.valves import PressureRegulator
from ....pneumatics.volume import FixedVolume, MovingVolume, WallHeat
from ....quantities import Quantity, declared, from_si, parse
from ....specimens import specimen as found
from ....specimens import specimens
from ... import forms
from ...widgets import box, select, text
from .document import GIVEN, Document, worded
from .response import TUBES

Put = Callable[[Callable[[Document], Document]], None]  # told how a document becomes another one
KIND_WORDS = {
    "linear_tube": "Linear", "quadratic_tube": "Quadratic", "inertial_tube": "Quadratic, with inertia",
    "lumped_tube": "Lumped, by Reynolds number",
}  # fmt: skip
UNSTATED = ("wall_temperature", "friction_scale", "supply_reference")  # shown where a file states them
HEAT_CONDUCTANCE = "0.1 W/K"  # of a wall, by default
FLOW_PRESSURE_WORDS = "6 bar"  # at which `size_as` states a flow into the room


def show(
    document: Document, plan: CircuitPlan, name: str, put: Put, model: Callable[[str], None]
) -> dict[str, forms.InputField]:
    """Show the fields of a node, of an element, or of the run if nothing is selected."""
    if name in plan.nodes:
        return _node(document, plan, name, put)
    if name in plan.circuit.elements:
        shown = _element(document, plan, name, put, model)
        return {f"elements.{name}.{key}": one for key, one in shown.items()}
    names = {"duration": plan.duration, "period": plan.period, "step": plan.step}
    doc = {"duration": "how long the response is", "period": "of the samples", "step": "largest step of the physics"}
    run = {k: (TIME._replace(doc=doc[k]), v) for k, v in names.items()}
    return _fields(run, lambda key, value: put(lambda d: {**d, "run": {**d.get("run", {}), key: value}}))


def _changed(document: Document, section: str, name: str, key: str, value: Any) -> Document:
    part = {**document[section][name], key: value}
    return {**document, section: {**document[section], name: {k: v for k, v in part.items() if v is not None}}}


def _fields(
    shown: Mapping[str, tuple[Quantity, float]], put: Callable[[str, Any], None]
) -> dict[str, forms.InputField]:
    fields = {}
    with box("div", "form"):
        for key, (quantity, value) in shown.items():

            def change(new: float, key: str = key, quantity: Quantity = quantity) -> None:
                put(key, worded(new, quantity))

            fields[key] = forms.field(key, quantity, value, change, key.replace("_", " ").capitalize())
    return fields


def _choice(words: str, options: Mapping[str, str], chosen: str, change: Callable[[str], None]) -> None:
    with box("div", "f pick"):
        text("span", words)
        select(options, chosen, change, words)


def _element(
    document: Document, plan: CircuitPlan, name: str, put: Put, model: Callable[[str], None]
) -> dict[str, forms.InputField]:
    words, element = document["elements"][name], plan.circuit.elements[name]
    kind = words["kind"]

    def change(key: str, value: object) -> None:
        put(lambda d: _changed(d, "elements", name, key, value))

    if kind in TUBES:
        _choice("Resistance", {k: KIND_WORDS[k] for k in TUBES}, kind, model)
    if "specimen" in words:
        valves = {s.id: s.title for s in specimens() if s.kind == "valve" and s.element == kind}
        _choice("Specimen", valves, str(words["specimen"]), lambda v: change("specimen", v))
    # the parameter that states the size of all passages alike; none if a specimen or each passage does
    size = next((n for n in map(build.canonical, words) if n in build.SIZES), "")
    if size and (kind == "orifice" or build.passages_of(kind)):
        _choice("Size stated by", build.TITLES, size, lambda v: put(lambda d: _restated(d, plan, name, v)))
    known, shown = build.known_keys(kind), {}
    numbers = [p for p, _ in paths.parameters(element) if "." not in p and np.ndim(paths.get(element, p)) == 0]
    for key in [*words, *(p for p in numbers if p not in words and p not in UNSTATED)]:
        if key in known:
            value = _si(words[key], known[key].unit, key) if key in words else float(paths.get(element, key))
            shown[key] = known[key], value
    return _fields(shown, change)


def _restated(document: Document, plan: CircuitPlan, name: str, size: str) -> Document:
    """State the same size by another parameter; of the first passage if an element has several."""
    words, one = document["elements"][name], plan.circuit.elements[name]
    orifice: Any = one if isinstance(one, Orifice) else getattr(one, build.passages_of(words["kind"])[0])
    way = next((w for w in build.PASSAGE_WAYS if size in w.needs), None)
    quantity = declared(Orifice)["conductance"] if way is None else way.needs[size]
    value, unit = build.size_as(orifice, size), build.BARE_UNITS.get(size, "l/min")
    flows = quantity.unit == "m^3/s"  # in the unit of catalogues
    new = build.put_value(
        words, size, f"{from_si(value, 'm^3/s', unit):.9g} {unit}" if flows else worded(value, quantity)
    )
    if size == "flow_into_the_room":
        new = build.put_value(new, "flow_pressure", FLOW_PRESSURE_WORDS)
    return {**document, "elements": {**document["elements"], name: new}}


def _si(words: Any, unit: str, key: str) -> float:
    return parse(build.with_usual_unit(key, words), unit, field=key)


def _node(document: Document, plan: CircuitPlan, name: str, put: Put) -> dict[str, forms.InputField]:
    words, planned = document["nodes"][name], plan.nodes[name]
    # gauge pressures are those of a regulator's set-point, down to vacuum
    known = declared(PressureRegulator)["set_pressure"]
    pressure = known._replace(bounds=(-float(plan.environment.pressure_abs), known.bounds[1]), doc="gauge pressure")
    shown: dict[str, tuple[Quantity, float]] = {}

    def change(key: str, value: object) -> None:
        put(lambda d: _changed(d, "nodes", name, key, value))

    if planned.kind == "reservoir" and "pressure" in words:
        shown["pressure"] = pressure, _si(words["pressure"], "Pa", "pressure")
    if planned.law is not None:
        muscles = {s.id: s.title for s in specimens() if s.kind == "mckibben"}

        def other_muscle(document: Document, specimen: str) -> Document:
            """Replace the muscle, held at its own rest length."""
            rest = rest_length_of(found(specimen))
            words = {k: v for k, v in document["nodes"][name].items() if k not in ("law", "parameters")}
            quantity = Quantity("m", (1e-3, 100.0), "rest length", "L0", (0.05, 1.0))
            new = {**words, "specimen": specimen} | ({"length": worded(rest, quantity)} if "length" in words else {})
            return {**document, "nodes": {**document["nodes"], name: new}}

        _choice("Specimen", muscles, str(words["specimen"]), lambda v: put(lambda d: other_muscle(d, v)))
        if planned.length is not None:
            ends = (float(planned.law.length_range()[0]), float(planned.law.length_range()[1]))
            shown["length"] = Quantity("m", ends, "length at which the muscle is held", "L", ends), planned.length
        shown["dead_volume"] = declared(MovingVolume)["dead_volume"], float(plan.circuit.nodes[name].dead_volume)  # type: ignore[union-attr]
    elif planned.kind in ("volume", "junction", "compliant") and "volume" in words:
        shown["volume"] = declared(FixedVolume)["volume"], _si(words["volume"], "m^3", "volume")
    if planned.kind not in GIVEN:
        shown["start_pressure"] = pressure, planned.start
    fields = _fields(shown, change)
    named = {"pressure": f"pressure of {name}", "start_pressure": f"pressure of {name}", "length": f"length of {name}"}
    named |= {key: f"nodes.{name}.{key}" for key in ("volume", "dead_volume")}
    by_caution = {named[key]: one for key, one in fields.items()}
    if planned.kind in GIVEN:
        if planned.kind == "atmosphere":
            text("p", f"{planned.words}.", "small dim")
        return by_caution
    heat = words.get("heat", "isothermal")
    kind = heat["kind"] if isinstance(heat, Mapping) else heat
    kinds = {k: k.capitalize() for k in HEATS if k != "polytropic" or k == kind}
    wall = {"kind": "wall", "conductance": HEAT_CONDUCTANCE}
    _choice("Heat of the gas", kinds, str(kind), lambda v: change("heat", wall if v == "wall" else v))
    if isinstance(heat, Mapping) and "conductance" in heat:
        conductance = declared(WallHeat)["conductance"]
        value = _si(heat["conductance"], conductance.unit, "conductance")
        _fields({"conductance": (conductance, value)}, lambda k, v: change("heat", {**heat, k: v}))
    return by_caution
