"""Parts of an energy account: values with their origin, cycles, and the possible saving by an accumulator."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from ..accessors import Accessor
from ..answers import Answer, Caution, Column, Table, brief
from ..documents import JsonValue
from ..errors import InputError
from ..extras import library

if TYPE_CHECKING:
    import pandas

    from ..accessors import EnergyPlots

MEANINGS = {
    "supply": "exergy of the air that was drawn",
    "machines": "shafts of compressors in the circuit",
    "walls": "exergy from walls that are not as warm as the room",
    "valve": "throttled in valves on the way to the muscle",
    "tube": "throttled in tubes",
    "dead_volume": "thrown away by volumes that do no work: ports, tubes, fittings, accumulators",
    "exhaust": "thrown away by the muscle's own volume, the valve on the way out included",
    "leak": "lost through leaks",
    "machine": "destroyed in compressors",
    "mixing": "destroyed where gas of one temperature meets gas of another",
    "heat": "destroyed by heat between gas and walls",
    "other_walls": "work on volumes that something else moves",
    "friction": "turned into heat by the braid's friction and creep, and by a wrap",
    "viscous": "by dampers and tendons",
    "shaft_work": "work of the muscles on their load",
    "gas": "gain of the gas that is stored",
    "muscle": "gain of bladder and braid",
    "tendon": "gain of end masses and tendons",
    "way_in": "throttled in valve and tube on the way to the muscle",
    "remainder": "what is left",
    "enthalpy": "carried by the air",
    "atmosphere": "work on the atmosphere by muscles that swell",
    "outside": "work on the load from elsewhere",
    "load_losses": "dampers and friction of the load",
    "load": "gain of the load",
}
CYCLES = 20  # rows of cycles that a person is shown
STORED_FRICTION = "gain of the friction's own springs"


class EnergyPart(NamedTuple):
    """A line of an account.

    Attributes:
        name: such as ``valve``.
        value: [J].
        side: ``into``, ``out``, ``stored`` or ``remainder``.
        origin: ``integral``, ``end states``, ``from samples``, ``estimate`` or ``remainder``.
    """

    name: str
    value: float
    side: str
    origin: str

    @property
    def meaning(self) -> str:
        """Explanation in one phrase."""
        return STORED_FRICTION if (self.name, self.side) == ("friction", "stored") else MEANINGS.get(self.name, "")


class CycleEnergy(NamedTuple):
    """Energies of one cycle, from samples; works and exergies in [J].

    Attributes:
        start: [s].
        end: [s].
        air: drawn [kg].
        supply: exergy of the supply.
        compressor: least work to compress it in one stage without cooling.
        shaft_work: shaft work of the muscles on the load, over the whole path.
        work_out: where it is positive.
        parts: all of the account, the remainder with them.
    """

    start: float
    end: float
    air: float
    supply: float
    compressor: float
    shaft_work: float
    work_out: float
    parts: tuple[EnergyPart, ...]

    def __repr__(self) -> str:
        return brief(self)

    @property
    def efficiency(self) -> float:
        """Shaft work over supply exergy; NaN if none was drawn."""
        return self.shaft_work / self.supply if self.supply > 0.0 else float("nan")


class Saving(NamedTuple):
    """Exergy of the exhaust that an accumulator could keep: an upper bound, since it never fills and never throttles.

    Attributes:
        pressure: gauge, of the accumulator [Pa].
        air: that leaves at a higher pressure than that [kg].
        exergy: exergy of it at the accumulator's pressure and the room's temperature [J].
        share: share of the supply's exergy [1].
        efficiency: shaft work over what the supply would still have to give [1].
    """

    pressure: float
    air: float
    exergy: float
    share: float
    efficiency: float


ASSUMED = "estimated with the gas at the room's temperature and the muscle at rest on its law"
WITHOUT_CYCLES = "no cycle was found: the parts are those of the whole stretch"


@dataclass(frozen=True, repr=False)
class EnergyAccount(Answer):
    """An account; see the module.

    Attributes:
        kind: ``simulated`` or ``measured``.
        parts: in exergy, the remainder last.
        energy: by the first law; empty if it is not known.
        load: result of the shaft work; likewise.
        throughput: that errors are compared to [J].
        air: drawn [kg].
        compressor: least work for it, ``isothermal`` and ``adiabatic`` [J].
        cycles: in their order.
        unknown: names of what cannot be told from this recording, which are not zero.
        caught: air [kg] and exergy [J] that an accumulator at an absolute pressure would catch, and the supply's exergy
            and shaft work [J] of the same stretch.
        file: path of the recording; None where it was no file.
        title: of the recording.
        saving: by the accumulator that was asked for.
        cautions: about cycles that were left out or differ, and values that can only be slips.
    """

    kind: str
    parts: tuple[EnergyPart, ...]
    energy: tuple[EnergyPart, ...]
    load: tuple[EnergyPart, ...]
    throughput: float
    air: float
    compressor: Mapping[str, float]
    cycles: tuple[CycleEnergy, ...]
    unknown: tuple[str, ...]
    room_pressure: float
    caught: Callable[[float], tuple[float, float, float, float]]
    file: str | None = None
    title: str = ""
    saving: Saving | None = None
    cautions: tuple[Caution, ...] = ()

    units: ClassVar[Mapping[str, str]] = {"energy": "J"}
    plot: ClassVar[Accessor[EnergyPlots]] = Accessor("EnergyPlots")

    def __repr__(self) -> str:
        supply, work = (sum(p.value for p in self.parts if p.name == name) for name in ("supply", "shaft_work"))
        return f"EnergyAccount({self.kind}, {len(self.cycles)} cycles, supply {supply:.4g} J, work {work:.4g} J)"

    def value(self, name: str, side: str | None = None) -> float:
        """A part by its name [J].

        Raises:
            InputError: names what the account has.
        """
        values = [p.value for p in self.parts if p.name == name and side in (None, p.side)]
        if not values:
            why = "cannot be known from this recording; " if name in self.unknown else ""
            raise InputError("part", name, f"{why}the account has", known=dict.fromkeys(p.name for p in self.parts))
        return values[0]

    @property
    def notes(self) -> tuple[str, ...]:
        """What the account takes for granted, and that nothing repeats."""
        return (*([ASSUMED] if self.kind == "measured" else []), *([] if self.cycles else [WITHOUT_CYCLES]))

    @property
    def remainder(self) -> float:
        """Input that no part accounts for [J]."""
        return self.value("remainder")

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per part of the exergy: side, value [J], origin and meaning.

        Raises:
            MissingLibraryError: pandas is not installed; it comes with the extra ``data``.
        """
        rows = [{**part._asdict(), "meaning": part.meaning} for part in self.parts]
        frame: pandas.DataFrame = library("pandas", "Data frames need").DataFrame(rows)
        return frame.set_index(["side", "name"])

    def to_dict(self) -> dict[str, JsonValue]:
        """All parts and cycles as plain values, for JSON: works and exergies in [J], air in [kg]."""

        def told(parts: tuple[EnergyPart, ...]) -> list[dict[str, JsonValue]]:
            return [{**p._asdict(), "meaning": p.meaning} for p in parts]

        return {
            "kind": self.kind,
            "exergy": told(self.parts),
            "energy": told(self.energy),
            "load": told(self.load),
            "throughput": self.throughput,
            "remainder": self.remainder,
            "air": self.air,
            "compressor": dict(self.compressor),
            "efficiency": self.efficiencies(),
            "cycles": [
                {**c._asdict(), "efficiency": c.efficiency, "parts": {f"{p.side}.{p.name}": p.value for p in c.parts}}
                for c in self.cycles
            ],
            "unknown": list(self.unknown),
            "notes": list(self.notes),
            "file": self.file,
            "saving": None if self.saving is None else self.saving._asdict(),
        }

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per part of the exergy."""
        return [{"side": p.side, "part": p.name, "energy": p.value, "from": p.origin} for p in self.parts]

    def tables(self) -> list[Table]:
        """The parts that are not zero with their shares of the supply, and the cycles."""
        supply = next((p.value for p in self.parts if p.name == "supply"), float("nan"))
        sides = {"into": "in", "out": "out", "stored": "gained", "remainder": "left"}
        rows = [
            {**p._asdict(), "side": sides[p.side], "meaning": p.meaning}
            | {"share": p.value / supply if supply > 0.0 else None}
            for p in self.parts
            if p.value or p.name in ("supply", "shaft_work", "remainder")
        ]
        energies = (Column("value", "energy", "J", places=".5g"), Column("share", "share", "1", "%", ".2f"))
        columns = (
            Column("side", ""),
            Column("name", "part"),
            *energies,
            Column("origin", "from"),
            Column("meaning", ""),
        )
        tables = [Table(f"Exergy, {self.kind}", columns, rows)]
        if self.cycles:
            each = [{**c._asdict(), "efficiency": c.efficiency, "remainder": c.parts[-1].value} for c in self.cycles]
            times = (Column("start", "from", "s"), Column("end", "to", "s"), Column("air", unit="kg", shown="g"))
            works = (Column(key, unit="J") for key in ("supply", "shaft_work", "work_out"))
            last = (Column("efficiency", None, "1", "%", ".2f"), Column("remainder", None, "J", places=".2g"))
            tables.append(Table("Cycles, from samples", (*times, *works, *last), each, most=CYCLES))
        return tables

    def remarks(self) -> list[str]:
        """Air and efficiencies, what is unknown, notes, and what an accumulator would keep."""
        shares = ", ".join(f"{100.0 * v:.3g} % of the {name}" for name, v in self.efficiencies().items() if v == v)
        said = [f"Air drawn: {1e3 * self.air:.4g} g. Shaft work: {shares or 'no supply to compare it with'}."]
        said += [f"Unknown, and not zero: {', '.join(self.unknown)}."] if self.unknown else []
        said += [f"Note: {note}." for note in self.notes]
        if self.saving is not None:
            pressure, air, exergy, share, _ = self.saving
            said.append(
                f"An exhaust accumulator at {pressure / 1e3:.4g} kPa would keep at most {exergy:.4g} J, "
                f"{100.0 * share:.3g} % of the supply's, in {1e3 * air:.4g} g of air."
            )
        return said

    def efficiencies(self) -> dict[str, float]:
        """Shaft work over the supply's exergy, and over the work of a compressor with and without cooling [1]."""
        work = self.value("shaft_work")
        below = {"supply": self.value("supply"), **{f"{k} compressor": v for k, v in self.compressor.items()}}
        return {name: work / value if value > 0.0 else float("nan") for name, value in below.items()}

    def saved_by_accumulator(self, pressure: float) -> Saving:
        """Upper bound of the saving by an exhaust accumulator at a gauge pressure [Pa], for the recorded run.

        Raises:
            InputError: if the pressure is not above the room's.
        """
        if not (np.isfinite(pressure) and pressure > 0.0):
            raise InputError("pressure", pressure, "must be a gauge pressure above 0 Pa")
        air, exergy, supply, work = self.caught(pressure + self.room_pressure)
        nothing = float("nan")
        rest = supply - exergy
        share, efficiency = exergy / supply if supply > 0.0 else nothing, work / rest if rest > 0.0 else nothing
        return Saving(pressure, air, exergy, share, efficiency)
