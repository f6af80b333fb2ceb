"""The report of the cycle that a visitor looks at."""

from __future__ import annotations

from dataclasses import replace

from ....analysis.energy import cycle_loops, energy_curve, energy_cycle
from ....analysis.energy.cycles import pressures
from ....errors import InputError
from ....report.energy_report import energy_report
from .choice import Choice, conditions, resolved
from .cycles import CURVE_POINTS, CURVE_TOP


def cycle_report(choice: Choice) -> bytes:
    """As an HTML file, with each exchange that there is."""
    spec, law, muscles = resolved(choice)
    muscle = next(iter(muscles.values()))
    other = "atmosphere" if choice.exchange == "accumulator" else "accumulator"
    loops, curves, numbers = [], [], {}
    for exchange in (choice.exchange, other):
        try:
            between = conditions(choice, exchange)
            highest = max(CURVE_TOP, choice.pressure)
            wide = conditions(replace(choice, pressure=highest), exchange)
        except InputError:
            continue
        loops.append(cycle_loops(muscle, choice.cycle, between))
        at = pressures(muscle, wide, highest, CURVE_POINTS)
        curves.append((exchange, energy_curve(muscle, choice.cycle, at, wide)))
        for volume, one in muscles.items():
            numbers[exchange, volume] = energy_cycle(one, choice.cycle, between)
    return energy_report(spec.title, law, muscles, loops, curves, numbers).html().encode("utf-8")
