"""Comparison of braided and biological muscles by the same properties.

drive          0 to 1: gauge pressure over the full pressure, or activation
F0             tension at the rest length L0, fully driven, at rest, without friction
relative       length over L0, tension over F0
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from ..._jax import Scalar
from ...analysis import characteristics
from ...analysis.channels import known
from ...analysis.characteristics import circle_area, static_characteristics
from ...analysis.energy import Conditions, cycle_muscle, energy_cycle
from ...analysis.loops import loop, paths, peak_velocity
from ...analysis.segments import segments, steps_of
from ...analysis.shortening import ShorteningPower, power_density, shortening_power
from ...answers import brief
from ...assembly.build import rig_unit
from ...assembly.muscle_unit import MuscleUnit
from ...documents import path_text
from ...errors import InputError, NoVolumeError, choice
from ...muscles import Muscle
from ...muscles.biological import BiologicalMuscle
from ...muscles.build import rest_length_of, upper_length_of
from ...muscles.evidence import interval_words
from ...muscles.muscle import from_specimen
from ...quantities import from_si, with_unit
from ...recordings import Recording, read_recording
from ...specimens import Specimen, muscle_specimen
from ...specimens.published import PublishedRange

FULL_PRESSURE = 5e5  # at which the paper compares its muscles [Pa]
LEAST = 0.99  # of the rest length: a muscle that is free there already makes no tension worth comparing


@dataclass(frozen=True, eq=False)
class ComparedMuscle:
    """A muscle in a comparison.

    `unit` is a braided muscle and `fibre` a biological one, the other is None; `full` is the drive that counts as 1: a
    gauge pressure [Pa], or an activation [1]. `section_area` [m^2] is None if it is not known, and `area_from` says what
    did.
    """

    spec: Specimen
    unit: MuscleUnit | None
    fibre: BiologicalMuscle | None
    full: float
    rest_length: float
    upper_length: float
    section_area: float | None
    area_from: str

    __repr__ = brief

    @property
    def id(self) -> str:
        """Identifier of its specimen."""
        return self.spec.id

    @property
    def law(self) -> Any:
        """Law for tension, stiffness and free length at a length [m] and a drive [Pa or 1]."""
        return self.fibre if self.fibre is not None else self.unit.law  # type: ignore[union-attr]

    @property
    def full_tension(self) -> float:
        """Full tension F0 [N]."""
        return float(self.law.tension(self.rest_length, self.full))

    def tension(self, relative_length: Scalar, drive: Scalar = 1.0) -> np.ndarray:
        """Static tension over F0 [1] at lengths over L0 [1] and drives [1], any shape."""
        length, pull = np.asarray(relative_length, float) * self.rest_length, np.asarray(drive, float) * self.full
        return np.asarray(self.law.tension(length, pull)) / self.full_tension

    def stiffness(self, relative_length: Scalar, drive: Scalar = 1.0) -> np.ndarray:
        """Static stiffness dF/dL times L0 over F0 [1], any shape."""
        length, pull = np.asarray(relative_length, float) * self.rest_length, np.asarray(drive, float) * self.full
        return np.asarray(self.law.stiffness(length, pull)) * self.rest_length / self.full_tension


def subject(
    what: str | os.PathLike[str] | Specimen | Muscle, *, pressure: float = FULL_PRESSURE, law: str | None = None
) -> ComparedMuscle:
    """Load a muscle from its specimen for comparison.

    Args:
        what: a specimen, its id or file, or a muscle of a specimen.
        pressure: the gauge pressure that counts as the full drive of a McKibben muscle [Pa].
        law: one that the specimen states; its default law by default.

    Raises:
        InputError: it is no muscle, the pressure is none, or the muscle does not pull at its rest length.
    """
    muscle = what if isinstance(what, Muscle) else None
    if isinstance(what, Muscle):
        if what.specimen is None:
            raise InputError("muscle", repr(what), "a comparison needs a muscle of a specimen, a braid or a fit")
        spec = what.specimen
    else:
        spec = what if isinstance(what, Specimen) else muscle_specimen(what)
    if spec.kind == "valve":
        raise InputError("specimen", spec.id, "must be a muscle; it is a valve", where=spec.where)
    if not 0.0 < pressure <= 1e8:
        raise InputError("pressure", with_unit(pressure, "Pa"), "must be above 0 up to 1000 bar gauge")
    if spec.kind == "biological":
        fibre: BiologicalMuscle = from_specimen(spec, law) if muscle is None else cast(Any, muscle.law)
        return ComparedMuscle(
            spec,
            None,
            fibre,
            1.0,
            float(fibre.rest_length),
            float(fibre.plateau_end * fibre.rest_length),
            float(fibre.section_area),
            "stated",
        )
    unit = rig_unit(spec if muscle is None else muscle, law=law)
    rest, upper = rest_length_of(spec, unit.law), upper_length_of(spec, unit.law)
    free = float(unit.law.free_length(pressure))
    if not free < LEAST * min(rest, upper):
        said = f"{spec.id} pulls nothing at its rest length of {with_unit(rest, 'm')}; choose a higher one"
        raise InputError("pressure", with_unit(pressure, "Pa"), said)
    area, area_from = _section(spec, unit, pressure, free)
    return ComparedMuscle(spec, unit, None, pressure, rest, upper, area, area_from)


def _section(spec: Specimen, unit: MuscleUnit, pressure: float, free: float) -> tuple[float | None, str]:
    """Cross section at maximal shortening [m^2], and its source."""
    if "section_area" in spec.properties:
        return spec.property_si("section_area", "m^2"), "stated"
    if "diameter_shortened" in spec.properties:
        return circle_area(spec.property_si("diameter_shortened", "m")), "stated diameter"
    try:
        return float(unit.law.volume(free, pressure)) / free, "volume over length of the law, at its shortest"
    except NoVolumeError:
        return None, "unknown"


class Property(NamedTuple):
    """A property of the table: its name, label and units.

    `unit` is what a person reads, with the rest length L0 as a unit; `si` and `plain` are the same without L0, SI and shown.
    """

    name: str
    title: str
    unit: str
    si: str
    plain: str

    def shown(self, value: float) -> float:
        """Convert an SI value to the displayed unit."""
        return from_si(value, self.si, self.plain)


def _plain(name: str, title: str, unit: str, si: str | None = None) -> Property:
    return Property(name, title, unit, si or unit, unit)


STATIC = (
    _plain("rest_length", "Resting length", "cm", "m"),
    Property("shortest", "Dynamic range from", "L0", "1", "1"),
    Property("longest", "Dynamic range to", "L0", "1", "1"),
    Property("dynamic_range", "Dynamic range", "L0", "1", "1"),
    _plain("maximum_tension", "Largest tension", "N"),
    Property("stiffness", "Stiffness", "N/L0", "N", "N"),
    Property("work", "Work per cycle", "N L0", "N", "N"),
    _plain("section_area", "Section area", "cm^2", "m^2"),
    _plain("tension_intensity", "Tension intensity", "N/cm^2", "N/m^2"),
    Property("stiffness_intensity", "Stiffness intensity", "N/(L0 cm^2)", "N/m^2", "N/cm^2"),
    _plain("work_density", "Work density per cycle", "J/cm^3", "J/m^3"),
    _plain("coulomb_friction", "Coulomb friction", "N"),
    Property("maximum_velocity", "Largest velocity", "L0/s", "1/s", "1/s"),
    _plain("mean_power_density", "Mean power density", "W/cm^3", "W/m^3"),
    _plain("peak_power_density", "Peak power density", "W/cm^3", "W/m^3"),
    _plain("efficiency", "Energy efficiency", "1"),
    _plain("efficiency_accumulator", "Efficiency, accumulator", "1"),
)
DYNAMIC = (
    _plain("twitch_tension", "Twitch over full tension", "1"),
    _plain("twitch_contraction_time", "Twitch contraction time", "ms", "s"),
    _plain("twitch_half_relaxation_time", "Twitch half-relaxation", "ms", "s"),
    _plain("step_delay", "Step: total delay", "ms", "s"),
    _plain("step_half_rise", "Step: rise 0-50 %", "ms", "s"),
    _plain("step_rise", "Step: rise 0-90 %", "ms", "s"),
    _plain("step_half_fall", "Step: fall 100-50 %", "ms", "s"),
    _plain("step_fall", "Step: fall 100-10 %", "ms", "s"),
    Property("release_velocity", "Release to F0/2: velocity", "L0/s", "1/s", "1/s"),
    Property("release_shortening", "Release to F0/2: shortening", "L0", "1", "1"),
    _plain("release_half_time", "Release to F0/2: half of it", "ms", "s"),
    _plain("tension_at_speed", "Tension at 1 L0/s over at rest", "1"),
    _plain("hill_curvature", "Hill's a/F0", "1"),
    Property("hill_velocity", "Hill's largest velocity", "L0/s", "1/s", "1/s"),
    Property("cycle_work", "Work loop: net work", "F0 L0", "1", "1"),
    _plain("cycle_work_density", "Work loop: net work density", "J/cm^3", "J/m^3"),
    _plain("cycle_power_density", "Work loop: power density", "W/cm^3", "W/m^3"),
    Property("stiffness_at_half", "Stiffness at F0/2, 0.9 L0", "F0/L0", "1", "1"),
)
PROPERTIES = {p.name: p for p in (*STATIC, *DYNAMIC)}


class MuscleColumn(NamedTuple):
    """One muscle of the table: its known properties by name [SI], and remarks."""

    name: str
    title: str
    kind: str  # ``law``, ``recording`` or ``law and protocols``
    values: Mapping[str, float]
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return brief(self)


class PropertyRow(NamedTuple):
    """One property of all columns [SI], None if unknown, and the published values of biological muscle."""

    property: Property
    values: tuple[float | None, ...]
    published: PublishedRange | None

    def __repr__(self) -> str:
        return brief(self)

    def shown(self) -> list[float | None]:
        """The values in the property's unit."""
        return [None if v is None else self.property.shown(v) for v in self.values]

    def shown_range(self) -> tuple[float, float] | None:
        """The published range in the property's unit."""
        if self.published is None:
            return None
        low, high = (self.property.shown(end) for end in self.published.si(self.property.si))
        return low, high


