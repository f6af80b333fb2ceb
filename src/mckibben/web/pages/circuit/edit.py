"""Editing of circuits: parts are added and removed; each edit returns another valid document."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from ....assembly.circuit_file import CircuitPlan
from ....errors import InputError
from ....pneumatics.build import ELEMENTS
from ....pneumatics.valves import PressureRegulator, SpoolValve
from .document import Document, planned

AIR = ("atmosphere",)
GIVEN = ("reservoir", *AIR)  # nodes whose pressure is given
TOP = "5 bar"  # of a step, where no supply says less


class PalettePart(NamedTuple):
    """An entry of the palette: its name, the key that adds it after Insert, and its content in a file."""

    name: str
    key: str
    kind: str
    words: Mapping[str, Any]
    stem: str


PARTS = {
    "supply": PalettePart("Supply", "S", "reservoir", {"pressure": "6.9 bar"}, "supply"),
    "regulator": PalettePart("Regulator", "R", "pressure_regulator", {
        "conductance": "4e-9 m^3/(s*Pa)", "critical_ratio": 0.35, "band": "0.1 bar", "set_pressure": "4 bar"}, "regulator"),
    "valve": PalettePart("Proportional valve", "A", "pressure_regulator", {
        "specimen": "MPP-3-1-8", "flow_into_the_room": "95 l/min", "flow_pressure": "6.9 bar",
        "dead_time": "2 ms"}, "valve"),
    "tube": PalettePart("Tube", "T", "lumped_tube", {"length": "50 cm", "diameter": "3.175 mm"}, "tube"),
    "orifice": PalettePart("Orifice", "O", "orifice", {"hole_diameter": "1 mm"}, "orifice"),
    "volume": PalettePart("Volume", "V", "volume", {"volume": "49.161 cm^3"}, "volume"),
    "muscle": PalettePart("Muscle", "M", "muscle", {
        "specimen": "nylon", "length": "14 cm", "dead_volume": "0.5 cm^3"}, "muscle"),
    "pressure": PalettePart("Pressure sensor", "P", "", {}, ""),
    "flow": PalettePart("Flow sensor", "F", "", {}, ""),
    "leak": PalettePart("Leak", "L", "leak", {"flow_into_the_room": "1 l/min", "flow_pressure": "5 bar"}, "leak"),
    "exhaust": PalettePart("Exhaust", "E", "orifice", {"hole_diameter": "1 mm"}, "exhaust"),
}  # fmt: skip


def insert(document: Document, plan: CircuitPlan, part: str, at: str) -> tuple[Document, str]:
    """Insert a part at a node or an element.

    A part with two ends goes into the line; a volume or a muscle takes the place of a junction, or hangs on the line by a
    fitting; a leak or an exhaust leads from it into the air.

    Args:
        document: the circuit.
        plan: plan of it.
        part: one of `PARTS` that is no sensor.
        at: name of the node or element.

    Returns:
        The new document and the name of what was put in.

    Raises:
        InputError: what it would be is no circuit.
    """
    if part not in PARTS or not PARTS[part].kind:
        raise InputError("part", part[:40], known=PARTS)
    one, new = PARTS[part], copy.deepcopy(document)
    node, after = line(plan, at)
    name = _free(new, one.stem)
    words = {"kind": one.kind, **copy.deepcopy(dict(one.words))}
    if part in ("volume", "muscle", "supply"):
        _hang(new, name, words, node)
        if part != "supply" and plan.nodes[node].kind == "junction":
            new = _in_place(document, node, words)
            name = node
    elif part in ("leak", "exhaust"):
        new["elements"][name] = {**words, "from": node, "to": _air(new)}
    else:
        _between(new, name, words, node, after, plan)
    planned(new)
    return new, name


def line(plan: CircuitPlan, at: str) -> tuple[str, str]:
    """Node of a position, and the element behind which a part is inserted ("" for in front of the node)."""
    if at in plan.nodes and plan.nodes[at].kind not in AIR:
        return at, ""
    if at in plan.circuit.elements:
        ends, element = plan.circuit.ends[at][0], plan.circuit.elements[at]
        return ends[element.paths[0][1]], at
    inner = [n for n, p in plan.nodes.items() if p.kind not in GIVEN]
    return inner[-1], ""


def _between(new: Document, name: str, words: Document, node: str, after: str, plan: CircuitPlan) -> None:
    junction = _free(new, "joint")
    ends = {e: nodes[0] for e, nodes in plan.circuit.ends.items()}
    fed = [e for e, nodes in ends.items() if nodes[plan.circuit.elements[e].paths[0][1]] == node]
    tube = ELEMENTS[words["kind"]].__name__ == "LumpedTube"
    new["nodes"][junction] = {"kind": "junction", "volume": "0.5 cm^3" if tube else "2 cm^3"}
    is_fed = plan.nodes[node].kind in GIVEN
    moved = ([after] if after in fed else fed) if not is_fed else [e for e, nodes in ends.items() if node in nodes]
    if not moved:  # nothing feeds it: the part goes behind
        moved, is_fed = [e for e, nodes in ends.items() if node in nodes], True
    for e in moved:
        for key, value in new["elements"][e].items():
            if value == node and key in ("from", "to", *plan.circuit.elements[e].ports):
                new["elements"][e][key] = junction
    first, second = (node, junction) if is_fed else (junction, node)
    if words["kind"] == "pressure_regulator":
        words |= {"supply": first, "outlet": second, "exhaust": _air(new)}
        if "specimen" in words:
            words["command"] = _signal(new, plan)
    else:
        words |= {"from": first, "to": second}
    new["elements"][name] = words


def _signal(new: Document, plan: CircuitPlan) -> str:
    known = [n for n, s in plan.signals.items() if s.unit == "Pa"]
    if known:
        return known[0]
    name = _free(new, "pressure")
    new.setdefault("signals", {})[name] = _steps("0 bar", TOP)
    return name


def _hang(new: Document, name: str, words: Document, node: str) -> None:
    new["nodes"][name] = words
    ends = (name, node) if words["kind"] in GIVEN else (node, name)
    new["elements"][_free(new, "fitting")] = {
        "kind": "orifice",
        "from": ends[0],
        "to": ends[1],
        "hole_diameter": "3.175 mm",
    }


def _in_place(document: Document, node: str, words: Document) -> Document:
    new = copy.deepcopy(document)
    new["nodes"][node] = words
    return new


def _air(new: Document) -> str:
    for name, node in new["nodes"].items():
        if node["kind"] in AIR:
            return str(name)
    name = _free(new, "room")
    new["nodes"][name] = {"kind": "atmosphere"}
    return name


def _free(document: Document, stem: str) -> str:
    taken = {n for section in ("nodes", "elements", "signals") for n in document.get(section, {})}
    plain = re.sub(r"\d+$", "", stem)
    return next(n for i in range(1, 1000) if (n := plain if i == 1 else f"{plain}{i}") not in taken)


def remove(document: Document, plan: CircuitPlan, name: str) -> Document:
    """Remove a part: its neighbours are joined, or what only it reached is removed too.

    Raises:
        InputError: nothing that is left is a circuit.
    """
    ways: list[Callable[[], Document]] = []
    if name in plan.circuit.elements:
        ends, element = plan.circuit.ends[name][0], plan.circuit.elements[name]
        i, j = element.paths[0]
        for gone, kept in ((ends[i], ends[j]), (ends[j], ends[i])):
            if plan.nodes[gone].kind == "junction" and plan.nodes[kept].kind not in AIR and gone != kept:
                ways.append(lambda gone=gone, kept=kept: _merged(document, name, gone, kept))  # type: ignore[misc]
        ways.append(lambda: _without(document, {name}))
    elif name in plan.nodes:
        if plan.nodes[name].kind in ("volume", "muscle", "compliant"):
            joined = [e for e, (ends, _) in plan.circuit.ends.items() if name in ends]
            if len(joined) > 1:
                ways.append(lambda: _in_place(document, name, {"kind": "junction", "volume": "2 cm^3"}))
            ways.append(lambda: _without(document, set(joined)))
        else:
            ways.append(lambda: _without(document, {e for e, (ends, _) in plan.circuit.ends.items() if name in ends}))
    else:
        raise InputError("part", name[:40], known=[*plan.nodes, *plan.circuit.elements])
    refused: InputError | None = None
    for way in ways:
        try:
            new = way()
            planned(new)
            return new
        except InputError as error:
            refused = error
    assert refused is not None
    raise refused


def _merged(document: Document, name: str, gone: str, kept: str) -> Document:
    new = copy.deepcopy(document)
    del new["elements"][name], new["nodes"][gone]
    for words in new["elements"].values():
        for key, value in words.items():
            if value == gone and key != "command":
                words[key] = kept
    return _tidy(new)


def _without(document: Document, elements: set[str]) -> Document:
    new = copy.deepcopy(document)
    for name in elements:
        del new["elements"][name]
    return _tidy(new)


def _tidy(new: Document) -> Document:
    """Remove nodes without elements, and unused signals."""
    joined = {
        v for words in new["elements"].values() for k, v in words.items() if isinstance(v, str) and k != "command"
    }
    new["nodes"] = {n: words for n, words in new["nodes"].items() if n in joined}
    uses = {words.get(k) for s in ("nodes", "elements") for words in new[s].values() for k in ("command", "signal")}
    new["signals"] = {n: words for n, words in new.get("signals", {}).items() if n in uses}
    if not new["signals"]:
        del new["signals"]
    return new


def _steps(low: Any, high: Any) -> Document:
    return {"kind": "steps", "times": ["0 s", "20 ms"], "values": [low, high]}


def top(document: Document, plan: CircuitPlan) -> str:
    """Upper gauge pressure of a step, as text."""
    for words in document.get("signals", {}).values():
        values = [v for v in words.get("values", []) if isinstance(v, str) and "bar" in v]
        if words.get("kind") == "steps" and values:
            return max(values, key=lambda v: float(v.split()[0]))
    supplies = [n for n in document["nodes"].values() if n["kind"] == "reservoir" and "pressure" in n]
    driven = any(s.unit == "Pa" for s in plan.signals.values())
    return TOP if driven or not supplies else str(supplies[0]["pressure"])


def stepped(document: Document, plan: CircuitPlan, rising: bool) -> Document:
    """Return the circuit with steps as its signals, from empty to full, or from full to empty."""
    new, full = copy.deepcopy(document), top(document, plan)
    for name, signal in plan.signals.items():
        if signal.unit == "m":
            continue
        low: Any = "0 bar"
        high: Any = full
        if signal.unit == "1":
            spools = [
                isinstance(plan.circuit.elements[p.split(".")[1]], SpoolValve)
                for p in signal.drives
                if p.startswith("elements.")
            ]
            low, high = (-1.0 if any(spools) else 0.0), 1.0
        new["signals"][name] = _steps(low, high) if rising else _steps(high, low)
    for name, planned_node in plan.nodes.items():
        if planned_node.kind in GIVEN:
            continue
        new["nodes"][name].pop("start_pressure", None)
        if not rising:
            new["nodes"][name]["start_pressure"] = full
    return new


def input_of(document: Document, plan: CircuitPlan) -> str:
    """Kind of input of a circuit: ``up`` or ``down``, a step of `stepped`, or ``waveform``, anything else."""
    for name, rising in (("up", True), ("down", False)):
        if stepped(document, plan, rising) == document:
            return name
    return "waveform"


def regulated(plan: CircuitPlan, name: str) -> bool:
    """Whether an element's command is a pressure."""
    return isinstance(plan.circuit.elements.get(name), PressureRegulator)
