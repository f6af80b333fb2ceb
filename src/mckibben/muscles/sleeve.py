"""A muscle from what one measures on a braided sleeve and a bladder, before anything is inflated.

Given are the rest length, the outer diameter and the braid angle at that length, the diameter of a thread, and the
thickness and Shore hardness of the bladder. The braid is two layers of threads on a bladder that touches it, so that the
middle of the threads lies at D - 2 d, and from there bladder and inner thread reach tk = h + d inwards:

    b = L0/cos theta,   n = L0 tan theta / (pi (D - 2 d))                                            (eqs. 5, 6)
    Kg, Lmin: straight line through eq. 10 over the stroke, Lmin >= b/sqrt(3)                         (eq. 10 to eq. 11)
    Kp = E A / L0,   A = pi (D - 4 d - h) h,   E of the hardness

No gas shortens a braid beyond 54.7 degrees, where it encloses most; eq. 10, whose wall keeps its thickness instead of its
volume, pulls a little further where the wall is thick, so that the line is turned about that end.

Threshold pressure and friction cannot be seen on a sleeve; they are those of the nylon muscle. Range: braid angles of
20.5 to 50 degrees at rest; muscles of four diameters and longer, because ends are not cylinders. Errors: `ERRORS`.
Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, Tree, jit, jnp
from ..answers import Caution
from ..components.programs import evaluated
from ..errors import InputError
from ..quantities import Quantity, declared, from_si, parse, shown_unit
from ..specimens import Specimen, SpecimenNumber
from . import braid
from .bladder import BLADDER_SHARE
from .build import law_from_specimen
from .law import TensionLaw
from .laws.hyperelastic_braid import HyperelasticBraid
from .laws.ideal import Ideal
from .laws.linear_threshold import LinearThreshold
from .laws.thick_wall import ThickWall
from .plausible import HIGHEST_PRESSURE


class InferredDimension(NamedTuple):
    """A number that no source prints for a braid to be made: value [SI], range, and where it comes from."""

    value: float
    range: tuple[float, float]
    note: str


# What a braid does not tell, from the one braided muscle whose dimensions and forces are both printed.
INFERRED: dict[str, InferredDimension] = {
    "threshold_pressure": InferredDimension(0.903e5, (0.3e5, 1.5e5), "Pa; of the nylon muscle"),
    "threshold_width": InferredDimension(0.85e5, (0.7e5, 1e5), "Pa; of the nylon muscle"),
    "friction_share": InferredDimension(
        2.5 / 110.0, (0.01, 0.09), "friction over the largest tension, of the nylon muscle"
    ),
    "shore": InferredDimension(
        45.0, (30.0, 70.0), "not stated; soft latex is at the lower end, chloroprene at the upper"
    ),
    "length_share": InferredDimension(
        1.1, (1.0, 1.15), "upper working length over the rest length, of the nylon muscle"
    ),
}

NARROWEST = float(np.deg2rad(20.5))  # [rad] below which the law with wall loses its stiffness
# What is measured on a sleeve: unit, bounds, meaning; and how far a reading may be off, as a share or in the unit.
DIMENSIONS: dict[str, Quantity] = {
    "rest_length": Quantity("m", (5e-3, 10.0), "length between the fittings, without pressure and load", "L0", (0.05, 0.5)),
    "diameter": Quantity("m", (1e-3, 0.5), "outer diameter of the braid at rest", "D", (5e-3, 4e-2)),
    "braid_angle": Quantity(
        "rad", (NARROWEST, float(np.deg2rad(50.0))), "angle of the threads at rest, from the long axis",
        "theta0", (0.36, 0.7),
    ),
    "thread_diameter": Quantity("m", (1e-5, 5e-3), "diameter of one thread", "d", (1e-4, 5e-4)),
    "bladder_thickness": Quantity("m", (5e-5, 2e-2), "wall thickness of the bladder", "h", (3e-4, 2e-3)),
    "shore": Quantity("1", (20.0, 80.0), "Shore A hardness of the bladder", "S", (30.0, 70.0)),
}  # fmt: skip
READING = {"rest_length": 0.005, "diameter": 0.02, "thread_diameter": 0.1, "bladder_thickness": 0.1}  # shares
ANGLE_READING = float(np.deg2rad(1.0))  # [rad]
SHORE_READING = 5.0  # a tube of 1 mm is too thin for the norm
# Length to which the straight line is taken over the thread length: 52 degrees, little short of no pull.
SHORTEST = 0.61
SLENDER = 4.0  # length over diameter
LEAST_BORE = 0.05  # of the diameter, which bladder and threads must leave
PRESSURE = 5e5  # [Pa] at which friction and the contracted diameter are stated
# Range of Kp over E A/L0: that of the nylon muscle is 1.7 to 3.8 times as large, by the thread taken.
PASSIVE = (0.5, 4.0)


class BraidError(NamedTuple):
    """How far the law of a braid was from the tension of a muscle, as shares of the largest tension."""

    rms: float
    largest: float
    make: str


# Computed by `tests/muscles/test_sleeve.py`, rounded up; the worst of the muscles of a make: the nylon muscle, whose own
# threshold it is, and two fluidic muscles with a hardness of 70.
ERRORS: dict[str, tuple[BraidError, ...]] = {
    "linear_threshold": (BraidError(0.11, 0.19, "loose sleeve"), BraidError(0.17, 0.34, "threads in rubber")),
    "hyperelastic_braid": (BraidError(0.32, 0.69, "loose sleeve"), BraidError(0.05, 0.12, "threads in rubber")),
    "thick_wall": (BraidError(0.32, 0.38, "loose sleeve"), BraidError(0.20, 0.31, "threads in rubber")),
    "ideal": (BraidError(0.39, 0.63, "loose sleeve"), BraidError(0.22, 0.32, "threads in rubber")),
}
DIFFER = 1.25  # largest over least tension of a braid's laws from which their difference is said
TRUST = (
    "Trust linear_threshold for a sleeve that lies loosely on its bladder: it alone knows the pressure below which the "
    "bladder does not fill the braid. Trust hyperelastic_braid where the threads lie in the rubber or are glued to it, and "
    "state the hardness. thick_wall and ideal know no elasticity and pull too much. A fit to measured points replaces all "
    "of them"
)


def youngs_modulus(shore: Scalar) -> Scalar:
    """Young's modulus of rubber of a Shore A hardness [Pa].

    E = 0.0981 (56 + 7.62336 S) / (0.137505 (254 - 2.54 S)) MPa. Range: 20-80; its author finds it valid above
    about 40. The other relation in use, log10(E/MPa) = 0.0235 S - 0.6403, gives 1.01 times as much at 30, 1.2 at 40 and 1.8
    at 70: hardness tells a modulus within a factor of two.
    Source: A. N. Gent, Rubber Chemistry and Technology 31(4), 1958, doi:10.5254/1.3542351.

    Args:
        shore: Shore A hardness, any shape [1].
    """
    return 0.0981e6 * (56.0 + 7.62336 * shore) / (0.137505 * (254.0 - 2.54 * shore))


@evaluated
def straight_line(law: TensionLaw, longest: Scalar, shortest: Scalar, limit: Scalar = 0.0) -> tuple[Tree, Tree]:
    """Least-squares slope of the force per pressure over five lengths of the stroke, Kg [m], and its zero, Lmin [m].

    Where the line would end below the limit it is the one through zero there.

    Args:
        law: proportional to the pressure, such as `thick_wall`; its parameters may be arrays.
        longest: end of the stroke [m].
        shortest: its other end [m].
        limit: least zero [m].
    """
    pressure = 1e6
    shares = jnp.linspace(0.0, 1.0, 5) - 0.5
    middle, span = 0.5 * (longest + shortest), longest - shortest
    pull = [law.braid_tension(middle + s * span, pressure) / pressure for s in shares]
    mean = sum(pull) / 5.0
    slope = sum(s * f for s, f in zip(shares, pull, strict=True)) / (jnp.sum(shares**2) * span)
    zero = middle - mean / slope
    arms = [middle + s * span - limit for s in shares]
    through = sum(a * f for a, f in zip(arms, pull, strict=True)) / sum(a * a for a in arms)
    return jnp.where(zero < limit, through, slope), jnp.maximum(zero, limit)


def braid_laws(dimensions: Mapping[str, Scalar], *, upper_length: Scalar | None = None) -> dict[str, TensionLaw]:
    """The laws of a braid, by name; dimensions may be arrays of one shape.

    Args:
        dimensions: all of `DIMENSIONS` [SI].
        upper_length: upper working length [m]; by default, 1.1 rest lengths, less for narrow braids.
    """
    rest, outer, angle, thread, wall, shore = (dimensions[name] for name in DIMENSIONS)
    layer = outer - 2.0 * thread
    shape = braid.wound(rest_length=rest, rest_angle=angle, rest_diameter=layer)
    upper = upper_length
    if upper is None:
        narrowest = braid.length_at(NARROWEST, thread_length=shape.thread_length)
        upper = jnp.minimum(INFERRED["length_share"].value * rest, narrowest)
    inner = {"thread_length": shape.thread_length, "turns": shape.turns, "wall_thickness": wall + thread}
    thick = ThickWall(**inner, upper_length=upper)
    modulus = youngs_modulus(shore)
    ends = SHORTEST * shape.thread_length, braid.SHORTEST_SHARE * shape.thread_length
    slope, zero = straight_line(thick, upper, *ends)
    rest_volume = braid.inner_volume(rest, **inner)
    # Beyond the upper length the gas ceases to pull over this length, where the law has emptied its braid; threads do not
    # let a muscle get longer there. The stop is as strong as the gas at the highest usual pressure then.
    change = slope * (upper - zero)
    fall = (1.0 - BLADDER_SHARE) * (rest_volume - 0.5 * (upper - rest) * (change + slope * (rest - zero))) / change
    strongest = change * (HIGHEST_PRESSURE - INFERRED["threshold_pressure"].value)
    linear = LinearThreshold(
        stiffness_per_pressure=slope,
        shortest_length=zero,
        threshold_pressure=INFERRED["threshold_pressure"].value,
        threshold_width=INFERRED["threshold_width"].value,
        passive_stiffness=modulus * jnp.pi * (outer - 4.0 * thread - wall) * wall / rest,
        rest_length=rest,
        upper_length=upper,
        rest_volume=rest_volume,
        stop_stiffness=strongest / fall**2,
    )
    # The law takes the threads at the outside of its wall; its wall reaches to the middle of the threads here, so that the
    # modulus is lowered until there is as much rubber as before.
    bore = layer - 2.0 * (wall + thread)
    rubber = (bore + wall) * wall / ((bore + wall + thread) * (wall + thread))
    elastic = HyperelasticBraid(
        rest_length=rest,
        rest_diameter=bore,
        wall_thickness=wall + thread,
        thread_depth=1.0,
        rest_angle=angle,
        shear_modulus=modulus / 3.0 * rubber,
        upper_length=jnp.minimum(upper, 1.03 * rest),
    )
    ideal = Ideal(thread_length=shape.thread_length, turns=shape.turns)
    return {"linear_threshold": linear, "hyperelastic_braid": elastic, "thick_wall": thick, "ideal": ideal}


def from_braid(
    *,
    rest_length: float | str,
    diameter: float | str,
    braid_angle: float | str,
    thread_diameter: float | str,
    bladder_thickness: float | str,
    shore: float | str | None = None,
    name: str = "braid",
) -> Specimen:
    """The specimen of a muscle made of a braided sleeve and a bladder, with a range for each number that is not known.

    Args:
        rest_length: length between the fittings, without pressure and load [m].
        diameter: outer diameter of the braid at that length [m].
        braid_angle: angle of the threads from the long axis at that length [rad], 20.5 to 50 degrees.
        thread_diameter: diameter of one thread [m].
        bladder_thickness: wall of the bladder [m].
        shore: Shore A hardness of the bladder, such as 40 or ``"40A"``; 45 with a range of 30 to 70 by default.
        name: id of the specimen.

    Returns:
        The specimen with the laws `linear_threshold`, `hyperelastic_braid`, `thick_wall` and `ideal` and Maxwell-slip
        friction; each number has its unit, source, note and range.

    Raises:
        InputError: a dimension is out of its bounds, or bladder and threads fill the braid.
    """
    dimensions = {
        "rest_length": rest_length,
        "diameter": diameter,
        "braid_angle": braid_angle,
        "thread_diameter": thread_diameter,
        "bladder_thickness": bladder_thickness,
        "shore": INFERRED["shore"].value if shore is None else _hardness(shore),
    }
    at = {key: _number(key, value) for key, value in dimensions.items()}
    filled = 4.0 * at["thread_diameter"] + 2.0 * at["bladder_thickness"]
    if filled > (1.0 - LEAST_BORE) * at["diameter"]:
        least = filled / (1.0 - LEAST_BORE)
        allowed = f"must be more than {least * 1e3:.3g} mm, for bladder and threads fill {filled * 1e3:.3g} mm"
        raise InputError("diameter", f"{at['diameter'] * 1e3:.3g} mm", allowed, where="braid")
    if at["rest_length"] < at["diameter"]:
        allowed = f"must be the diameter or more, {at['diameter'] * 1e3:.3g} mm, or the braid is no cylinder"
        raise InputError("rest_length", f"{at['rest_length'] * 1e3:.3g} mm", allowed, where="braid")
    laws, upper, pull, bore = _computed(_varied(at, shore is None))
    return Specimen(
        id=name,
        kind="mckibben",
        title=f"Braid of {at['rest_length'] * 1e3:.4g} mm and {np.degrees(at['braid_angle']):.3g} deg, nothing measured yet",
        sources=["gent1958", "chou1996"],
        law="linear_threshold",
        note=TRUST,
        properties=_properties(at, float(upper), float(bore), float(pull), shore is None),
        laws={law: _group(law, laws[law], float(np.ravel(laws["ideal"].thread_length)[0])) for law in ERRORS},
        errors={law: {"largest": _stated_error(known)} for law, known in ERRORS.items()},
        friction={"maxwell_slip": _friction(float(pull), at["rest_length"])},
    )


@jit
def _computed(varied: dict[str, Any]) -> tuple[dict[str, TensionLaw], Any, Any, Any]:
    """The laws of varied dimensions; of the dimensions as read the upper length, tension at rest, and contracted bore."""
    at = {name: values[0] for name, values in varied.items()}
    nominal: dict[str, Any] = braid_laws(at)
    linear, thick = nominal["linear_threshold"], nominal["thick_wall"]
    laws = braid_laws(varied, upper_length=linear.upper_length)
    inner = {name: getattr(thick, name) for name in ("thread_length", "turns", "wall_thickness")}
    bore = braid.inner_diameter(linear.free_length(PRESSURE), **inner)
    return laws, linear.upper_length, linear.tension(at["rest_length"], PRESSURE), bore


def _stated_error(known: tuple[BraidError, ...]) -> SpecimenNumber:
    """The largest error of a law for the make of which it is worst among those that it may be of: a loose sleeve."""
    first, *others = known
    more = "".join(f"; {100 * one.largest:.0f} % of {one.make}" for one in others)
    note = f"computed, not measured: of a {first.make}{more}"
    return SpecimenNumber(value=100.0 * first.largest, unit="%", inferred=True, note=note)


class VariedLaw(NamedTuple):
    """Changes of a law's parameters [SI] by each reading that is off, and parameters that no reading tells."""

    of_dimensions: dict[str, list[dict[str, Any]]]
    unseen: frozenset[str]