Comparable = str | os.PathLike[str] | Specimen | Muscle | ComparedMuscle


def law_column(muscle: ComparedMuscle) -> MuscleColumn:
    """Compute Table 1 of one muscle from its law [SI]."""
    values, notes = (_biological if muscle.fibre is not None else _braided)(muscle)
    return MuscleColumn(muscle.id, muscle.spec.title, "law", values, notes)


def _braided(muscle: ComparedMuscle) -> tuple[dict[str, float], tuple[str, ...]]:
    unit = muscle.unit
    assert unit is not None
    area = muscle.section_area
    c = static_characteristics(
        unit.law,
        pressure=muscle.full,
        rest_length=muscle.rest_length,
        upper_length=muscle.upper_length,
        section_area=area or 1.0,
    )
    values = {
        "rest_length": c.rest_length,
        "shortest": c.zero_tension_length / c.rest_length,
        "longest": c.upper_length / c.rest_length,
        "dynamic_range": c.dynamic_range,
        "maximum_tension": c.maximum_tension,
        "stiffness": c.stiffness,
        "work": c.work,
    }
    notes = []
    if area is not None:
        names = ("section_area", "tension_intensity", "stiffness_intensity", "work_density")
        values |= {name: getattr(c, name) for name in names}
    if muscle.area_from not in ("stated", "stated diameter"):
        notes.append(f"section area: {muscle.area_from}")
    if unit.friction is not None:
        values["coulomb_friction"] = float(unit.friction.largest_force(muscle.full))
    else:
        notes.append("no friction is stated")
    efficiencies, said = _efficiency(muscle, values.get("coulomb_friction", 0.0))
    return values | efficiencies, (*notes, said, interval_words(muscle.spec, unit.law))


