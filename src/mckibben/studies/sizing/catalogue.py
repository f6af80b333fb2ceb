"""Available muscles: shipped specimens unchanged, and fluidic muscles cut to the required length."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ...errors import InputError, MckibbenError
from ...muscles.build import cut_parameters, law_from_specimen, upper_length_of
from ...muscles.law import TensionLaw, law_name
from ...quantities import values
from ...specimens import Specimen, specimen, specimens
from ...specimens.parts import CataloguePart, parts
from .braid_law import INFERRED, error_of_size, error_of_specimen, usual
from .candidate import Candidate, LawAtPressure, judged
from .requirements import Requirements
from .spread import ends_of_specimen

CUT = 0.01  # in steps of which a fluidic muscle is cut [m]
SIZE_LAWS = {
    "DMSP-10-250": "hyperelastic_braid",
    "DMSP-20-300": "hyperelastic_braid",
    "DMSP-40-400": "hyperelastic_braid",
    "festo-10mm": "seated_braid",
}
# Lengths of a law that grow with the bore, and the one that grows with the length; all other parameters are the material's.
BORES = ("rest_diameter", "wall_thickness")
MEMBRANE = ("bore", "wall_thickness", "shortest_length", "longest_length", "largest_contraction", "rated_pressure")
NYLON_WALL = 0.0762e-2  # [m]


def of_specimens(wish: Requirements) -> list[Candidate]:
    """All shipped McKibben muscles with a known law."""
    candidates = []
    for spec in specimens():
        if spec.kind == "mckibben":
            one = of_specimen(spec, wish)
            if one is not None:
                candidates.append(one)
    return candidates


def of_specimen(spec: Specimen | str, wish: Requirements) -> Candidate | None:
    """Candidate of a specimen, by its most accurate law; None if no law of it has a known volume."""
    stated = specimen(spec) if isinstance(spec, str) else spec
    laws = {}
    for name in stated.laws:
        try:
            law = law_from_specimen(stated, name)
        except MckibbenError:
            continue
        if law.has_volume() and (name == stated.law or stated.map is not None):
            laws[name] = (law, error_of_specimen(stated, name))
    if not laws:
        return None
    name = min(laws, key=lambda n: laws[n][1].share)
    law, error = laws[name]
    longest = upper_length_of(stated, law)
    wall = _property(stated, "wall_thickness", 0.0)
    if not wall and stated.source() == "chou1996":
        wall = NYLON_WALL
    diameter = outer_diameter(law, wish, longest, wall)
    range_ = _range_of(stated)
    rested = _property(stated, "rest_length", longest)
    rated = stated.property_si("rated_pressure", "Pa") if "rated_pressure" in stated.properties else None
    return Candidate(
        id=stated.id,
        title=stated.title,
        kind="specimen",
        law=law,
        law_name=name,
        error=error,
        longest=longest,
        friction=friction_of(stated, law, longest, wish, range_),
        overall_length=longest + 2.0 * usual("fitting_share") * diameter,
        diameter=diameter,
        mass=None if range_ is None else range_.values["fittings_mass"] + range_.values["mass_per_length"] * rested,
        rated_pressure=rated if range_ is None else range_.values["rated_pressure"],
        dimensions={"rest_length": rested, "longest_length": longest, "wall_thickness": wall},
        inferred=("fitting_share", *stated.inferred()),
        sources=tuple(stated.sources),
        law_ends=functools.partial(ends_of_specimen, stated, law, name),
        friction_range=friction_range_of(stated, law, longest, wish, range_),
        spec=stated,
    )


def of_file(path: str, wish: Requirements) -> Candidate:
    """A specimen file as a candidate.

    Raises:
        InputError: it is no McKibben muscle, or no law of it knows its volume.
    """
    spec = specimen(path)
    one = of_specimen(spec, wish) if spec.kind == "mckibben" else None
    if one is None:
        raise InputError("muscle", path, "must be a McKibben muscle whose law knows its volume or states rest_volume")
    return one


def of_sizes(wish: Requirements) -> list[Candidate]:
    """For every bore of the fluidic muscle, the shortest sufficient cut, or the longest that the space allows."""
    candidates, lengths = [], dict[object, float | None]()
    for part in parts("fluidic_muscle"):
        membrane = part.law, *(part.values[name] for name in MEMBRANE)  # alike in pressed and screwed muscles
        if membrane not in lengths:
            one = of_size(part, wish)
            lengths[membrane] = None if one is None else one.longest
        else:
            length = lengths[membrane]
            one = None if length is None else _cut(part, length, wish)
        candidates += [] if one is None else [one]
    return candidates


def of_size(part: CataloguePart, wish: Requirements) -> Candidate | None:
    """Cut one bore to the requirements; None if no cut leaves room for the stroke."""
    v = part.values
    shortest = max(v["shortest_length"], wish.stroke / v["largest_contraction"])
    longest = v["longest_length"] if wish.length is None else min(v["longest_length"], wish.length)
    cuts = CUT * np.arange(int(np.ceil(shortest / CUT - 1e-9)), int(np.floor(longest / CUT + 1e-9)) + 1)
    if not cuts.size:
        return None
    low, high = 0, len(cuts) - 1
    if not _does(part, float(cuts[high]), wish):
        # A law holds best at the length that was measured, so that a longer cut may promise less.
        at = np.r_[np.linspace(0, high, 12), np.geomspace(1, high + 1, 12) - 1].astype(int)
        some = [_cut(part, float(c), wish) for c in cuts[np.unique(at)]]
        least = max(some, key=lambda c: judged(c, wish).margins["force"])
        if judged(least, wish).margins["force"] < 0.0:
            # Too long for the space at its end, or too weak at any length: the one with the least fault stands for it.
            return max(some, key=lambda c: judged(c, wish).worst[1])
        high = int(np.argmin(np.abs(cuts - least.longest)))
    while low < high:  # a longer cut pulls more at the same stroke
        middle = (low + high) // 2
        low, high = (low, middle) if _does(part, float(cuts[middle]), wish) else (middle + 1, high)
    return _cut(part, float(cuts[low]), wish)


def _does(part: CataloguePart, length: float, wish: Requirements) -> bool:
    return judged(_cut(part, length, wish), wish).margins["force"] >= 0.0


def _cut(part: CataloguePart, length: float, wish: Requirements) -> Candidate:
    v, of = part.values, specimen(part.law)
    name = SIZE_LAWS[of.id]
    own = law_from_specimen(of, name)
    law, scale = _resized(own, v["bore"], length)
    diameter = outer_diameter(law, wish, length, v["wall_thickness"])
    return Candidate(
        id=f"{part.id}-{1e3 * length:.0f}",
        title=f"{part.title}, cut to {1e2 * length:.0f} cm",
        kind="size",
        law=law,
        law_name=name,
        error=error_of_size(of, name, length, scale=scale),
        longest=length,
        friction=friction_of(of, law, length, wish, part),
        overall_length=length + 2.0 * usual("fitting_share") * diameter,
        diameter=diameter,
        mass=v["fittings_mass"] + v["mass_per_length"] * length,
        rated_pressure=v["rated_pressure"],
        dimensions={"rest_length": length, "longest_length": length, "bore": v["bore"]},
        inferred=(f"law of {of.id}", *part.inferred()),
        sources=tuple(dict.fromkeys((*part.sources, *of.sources))),
        law_ends=functools.partial(ends_of_specimen, of, law, name, dict.fromkeys(BORES, scale)),
        friction_range=friction_range_of(of, law, length, wish, part),
        spec=of,
    )


def _resized(law: Any, bore: float, length: float) -> tuple[TensionLaw, float]:
    """Scale a law to another rest length and bore; return it with the scale of the bore."""
    scale = bore / float(law.rest_diameter)
    own: dict[str, Any] = dict(values(law))
    changed = cut_parameters(law_name(law), own, {"rest_length": length}, [own["rest_length"]])
    changed |= {n: scale * float(getattr(law, n)) for n in BORES}
    if hasattr(law, "seat_compliance") and abs(scale - 1.0) > 1e-6:  # u = q sqrt(F): u with the bore, F with its square
        changed["seat_compliance"] = float(law.seat_compliance)
    resized: TensionLaw = law.replace(**changed)
    return resized, scale


def outer_diameter(law: TensionLaw, wish: Requirements, longest: float, wall: float) -> float:
    """Outer diameter at the end of the stroke, of a cylinder with the law's volume and a wall [m]."""
    ends = LawAtPressure(law, wish.pressure)
    end = max(longest - wish.stroke, ends.free_length(longest))
    volume = ends.volume(end)
    return 2.0 * float(np.sqrt(volume / (np.pi * end))) + 2.0 * wall


