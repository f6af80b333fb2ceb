"""A circuit as the plumbing of a test machine: the paper's rig with other pneumatic parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ....assembly.circuit_file import CircuitPlan
from ....bench.rig_file import read_rig, rig
from ....documents import JsonValue
from ....errors import InputError
from ....quantities import parse
from .document import text_of

LAYOUT = "direct"  # of the rig, which the circuit replaces
ENDS = ("kind", "from", "to", "supply", "outlet", "exhaust", "command")


def muscle_of(plan: CircuitPlan) -> str:
    """Specimen of the circuit's muscle.

    Raises:
        InputError: it has none, or more than one.
    """
    specimens = [str(words["specimen"]) for words in plan.document["nodes"].values() if words["kind"] == "muscle"]
    if len(specimens) != 1:
        raise InputError("nodes", None, f"must have one muscle for the bench, got {len(specimens)}")
    return specimens[0]


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
                raise InputError(
                    f"nodes.{node}", None, "has no place: the bench has volumes at the two ends of its tube only"
                )
            behind += parse(str(words["volume"]), "m^3", field=f"nodes.{node}.volume")
    if behind:
        plumbing["muscle_accumulator"] = f"{behind!r} m^3"
    plumbing["valve"] = {k: v for k, v in elements[valve].items() if k not in ENDS}
    plumbing["tube"] = {k: v for k, v in elements[tube].items() if k not in ENDS}
    for name_, words in elements.items():
        if words["kind"] == "leak":
            plumbing["leak"] = {k: v for k, v in words.items() if k not in ENDS}
        elif name_ not in (valve, tube) and not (words["kind"] == "orifice" and _inside(words, nodes)):
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


def _inside(words: Mapping[str, JsonValue], nodes: Mapping[str, JsonValue]) -> bool:
    """Whether an orifice joins two chambers: a fitting, which a test machine includes in its volumes."""
    return all(nodes[str(words[k])]["kind"] in ("volume", "muscle", "junction") for k in ("from", "to"))


def _only(elements: Mapping[str, JsonValue], kind: str, words: str) -> str:
    names = [n for n, e in elements.items() if e["kind"] == kind]
    if len(names) != 1:
        raise InputError("elements", None, f"must have {words} of {kind} for the bench, got {len(names)}")
    return names[0]