def _efficiency(muscle: ComparedMuscle, friction: float) -> tuple[dict[str, float], str]:
    """Efficiencies of quasi-stationary maximal shortening, with air from the surroundings and from an accumulator."""
    settings: dict[str, Any] = {"stretched_length": muscle.upper_length, "friction": friction}
    try:
        gas = cycle_muscle(muscle.law)
        threshold = float(gas.threshold())
        plain = energy_cycle(gas, "maximal", Conditions(pressure=muscle.full, **settings))
        values = {"efficiency": plain.efficiency}
        if threshold > 0.0:
            stored = Conditions(pressure=muscle.full, exchange_pressure=threshold, **settings)
            values["efficiency_accumulator"] = energy_cycle(gas, "maximal", stored).efficiency
    except (InputError, NoVolumeError) as error:
        return {}, f"no efficiency: {error}"
    return values, "efficiency of quasi-stationary maximal shortening with an ideal compressor"


def _biological(muscle: ComparedMuscle) -> tuple[dict[str, float], tuple[str, ...]]:
    fibre, area = muscle.fibre, muscle.section_area
    assert fibre is not None and area is not None
    c = characteristics.comparison(fibre)
    values = {
        "rest_length": muscle.rest_length,
        "shortest": c.dynamic_range.shortest,
        "longest": c.dynamic_range.longest,
        "dynamic_range": c.dynamic_range.width,
        "maximum_tension": c.tension_intensity * area,
        "stiffness": c.stiffness_intensity * area,
        "work": c.work_density * area,
        "section_area": area,
        "tension_intensity": c.tension_intensity,
        "stiffness_intensity": c.stiffness_intensity,
        "work_density": c.work_density,
        "coulomb_friction": 0.0,
        "maximum_velocity": c.maximum_velocity,
        "peak_power_density": c.peak_power_density,
    }
    sized = [p for p in ("rest_length", "section_area") if muscle.spec.laws[muscle.spec.law][p].inferred]
    return values, ("its size is inferred: compare densities and intensities",) if sized else ()


