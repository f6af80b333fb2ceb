"""The data to draw a muscle to scale: the thread of its braid, the turns that it makes, angle and diameter.

Where no law of a specimen states a braid, it follows from two printed numbers: the volume at rest and the diameter when
shortened. A page gets a table over the length and reads between its rows, so that no formula is in its script.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ....documents import JsonValue
from ....errors import MckibbenError
from ....muscles import braid
from ....muscles.build import built_muscle, rest_length_of
from ....specimens import Specimen, specimens

if TYPE_CHECKING:
    from ....muscles.law import TensionLaw

# Of the table [rad]. A straight line between two is off by the square of their distance over 8 sin^2(theta), so they stand
# apart in proportion: the diameter is right to 0.02 % from 2 to 89 degrees.
ANGLES = np.radians(np.geomspace(89.0, 2.0, 160))


def muscles() -> list[Specimen]:
    """Return the specimens that fit a bench, sorted by length."""
    fitting = [s for s in specimens() if s.kind == "mckibben"]
    order = ["nylon", "fiberglass", "bridgestone"]
    return sorted(fitting, key=lambda s: (order.index(s.id) if s.id in order else 9, rest_length(s), s.id))


def rest_length(spec: Specimen) -> float:
    """Return the rest length of the file, or of its law [m]."""
    return rest_length_of(spec)


def shape(spec: Specimen, law: TensionLaw | None = None) -> dict[str, JsonValue] | None:
    """Return thread length [m], turns, and whether they were inferred; None if unknown."""
    for name in ("ideal", "thick_wall"):
        group = spec.laws.get(name, {})
        if {"thread_length", "turns"} <= group.keys():
            b, n = (group[k].si(u, field=k) for k, u in (("thread_length", "m"), ("turns", "1")))
            assert isinstance(b, float) and isinstance(n, float)
            inferred = group["thread_length"].inferred or group["turns"].inferred
            return {"thread_length": b, "turns": n, "inferred": inferred}
    return _of_law(spec, law) or _of_volume(spec)


def _of_law(spec: Specimen, law: Any) -> dict[str, JsonValue] | None:
    try:
        shape_of_law = braid.braid_of(built_muscle(spec).law if law is None else law)
    except MckibbenError:
        return None
    return None if shape_of_law is None else {**shape_of_law._asdict(), "inferred": False}


def _of_volume(spec: Specimen) -> dict[str, JsonValue] | None:
    group = spec.laws.get(spec.law, {})
    if not {"rest_volume", "shortest_length"} <= group.keys() or "diameter_shortened" not in spec.properties:
        return None
    rest, wide = rest_length(spec), spec.property_si("diameter_shortened", "m")
    volume, short = (group[k].si(u, field=k) for k, u in (("rest_volume", "m^3"), ("shortest_length", "m")))
    assert isinstance(volume, float) and isinstance(short, float)
    shape_of_volume = braid.through(
        rest_length=rest, rest_volume=volume, shortest_length=short, diameter_shortened=wide
    )
    return None if shape_of_volume is None else {**shape_of_volume._asdict(), "inferred": True}


def table(thread_length: float, turns: float) -> dict[str, list[float]]:
    """Tabulate rising length [m], braid angle [rad] and diameter [m] of a braid."""
    length = np.asarray(braid.length_at(ANGLES, thread_length=thread_length))
    wide = np.asarray(braid.diameter(length, thread_length=thread_length, turns=turns))
    columns = {"length": length, "angle": ANGLES, "diameter": wide}
    return {name: [float(f"{x:.9g}") for x in values] for name, values in columns.items()}


def plain(spec: Specimen) -> dict[str, JsonValue]:
    """Describe a specimen for the list of a page."""
    braid_shape = shape(spec)
    drawn = (
        None
        if braid_shape is None
        else {**braid_shape, "table": table(braid_shape["thread_length"], braid_shape["turns"])}
    )
    return {"id": spec.id, "title": spec.title, "rest_length": rest_length(spec), "law": spec.law, "braid": drawn}