def friction_of(
    spec: Specimen, law: TensionLaw, longest: float, wish: Requirements, range_: CataloguePart | None
) -> float:
    """Friction that reduces the guaranteed force [N]: stated, or a usual share of the largest tension."""
    if "coulomb_friction" in spec.properties and range_ is None:
        return spec.property_si("coulomb_friction", "N")
    return usual("friction_share") * float(LawAtPressure(law, wish.pressure).tension(longest))


def friction_range_of(
    spec: Specimen, law: TensionLaw, longest: float, wish: Requirements, range_: CataloguePart | None
) -> tuple[float, float] | None:
    """Range of a friction that is not stated [N]; None of one that is."""
    if "coulomb_friction" in spec.properties and range_ is None:
        return None
    pull = float(LawAtPressure(law, wish.pressure).tension(longest))
    low, high = INFERRED["friction_share"].range
    return low * pull, high * pull


def _range_of(spec: Specimen) -> CataloguePart | None:
    """Series of fluidic muscles to which a specimen belongs."""
    if "rest_inner_diameter" not in spec.properties or "bladder_thickness" in spec.properties:
        return None  # a sleeve over a bladder is none, whatever its bore
    bore = spec.property_si("rest_inner_diameter", "m")
    return next((p for p in parts("fluidic_muscle") if abs(p.values["bore"] - bore) < 1e-6), None)


def _property(spec: Specimen, name: str, otherwise: float) -> float:
    return spec.property_si(name, "m") if name in spec.properties else otherwise
