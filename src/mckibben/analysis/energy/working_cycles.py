"""Working cycles of a muscle by its name: the muscle with each volume, conditions, cycles and curves in one object."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

from ...accessors import Accessor, implementation
from ...answers import Caution, collect, warn
from ...components import Environment
from ...documents import JsonValue
from ...errors import InputError
from ...extras import library
from ...muscles.build import at_rest_length
from ...muscles.build import muscle as built_muscle
from ...muscles.evidence import law_cautions
from ...muscles.law import law_name
from ...muscles.muscle import Muscle
from ...muscles.plausible import length_caution, pressure_caution, typed, usual_pressure
from ...quantities import in_si, values, with_unit
from ...specimens import Specimen, muscle_specimen
from . import cycles as one_cycle
from .curves import LEG_POINTS, CycleLoops, EnergyCurve, cycle_loops, energy_curve
from .cycles import CYCLES, Conditions, EnergyCycle, energy_cycle
from .muscle import CycleMuscle

if TYPE_CHECKING:
    import pandas

    from ...report.figures.plots import CyclePlots

LOSSES = ("friction", "throttling", "exhaust", "emptying", "slackening", "unaccounted")
CURVE_POINTS = 91


@dataclass(frozen=True)
class WorkingCycles:
    """Working cycles of a muscle: what `energy` computes.

    Attributes:
        specimen: of which muscle.
        law: name of its law.
        volume: name of the gas volume that counts, of `VOLUMES`.
        conditions: between which the cycles run.
        muscles: the muscle with each available volume, the one that counts first.
        cycles: numbers by the name of the cycle and of the volume [J].
        curves: cycles over the pressure of the supply, where they were asked for.
        cautions: what can hardly be meant of the conditions.
    """

    specimen: Specimen
    law: str
    volume: str
    conditions: Conditions
    muscles: Mapping[str, CycleMuscle]
    cycles: Mapping[str, Mapping[str, EnergyCycle]]
    curves: Mapping[str, EnergyCurve]
    cautions: tuple[Caution, ...] = ()

    plot: ClassVar[Accessor[CyclePlots]] = Accessor("report.figures.plots:CyclePlots")
    """Plots: ``plot.loops`` and ``plot.efficiency``, see `report.figures.plots`."""

    def __getitem__(self, name: str) -> EnergyCycle:
        """A cycle by its name, with the volume that counts."""
        if name not in self.cycles:
            raise InputError("cycle", name, known=self.cycles)
        return self.cycles[name][self.volume]

    @property
    def overstretched(self) -> bool:
        """Whether the cycles begin beyond the lengths that the law is made for."""
        return bool(self.muscles[self.volume].law.overstretched(self.conditions.stretched_length))

    def loops(self, points: int = LEG_POINTS) -> list[CycleLoops]:
        """The cycles as closed paths of piston and tendon, with a number of points on each curved leg."""
        return [cycle_loops(self.muscles[self.volume], name, self.conditions, points=points) for name in self.cycles]

    def curve(self, name: str, highest: float | None = None, points: int = CURVE_POINTS - 1) -> EnergyCurve:
        """A cycle over the pressure of the supply.

        Args:
            name: name of `CYCLES`.
            highest: gauge pressure up to which it is computed, from the threshold on [Pa]; twice that of the conditions by
                default.
            points: number of pressures.
        """
        muscle, most = self.muscles[self.volume], 2.0 * self.conditions.pressure if highest is None else highest
        at = one_cycle.pressures(muscle, self.conditions, most, points)
        return energy_curve(muscle, name, at, self.conditions)

    @property
    def threshold(self) -> float:
        """Gauge pressure from which the gas pulls, zero for a law without one [Pa]."""
        return float(self.muscles[self.volume].threshold())

    def to_dict(self) -> dict[str, JsonValue]:
        """Cycles, conditions and curves as plain values, in SI units."""
        listed = []
        for name, by_volume in self.cycles.items():
            beside = {
                volume: {key: getattr(one, key) for key in ("input", "output", "efficiency")}
                for volume, one in by_volume.items()
                if volume != self.volume
            }
            about = {"name": name, "title": CYCLES[name], **by_volume[self.volume]._asdict()}
            listed.append(about | {"volume": self.volume, "beside": beside})
        c = self.conditions
        content = {
            "cycles": listed,
            "specimen": self.specimen.id,
            "law": self.law,
            "volume": self.volume,
            "pressure": c.pressure,
            "exchange_pressure": c.exchange_pressure,
            "ambient_pressure": float(c.ambient.pressure_abs),
            "stretched_length": c.stretched_length,
            "overstretched": self.overstretched,
            "friction": c.friction,
            "reading": c.reading,
        }
        if self.curves:
            content["curves"] = [
                {"name": curve.name, "pressure": curve.pressure}
                | {key: getattr(curve.cycles, key) for key in ("input", "output", "efficiency")}
                for curve in self.curves.values()
            ]
        return content

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per cycle and volume, the energies in J."""
        return [
            {"cycle": name, "volume": volume} | one._asdict()
            for name, by_volume in self.cycles.items()
            for volume, one in by_volume.items()
        ]

    def to_dataframe(self) -> pandas.DataFrame:
        """`rows` as a data frame.

        Raises:
            MissingLibraryError: pandas is not installed; it comes with the extra ``data``.
        """
        frame: pandas.DataFrame = library("pandas", "Data frames need").DataFrame(self.rows())
        return frame.set_index(["cycle", "volume"])

    def __repr__(self) -> str:
        shares = ", ".join(f"{name} {self[name].efficiency:.1%}" for name in self.cycles)
        return f"WorkingCycles({self.specimen.id}, {with_unit(self.conditions.pressure, 'Pa')}: {shares})"

    def _repr_html_(self) -> str:
        return str(implementation("report.figures.plots:cycles_html")(self))


