"""Fields of the selected part, from declarations; a refused value is shown with the message of the command line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ....assembly.circuit_file import TIME, CircuitPlan
from ....assembly.circuit_parts import HEATS
from ....components import paths
from ....muscles.build import rest_length_of
from ....pneumatics.build import (
    BARE_UNITS,
    PASSAGE_WAYS,
    SIZES,
    TITLES,
    canonical,
    known_keys,
    passages_of,
    put_value,
    size_as,
    with_usual_unit,
)
from ....pneumatics.orifice import Orifice
from ....pneumatics.valves import PressureRegulator
from ....pneumatics.volume import FixedVolume, MovingVolume, WallHeat
from ....quantities import Quantity, declared, from_si, parse
from ....specimens import specimen as found
from ....specimens import specimens
from ... import forms
from ...widgets import box, select, text
from .document import Document, worded
from .response import TUBES

Put = Callable[[Callable[[Document], Document]], None]  # told how a document becomes another one
KIND_WORDS = {
    "linear_tube": "Linear", "quadratic_tube": "Quadratic", "inertial_tube": "Quadratic, with inertia",
    "lumped_tube": "Lumped, by Reynolds number",
}  # fmt: skip
HEAT_CONDUCTANCE = "0.1 W/K"  # of a wall, by default
FLOW_PRESSURE_WORDS = "6 bar"  # at which `size_as` states a flow into the room


def gauge(plan: CircuitPlan) -> Quantity:
    """Permitted gauge pressures of nodes: those of a regulator's set-point, down to vacuum."""
    known = declared(PressureRegulator)["set_pressure"]
    return known._replace(bounds=(-float(plan.environment.pressure_abs), known.bounds[1]), doc="gauge pressure")


def show(document: Document, plan: CircuitPlan, name: str, put: Put, model: Callable[[str], None]) -> None:
    """Show the fields of a node, of an element, or of the run if nothing is selected."""
    if name in plan.nodes:
        _node(document, plan, name, put)
    elif name in plan.circuit.elements:
        _element(document, plan, name, put, model)
    else:
        _run(document, plan, put)


def _changed(document: Document, section: str, name: str, key: str, value: Any) -> Document:
    part = {**document[section][name], key: value}
    return {**document, section: {**document[section], name: {k: v for k, v in part.items() if v is not None}}}


def _fields(
    shown: Mapping[str, tuple[Quantity, float]],
    put: Callable[[str, Any], None],
    labels: Mapping[str, str] | None = None,
) -> None:
    with box("div", "form"):
        for key, (quantity, value) in shown.items():
            forms.field(
                key,
                quantity,
                value,
                lambda v, k=key, q=quantity: put(k, worded(v, q)),  # type: ignore[misc]
                label=(labels or {}).get(key, key.replace("_", " ").capitalize()),
            )


def _choice(words: str, options: Mapping[str, str], chosen: str, change: Callable[[str], None]) -> None:
    with box("div", "f pick"):
        text("span", words)
        select(options, chosen, change, words)


def _element(document: Document, plan: CircuitPlan, name: str, put: Put, model: Callable[[str], None]) -> None:
    words, element = document["elements"][name], plan.circuit.elements[name]
    kind = words["kind"]
    if kind in TUBES:
        _choice("Resistance", {k: KIND_WORDS[k] for k in TUBES}, kind, model)
    if "specimen" in words:
        valves = {s.id: s.title for s in specimens() if s.kind == "valve" and s.element == kind}
        _choice(
            "Specimen",
            valves,
            str(words["specimen"]),
            lambda v: put(lambda d: _changed(d, "elements", name, "specimen", v)),
        )
    # the parameter that states the size of all passages alike; none if a specimen or each passage does
    size = next((n for n in map(canonical, words) if n in SIZES), "")
    if size and (kind == "orifice" or passages_of(kind)):
        _choice("Size stated by", TITLES, size, lambda v: put(lambda d: _restated(d, plan, name, v)))
    known = known_keys(kind)
    values = {
        p: float(paths.get(element, p)) for p, _ in paths.parameters(element) if "." not in p and _plain(element, p)
    }
    keys = [k for k in words if k in known] + [k for k in values if k not in words]
    keys = [k for k in keys if k in known]
    shown = {}
    for key in keys:
        value = values[key] if key not in words else _si(words[key], known[key].unit, key)
        if not (key not in words and key in ("wall_temperature", "friction_scale", "supply_reference")):
            shown[key] = known[key], value
    _fields(shown, lambda k, v: put(lambda d: _changed(d, "elements", name, k, v)))


