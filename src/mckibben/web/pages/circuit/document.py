"""Circuits as documents: text, links and examples; parts put in and taken out; the plumbing of a test machine."""

from __future__ import annotations

import base64
import binascii
import copy
import hashlib
import re
import zlib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import tomlkit

from ....assembly.circuit_file import CircuitPlan, build_plan
from ....bench.rig_file import read_rig, rig
from ....documents import JsonValue, parse_toml
from ....errors import InputError
from ....pneumatics.build import ELEMENTS
from ....pneumatics.valves import SpoolValve
from ....quantities import Quantity, from_si, parse, shown_unit

LARGEST = 64 * 1024  # of a file's text [B]
Document = dict[str, Any]
WHERE = "circuit"

_SUPPLY = {"kind": "reservoir", "pressure": "6.9 bar"}
_ROOM = {"kind": "atmosphere"}
_VALVE = {
    "kind": "pressure_regulator", "specimen": "MPP-3-1-8", "supply": "supply", "outlet": "port", "exhaust": "room",
    "flow_into_the_room": "95 l/min", "flow_pressure": "6.9 bar", "dead_time": "2 ms", "command": "pressure",
}  # fmt: skip
_STEP = {"kind": "steps", "times": ["0 s", "20 ms"], "values": ["0 bar", "5 bar"]}
_MUSCLE = {"kind": "muscle", "specimen": "nylon", "length": "14 cm", "dead_volume": "0.5 cm^3"}


def _tube(to: str, length: str) -> Document:
    return {"kind": "lumped_tube", "from": "port", "to": to, "length": length, "diameter": "3.175 mm"}


def starts() -> dict[str, Document]:
    """Example circuits, by title."""
    port = {"kind": "junction", "volume": "2 cm^3"}
    muscle = {
        "schema": 1,
        "title": "Valve, tube, volume and muscle",
        "nodes": {
            "supply": _SUPPLY,
            "room": _ROOM,
            "port": port,
            "volume": {"kind": "volume", "volume": "49.161 cm^3"},
            "muscle": _MUSCLE,
        },
        "elements": {
            "valve": _VALVE,
            "tube": _tube("volume", "100 cm"),
            "fitting": {"kind": "orifice", "from": "volume", "to": "muscle", "hole_diameter": "3.175 mm"},
        },
        "signals": {"pressure": _STEP},
        "run": {"duration": "300 ms"},
    }
    direct = {
        "schema": 1,
        "title": "Valve, tube and muscle",
        "nodes": {"supply": _SUPPLY, "room": _ROOM, "port": port, "muscle": _MUSCLE},
        "elements": {"valve": _VALVE, "tube": _tube("muscle", "50 cm")},
        "signals": {"pressure": _STEP},
        "run": {"duration": "300 ms"},
    }
    tank = {
        "schema": 1,
        "title": "Filling a tank through a tube",
        "nodes": {
            "source": {"kind": "reservoir", "pressure": "5 bar"},
            "tank": {"kind": "volume", "volume": "120 cm^3"},
        },
        "elements": {
            "tube": {"kind": "lumped_tube", "from": "source", "to": "tank", "length": "60 cm", "diameter": "2 mm"}
        },
        "run": {"duration": "1 s"},
    }
    return {str(d["title"]): d for d in (muscle, direct, tank)}


def planned(document: Mapping[str, JsonValue]) -> CircuitPlan:
    """The plan of a document; error messages are those of the command line, without the name of a file."""
    try:
        return build_plan(document, where=WHERE, digest=hashlib.sha256(repr(document).encode()).hexdigest())
    except InputError as error:
        if error.where == WHERE:
            raise error.changed(where="") from None
        raise


def text_of(document: Mapping[str, JsonValue]) -> str:
    """Format a document as the text of a file."""
    return tomlkit.dumps(document)


