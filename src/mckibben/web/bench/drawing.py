"""What a page needs to draw a muscle to scale: the thread of its braid and the turns that it makes.

    cos(theta) = L/b,  D = b sin(theta)/(n pi)

Where no law of a specimen states a braid, it follows from two printed numbers: the volume at rest and the diameter when
shortened, V0 = L0 (b^2 - L0^2)/(4 pi n^2) and D = sqrt(b^2 - Ls^2)/(n pi).
"""

from __future__ import annotations

import math
from typing import Any

from ...assembly.build import unit_from_specimen
from ...errors import MckibbenError
from ...specimens import Specimen, specimens


def muscles() -> list[Specimen]:
    """The specimens that a bench can take, in the order of their length."""
    found = [s for s in specimens() if s.kind == "mckibben"]
    order = ["nylon", "fiberglass", "bridgestone"]
    return sorted(found, key=lambda s: (order.index(s.id) if s.id in order else 9, rest_length(s), s.id))


def rest_length(spec: Specimen) -> float:
    """As the specimen states it [m]."""
    return spec.property_si("rest_length", "m")


def shape(spec: Specimen, law: Any = None) -> dict[str, Any] | None:
    """Thread length [m], turns, and whether they were inferred; None where nothing says them."""
    for name in ("ideal", "thick_wall"):
        group = spec.laws.get(name, {})
        if {"thread_length", "turns"} <= group.keys():
            b, n = (group[k].si(u, field=k) for k, u in (("thread_length", "m"), ("turns", "1")))
            assert isinstance(b, float) and isinstance(n, float)
            inferred = group["thread_length"].inferred or group["turns"].inferred
            return {"thread_length": b, "turns": n, "inferred": inferred}
    return _of_law(spec, law) or _of_volume(spec)


def _of_law(spec: Specimen, law: Any) -> dict[str, Any] | None:
    from ...report.figures.muscle_figures import braid_of

    try:
        found = braid_of(unit_from_specimen(spec).law if law is None else law)
    except MckibbenError:
        return None
    return None if found is None else {"thread_length": found.thread_length, "turns": found.turns, "inferred": False}


def _of_volume(spec: Specimen) -> dict[str, Any] | None:
    group = spec.laws.get(spec.law, {})
    if not {"rest_volume", "shortest_length"} <= group.keys() or "diameter_shortened" not in spec.properties:
        return None
    rest, wide = rest_length(spec), spec.property_si("diameter_shortened", "m")
    volume, short = (group[k].si(u, field=k) for k, u in (("rest_volume", "m^3"), ("shortest_length", "m")))
    assert isinstance(volume, float) and isinstance(short, float)
    slim, full = 4.0 * math.pi * volume / rest, (math.pi * wide) ** 2
    if not full > slim > 0.0:
        return None
    turns = math.sqrt((rest**2 - short**2) / (full - slim))
    return {"thread_length": math.sqrt(rest**2 + slim * turns**2), "turns": turns, "inferred": True}


def plain(spec: Specimen) -> dict[str, Any]:
    """A specimen as a page lists it."""
    return {"id": spec.id, "title": spec.title, "rest_length": rest_length(spec), "law": spec.law, "braid": shape(spec)}