def energy(
    muscle: str | os.PathLike[str] | Specimen | Muscle,
    *,
    pressure: float | str | None = None,
    cycles: str | Sequence[str] = tuple(CYCLES),
    law: str | None = None,
    parameters: Mapping[str, float] | None = None,
    volume: str | None = None,
    stretched_length: float | str | None = None,
    contraction: float | str | None = None,
    accumulator: bool = False,
    accumulator_pressure: float | str | None = None,
    friction: float | str | None = None,
    reading: str = "printed",
    ambient: float | str | None = None,
    curves: bool = False,
) -> WorkingCycles:
    """Compute input, output, losses and efficiency of a muscle's working cycles.

    Args:
        muscle: a specimen, its id or file, or a muscle of one.
        pressure: highest gauge pressure, that of the supply [Pa]; 5 bar by default, less where the muscle is rated for less.
        cycles: names of `CYCLES`.
        law: name of a law that the specimen states; its default, or that of the muscle, if left out.
        parameters: parameters of the law that are replaced [SI].
        volume: name of `VOLUMES`; the paper's where the law has it, if left out.
        stretched_length: length at which the cycles begin [m]; by default the upper working length.
        contraction: the same as a contraction from the rest length [1], negative if stretched.
        accumulator: whether air is exchanged with an accumulator at the threshold pressure.
        accumulator_pressure: gauge pressure of an accumulator instead [Pa].
        friction: Coulomb friction while shortening [N]; as the specimen states it by default.
        reading: name of `READINGS`: where friction acts in the isotonic cycles.
        ambient: absolute pressure of the surroundings [Pa]; that of the papers for their muscles, else standard.
        curves: whether the efficiency over pressure is computed too, from the threshold to twice the pressure.

    Raises:
        InputError: an argument is out of range, or the muscle makes no such cycle; says why.

    Examples:
        >>> import mckibben as mk
        >>> mk.energy("nylon", pressure="5 bar", cycles="maximal")
        WorkingCycles(nylon, 5 bar: maximal 29.2%)
    """
    spec, changes, law = _described(muscle, law, parameters)
    names = _names([cycles] if isinstance(cycles, str) else cycles)
    if volume == "":
        raise InputError("volume", volume, "must be the name of a volume")
    law, muscles = one_cycle.cycle_muscles(spec, law or spec.law, volume or "", changes)
    which = next(iter(muscles))
    own = muscles[which]
    around = one_cycle.surroundings(spec)
    if ambient is not None:
        around = Environment(pressure_abs=in_si(ambient, "Pa", field="ambient"))
    conditions = Conditions(
        pressure=usual_pressure(spec) if pressure is None else float(in_si(pressure, "Pa", field="pressure")),
        stretched_length=_stretched(spec, own, law, stretched_length, contraction),
        ambient=around,
        exchange_pressure=_exchange(accumulator, accumulator_pressure, own, law),
        friction=one_cycle.coulomb_friction(spec)
        if friction is None
        else float(in_si(friction, "N", field="friction")),
        reading=reading,
    )
    conditions.check(own)
    computed = {n: {v: energy_cycle(m, n, conditions) for v, m in muscles.items()} for n in names}
    length, longest = conditions.stretched_length, float(own.law.length_range()[1])
    said = collect(
        *law_cautions(spec, law),
        pressure_caution(conditions.pressure, spec, text=typed(pressure)),
        None
        if stretched_length is None
        else length_caution(length, longest, text=typed(stretched_length), name="stretched length"),
    )
    warn(said)
    whole = WorkingCycles(spec, law, which, conditions, muscles, computed, {}, said)
    return replace(whole, curves={n: whole.curve(n) for n in names}) if curves else whole