def read_text(text: str) -> Document:
    """Read a document from the text of a file; it must be self-contained, since a page reads no other file.

    Raises:
        InputError: it is too long, no TOML, no circuit, or names a table in another file.
    """
    if (size := len(text.encode())) > LARGEST:
        why = f"must be at most {LARGEST >> 10} kB, got {size >> 10} kB; nothing was stored"
        raise InputError("file", None, why)
    document = parse_toml(text, where=WHERE)
    signals = document.get("signals", {})
    for name, signal in signals.items() if isinstance(signals, Mapping) else ():
        if isinstance(signal, Mapping) and "file" in _keys(signal):
            why = "must be replaced by values in the circuit itself; this page reads no other files"
            raise InputError(f"signals.{name}.file", None, why)
    for section in ("nodes", "elements"):  # specimens are named by id, since a path would read another file
        parts = document.get(section, {})
        for name, part in parts.items() if isinstance(parts, Mapping) else ():
            wanted = part.get("specimen", "") if isinstance(part, Mapping) else ""
            if not isinstance(wanted, str) or any(c in wanted for c in "/\\") or wanted.lower().endswith(".toml"):
                why = "must be the id of a specimen; this page reads no other files"
                raise InputError(f"{section}.{name}.specimen", None, why)
    planned(document)
    return document


def _keys(value: Any) -> set[str]:
    if isinstance(value, Mapping):
        return set(value) | {k for v in value.values() for k in _keys(v)}
    return {k for v in value for k in _keys(v)} if isinstance(value, list) else set()


def packed(document: Mapping[str, JsonValue]) -> str:
    """Encode a document for a link."""
    squeezed = zlib.compress(text_of(document).encode(), 9)
    return base64.urlsafe_b64encode(squeezed).decode().rstrip("=")


def unpacked(word: str) -> Document:
    """Decode the document of a link.

    Raises:
        InputError: the word was cut or changed, or holds no circuit.
    """
    refusal = InputError("link", None, f"holds no circuit ({word[:12]}..): it was cut or changed on its way")
    try:
        squeezed = base64.urlsafe_b64decode(word[: 2 * LARGEST] + "=" * (-len(word) % 4))
        unpack = zlib.decompressobj()
        data = unpack.decompress(squeezed, LARGEST)
        if unpack.unconsumed_tail:
            raise refusal
        return read_text(data.decode("utf-8"))
    except (ValueError, zlib.error, binascii.Error):
        raise refusal from None


def worded(value: float, quantity: Quantity) -> float | str:
    """Format a value [SI] for a file: in the unit of its field, with enough digits to restore it."""
    if quantity.unit == "1":
        return value
    unit = shown_unit(quantity.unit)
    shown = from_si(value, quantity.unit, unit)
    for digits in (6, 9, 12, 15, 17):
        words = f"{shown:.{digits}g} {unit}"
        if parse(words, quantity.unit, field="value") == value:
            return words
    return f"{value!r} {quantity.unit}"


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
    """
    if part not in PARTS or not PARTS[part].kind:
        raise InputError("part", part[:40], known=PARTS)
    one, new = PARTS[part], copy.deepcopy(document)
    node, after = line(plan, at)
    name = _free(new, one.stem)
    words = {"kind": one.kind, **copy.deepcopy(dict(one.words))}
    if part in ("volume", "muscle", "supply"):
        new["nodes"][name] = words
        first, last = (name, node) if words["kind"] in GIVEN else (node, name)
        fitting = {"kind": "orifice", "from": first, "to": last, "hole_diameter": "3.175 mm"}
        new["elements"][_free(new, "fitting")] = fitting
        if part != "supply" and plan.nodes[node].kind == "junction":
            new, name = {**document, "nodes": {**document["nodes"], node: words}}, node
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
            known = [n for n, s in plan.signals.items() if s.unit == "Pa"]
            words["command"] = known[0] if known else _free(new, "pressure")
            if not known:
                new.setdefault("signals", {})[words["command"]] = _steps("0 bar", TOP)
    else:
        words |= {"from": first, "to": second}
    new["elements"][name] = words


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
    """Remove a part: its neighbours are joined, or what only it reached is removed too."""
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
                junction = {**document["nodes"], name: {"kind": "junction", "volume": "2 cm^3"}}
                ways.append(lambda: {**document, "nodes": junction})
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


def is_pressure(words: str) -> bool:
    """Whether the words are a pressure with its unit."""
    try:
        parse(words, "Pa", field="value")
    except InputError:
        return False
    return True


def top(document: Document, plan: CircuitPlan) -> str:
    """Upper gauge pressure of a step, as text."""
    for words in document.get("signals", {}).values():
        values = [v for v in words.get("values", []) if isinstance(v, str)]
        if words.get("kind") == "steps" and values and is_pressure(values[0]):
            return max(values, key=lambda v: parse(v, "Pa", field="values"))
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


LAYOUT = "direct"  # of the rig, which the circuit replaces
CHAMBERS = {"volume", "muscle", "junction"}
ENDS = ("kind", "from", "to", "supply", "outlet", "exhaust", "command")


def muscle_of(plan: CircuitPlan) -> str:
    """Specimen of the circuit's muscle, which has to be all that the circuit says of it."""
    muscles = {name: words for name, words in plan.document["nodes"].items() if words["kind"] == "muscle"}
    if len(muscles) != 1:
        raise InputError("nodes", None, f"must have one muscle for the bench, got {len(muscles)}")
    ((name, words),) = muscles.items()
    if words.get("parameters"):
        why = "have no place on the bench, which takes a specimen; a sized muscle is taken there by the page Size"
        raise InputError(f"nodes.{name}.parameters", None, why)
    return str(words["specimen"])


