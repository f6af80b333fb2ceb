"""Charts and facts of a sizing for the page."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....quantities import with_unit
from ....studies.sizing import Judged, Sizing
from ....studies.sizing.candidate import LawAtPressure
from ....studies.sizing.tables import ms, ranged
from ...charts import Axis, Chart, ChartLine

POINTS = 97
MOST = 4  # muscles drawn
SLOWEST = 3.0  # times the best line's time, up to which lines are drawn
DASHES = ("A", "B", "C", "D")


class SizingCharts(NamedTuple):
    """Charts of a sizing: force over stroke; time over mass of valves with tubes, None where none was looked for."""

    force: Chart
    lines: Chart | None


class SizingFact(NamedTuple):
    """A line of the chosen combination: label, class of its quantity, value, and the range in brackets."""

    label: str
    quantity: str
    value: str
    range: str = ""


def charts_of(sizing: Sizing) -> SizingCharts:
    """Evaluate the charts of a sizing."""
    return SizingCharts(_force_chart(sizing), _lines_chart(sizing) if sizing.lines else None)


def _shown(sizing: Sizing) -> list[Judged]:
    """The chosen muscle, then the best of each kind."""
    kinds = ("braid", "specimen", "size")
    first = [next((m for m in sizing.muscles if m.muscle.kind == kind), None) for kind in kinds]
    some = [sizing.chosen, *(m for m in first if m is not None and m.muscle.id != sizing.chosen.muscle.id)]
    return some[:MOST]


def _force_chart(sizing: Sizing) -> Chart:
    wish = sizing.wish
    strokes = np.linspace(0.0, 2.0 * wish.stroke, POINTS)
    top = 1.15 * max(2.6 * wish.force, 1.2 * sizing.chosen.end_force)
    lines = []
    for one, dash in zip(_shown(sizing), DASHES, strict=False):
        m = one.muscle
        pull = LawAtPressure(m.law, wish.pressure).tension(m.longest - strokes) - m.friction - one.error_force
        kept = (pull > 0.0) & (pull < 1.5 * top)
        chosen = one is sizing.chosen
        lines.append(
            ChartLine(
                100.0 * strokes[kept], pull[kept], m.id, quantity="tension", dash=dash, width=2.5 if chosen else 1.5,
                opacity=1.0 if chosen else 0.75,
            )
        )  # fmt: skip
    lines.append(ChartLine([100.0 * wish.stroke], [wish.force], "required", points=True, line=False))
    said = (
        f"{sizing.chosen.muscle.id} promises {sizing.chosen.promised_force:.1f} N at a stroke of "
        f"{100.0 * wish.stroke:.3g} cm, where {wish.force:.4g} N are required."
    )
    return Chart(
        f"At {wish.pressure / 1e5:g} bar", said, Axis("Stroke", "cm", "length", low=0.0),
        Axis("Promised force", "N", "tension", low=0.0, high=top), lines,
    )  # fmt: skip


def _lines_chart(sizing: Sizing) -> Chart | None:
    every = [one for one in sizing.lines if one.to_force is not None]
    if not every:
        return None
    able = [one for one in every if (one.to_force or 0.0) <= SLOWEST * (every[0].to_force or 0.0)]
    best, pareto = able[0], [one for one in able[1:] if one.pareto]
    rest = [one for one in able[1:] if not one.pareto]
    lines = [
        ChartLine(
            [1e3 * one.mass for one in some], [1e3 * (one.to_force or 0.0) for one in some], quantity="valve", points=True,
            line=False, opacity=opacity,
        )
        for some, opacity in ((rest, 0.35), (pareto, 1.0))
        if some
    ]  # fmt: skip
    label = f"{best.valve}, {best.tube}"
    lines.append(
        ChartLine([1e3 * best.mass], [1e3 * (best.to_force or 0.0)], label, quantity="tension", points=True, line=False)
    )
    said = (
        f"{label} reaches the force after {ms(best.to_force)} ms and weighs {1e3 * best.mass:.0f} g; {len(able)} of "
        f"{len(every)} lines are drawn, slower ones stand in the table."
    )
    heaviest, slowest = 1e3 * max(one.mass for one in able), 1e3 * max(one.to_force or 0.0 for one in able)
    mass = Axis("Mass of valve and tube", "g", low=0.0, high=1.2 * heaviest)
    time = Axis("Time to the force", "ms", low=0.0, high=1.1 * slowest)
    return Chart(f"For {sizing.chosen.muscle.id}", said, mass, time, lines)


def facts_of(sizing: Sizing) -> list[SizingFact]:
    """The chosen combination, with the ranges that inferred numbers leave."""
    one, line, spread = sizing.chosen, sizing.line, sizing.spread
    facts = [SizingFact("Muscle", "", one.muscle.id, one.verdict)]
    force = "" if spread is None else _brackets(*spread.force, 1.0)
    facts.append(SizingFact("Force at the end", "F", f"{one.promised_force:.1f} N", f"law {one.end_force:.1f} {force}"))
    facts.append(
        SizingFact(
            "Length, width", "L", f"{100 * one.muscle.overall_length:.1f} cm, {1e3 * one.muscle.diameter:.1f} mm"
        )
    )
    if line is not None:
        facts.append(SizingFact("Valve", "v", line.valve, f"{line.power_shown} W, {line.valve_mass_shown} g"))
        facts.append(SizingFact("Tube", "L", line.tube, with_unit(line.tube_length, "m")))
        times = "" if sizing.time_range is None else _brackets(*sizing.time_range, 1e3)
        facts.append(SizingFact("Time to the force", "", f"{ms(line.to_force)} ms", times))
        if line.speed is not None:
            facts.append(SizingFact("Speed", "L", f"{100 * line.speed:.0f} cm/s"))
    air = one.air if line is None else line.air
    facts.append(
        SizingFact("Air of a cycle", "q", f"{1e6 * air:.0f} mg", "" if spread is None else _brackets(*spread.air, 1e6))
    )
    source = next((s for s in sizing.gas_sources if s.able), None)
    if source is not None:
        facts.append(SizingFact("Gas source", "", source.title))
        facts.append(SizingFact("Energy of a cycle", "", f"{ranged(source.energy, source.energy_range, 'J')} J"))
        if source.run_time is not None:
            facts.append(SizingFact("Lasts", "", f"{ranged(source.run_time, source.run_time_range, 's', 'min')} min"))
        if source.daily is not None:
            facts.append(
                SizingFact("Energy of a day", "", f"{ranged(source.daily, source.daily_range, 'J', 'W h')} W h")
            )
    if sizing.daily is not None:
        low, high = sizing.daily.air_range
        facts.append(SizingFact("Air of a day", "q", f"{sizing.daily.air:.3g} kg", f"({low:.3g} to {high:.3g})"))
    return facts


def _brackets(low: float, high: float, scale: float) -> str:
    ends = [f"{scale * end:.3g}" for end in (low, high)]
    return "" if ends[0] == ends[1] else f"({ends[0]} to {ends[1]})"