def _described(
    muscle: str | os.PathLike[str] | Specimen | Muscle, law: str | None, parameters: Mapping[str, float] | None
) -> tuple[Specimen, dict[str, float], str | None]:
    """Specimen, cut where its rest length was changed; other changed parameters, and name of the law."""
    if isinstance(muscle, Muscle):
        if muscle.specimen is None:
            raise InputError("muscle", muscle.title, "must have a specimen, which states friction and lengths")
        own: dict[str, Any] = dict(values(muscle.law)) if law in (None, law_name(muscle.law)) else {}
        spec, law, parameters = muscle.specimen, law or law_name(muscle.law), own | dict(parameters or {})
    else:
        spec = muscle if isinstance(muscle, Specimen) else muscle_specimen(muscle)
    return *at_rest_length(spec, law or spec.law, parameters or {}), law


def _names(cycles: Iterable[str]) -> list[str]:
    names = list(dict.fromkeys(cycles))
    for name in names:
        if name not in CYCLES:
            raise InputError("cycle", name, known=CYCLES)
    return names


def _stretched(
    spec: Specimen, muscle: CycleMuscle, law: str, length: float | str | None, contraction: float | str | None
) -> float:
    """Length at the start of cycles [m], below that of the threads if the specimen states it."""
    if length is not None and contraction is not None:
        raise InputError("contraction", str(contraction), "is allowed only without a stretched length")
    if contraction is not None:
        length = float(built_muscle(spec, law=law).length_at(contraction))
    if length is None:
        return one_cycle.stretched_length(spec, muscle)
    stretched = float(in_si(length, "m", field="stretched_length"))
    one_cycle.check_threads(spec, stretched, shown=length if isinstance(length, str) else "")
    return stretched


def _exchange(accumulator: bool, pressure: float | str | None, muscle: CycleMuscle, law: str) -> float:
    """Gauge pressure of the exchange [Pa]."""
    if pressure is not None and accumulator:
        raise InputError("accumulator_pressure", None, "is allowed only without an accumulator at the threshold")
    if pressure is not None:
        return float(in_si(pressure, "Pa", field="accumulator_pressure"))
    cure = "an accumulator pressure, such as '0.9 bar'"
    return one_cycle.at_threshold(muscle, law, cure=cure) if accumulator else 0.0