def _restated(document: Document, plan: CircuitPlan, name: str, size: str) -> Document:
    """State the same size by another parameter; of the first passage if an element has several."""
    words, one = document["elements"][name], plan.circuit.elements[name]
    orifice: Any = one if isinstance(one, Orifice) else getattr(one, passages_of(words["kind"])[0])
    way = next((w for w in PASSAGE_WAYS if size in w.needs), None)
    quantity = declared(Orifice)["conductance"] if way is None else way.needs[size]
    value, unit = size_as(orifice, size), BARE_UNITS.get(size, "l/min")
    flows = quantity.unit == "m^3/s"  # in the unit of catalogues
    new = put_value(words, size, f"{from_si(value, 'm^3/s', unit):.9g} {unit}" if flows else worded(value, quantity))
    if size == "flow_into_the_room":
        new = put_value(new, "flow_pressure", FLOW_PRESSURE_WORDS)
    return {**document, "elements": {**document["elements"], name: new}}


def _plain(element: Any, path: str) -> bool:
    return bool(np.ndim(paths.get(element, path)) == 0)


def _si(words: Any, unit: str, key: str) -> float:
    return parse(with_usual_unit(key, words), unit, field=key)


def _node(document: Document, plan: CircuitPlan, name: str, put: Put) -> None:
    words, planned = document["nodes"][name], plan.nodes[name]
    pressure = gauge(plan)
    shown: dict[str, tuple[Quantity, float]] = {}
    if planned.kind == "reservoir" and "pressure" in words:
        shown["pressure"] = pressure, _si(words["pressure"], "Pa", "pressure")
    if planned.law is not None:
        muscles = {s.id: s.title for s in specimens() if s.kind == "mckibben"}
        _choice("Specimen", muscles, str(words["specimen"]), lambda v: put(lambda d: _other_muscle(d, name, v)))
        if planned.length is not None:
            low, high = (float(v) for v in planned.law.length_range())
            shown["length"] = (
                Quantity("m", (low, high), "length at which the muscle is held", "L", (low, high)),
                planned.length,
            )
        shown["dead_volume"] = declared(MovingVolume)["dead"], float(plan.circuit.nodes[name].dead)  # type: ignore[union-attr]
    elif planned.kind in ("volume", "junction", "compliant") and "volume" in words:
        shown["volume"] = declared(FixedVolume)["size"], _si(words["volume"], "m^3", "volume")
    if planned.kind not in ("reservoir", "atmosphere"):
        shown["start_pressure"] = pressure, planned.start
    _fields(shown, lambda k, v: put(lambda d: _changed(d, "nodes", name, k, v)))
    if planned.kind in ("reservoir", "atmosphere"):
        if planned.kind == "atmosphere":
            text("p", f"{planned.words}.", "small dim")
        return
    heat = words.get("heat", "isothermal")
    kind = heat["kind"] if isinstance(heat, Mapping) else heat
    kinds = {k: k.capitalize() for k in HEATS if k != "polytropic" or k == kind}

    def other(value: str) -> None:
        new: Any = {"kind": "wall", "conductance": HEAT_CONDUCTANCE} if value == "wall" else value
        put(lambda d: _changed(d, "nodes", name, "heat", new))

    _choice("Heat of the gas", kinds, str(kind), other)
    if isinstance(heat, Mapping) and "conductance" in heat:
        known = declared(WallHeat)["conductance"]
        value = _si(heat["conductance"], known.unit, "conductance")
        _fields(
            {"conductance": (known, value)},
            lambda k, v: put(lambda d: _changed(d, "nodes", name, "heat", {**heat, k: v})),
        )


def _other_muscle(document: Document, name: str, specimen: str) -> Document:
    """Replace the muscle, held at its own rest length."""
    rest = rest_length_of(found(specimen))
    words = {k: v for k, v in document["nodes"][name].items() if k not in ("law", "parameters")}
    quantity = Quantity("m", (1e-3, 100.0), "rest length", "L0", (0.05, 1.0))
    new = {**words, "specimen": specimen} | ({"length": worded(rest, quantity)} if "length" in words else {})
    return {**document, "nodes": {**document["nodes"], name: new}}


def _run(document: Document, plan: CircuitPlan, put: Put) -> None:
    names = {"duration": plan.duration, "period": plan.period, "step": plan.step}
    doc = {"duration": "how long the response is", "period": "of the samples", "step": "largest step of the physics"}
    shown = {k: (TIME._replace(doc=doc[k]), v) for k, v in names.items()}

    def change(key: str, value: Any) -> None:
        put(lambda d: {**d, "run": {**d.get("run", {}), key: value}})

    _fields(shown, change)