# Properties of a braid's specimen, in the order of `DIMENSIONS`.
_PROPERTIES = ("rest_length", "outer_diameter", "rest_angle", "thread_diameter", "bladder_thickness", "shore_hardness")
_READ_PROPERTIES = dict(zip(_PROPERTIES, DIMENSIONS.items(), strict=True))


def is_braid(spec: Specimen, law: str) -> bool:
    """Whether a law of a specimen follows from the dimensions of a braid, as `from_braid` makes it."""
    return law in ERRORS and set(_PROPERTIES) <= set(spec.properties)


def varied_law(spec: Specimen, name: str, law: TensionLaw) -> VariedLaw | None:
    """How readings that are off change a law of a braid; None of a specimen that was not made from a braid's dimensions.

    Args:
        spec: as `from_braid` makes it, perhaps cut to another length.
        name: of the law.
        law: the law, perhaps with other parameters.
    """
    if not is_braid(spec, name):
        return None
    units = (q.unit for q in DIMENSIONS.values())
    at = {key: spec.property_si(path, unit) for key, path, unit in zip(DIMENSIONS, _PROPERTIES, units, strict=True)}
    built = _computed(_varied(at, spec.properties["shore_hardness"].inferred))[0][name]
    unseen = {*_MODULI, *_UNSEEN, *(INFERRED if name == "linear_threshold" else ())}
    changes: dict[str, list[dict[str, Any]]] = {}
    count = 1 + 2 * len(DIMENSIONS)
    seen = (name for name in declared(law) if name not in unseen)
    columns = {n: np.broadcast_to(np.asarray(getattr(built, n), float), (count,)) for n in seen}
    for k in range(1, count):
        off = {n: float(getattr(law, n)) + c[k] - c[0] for n, c in columns.items() if c[k] != c[0]}
        if off:
            changes.setdefault(list(DIMENSIONS)[(k - 1) // 2], []).append(off)
    return VariedLaw(changes, frozenset(unseen))


def other_laws(spec: Specimen, name: str, length: float, pressure: float) -> dict[str, float]:
    """Tension of a braid by its other laws [N]; empty of a specimen that was not made from a braid's dimensions."""
    if not is_braid(spec, name):
        return {}
    laws = {law: law_from_specimen(spec, law) for law in ERRORS if law in spec.laws and law != name}
    return {law: float(built.tension(length, pressure)) for law, built in laws.items()}


def differing_caution(spec: Specimen, name: str, tension: float, others: Mapping[str, float]) -> Caution | None:
    """What is not known where the laws of a braid differ, which of them is recommended, and why; None where they agree."""
    pulls = {name: tension} | dict(others)
    if not others or max(pulls.values()) <= DIFFER * min(pulls.values()):
        return None
    shown = ", ".join(f"{pull:.3g} N by {law}" for law, pull in pulls.items())
    said = f"nothing of {spec.id} was measured, and its laws differ: {shown}. {TRUST}"
    return Caution(said, "law")


def slenderness_caution(spec: Specimen) -> str | None:
    """What is to be said of a braid that is too short for its diameter; None if it is slender enough."""
    length, wide = spec.property_si("rest_length", "m"), spec.property_si("outer_diameter", "m")
    if length >= SLENDER * wide:
        return None
    said = f"the braid is {length / wide:.2g} diameters long; below {SLENDER:g} its ends, which are no cylinders, weaken it"
    return f"{said}, and no law of it knows them"


def _hardness(shore: float | str) -> float | str:
    if not isinstance(shore, str):
        return shore
    text = shore.strip()
    if text[-1:].upper() == "D" or "00" in text:
        raise InputError("shore", shore, "must be a hardness on the A scale, such as 40A", where="braid")
    return text[:-1].strip() if text[-1:].upper() == "A" else text


def _number(key: str, value: Any) -> float:
    q = DIMENSIONS[key]
    number = parse(value, q.unit, field=key, where="braid") if isinstance(value, str) else float(value)
    q.check(key, number, where="braid")
    return number


def _varied(at: Mapping[str, float], unknown: bool) -> dict[str, np.ndarray]:
    """The dimensions as read, then each reading off to either side, alone: arrays (13,) [SI]."""
    hardness = INFERRED["shore"].range if unknown else (at["shore"] - SHORE_READING, at["shore"] + SHORE_READING)
    ends = {name: (at[name] * (1.0 - share), at[name] * (1.0 + share)) for name, share in READING.items()}
    ends["braid_angle"] = (max(at["braid_angle"] - ANGLE_READING, NARROWEST), at["braid_angle"] + ANGLE_READING)
    ends["shore"] = (max(hardness[0], 20.0), min(hardness[1], 80.0))
    # A reading cannot be off by so much that bladder and threads fill the braid.
    spare = 0.9 * ((1.0 - LEAST_BORE) * at["diameter"] - 4.0 * at["thread_diameter"] - 2.0 * at["bladder_thickness"])
    for name, part in (("thread_diameter", 0.25), ("bladder_thickness", 0.5)):
        ends[name] = ends[name][0], min(ends[name][1], at[name] + part * spare)
    ends["diameter"] = max(ends["diameter"][0], at["diameter"] - spare), ends["diameter"][1]
    rows = [dict(at)] + [{**at, name: end} for name, pair in ends.items() for end in pair]
    return {name: np.array([row[name] for row in rows]) for name in DIMENSIONS}


def _group(law: str, built: TensionLaw, threads: float) -> dict[str, SpecimenNumber]:
    known = declared(built)
    # No braid shortens beyond 54.7 degrees, and one that pulls at rest has its end below its rest length.
    limits = {name: q.bounds for name, q in known.items()}
    limits["shortest_length"] = braid.SHORTEST_SHARE * threads, threads
    return {key: _parameter(law, key, q.unit, getattr(built, key), limits[key]) for key, q in known.items()}


def _parameter(law: str, key: str, unit: str, values: Scalar, limits: tuple[float, float]) -> SpecimenNumber:
    values = np.broadcast_to(np.asarray(values, float), (1 + 2 * len(DIMENSIONS),))
    value, off = float(values[0]), values[1:] - values[0]
    # Readings are independent: their effects to either side add as squares.
    below, above = (float(np.sqrt(np.sum(np.where(off * sign > 0.0, off, 0.0) ** 2))) for sign in (-1.0, 1.0))
    low, high = max(value - below, limits[0]), min(value + above, limits[1])
    cut = "" if (low, high) == (value - below, value + above) else "; the range ends where no braid can be"
    if key in ("rest_length", "rest_angle"):
        return stated_number(value, unit, note=AS_READ, interval=(low, high))
    if key in INFERRED and law == "linear_threshold":
        known = INFERRED[key]
        return stated_number(value, unit, source="chou1996", note=known.note.split("; ")[-1], interval=known.range)
    if key == "stop_stiffness" and law in _STOPS:
        return stated_number(value, unit, source="inferred", note=_STOPS[law], interval=(0.1 * value, 10.0 * value))
    if key in _MODULI:
        least, most, note = _MODULI[key]
        return stated_number(value, unit, source="gent1958", note=note, interval=(least * low, most * high))
    if key in _UNSEEN:
        ends, note = _UNSEEN[key]
        return stated_number(value, unit, source="inferred", note=note, interval=ends)
    if key == "upper_length":
        return stated_number(value, unit, source="chou1996", note="as the property of that name")
    note = f"computed from the dimensions{cut}"
    return stated_number(value, unit, source="chou1996", note=note, interval=(low, high))


# Elastic parameters: factors of the range that hardness and readings leave, and the note.
_MODULI = {
    "passive_stiffness": (*PASSIVE, "E A/L0 of the bladder, E of its hardness"),
    "shear_modulus": (0.7, 2.0, "E/3 of the hardness, for as much rubber as the bladder has"),
}
# What cannot be seen on a sleeve and stays at the default of its law: range and note.
_UNSEEN: dict[str, tuple[tuple[float, float] | None, str]] = {
    "thread_compliance": ((0.0, 3e-8), "not seen on a sleeve; default of the law"),
    "inactive_share": ((0.0, 1.5), "not seen on a sleeve; default of the law"),
    "threshold_width": ((1e3, 1e5), "not seen on a sleeve; default of the law"),
    "thread_depth": (None, "assumed: the threads lie on the outside"),
    "length_factor": (None, "assumed: the rest length is the true one"),
    "stop_stiffness": ((0.0, 3e7), "not seen on a sleeve; no stop is assumed"),
    "thread_strain": ((1e-3, 0.02), "the material is not stated; default of the law"),
}
_STOPS = {"linear_threshold": "assumed: no load draws the muscle out of its threads"}


def _properties(
    at: Mapping[str, float], upper: float, contracted: float, largest: float, unknown: bool
) -> dict[str, SpecimenNumber]:
    wall = at["bladder_thickness"] + 2.0 * at["thread_diameter"]
    hardness, share, friction = INFERRED["shore"], INFERRED["length_share"], INFERRED["friction_share"]
    longest = max(share.range[1] * at["rest_length"], upper)
    read = {name: stated_number(at[key], q.unit, note=AS_READ) for name, (key, q) in _READ_PROPERTIES.items()}
    if unknown:
        read["shore_hardness"] = stated_number(
            at["shore"], "1", source="inferred", note=hardness.note, interval=hardness.range
        )
    bore = at["diameter"] - 2.0 * wall

    def of_nylon(value: float, unit: str, note: str, low: float, high: float) -> SpecimenNumber:
        return stated_number(value, unit, source="chou1996", note=note, interval=(low, high))

    rubbing = [share * largest for share in (friction.value, *friction.range)]
    contracts = "inner, at 5 bar without load, of the braid's geometry"
    return read | {
        "rest_inner_diameter": stated_number(bore, "m", note="outer diameter less bladder and two layers of threads"),
        "wall_thickness": stated_number(wall, "m", note="bladder and two layers of threads"),
        "upper_length": of_nylon(upper, "m", f"{share.note}; less for narrow braids", at["rest_length"], longest),
        "coulomb_friction": of_nylon(rubbing[0], "N", f"at 5 bar; {friction.note}", *rubbing[1:]),
        "diameter_shortened": of_nylon(contracted, "m", contracts, 0.9 * contracted, 1.1 * contracted),
    }


def _friction(largest: float, rest: float) -> dict[str, SpecimenNumber]:
    """Friction like that of the nylon muscle, for a largest tension [N] at 5 bar and a rest length [m]."""
    share = INFERRED["friction_share"]
    low, high = (end / share.value for end in share.range)
    # A fifth of it without pressure, and travels over the rest length, as in the nylon muscle.
    constant, growth = 0.2 * share.value * largest, 0.8 * share.value * largest / PRESSURE
    note = f"{100 * share.value:.2g} % of the tension at rest length and 5 bar, as in the nylon muscle"
    short, long = 0.2 / 140.0 * rest, 8.0 / 140.0 * rest

    def inferred(value: float, unit: str, said: str, spread: tuple[float, float]) -> SpecimenNumber:
        ends = spread[0] * value, spread[1] * value
        return stated_number(value, unit, source="chou1996", note=said, interval=ends)

    travel = "over the rest length as in the nylon muscle"
    return {
        "constant": inferred(constant, "N", note, (low, high)),
        "per_pressure": inferred(growth, "m^2", note, (low, high)),
        "elements": stated_number(8, "1", source="chou1996", note="as in the nylon muscle"),
        "shortest": inferred(short, "m", travel, (0.3, 3.0)),
        "longest": inferred(long, "m", travel, (0.3, 3.0)),
        "at_pressure": stated_number(PRESSURE, "Pa", source="chou1996", note="as in the nylon muscle"),
    }


def stated_number(
    value: float, unit: str, *, source: str = "", note: str = "", interval: tuple[float, float] | None = None
) -> SpecimenNumber:
    """A number of a specimen in the unit that people read, rounded to six digits.

    Args:
        value: [unit].
        unit: SI unit.
        source: what it was inferred from, a citation key or ``inferred``; empty for a number that was measured.
        note: where it comes from.
        interval: in which it lies [unit].
    """
    people = _UNITS.get(unit, shown_unit(unit))
    if unit == "Pa" and "rubber" in note:
        people = "MPa"
    ends = None
    if interval is not None:
        ends = _rounded(from_si(interval[0], unit, people)), _rounded(from_si(interval[1], unit, people))
    return SpecimenNumber(
        value=_rounded(from_si(value, unit, people)),
        unit=people,
        source="" if source == "inferred" else source,
        inferred=bool(source),
        note=note,
        range=ends,
    )


AS_READ = "as measured on the sleeve"
_UNITS = {"m": "mm", "N/m": "N/mm", "m^2": "N/bar"}


def _rounded(value: float) -> float:
    return float(f"{value:.6g}")
