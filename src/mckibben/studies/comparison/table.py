"""Table 1 for any muscles: from their laws, from recordings, and beside both what is published of biological muscle.

The properties are those by which C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996,
doi:10.1109/70.481753, compare; those that need a protocol are added by `protocols`. A property that nothing tells stays
None: a law without velocity has no largest one.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from ...analysis import biology
from ...analysis.characteristics import static_characteristics
from ...analysis.energy import Conditions, cycle_muscle, energy_cycle
from ...errors import InputError, NoVolumeError
from ...quantities import from_si
from ...specimens.published import PublishedRange, published_ranges
from .subject import FULL_PRESSURE, Subject, subject


class Property(NamedTuple):
    """A line of the table: its name, how it reads, and its units.

    `unit` is what a person reads, with the rest length L0 as a unit; `si` and `plain` are the same without L0, SI and shown.
    """

    name: str
    title: str
    unit: str
    si: str
    plain: str

    def shown(self, value: float) -> float:
        """An SI value in the unit that is read."""
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


class Column(NamedTuple):
    """One muscle of the table: its properties by name [SI] as far as something tells them, and remarks."""

    name: str
    title: str
    kind: str  # ``law``, ``recording`` or ``law and protocols``
    values: Mapping[str, float]
    notes: tuple[str, ...] = ()


class Row(NamedTuple):
    """One property of all columns [SI], None where it is not known, and what is published of biological muscle."""

    property: Property
    values: tuple[float | None, ...]
    published: PublishedRange | None

    def shown(self) -> list[float | None]:
        """The values in the property's unit."""
        return [None if v is None else self.property.shown(v) for v in self.values]

    def shown_range(self) -> tuple[float, float] | None:
        """The published range in the property's unit."""
        if self.published is None:
            return None
        low, high = (self.property.shown(end) for end in self.published.si(self.property.si))
        return low, high


@dataclass(frozen=True)
class Table:
    """Columns beside one another; rows are the properties that any of them has, or that are published."""

    columns: tuple[Column, ...]
    published: Mapping[str, PublishedRange]

    def rows(self) -> tuple[Row, ...]:
        """Every row that is not empty, in the order of `PROPERTIES`."""
        found = []
        for name, prop in PROPERTIES.items():
            values = tuple(c.values.get(name) for c in self.columns)
            if any(v is not None for v in values) or (name in self.published and prop in STATIC):
                found.append(Row(prop, values, self.published.get(name)))
        return tuple(found)


def compare(
    muscles: Iterable[str | os.PathLike[str] | Subject] = (),
    recordings: Sequence[str | os.PathLike[str]] = (),
    *,
    pressure: float = FULL_PRESSURE,
) -> Table:
    """Table 1 for muscles by their laws, and for recordings given as files.

    Args:
        muscles: specimens by id or file, or subjects.
        recordings: files of recordings with the names of their muscle's rest length, see `recorded.column_of`.
        pressure: full drive of the McKibben muscles [Pa].

    Raises:
        InputError: nothing to compare, or what a muscle or a recording lacks.
    """
    from .recorded import column_of

    subjects = [m if isinstance(m, Subject) else subject(m, pressure=pressure) for m in muscles]
    columns = [law_column(s) for s in subjects] + [column_of(file) for file in recordings]
    if not columns:
        raise InputError("muscles", "none", "allowed is a specimen's id or file, or a recording")
    return Table(tuple(columns), published_ranges())


def law_column(muscle: Subject) -> Column:
    """Table 1 of one muscle from its law [SI]."""
    values, notes = (_biological if muscle.fibre is not None else _braided)(muscle)
    return Column(muscle.id, muscle.spec.title, "law", values, notes)


def _braided(muscle: Subject) -> tuple[dict[str, float], tuple[str, ...]]:
    unit = muscle.unit
    assert unit is not None
    area = muscle.section_area
    c = static_characteristics(
        unit.law, pressure=muscle.full, rest_length=muscle.rest_length, upper_length=muscle.upper_length,
        section_area=area or 1.0,
    )  # fmt: skip
    values = {
        "rest_length": c.rest_length, "shortest": c.zero_tension_length / c.rest_length,
        "longest": c.upper_length / c.rest_length, "dynamic_range": c.dynamic_range,
        "maximum_tension": c.maximum_tension, "stiffness": c.stiffness, "work": c.work,
    }  # fmt: skip
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
    return values | efficiencies, (*notes, said)


def _efficiency(muscle: Subject, friction: float) -> tuple[dict[str, float], str]:
    """Of quasi-stationary maximal shortening, air from the surroundings and from an accumulator at the threshold."""
    own: dict[str, Any] = {"stretched_length": muscle.upper_length, "friction": friction}
    try:
        gas = cycle_muscle(muscle.law)
        threshold = float(gas.threshold())
        plain = energy_cycle(gas, "maximal", Conditions(pressure=muscle.full, **own))
        found = {"efficiency": plain.efficiency}
        if threshold > 0.0:
            stored = Conditions(pressure=muscle.full, exchange_pressure=threshold, **own)
            found["efficiency_accumulator"] = energy_cycle(gas, "maximal", stored).efficiency
    except (InputError, NoVolumeError) as error:
        return {}, f"no efficiency: {error}"
    return found, "efficiency of quasi-stationary maximal shortening with an ideal compressor"


def _biological(muscle: Subject) -> tuple[dict[str, float], tuple[str, ...]]:
    fibre, area = muscle.fibre, muscle.section_area
    assert fibre is not None and area is not None
    c = biology.comparison(fibre)
    values = {
        "rest_length": muscle.rest_length, "shortest": c.dynamic_range.shortest, "longest": c.dynamic_range.longest,
        "dynamic_range": c.dynamic_range.width, "maximum_tension": c.tension_intensity * area,
        "stiffness": c.stiffness_intensity * area, "work": c.work_density * area, "section_area": area,
        "tension_intensity": c.tension_intensity, "stiffness_intensity": c.stiffness_intensity,
        "work_density": c.work_density, "coulomb_friction": 0.0, "maximum_velocity": c.maximum_velocity,
        "peak_power_density": c.peak_power_density,
    }  # fmt: skip
    sized = [p for p in ("rest_length", "section_area") if muscle.spec.laws[muscle.spec.law][p].inferred]
    return values, ("its size is inferred: compare densities and intensities",) if sized else ()