# Channels of a recording that are driven, and those that answer, the ones that are measured first.
LENGTHS = ("span", "muscle.length", "muscle.span", "length")
TENSIONS = ("tension", "muscle.tension")
PRESSURES = ("pressure", "muscle.pressure")
STEADY = 0.1  # of its mean: a drive that moves less is constant
NEAR_TOP = 0.9  # of the highest constant drive: cycles there are compared
SLACK = 0.02  # of the largest tension: shorter lengths carry none
GRID = 401


class _Piece(NamedTuple):
    """Cycles of a recording: the part, mean drive (0 if none is recorded), movement, and peak velocity [m/s]."""

    record: Recording
    drive: float
    moves: float
    velocity: float


def column_of(file: str | os.PathLike[str] | Recording, *, name: str | None = None) -> MuscleColumn:
    """Determine the properties of a muscle from its recording [SI].

    Args:
        file: a recording, or its file. Its meta must tell the rest length: ``rest_length`` [m], or a ``specimen`` that is
            known, which also gives the section.
        name: name of the column; that of the file, or of the protocol, by default.

    Raises:
        InputError: it cannot be read, has no length or no tension, has no rest length, or has no full cycle.
    """
    if isinstance(file, Recording):
        record, where = file, str(file.meta.get("title", "recording"))
    else:
        record, where = read_recording(Path(path_text(file, "recordings"))), str(file)
    title = name or (where if isinstance(file, Recording) else Path(file).stem)
    try:
        return _column(record, title)
    except InputError as error:
        raise error if error.where else error.at(where) from None


