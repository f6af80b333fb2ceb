"""Working cycles of a muscle by its name: with each volume, over the supply's pressure, and as closed paths (Fig. 12)."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from ... import verbs
from ...accessors import Accessor
from ...answers import Answer, Caution, Column, Table, brief, collect
from ...components import Environment
from ...documents import JsonValue
from ...errors import InputError, UnreachableError
from ...extras import library
from ...muscles.build import at_rest_length, changed_parameters
from ...muscles.evidence import interval_words, law_cautions, law_error
from ...muscles.law import law_name
from ...muscles.muscle import Muscle
from ...muscles.muscle import muscle as built_muscle
from ...muscles.plausible import free_length_caution, length_caution, pressure_caution, usual_pressure
from ...quantities import values, with_unit
from ...specimens import Specimen, muscle_specimen
from . import cycles as one_cycle
from .cycles import (
    CYCLES,
    READINGS,
    Conditions,
    CycleMuscle,
    EnergyCycle,
    Probe,
    computed,
    energy_cycle,
    isotonic_pressure,
)

if TYPE_CHECKING:
    import pandas

    from ...accessors import CyclePlots


POINTS = 61
LEG_POINTS = 257  # of each curved leg of a path


class EnergyCurve(NamedTuple):
    """Cycles over the gauge pressure of the supply [Pa]; every entry of ``cycles`` is an array of its shape.

    Not a number where the muscle does not shorten.
    """

    name: str
    pressure: np.ndarray
    cycles: EnergyCycle


def energy_curve(
    muscle: CycleMuscle, name: str, pressures: Sequence[float] | np.ndarray, conditions: Conditions
) -> EnergyCurve:
    """A cycle at many pressures.

    Args:
        muscle: from `cycle_muscle`.
        name: name of `CYCLES`.
        pressures: gauge pressures above the threshold and the exchange (n,) [Pa].
        conditions: all else; its own pressure must be allowed and is otherwise not used.
    """
    if name not in CYCLES:
        raise InputError("cycle", name, known=CYCLES)
    conditions.check(muscle)
    at = np.atleast_1d(np.asarray(pressures, float))
    floor = max(float(muscle.threshold()), conditions.exchange_pressure)
    if not np.all(np.isfinite(at) & (at > floor)):
        raise InputError("pressures", with_unit(float(at.min()), "Pa"), f"must be above {with_unit(floor, 'Pa')}")
    cycles = computed(muscle, name, conditions, at)
    shortens = Probe(muscle).tension(conditions.stretched_length, at) > conditions.friction
    return EnergyCurve(name, at, EnergyCycle(*(np.where(shortens, v, np.nan) for v in cycles)))


def best_pressure(
    muscle: CycleMuscle, name: str, conditions: Conditions, *, highest: float = 10e5
) -> tuple[float, float]:
    """Gauge pressure of the largest efficiency up to ``highest`` [Pa], and that efficiency [1].

    Raises:
        UnreachableError: if the efficiency still grows at ``highest``.
    """
    low, high = max(float(muscle.threshold()), conditions.exchange_pressure), highest
    at = low + (high - low) * np.linspace(0.0, 1.0, POINTS)[1:]
    for _ in range(5):  # each narrows the range thirtyfold; a maximum is flat, so that its place is known to 1e-8 of it
        share = energy_curve(muscle, name, at, conditions).cycles.efficiency
        if np.all(np.isnan(share)):
            raise UnreachableError(f"up to {with_unit(highest, 'Pa')} the muscle does no work in the cycle '{name}'")
        i = int(np.nanargmax(share))
        if at[i] >= highest:
            raise UnreachableError(f"the efficiency of the cycle '{name}' still grows at {with_unit(highest, 'Pa')}")
        best = float(at[i]), float(share[i])
        at = np.linspace(at[max(i - 1, 0)], at[min(i + 1, len(at) - 1)], len(at))
    return best


def zero_pressure(muscle: CycleMuscle, name: str, conditions: Conditions, *, highest: float = 10e5) -> float:
    """Gauge pressure at which the output passes zero, between the threshold and ``highest`` [Pa].

    Raises:
        UnreachableError: if there is none, as without friction.
    """
    low, high = max(float(muscle.threshold()), conditions.exchange_pressure), highest
    at = low + (high - low) * np.linspace(0.0, 1.0, 4 * POINTS)[1:]
    for _ in range(8):
        output = energy_curve(muscle, name, at, conditions).cycles.output
        rises = np.flatnonzero((output[:-1] < 0.0) & (output[1:] >= 0.0))
        if not rises.size:
            raise UnreachableError(
                f"the output of the cycle '{name}' does not pass zero between {with_unit(low, 'Pa')} and "
                f"{with_unit(highest, 'Pa')}"
            )
        i = int(rises[0])
        at = np.linspace(at[i], at[i + 1], len(at))
    return float(at[len(at) // 2])


CORNERS = {"maximal": ("A", "B", "C", "D"), "isotonic": ("E", "F", "G", "H"), "valve": ("E", "F", "G", "H")}


class CyclePath(NamedTuple):
    """A closed path; its last point is its first.

    Attributes:
        x: volume [m^3] or length [m], shape (n,).
        y: absolute pressure [Pa] or tension [N], shape (n,).
        corners: index of each named corner.
    """

    x: np.ndarray
    y: np.ndarray
    corners: dict[str, int]

    def __repr__(self) -> str:
        return brief(self)

    def area(self) -> float:
        """Work done along it, the integral of y dx by the trapezoid rule [J]."""
        return float(np.sum(0.5 * (self.y[1:] + self.y[:-1]) * np.diff(self.x)))


class CycleLoops(NamedTuple):
    """A cycle as two paths, both in the order of time.

    Attributes:
        name: name of the cycle.
        cycle: numbers of the cycle.
        conditions: that it was run between.
        piston: absolute pressure over the volume of the piston plus that of the stretched muscle.
        tendon: tension over length.
    """

    name: str
    cycle: EnergyCycle
    conditions: Conditions
    piston: CyclePath
    tendon: CyclePath

    def __repr__(self) -> str:
        return brief(self)


def cycle_loops(muscle: CycleMuscle, name: str, conditions: Conditions, *, points: int = LEG_POINTS) -> CycleLoops:
    """The paths of a cycle.

    The area of the piston's is the negative of the input, that of the tendon's the negative of the output. Corners have the
    paper's names; with an accumulator those on its line have a prime (A', D'), and so has the corner at which the supply of
    a valve is full (F').

    Args:
        muscle: from `cycle_muscle`.
        name: name of `CYCLES`.
        conditions: between which pressures and lengths.
        points: points of each curved leg.
    """
    cycle = energy_cycle(muscle, name, conditions)
    probe = Probe(muscle)
    piston = _piston(probe, name, conditions, cycle, points)
    return CycleLoops(name, cycle, conditions, piston, _tendon(probe, name, conditions, cycle, points))


def _piston(probe: Probe, name: str, c: Conditions, cycle: EnergyCycle, points: int) -> CyclePath:
    ambient = float(c.ambient.pressure_abs)
    low, high, rest = c.exchange_pressure + ambient, c.pressure + ambient, cycle.stretched_volume
    air = high * cycle.shortened_volume  # pressure times volume of all air in piston and muscle
    begins = high if name == "valve" else cycle.start_pressure + ambient
    rising = np.geomspace(low, begins, points)
    held = rest if name == "valve" else probe.volume(c.stretched_length, rising - ambient)
    first = np.stack([air / rising - held + rest, rising])
    if name == "valve":
        second = np.array([[rest], [high]])
    else:
        lengths = np.linspace(c.stretched_length, cycle.shortened_length, points)
        gauge = (
            np.full_like(lengths, c.pressure)
            if name == "maximal"
            else isotonic_pressure(probe, lengths, cycle.load + c.friction, c.exchange_pressure, c.pressure)
        )
        inside = probe.volume(lengths, gauge)
        second = np.stack([air / (gauge + ambient) - inside + rest, gauge + ambient])[:, 1:]
    back = np.array([[rest, first[0, 0]], [low, low]])
    x, y = np.concatenate([first, second, back], axis=1)
    full = points - 1 + second.shape[1]  # the piston is empty, all air in the muscle
    return CyclePath(x, y, dict(zip(_compared_names(name, c), (0, points - 1, full, full + 1), strict=True)))


def _tendon(probe: Probe, name: str, c: Conditions, cycle: EnergyCycle, points: int) -> CyclePath:
    lengths = np.linspace(c.stretched_length, cycle.shortened_length, points)
    if name == "maximal":
        pull = probe.tension(lengths, c.pressure) - c.friction
    else:
        pull = np.full_like(lengths, cycle.load)
    down = np.linspace(cycle.taut_length, c.stretched_length, points)
    taken = probe.tension(down, c.exchange_pressure) + c.return_friction
    slack = cycle.taut_length > cycle.shortened_length + 1e-12
    # The air leaves at a held length, and a slack muscle is drawn out without force before it is taut.
    limp = np.array([[cycle.shortened_length, cycle.taut_length], [0.0, 0.0]]) if slack else np.empty((2, 0))
    start = np.array([[c.stretched_length], [taken[-1]]])
    x, y = np.concatenate([start, np.stack([lengths, pull]), limp, np.stack([down, taken])], axis=1)
    # the paper's D is where the muscle is taut, its H where it ended
    last = points + 1 + int(slack and name == "maximal")
    names = [n if n[0] in "ADEH" else n[0] for n in _compared_names(name, c)]
    return CyclePath(x, y, dict(zip(names, (0, 1, points, last), strict=True)))


def _compared_names(name: str, c: Conditions) -> list[str]:
    prime = "'" if c.exchange_pressure else ""
    first, second, third, fourth = CORNERS[name]
    return [first + prime, second + ("'" if name == "valve" else ""), third, fourth + prime]


LOSSES = ("friction", "throttling", "exhaust", "emptying", "slackening", "unaccounted")
CURVE_POINTS = 91


@dataclass(frozen=True)
class WorkingCycles(Answer):
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

    plot: ClassVar[Accessor[CyclePlots]] = Accessor("CyclePlots")
    """Plots: ``plot.loops`` and ``plot.efficiency``, see `report.figures.plots`."""
    units: ClassVar[Mapping[str, str]] = (
        dict.fromkeys(("input", "output", "compression", "delivery", *LOSSES), "J")
        | dict.fromkeys(("shortened_length", "taut_length"), "m")
        | dict.fromkeys(("shortened_volume", "stretched_volume"), "m^3")
        | {"load": "N", "start_pressure": "Pa"}
    )

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
            "law_error": law_error(self.specimen, self.muscles[self.volume].law),
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

    def tables(self) -> list[Table]:
        """Input, output and efficiency of each cycle; where the input goes; and curves, where they were asked for."""
        c = self.conditions
        air = f"an accumulator at {with_unit(c.exchange_pressure, 'Pa')}" if c.exchange_pressure else "the surroundings"
        title = f"{self.specimen.title}, {self.law}, at {with_unit(c.pressure, 'Pa')}, air from {air} and back"
        rows = [row | {"title": CYCLES[str(row["cycle"])]} for row in self.rows()]
        names = (Column("cycle"), Column("title", ""), Column("volume"))
        output = Column("output", unit="J", places=".3f")
        numbers = (
            Column("input", unit="J", places=".3f"),
            output,
            Column("efficiency", unit="1", shown="%", places=".2f"),
            Column("shortened_length", "down to", "m", places=".2f"),
            Column("load", "load at first", "N", places=".1f"),
        )
        losses = [Column(name, unit="1", places=".3f") for name in ("output", *LOSSES)]  # the title has their unit
        tables = [Table(title, names + numbers, rows), Table("Where the input goes, J", (*names[::2], *losses), rows)]
        if not self.curves:
            return tables
        first, *_ = self.curves.values()
        efficiency = [Column(name, unit="1", shown="%", places=".2f") for name in self.curves]
        points = [
            {"pressure": pressure} | {name: curve.cycles.efficiency[i] for name, curve in self.curves.items()}
            for i, pressure in enumerate(first.pressure)
            if i % 6 == 0  # all of them are in the JSON
        ]
        columns = (Column("pressure", unit="Pa", places=".3f"), *efficiency)
        return [*tables, Table("Efficiency over pressure", columns, points)]

    def remarks(self) -> list[str]:
        """Conditions of the cycles, and where the numbers are less than they seem."""
        c = self.conditions
        around = with_unit(float(c.ambient.pressure_abs), "Pa", 5)
        start, friction = with_unit(c.stretched_length, "m"), with_unit(c.friction, "N")
        said = f"Begins at {start}, surroundings {around}, friction {friction}."
        if c.friction and any(name != "maximal" for name in self.cycles):
            said += f" Reading '{c.reading}': {READINGS[c.reading]}."
        remarks = [said]
        if "paper" in self.muscles and abs(next(iter(self.cycles.values()))["paper"].unaccounted) > 5e-4:
            remarks.append(
                "Unaccounted: eq. 38b moves with the length below the threshold too, where the gas does not pull."
            )
        if self.overstretched:
            most = with_unit(float(self.muscles[self.volume].law.length_range()[1]), "m")
            remarks.append(
                f"Overstretched: the law is made for up to {most}. The stop beyond is left out, as in the paper."
            )
        return [*remarks, f"Tension of one muscle: {interval_words(self.specimen, self.muscles[self.volume].law)}."]

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


@verbs.verb
def energy(
    muscle: verbs.MuscleName,
    *,
    pressure: verbs.Pressure | None = None,
    cycles: verbs.CycleName | Sequence[verbs.CycleName] | None = None,
    accumulator: bool = False,
    accumulator_pressure: verbs.Pressure | None = None,
    friction: verbs.Force | None = None,
    reading: verbs.ReadingName = "printed",
    volume: verbs.VolumeName | None = None,
    stretched_length: verbs.Length | None = None,
    contraction: verbs.Contraction | None = None,
    ambient: verbs.Pressure | None = None,
    law: verbs.LawName | None = None,
    parameters: verbs.Changes | None = None,
    curves: bool = False,
) -> WorkingCycles:
    """Compute input, output and efficiency of a muscle's working cycles.

    Args:
        muscle: id of a specimen, or the .toml file of one.
        pressure: gauge pressure of the supply [Pa]; '5 bar' by default, less where the specimen's rated pressure is less.
        cycles: cycle to compute: maximal, isotonic or valve; all by default.
        accumulator: exchange air with an accumulator at the threshold pressure.
        accumulator_pressure: exchange air with an accumulator at this gauge pressure [Pa], such as '1 bar'.
        friction: Coulomb friction while shortening [N], such as '2.5 N'; by default as the specimen states it.
        reading: where friction acts in the isotonic cycles: printed (output only) or throughout.
        volume: gas volume: paper (eq. 38b) or potential (the law's own); paper by default where the law has it.
        stretched_length: length at which cycles begin [m], such as '15 cm'; by default the upper working length.
        contraction: contraction from the rest length instead of a length, such as '20 %'; negative if stretched.
        ambient: absolute pressure of the surroundings [Pa], such as '1 bar'.
        law: law to use instead of the specimen's default, or my.py:MyLaw.
        parameters: replace a parameter, such as law.turns=3.2 or thread_length='16 cm'.
        curves: also compute efficiency over pressure, from the threshold to twice the pressure.

    Raises:
        InputError: an argument is out of range, or the muscle makes no such cycle; says why.

    Examples:
        >>> import mckibben as mk
        >>> mk.energy("nylon", pressure="5 bar", cycles="maximal")
        WorkingCycles(nylon, 5 bar: maximal 29.2%)
    """
    spec, changes, law = _described(muscle, law, parameters)
    names = list(dict.fromkeys([cycles] if isinstance(cycles, str) else cycles or CYCLES))
    for name in names:
        if name not in CYCLES:
            raise InputError("cycle", name, known=CYCLES)
    if volume == "":
        raise InputError("volume", volume, "must be the name of a volume")
    law, muscles = one_cycle.cycle_muscles(spec, law or spec.law, volume or "", changes)
    which = next(iter(muscles))
    own = muscles[which]
    around = one_cycle.surroundings(spec)
    if ambient is not None:
        around = Environment(pressure_abs=float(ambient))
    stretched = _stretched(spec, own, law, stretched_length, contraction)
    exchange = 0.0 if accumulator_pressure is None else float(accumulator_pressure)
    if accumulator:
        if accumulator_pressure is not None:
            raise InputError("accumulator_pressure", None, "is allowed only without an accumulator at the threshold")
        exchange = one_cycle.at_threshold(own, law)
    conditions = Conditions(
        pressure=usual_pressure(spec) if pressure is None else float(pressure),
        stretched_length=stretched,
        ambient=around,
        exchange_pressure=exchange,
        friction=one_cycle.coulomb_friction(spec) if friction is None else float(friction),
        reading=reading,
    )
    conditions.check(own)
    computed = {n: {v: energy_cycle(m, n, conditions) for v, m in muscles.items()} for n in names}
    length, longest = conditions.stretched_length, float(own.law.length_range()[1])
    said = collect(
        *law_cautions(spec, own.law),
        pressure_caution(conditions.pressure, spec, text=verbs.typed(pressure)),
        free_length_caution(own.law, [conditions.pressure], spec) if "maximal" in names else None,
        None
        if stretched_length is None
        else length_caution(length, longest, text=verbs.typed(stretched_length), name="stretched length"),
    )
    whole = WorkingCycles(spec, law, which, conditions, muscles, computed, {}, said)
    return replace(whole, curves={n: whole.curve(n) for n in names}) if curves else whole


def _described(
    muscle: str | os.PathLike[str] | Specimen | Muscle, law: str | None, changes: verbs.Changes | None
) -> tuple[Specimen, dict[str, float], str | None]:
    """Specimen, cut where its rest length was changed; other changed parameters, and name of the law."""
    if isinstance(muscle, Muscle):
        if muscle.specimen is None:
            raise InputError("muscle", muscle.title, "must have a specimen, which states friction and lengths")
        own: dict[str, Any] = dict(values(muscle.law)) if law in (None, law_name(muscle.law)) else {}
        spec, law = muscle.specimen, law or law_name(muscle.law)
    else:
        spec, own = muscle if isinstance(muscle, Specimen) else muscle_specimen(muscle), {}
    if law is not None and not law.strip():
        raise InputError("law", law, f"{spec.id} states", known=spec.laws)
    chosen = law or spec.law
    return *at_rest_length(spec, chosen, own | (changed_parameters(changes, chosen, of=spec) if changes else {})), law


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
    stretched = float(length)
    one_cycle.check_threads(spec, stretched, shown=getattr(length, "text", ""))
    return stretched
