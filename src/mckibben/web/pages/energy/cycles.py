"""Cycles of Part IV for the Energy page: numbers, both loops, and the efficiency over supply pressure.

Values are those of `analysis.energy`, in the units of the axes; the browser draws and computes nothing.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ....analysis.energy import (
    READINGS,
    Conditions,
    CycleLoops,
    CyclePath,
    EnergyCurve,
    EnergyCycle,
    WorkingCycles,
)
from ....documents import JsonValue
from ....errors import InputError, NoVolumeError
from ....quantities import from_si, with_unit
from ....report.figures import energy_figures
from ....report.study_reports import energy_report
from ....reproduction import part4
from .state import EnergyChoice, conditions, described, working_cycle

if TYPE_CHECKING:
    from ....report.figures.page_charts import Figure

ML, BAR, CM = (from_si(1.0, a, b) for a, b in (("m^3", "cm^3"), ("Pa", "bar"), ("m", "cm")))
LOSSES = {
    "friction": "Friction", "throttling": "Throttled in the valve", "exhaust": "Lost in the exhaust",
    "emptying": "Work on that air", "slackening": "Slack braid", "unaccounted": "Unaccounted",
}  # fmt: skip
POINTS, CURVE_POINTS = 65, 120
CURVE_TOP = 10e5  # to which efficiency is drawn at least [Pa]
TITLES = {"maximal": "Maximal shortening", "isotonic": "Isotonic", "valve": "Isotonic, constant pressure"}


# ---- what is shown


def cycle_document(choice: EnergyChoice) -> dict[str, JsonValue]:
    """Compute everything that depends on the supply pressure.

    Raises:
        MckibbenError: there is no such cycle; says why.
    """
    computed = working_cycle(choice)
    (main,) = computed.loops(POINTS)
    other, between, volume = _other(choice), computed.conditions, computed.volume
    (smooth,) = working_cycle(replace(choice, friction=0.0)).loops(POINTS)
    return {
        "title": computed.specimen.title,
        "law": computed.law,
        "volume": volume,
        "cycle": choice.cycle,
        "pressure": choice.pressure * BAR,
        "piston": {
            **_path(main.piston, ML, BAR),
            "corners": _corners(main.piston, ML, BAR),
            "w12": _joules(main, "delivery"),
            "w01": _joules(main, "compression"),
            "throttled": _joules(main, "throttling"),
            "input": main.cycle.input,
            "rest": main.cycle.stretched_volume * ML,
            "at": _corner_x(main) * ML,
            "other": None if other is None else _path(other.piston, ML, BAR),
        },
        "tendon": {
            **_path(main.tendon, CM, 1.0),
            "corners": _corners(main.tendon, CM, 1.0),
            "output": main.cycle.output,
            "other": None if not between.friction else _path(smooth.tendon, CM, 1.0),
        },
        "exchange": choice.exchange,
        "friction": between.friction,
        "rows": _rows(choice, main.cycle, None if other is None else other.cycle, between, volume),
        "say": _say(choice, main, other, between),
        "more": _more(choice, main, computed),
        "efficiency": _plain(main.cycle.efficiency),
        "other_efficiency": None if other is None else _plain(other.cycle.efficiency),
        "volumes": _volumes(computed, choice.cycle),
    }


def _other(choice: EnergyChoice) -> CycleLoops | None:
    """Compute the same cycle with the other exchange, if there is one."""
    flipped = "atmosphere" if choice.exchange == "accumulator" else "accumulator"
    try:
        return working_cycle(choice, flipped).loops(POINTS)[0]
    except (InputError, NoVolumeError):
        return None


def _plain(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _path(path: CyclePath, x: float, y: float) -> dict[str, JsonValue]:
    return {"x": [float(f"{v:.6g}") for v in path.x * x], "y": [float(f"{v:.6g}") for v in path.y * y]}


def _corners(path: CyclePath, x: float, y: float) -> dict[str, list[float]]:
    return {
        name.replace("'", "\u2032"): [float(path.x[i]) * x, float(path.y[i]) * y] for name, i in path.corners.items()
    }


def _joules(loops: CycleLoops, name: str) -> float:
    return float(getattr(loops.cycle, name))


def _corner_x(loops: CycleLoops) -> float:
    """Volume at the corner where the muscle begins to shorten [m^3]."""
    second = list(loops.piston.corners.values())[1]
    return float(loops.piston.x[second])


def _rows(
    choice: EnergyChoice, main: EnergyCycle, other: EnergyCycle | None, between: Conditions, volume: str
) -> list[dict[str, JsonValue]]:
    """Numbers of one cycle: label, value, unit, quantity, and the printed value at 5 bar."""
    accumulated = choice.exchange == "accumulator"
    printed = _printed(choice, between, volume)
    a, b, c = ("A", "B", "C") if choice.cycle == "maximal" else ("E", "F", "G")
    prime = "\u2032" if accumulated else ""
    rows = [
        (f"Compression, {a}{prime} to {b}", main.compression, "J", "P", ""),
        (f"Shortening, {b} to {c}", main.delivery, "J", "P", ""),
    ]
    if choice.cycle == "valve":
        rows.append(("of it throttled in the valve", main.throttling, "J", "", ""))
    words = {False: "atmosphere", True: "accumulator"}
    rows += [
        ("In", main.input, "J", "P", printed.get(("input", accumulated), "")),
        ("Out", main.output, "J", "F", printed.get(("output", False), "")),
        ("Efficiency", main.efficiency, "", "", printed.get(("efficiency", accumulated), "")),
    ]
    if other is not None:
        end = words[not accumulated]
        rows += [
            (f"In, {end}", other.input, "J", "P", printed.get(("input", not accumulated), "")),
            (f"Efficiency, {end}", other.efficiency, "", "", printed.get(("efficiency", not accumulated), "")),
        ]
    return [
        {"words": w, "value": _plain(v), "unit": u, "quantity": q, "paper": p, "places": 2 if u else 3}
        for w, v, u, q, p in rows
    ]


def _printed(choice: EnergyChoice, between: Conditions, volume: str) -> dict[tuple[str, bool], Any]:
    """Values that the paper prints for this cycle; empty if it prints another."""
    ours = part4.conditions()._replace(exchange_pressure=between.exchange_pressure, reading=between.reading)
    same = choice.muscle == part4.MUSCLE and not choice.law and volume == "paper" and between == ours
    if not same or choice.accumulator_pressure is not None:
        return {}
    output = "maximal" if choice.cycle == "maximal" else "isotonic"
    values: dict[tuple[str, bool], Any] = {("output", False): part4.printed(f"{output}.output")}
    for quantity in ("input", "efficiency"):
        for accumulated in (False, True):
            values[quantity, accumulated] = part4.printed(f"{choice.cycle}.{quantity}" + "_accumulator" * accumulated)
    if choice.cycle == "maximal":
        joules = part4.printed("maximal.output") / part4.printed("maximal.input_accumulator")
        values["efficiency", True] = {"struck": values["efficiency", True], "instead": joules}
    return values


def _say(choice: EnergyChoice, main: CycleLoops, other: CycleLoops | None, between: Conditions) -> list[str]:
    """Sentences below the numbers."""
    said, cycle = [], main.cycle
    at = between.exchange_pressure if choice.exchange == "accumulator" else _accumulator(choice)
    if other is not None and at is not None:
        saved = abs(cycle.input - other.cycle.input)
        said.append(
            f"What the air could still do, {cycle.exhaust:.2f} J, is lost as the air leaves. An accumulator at "
            f"{with_unit(at, 'Pa', 3)} gives {saved:.2f} J of the input back."
        )
    if choice.muscle == part4.MUSCLE and choice.stretched_length is None:
        said.append("Volume and stretched length are inferred.")
    return said


def _more(choice: EnergyChoice, main: CycleLoops, computed: WorkingCycles) -> list[str]:
    """Sentences about the assumptions of the numbers."""
    between = computed.conditions
    said = [f"{str(one)[0].upper()}{str(one)[1:]}." for one in computed.cautions]
    if choice.cycle != "maximal" and between.friction:
        said.append(f"Friction: {READINGS[between.reading]}.")
    if abs(main.cycle.unaccounted) > 5e-4:
        said.append("Unaccounted: eq. 38b moves with the length below the threshold too, where the gas does not pull.")
    if computed.overstretched:
        most = with_unit(float(computed.muscles[computed.volume].law.length_range()[1]), "m")
        said.append(f"Overstretched: the law is made for up to {most}. The stop beyond is left out, as in the paper.")
    return said


def _accumulator(choice: EnergyChoice) -> float | None:
    try:
        return conditions(choice, "accumulator").exchange_pressure
    except InputError:
        return None


def _volumes(computed: WorkingCycles, cycle: str) -> list[dict[str, JsonValue]]:
    """Division of the input under each volume [J], as the table of the command line."""
    return [
        {"volume": name, **{k: _plain(getattr(one, k)) for k in ("input", "output", "efficiency", *LOSSES)}}
        for name, one in computed.cycles[cycle].items()
    ]


@functools.lru_cache(maxsize=16)
def curves(choice: EnergyChoice) -> dict[str, JsonValue]:
    """Efficiency over supply pressure, with each exchange, with and without friction."""
    highest = max(CURVE_TOP, choice.pressure)
    lines = []
    for exchange in ("atmosphere", "accumulator"):
        for rubs in (True, False):
            try:
                computed = working_cycle(_wide(choice), exchange)
                if not rubs and not computed.conditions.friction:
                    continue
                computed = computed if rubs else working_cycle(replace(_wide(choice), friction=0.0), exchange)
            except InputError:
                continue
            over = computed.curve(choice.cycle, highest, CURVE_POINTS)
            share = over.cycles.efficiency
            keep = np.isfinite(share) & (share >= 0.0)
            lines.append(
                {
                    "words": exchange,
                    "friction": rubs,
                    "x": [float(f"{v:.6g}") for v in over.pressure[keep] * BAR],
                    "y": [float(f"{v:.6g}") for v in share[keep]],
                }
            )
    return {"lines": lines, "highest": highest * BAR, "threshold": described(choice).threshold * BAR}


def _wide(choice: EnergyChoice) -> EnergyChoice:
    """The choice at the highest pressure of the curves."""
    return replace(choice, pressure=max(CURVE_TOP, choice.pressure))


def curves_key(choice: EnergyChoice) -> EnergyChoice:
    """Choices on which the curves depend."""
    return replace(_wide(choice), exchange="atmosphere")


class DrawnCycle(NamedTuple):
    """Loops of a cycle and its efficiency over pressure, the requested exchange first; numbers by exchange and volume."""

    loops: list[CycleLoops]
    curves: list[tuple[str, EnergyCurve]]
    numbers: dict[tuple[str, str], EnergyCycle]


def drawn_cycle(choice: EnergyChoice) -> DrawnCycle:
    """Compute what figures and reports show of a cycle, with each available exchange."""
    other = "atmosphere" if choice.exchange == "accumulator" else "accumulator"
    drawn = DrawnCycle([], [], {})
    for exchange in (choice.exchange, other):
        try:
            computed, wide = working_cycle(choice, exchange), working_cycle(_wide(choice), exchange)
        except InputError:
            continue
        drawn.loops.extend(computed.loops())
        drawn.curves.append((exchange, wide.curve(choice.cycle, wide.conditions.pressure, CURVE_POINTS)))
        for volume, one in computed.cycles[choice.cycle].items():
            drawn.numbers[exchange, volume] = one
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
