"""Cycles of Part IV for the Energy page: numbers, both loops, and the efficiency over supply pressure.

Values are those of `analysis.energy`, in the units of the axes; the browser draws and computes nothing.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ....analysis.energy import (
    READINGS,
    Conditions,
    CycleLoops,
    CycleMuscle,
    CyclePath,
    EnergyCurve,
    EnergyCycle,
    cycle_loops,
    energy_curve,
    energy_cycle,
)
from ....analysis.energy.cycles import pressures
from ....documents import JsonValue
from ....errors import InputError, NoVolumeError
from ....muscles.plausible import pressure_caution
from ....quantities import from_si, with_unit
from ....report.energy_report import energy_report
from ....report.figures import energy_figures
from ....reproduction import part4
from .state import EnergyChoice, conditions, resolved

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
    spec, law, all_ = resolved(choice)
    volume, muscle = next(iter(all_.items()))
    between = conditions(choice)
    main = cycle_loops(muscle, choice.cycle, between, points=POINTS)
    other = _other(choice, muscle)
    smooth = cycle_loops(muscle, choice.cycle, between._replace(friction=0.0), points=POINTS)
    overstretched = bool(muscle.law.overstretched(between.stretched_length))
    return {
        "title": spec.title,
        "law": law,
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
        "more": _more(choice, main, between, overstretched),
        "efficiency": _plain(main.cycle.efficiency),
        "other_efficiency": None if other is None else _plain(other.cycle.efficiency),
        "volumes": _volumes(all_, choice.cycle, between),
    }


def _other(choice: EnergyChoice, muscle: CycleMuscle) -> CycleLoops | None:
    """Compute the same cycle with the other exchange, if there is one."""
    flipped = "atmosphere" if choice.exchange == "accumulator" else "accumulator"
    try:
        return cycle_loops(muscle, choice.cycle, conditions(choice, flipped), points=POINTS)
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


def _more(choice: EnergyChoice, main: CycleLoops, between: Conditions, overstretched: bool) -> list[str]:
    """Sentences about the assumptions of the numbers."""
    caution = pressure_caution(between.pressure, resolved(choice).spec)
    said = [] if caution is None else [f"{caution[0].upper()}{caution[1:]}."]
    if choice.cycle != "maximal" and between.friction:
        said.append(f"Friction: {READINGS[between.reading]}.")
    if abs(main.cycle.unaccounted) > 5e-4:
        said.append("Unaccounted: eq. 38b moves with the length below the threshold too, where the gas does not pull.")
    if overstretched:
        most = with_unit(float(next(iter(resolved(choice).muscles.values())).law.length_range()[1]), "m")
        said.append(f"Overstretched: the law is made for up to {most}. The stop beyond is left out, as in the paper.")
    return said


def _accumulator(choice: EnergyChoice) -> float | None:
    try:
        return conditions(choice, "accumulator").exchange_pressure
    except InputError:
        return None


def _volumes(all_: Mapping[str, CycleMuscle], cycle: str, between: Conditions) -> list[dict[str, JsonValue]]:
    """Division of the input under each volume [J], as the table of the command line."""
    rows = []
    for name, muscle in all_.items():
        try:
            one = energy_cycle(muscle, cycle, between)
        except InputError:
            continue
        parts = {k: _plain(getattr(one, k)) for k in ("input", "output", "efficiency", *LOSSES)}
        rows.append({"volume": name, **parts})
    return rows


@functools.lru_cache(maxsize=16)
def curves(choice: EnergyChoice) -> dict[str, JsonValue]:
    """Efficiency over supply pressure, with each exchange, with and without friction."""
    muscle = next(iter(resolved(choice).muscles.values()))
    highest = max(CURVE_TOP, choice.pressure)
    lines = []
    for exchange in ("atmosphere", "accumulator"):
        for rubs in (True, False):
            try:
                between = conditions(replace(choice, pressure=highest), exchange)
            except InputError:
                continue
            if not rubs and not between.friction:
                continue
            between = between if rubs else between._replace(friction=0.0)
            at = pressures(muscle, between, highest, CURVE_POINTS)
            share = energy_curve(muscle, choice.cycle, at, between).cycles.efficiency
            keep = np.isfinite(share) & (share >= 0.0)
            lines.append(
                {
                    "words": exchange,
                    "friction": rubs,
                    "x": [float(f"{v:.6g}") for v in at[keep] * BAR],
                    "y": [float(f"{v:.6g}") for v in share[keep]],
                }
            )
    return {"lines": lines, "highest": highest * BAR, "threshold": float(muscle.threshold()) * BAR}


def curves_key(choice: EnergyChoice) -> EnergyChoice:
    """Choices on which the curves depend."""
    return replace(choice, pressure=max(CURVE_TOP, choice.pressure), exchange="atmosphere")


class DrawnCycle(NamedTuple):
    """Loops of a cycle and its efficiency over pressure, the requested exchange first; numbers by exchange and volume."""

    loops: list[CycleLoops]
    curves: list[tuple[str, EnergyCurve]]
    numbers: dict[tuple[str, str], EnergyCycle]


def drawn_cycle(choice: EnergyChoice) -> DrawnCycle:
    """Compute what figures and reports show of a cycle, with each available exchange."""
    muscles = resolved(choice).muscles
    muscle = next(iter(muscles.values()))
    other = "atmosphere" if choice.exchange == "accumulator" else "accumulator"
    drawn = DrawnCycle([], [], {})
    for exchange in (choice.exchange, other):
        try:
            between = conditions(choice, exchange)
            highest = max(CURVE_TOP, choice.pressure)
            wide = conditions(replace(choice, pressure=highest), exchange)
        except InputError:
            continue
        drawn.loops.append(cycle_loops(muscle, choice.cycle, between))
        at = pressures(muscle, wide, highest, CURVE_POINTS)
        drawn.curves.append((exchange, energy_curve(muscle, choice.cycle, at, wide)))
        for volume, one in muscles.items():
            drawn.numbers[exchange, volume] = energy_cycle(one, choice.cycle, between)
    return drawn


def loops_picture(choice: EnergyChoice) -> Figure:
    """Draw both loops of a cycle, with each exchange."""
    return energy_figures.loops_figure(drawn_cycle(choice).loops, title=resolved(choice).spec.title)


def efficiency_picture(choice: EnergyChoice) -> Figure:
    """Draw the efficiency over supply pressure, with each exchange."""
    lines = [energy_figures.EfficiencyLine(words, curve) for words, curve in drawn_cycle(choice).curves]
    return energy_figures.efficiency_figure(lines, title=resolved(choice).spec.title)


def cycle_report(choice: EnergyChoice) -> bytes:
    """Write the report as an HTML file, with each available exchange."""
    spec, law, muscles = resolved(choice)
    drawn = drawn_cycle(choice)
    return energy_report(spec.title, law, muscles, *drawn).html().encode("utf-8")
