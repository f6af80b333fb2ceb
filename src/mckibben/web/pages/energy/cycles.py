"""Cycles of Part IV for the Energy page: what a visitor chose, the numbers, both loops, efficiency over pressure.

Values are those of the verb `energy`, in the units of the axes; the browser draws and computes nothing.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ....analysis.energy import CYCLES, READINGS, CycleLoops, CyclePath, EnergyCurve, EnergyCycle, WorkingCycles, energy
from ....analysis.energy.cycles import SETTINGS
from ....analysis.energy.working_cycles import LOSSES
from ....documents import JsonValue
from ....errors import InputError, MckibbenError, NoVolumeError
from ....muscles.muscle import built_muscle
from ....quantities import from_si, parse, shown_unit, with_unit
from ....registry import plugins
from ....report.figures import energy_figures
from ....report.study_reports import energy_report
from ....specimens import specimen, specimen_ids
from ....verbs import answer
from ...shelf import Shelf
from ...transfers import SpecimenFile, own_titles, specimen_file

if TYPE_CHECKING:
    from ....report.figures.page_charts import Figure


@dataclass(frozen=True)
class EnergyChoice:
    """Choices of a visitor; None stands for the muscle's own value."""

    muscle: str = "nylon"  # id of a specimen, or the name of a visitor's file
    law: str = ""  # where it states several
    cycle: str = "maximal"  # cycle of `CYCLES`
    pressure: float = 5e5  # gauge pressure of the supply [Pa]
    exchange: str = "atmosphere"  # atmosphere or accumulator
    accumulator_pressure: float | None = None  # gauge pressure of that [Pa]; the threshold where None
    friction: float | None = None  # while shortening [N]
    stretched_length: float | None = None  # where cycles begin [m]
    volume: str = ""  # volume of `VOLUMES`; the paper's where the law has it, if empty
    reading: str = "printed"  # reading of `READINGS`
    file: SpecimenFile | None = None  # file of the muscle, if it is the visitor's

    @property
    def source(self) -> str:
        """Id of the specimen, or path of the visitor's file."""
        return self.muscle if self.file is None else self.file.path


OF_THE_PAPERS = "nylon"  # they print its cycles, and neither its volume nor its stretched length
WORDS = {"cycle": CYCLES, "exchange": ("atmosphere", "accumulator"), "reading": READINGS}
LINKED = ("muscle", "law", "cycle", "exchange", "volume", "reading", *SETTINGS)


def from_link(words: Mapping[str, str], own: Shelf) -> tuple[EnergyChoice, list[str]]:
    """Read a choice from a link, with a sentence for each refused value, which gets its default."""
    choice, said = EnergyChoice(), []
    for name, text in words.items():
        try:
            value: Any = text
            if name in SETTINGS:
                value = parse(text, SETTINGS[name].unit, field=name, bare=True)
                SETTINGS[name].check(name, value)
            elif name in WORDS and text not in WORDS[name]:
                raise InputError(name, text, known=WORDS[name])
            tried = with_muscle(choice, text, own) if name == "muscle" else replace(choice, **{name: value})
            described(tried) if name in ("muscle", "law", "volume") else None
            choice = tried
        except MckibbenError as error:
            said.append(str(error))
    return choice, said


def to_link(choice: EnergyChoice) -> dict[str, str | None]:
    """Parameters of a link; None for default values."""
    usual = EnergyChoice()
    parameters: dict[str, str | None] = {}
    for name in LINKED:
        value = getattr(choice, name)
        words = str(value)
        if name in SETTINGS and value is not None:
            unit = SETTINGS[name].unit
            words = f"{from_si(value, unit, shown_unit(unit)):.10g} {shown_unit(unit)}"
        parameters[name] = None if value == getattr(usual, name) else words
    return parameters


def with_muscle(choice: EnergyChoice, name: str, own: Shelf) -> EnergyChoice:
    """The choice with another muscle, its usual law and its usual volume."""
    files = own.names()
    if name not in files and name not in specimen_ids():
        raise InputError("specimen", name, known=[*specimen_ids(), *files])
    file = specimen_file(own, name) if name in files else None
    return replace(choice, muscle=name, file=file, law="", volume="")


def muscles(own: Shelf) -> dict[str, str]:
    """Muscles with a volume, those of the visitor first: id or name of the file, and title."""
    titles = own_titles(own, lambda path: _has_volume(str(path), path.stat().st_mtime_ns))
    return titles | {one: specimen(one).title for one in specimen_ids("mckibben") if _has_volume(one, 0)}


@functools.lru_cache(maxsize=64)
def _has_volume(source: str, changed: int) -> bool:
    muscle = built_muscle(source)
    return not muscle.is_biological and muscle.law.has_volume()


def described(choice: EnergyChoice) -> WorkingCycles:
    """A cycle of the muscle of a choice, with the conditions that it has where none are chosen."""
    return working_cycle(EnergyChoice(choice.muscle, choice.law, volume=choice.volume, file=choice.file))