def rig_text(plan: CircuitPlan, name: str) -> str:
    """Text of a rig's file with the circuit as its plumbing.

    The bench joins a supply, a pressure regulator, one tube and one muscle, with a volume at either end of the tube and
    a leak. Fittings between them are left out.

    Raises:
        InputError: names what the bench has no place for.
    """
    nodes, elements = plan.document["nodes"], plan.document["elements"]
    valve = _only(elements, "pressure_regulator", "one pressure regulator as its valve")
    tube = _only(elements, "lumped_tube", "one tube of the kind lumped_tube")
    supply = nodes[str(elements[valve]["supply"])]
    if supply["kind"] != "reservoir" or "pressure" not in supply:
        raise InputError(f"elements.{valve}.supply", str(elements[valve]["supply"]), "must be a supply of one pressure")
    muscle_of(plan)
    first, last = str(elements[tube]["from"]), str(elements[tube]["to"])
    if first != elements[valve]["outlet"]:
        raise InputError(f"elements.{tube}.from", first, "the bench joins the tube to the outlet of the valve")
    plumbing: dict[str, Any] = {"supply_pressure": supply["pressure"], "heat": "isothermal"}
    near = nodes[first]
    plumbing["port_volume" if near["kind"] == "junction" else "valve_accumulator"] = near.get("volume", "2 cm^3")
    behind = 0.0
    for node, words in nodes.items():
        if words["kind"] == "volume" and node != first:
            if node != last:
                why = "has no place: the bench has volumes at the two ends of its tube only"
                raise InputError(f"nodes.{node}", None, why)
            behind += parse(str(words["volume"]), "m^3", field=f"nodes.{node}.volume")
    if behind:
        plumbing["muscle_accumulator"] = f"{behind!r} m^3"
    plumbing["valve"] = {k: v for k, v in elements[valve].items() if k not in ENDS}
    plumbing["tube"] = {k: v for k, v in elements[tube].items() if k not in ENDS}
    for name_, words in elements.items():
        if words["kind"] == "leak":
            plumbing["leak"] = {k: v for k, v in words.items() if k not in ENDS}
            continue
        # an orifice between two chambers is a fitting, which a test machine includes in its volumes
        joins = words["kind"] == "orifice" and {nodes[str(words[k])]["kind"] for k in ("from", "to")} <= CHAMBERS
        if name_ not in (valve, tube) and not joins:
            raise InputError(f"elements.{name_}", str(words["kind"]), "the bench has no place for it")
    base = dict(rig("paper").document)
    kept = [p for p in base["inferred"] if not p.startswith(f"plumbing.{LAYOUT}.")]
    new = {
        **base,
        "name": name,
        "title": f"Paper's machine with the circuit {name}",
        "inferred": kept,
        "plumbing": {**base["plumbing"], LAYOUT: plumbing},
    }
    read_rig(new, where=f"{name}.toml")
    return text_of(new)


def _only(elements: Mapping[str, JsonValue], kind: str, words: str) -> str:
    names = [n for n, e in elements.items() if e["kind"] == kind]
    if len(names) != 1:
        raise InputError("elements", None, f"must have {words} of {kind} for the bench, got {len(names)}")
    return names[0]