def _column(record: Recording, name: str) -> MuscleColumn:
    length, tension = _channel(record, LENGTHS, "length"), _channel(record, TENSIONS, "tension")
    muscle = _muscle(record)
    stated = record.meta.get("rest_length", None if muscle is None else muscle.rest_length)
    if isinstance(stated, bool) or not isinstance(stated, int | float) or not 0.0 < stated < 100.0:
        raise InputError(
            "rest_length",
            None if stated is None else str(stated),
            "must be a length [m] in the meta of the recording, or the id of a known specimen under specimen",
        )
    rest, area = float(stated), None if muscle is None else muscle.section_area
    pieces = _pieces(record, length)
    values: dict[str, float] = {"rest_length": rest, "maximum_tension": float(known(record, tension).max())}
    notes = ["largest velocity is the largest seen"]
    steady = [p for p in pieces if p.moves <= STEADY]
    if steady:
        top = max(p.drive for p in steady)
        slowest = min((p for p in steady if p.drive >= NEAR_TOP * top), key=lambda p: p.velocity)
        properties, said = _static(slowest.record, length, tension, rest)
        values, notes = values | properties, [*notes, *said]
        if top > 0.0:
            notes.append(f"static rows at {with_unit(slowest.drive, 'Pa')}")
    else:
        notes.append("no cycle at constant drive: no static rows")
    powers = [shortening_power(p.record, length=length, tension=tension) for p in pieces]
    values["maximum_velocity"] = max(p.peak_velocity for p in powers) / rest
    if area is not None:
        values |= _per_volume(values, powers, area, rest)
    else:
        notes.append("no section is known: nothing per section or volume")
    title = str(record.meta.get("title") or name)
    return MuscleColumn(name, title, "recording", values, tuple(notes))


def _static(record: Recording, length: str, tension: str, rest: float) -> tuple[dict[str, float], list[str]]:
    both = paths(record, length=length, tension=tension)
    ends = max(p.length[0] for p in both), min(p.length[-1] for p in both)
    at = np.linspace(*ends, GRID)
    mean = 0.5 * (both.rising.at(at) + both.falling.at(at))
    strongest = float(mean.max())
    pulls = mean > SLACK * strongest
    first = int(np.argmax(pulls))
    notes = (
        [] if first > 0 or mean[0] <= 2.0 * SLACK * strongest else ["zero tension was not reached: range as visited"]
    )
    low, high = float(at[first]), float(at[-1])
    values = {
        "shortest": low / rest,
        "longest": high / rest,
        "dynamic_range": (high - low) / rest,
        "maximum_tension": strongest,
        "stiffness": float(mean[-1] - mean[first]) / (high - low) * rest,
        "work": float(np.trapezoid(mean[first:], at[first:])) / rest,
        "coulomb_friction": loop(record, length=length, tension=tension).friction,
    }
    return values, notes


def _per_volume(values: dict[str, float], powers: list[ShorteningPower], area: float, rest: float) -> dict[str, float]:
    size: dict[str, Any] = {"section_area": area, "rest_length": rest}
    shares = {
        "section_area": area,
        "tension_intensity": values["maximum_tension"] / area,
        "mean_power_density": power_density(max(p.mean_power for p in powers), **size),
        "peak_power_density": power_density(max(p.peak_power for p in powers), **size),
    }
    if "stiffness" in values:
        shares |= {"stiffness_intensity": values["stiffness"] / area, "work_density": values["work"] / area}
    return shares


def _channel(record: Recording, names: tuple[str, ...], what: str) -> str:
    for name in names:
        if name in record:
            return name
    raise InputError(
        f"channel of {what}",
        None,
        f"is missing: it must be {choice(names)}; the recording has {', '.join(record.names()) or 'none'}",
    )


def _muscle(record: Recording) -> ComparedMuscle | None:
    """Specimen named by the recording, if it is known."""
    name = record.meta.get("specimen")
    if not isinstance(name, str):
        return None
    try:
        return subject(name)
    except InputError:
        return None


def _pieces(record: Recording, length: str) -> list[_Piece]:
    """The parts with full cycles of the length: the steps of the test machine, or the whole."""
    try:
        steps_of(record)
        parts = segments(record)
    except InputError:
        parts = [record]
    pressure = next((n for n in PRESSURES if n in record), None)
    pieces, last = [], None
    for part in parts:
        try:
            velocity = peak_velocity(part, length=length)
        except InputError as error:
            last = error
            continue
        drive = np.zeros(1) if pressure is None else known(part, pressure)
        mean = float(np.mean(drive))
        moves = float(np.ptp(np.quantile(drive, [0.01, 0.99]))) / mean if mean > 0.0 else 0.0
        pieces.append(_Piece(part, mean, moves, velocity))
    if not pieces:
        assert last is not None
        raise last
    return pieces