@functools.lru_cache(maxsize=64)
def working_cycle(choice: EnergyChoice) -> WorkingCycles:
    """Cycle of a choice under each volume."""
    accumulated, pressure = choice.exchange == "accumulator", choice.accumulator_pressure
    asked: dict[str, Any] = {
        "muscle": choice.source, "pressure": choice.pressure, "cycles": choice.cycle, "law": choice.law or None,
        "volume": choice.volume or None, "stretched_length": choice.stretched_length,
        "accumulator": accumulated and pressure is None, "accumulator_pressure": pressure if accumulated else None,
        "friction": choice.friction, "reading": choice.reading,
    }  # fmt: skip
    # a number that was typed goes as its text, so that a caution can tell the unit that was meant
    return answer(energy, {name: getattr(value, "text", value) for name, value in asked.items()})


def with_other_exchange(choice: EnergyChoice) -> EnergyChoice:
    """The same cycle, the air from an accumulator instead of the surroundings, or the other way round."""
    return replace(choice, exchange="atmosphere" if choice.exchange == "accumulator" else "accumulator")


ML, BAR, CM = (from_si(1.0, a, b) for a, b in (("m^3", "cm^3"), ("Pa", "bar"), ("m", "cm")))
POINTS, CURVE_POINTS = 65, 120
NUMBERS = ("input", "output", "efficiency")
CURVE_TOP = 10e5  # to which efficiency is drawn at least [Pa]
TITLES = {"maximal": "Maximal shortening", "isotonic": "Isotonic", "valve": "Isotonic, constant pressure"}


# ---- what is shown


def cycle_document(choice: EnergyChoice) -> dict[str, JsonValue]:
    """Compute everything that depends on the supply pressure."""
    computed = working_cycle(choice)
    (main,) = computed.loops(POINTS)
    other: CycleLoops | None = None  # the same with the other exchange, if there is one
    try:
        (other,) = working_cycle(with_other_exchange(choice)).loops(POINTS)
    except (InputError, NoVolumeError):
        pass
    (smooth,) = working_cycle(replace(choice, friction=0.0)).loops(POINTS)
    cycle, friction = main.cycle, computed.conditions.friction
    begins = list(main.piston.corners.values())[1]  # the corner where the muscle begins to shorten
    said = []
    if other is not None:
        accumulated = computed if choice.exchange == "accumulator" else working_cycle(with_other_exchange(choice))
        at = with_unit(accumulated.conditions.exchange_pressure, "Pa", 3)
        said.append(
            f"What the air could still do, {cycle.exhaust:.2f} J, is lost as the air leaves. An accumulator at "
            f"{at} gives {abs(cycle.input - other.cycle.input):.2f} J of the input back."
        )
    if choice.muscle == OF_THE_PAPERS and choice.stretched_length is None:
        said.append("Volume and stretched length are inferred.")
    return {
        "title": computed.specimen.title,
        "cycle": choice.cycle,
        "pressure": choice.pressure * BAR,
        "piston": {
            **_path(main.piston, ML, BAR),
            "w12": float(cycle.delivery),
            "w01": float(cycle.compression),
            "throttled": float(cycle.throttling),
            "input": cycle.input,
            "rest": cycle.stretched_volume * ML,
            "at": float(main.piston.x[begins]) * ML,
            "other": None if other is None else _path(other.piston, ML, BAR),
        },
        "tendon": {
            **_path(main.tendon, CM, 1.0),
            "output": cycle.output,
            "other": None if not friction else _path(smooth.tendon, CM, 1.0),
        },
        "exchange": choice.exchange,
        "friction": friction,
        "rows": _rows(choice, computed, cycle, None if other is None else other.cycle),
        "say": said,
        "more": computed.remarks(),
        "efficiency": _plain(cycle.efficiency),
        "other_efficiency": None if other is None else _plain(other.cycle.efficiency),
        # division of the input under each volume [J], as the table of the command line
        "volumes": [
            {name: row[name] if name == "volume" else _plain(row[name]) for name in ("volume", *NUMBERS, *LOSSES)}
            for row in computed.rows()
        ],
    }


def _plain(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _path(path: CyclePath, x: float, y: float) -> dict[str, JsonValue]:
    corners = {n.replace("'", "\u2032"): [float(path.x[i]) * x, float(path.y[i]) * y] for n, i in path.corners.items()}
    points = {"x": [float(f"{v:.6g}") for v in path.x * x], "y": [float(f"{v:.6g}") for v in path.y * y]}
    return {**points, "corners": corners}


def _rows(
    choice: EnergyChoice, computed: WorkingCycles, main: EnergyCycle, other: EnergyCycle | None
) -> list[dict[str, JsonValue]]:
    """Numbers of one cycle: label, value, unit, quantity, and the printed value at 5 bar."""
    accumulated, printed = choice.exchange == "accumulator", _printed(choice, computed)
    a, b, c = ("A", "B", "C") if choice.cycle == "maximal" else ("E", "F", "G")
    prime = "\u2032" if accumulated else ""
    rows = [
        (f"Compression, {a}{prime} to {b}", main.compression, "J", "P", ""),
        (f"Shortening, {b} to {c}", main.delivery, "J", "P", ""),
    ]
    if choice.cycle == "valve":
        rows.append(("of it throttled in the valve", main.throttling, "J", "", ""))
    rows += [
        ("In", main.input, "J", "P", printed.get(("input", accumulated), "")),
        ("Out", main.output, "J", "F", printed.get(("output", False), "")),
        ("Efficiency", main.efficiency, "", "", printed.get(("efficiency", accumulated), "")),
    ]
    if other is not None:
        end = with_other_exchange(choice).exchange
        rows += [
            (f"In, {end}", other.input, "J", "P", printed.get(("input", not accumulated), "")),
            (f"Efficiency, {end}", other.efficiency, "", "", printed.get(("efficiency", not accumulated), "")),
        ]
    return [
        {"words": w, "value": _plain(v), "unit": u, "quantity": q, "paper": p, "places": 2 if u else 3}
        for w, v, u, q, p in rows
    ]


def _printed(choice: EnergyChoice, computed: WorkingCycles) -> dict[tuple[str, bool], Any]:
    """Values that a paper prints for this cycle, by an installed package that knows them; empty if it prints another."""
    printed = plugins("mckibben.printed").get("cycle")
    if printed is None or choice.law or computed.volume != "paper" or choice.accumulator_pressure is not None:
        return {}
    values: dict[tuple[str, bool], Any] = printed(choice.muscle, choice.cycle, computed.conditions)
    return values


@functools.lru_cache(maxsize=16)
def curves(choice: EnergyChoice) -> dict[str, JsonValue]:
    """Efficiency over supply pressure, with each exchange, with and without friction; see `curves_key`."""
    lines = []
    for exchange in ("atmosphere", "accumulator"):
        for rubs in (True, False):
            try:
                one = replace(choice, exchange=exchange)
                computed = working_cycle(one)
                if not rubs and not computed.conditions.friction:
                    continue
                computed = computed if rubs else working_cycle(replace(one, friction=0.0))
            except InputError:
                continue
            over = computed.curve(choice.cycle, choice.pressure, CURVE_POINTS)
            share = over.cycles.efficiency
            keep = np.isfinite(share) & (share >= 0.0)
            x, y = ([float(f"{v:.6g}") for v in values[keep]] for values in (over.pressure * BAR, share))
            lines.append({"words": exchange, "friction": rubs, "x": x, "y": y})
    return {"lines": lines, "highest": choice.pressure * BAR}


def curves_key(choice: EnergyChoice) -> EnergyChoice:
    """The choice as far as its curves depend on it: at the highest pressure to which they are drawn."""
    return replace(choice, pressure=max(CURVE_TOP, choice.pressure), exchange="atmosphere")


class DrawnCycle(NamedTuple):
    """Loops of a cycle and its efficiency over pressure, the requested exchange first; numbers by exchange and volume."""

    loops: list[CycleLoops]
    curves: list[tuple[str, EnergyCurve]]
    numbers: dict[tuple[str, str], EnergyCycle]


def drawn_cycle(choice: EnergyChoice) -> DrawnCycle:
    """Compute what figures and reports show of a cycle, with each available exchange."""
    drawn = DrawnCycle([], [], {})
    for one in (choice, with_other_exchange(choice)):
        try:
            computed, wide = working_cycle(one), working_cycle(replace(curves_key(one), exchange=one.exchange))
        except InputError:
            continue
        drawn.loops.extend(computed.loops())
        drawn.curves.append((one.exchange, wide.curve(choice.cycle, wide.conditions.pressure, CURVE_POINTS)))
        for volume, numbers in computed.cycles[choice.cycle].items():
            drawn.numbers[one.exchange, volume] = numbers
    return drawn


def loops_picture(choice: EnergyChoice) -> Figure:
    """Draw both loops of a cycle, with each exchange."""
    return energy_figures.loops_figure(drawn_cycle(choice).loops, title=described(choice).specimen.title)


def efficiency_picture(choice: EnergyChoice) -> Figure:
    """Draw the efficiency over supply pressure, with each exchange."""
    lines = [energy_figures.EfficiencyLine(words, curve) for words, curve in drawn_cycle(choice).curves]
    return energy_figures.efficiency_figure(lines, title=described(choice).specimen.title)


def cycle_report(choice: EnergyChoice) -> bytes:
    """Write the report as an HTML file, with each available exchange."""
    of = described(choice)
    return energy_report(of.specimen.title, of.law, of.muscles, *drawn_cycle(choice)).html().encode("utf-8")
