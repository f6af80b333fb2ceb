"""Part IV of the paper: input, output and efficiency of the nylon muscle's cycles, computed from the muscle only.

As the paper does it: the line of eq. 13, the volume of eq. 38b, surroundings of 1.0336 bar, friction off the output only.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

from mckibben.analysis import energy
from mckibben.components import Environment
from mckibben.quantities import from_si, parse
from mckibben.specimens import specimen

from . import computed, rows
from .rows import ComputedValue, reproduces

MUSCLE = "nylon"
PRESSURE = 5e5  # [Pa]
PRESSURES = np.linspace(1e5, 10e5, 91)  # of Fig. 12c, where the largest Wa/W12 is sought [Pa]


def muscle(volume: str = "paper") -> energy.CycleMuscle:
    """Muscle of Part IV: eq. 13 as printed, with a volume of `VOLUMES`."""
    return energy.cycle_muscle(computed.line(computed.KG, computed.PA, computed.LMIN, computed.FA), volume)


def stretched_length() -> float:
    """Length L2 at the start of the cycles [m]."""
    return specimen(MUSCLE).property_si("stretched_length", "m")


def conditions(*, accumulator: bool = False, friction: bool = True, reading: str = "printed") -> energy.Conditions:
    """Conditions of the cycles of Part IV, at 5 bar; the accumulator is at the threshold."""
    return energy.Conditions(
        pressure=PRESSURE,
        stretched_length=stretched_length(),
        ambient=Environment.of_the_papers(),
        exchange_pressure=float(muscle().threshold()) if accumulator else 0.0,
        friction=specimen(MUSCLE).property_si("coulomb_friction", "N") if friction else 0.0,
        reading=reading,
    )


@functools.cache
def cycle(
    name: str, *, accumulator: bool = False, friction: bool = True, reading: str = "printed", volume: str = "paper"
) -> energy.EnergyCycle:
    """A cycle at 5 bar."""
    between = conditions(accumulator=accumulator, friction=friction, reading=reading)
    return energy.energy_cycle(muscle(volume), name, between)


def printed(identifier: str) -> float:
    """Value that the paper prints for a row of Part IV, in the row's unit; the figures draw it."""
    return rows.printed(f"energy.{identifier}")


def printed_cycle(of: str, name: str, between: energy.Conditions) -> dict[tuple[str, bool], Any]:
    """Values that the paper prints for a cycle, by name and whether there is an accumulator; empty for another cycle.

    Args:
        of: id of the muscle.
        name: of the cycle.
        between: its conditions; exchange and reading are free, for both are printed.
    """
    ours = conditions()._replace(exchange_pressure=between.exchange_pressure, reading=between.reading)
    if of != MUSCLE or between != ours:
        return {}
    output = "maximal" if name == "maximal" else "isotonic"
    values: dict[tuple[str, bool], Any] = {("output", False): printed(f"{output}.output")}
    for quantity in ("input", "efficiency"):
        for accumulated in (False, True):
            values[quantity, accumulated] = printed(f"{name}.{quantity}" + "_accumulator" * accumulated)
    if name == "maximal":  # a misprint: the efficiency does not follow from the joules beside it
        joules = printed("maximal.output") / printed("maximal.input_accumulator")
        values["efficiency", True] = {"struck": values["efficiency", True], "instead": joules}
    return values


def _beside(name: str, what: str, unit: str = "", *, accumulator: bool = False) -> str:
    """Values from the consistent potential and, for the isotonic cycles, with friction throughout."""
    digits = ".3f" if what == "efficiency" else ".2f"

    def ours(**options: str) -> str:
        return f"{getattr(cycle(name, accumulator=accumulator, **options), what):{digits}}{unit}"

    words = f"{ours(volume='potential')} with the volume of the potential"
    return words if name == "maximal" else f"{words}, {ours(reading='throughout')} with friction throughout"


def _number(name: str, what: str, *, accumulator: bool = False) -> ComputedValue:
    """A number of a cycle, beside what other readings give."""
    value: float = getattr(cycle(name, accumulator=accumulator), what)
    return ComputedValue(value, _beside(name, what, "" if what == "efficiency" else " J", accumulator=accumulator))


for _name in ("maximal", "isotonic", "valve"):
    for _row, _what, _accumulator in (
        ("input", "input", False),
        ("input_accumulator", "input", True),
        ("efficiency", "efficiency", False),
        ("efficiency_accumulator", "efficiency", True),
    ):
        # what more is to be said of these is said below
        if (_name, _row) not in (("maximal", "efficiency"), ("maximal", "efficiency_accumulator"), ("valve", "input")):
            _unit = "1" if _what == "efficiency" else "J"
            reproduces(f"energy.{_name}.{_row}", _unit)(
                functools.partial(_number, _name, _what, accumulator=_accumulator)
            )
reproduces("energy.maximal.output", "J")(lambda: _number("maximal", "output"))
reproduces("energy.atmosphere", "Pa")(lambda: parse("1 atm", "Pa", field="atmosphere"))  # by its definition


@reproduces("energy.maximal.compression", "J")
def compression() -> ComputedValue:
    """W01 from the total initial volume, and what the integral from the muscle's own initial volume gives."""
    one, ambient = cycle("maximal"), conditions().ambient.pressure_abs
    high, final = one.start_pressure + ambient, one.shortened_volume
    wrong = -high * final * math.log(final / one.stretched_volume) - high * final * (1.0 - ambient / high)
    return ComputedValue(
        one.compression, f"{wrong:.1f} J from V2 = {from_si(one.stretched_volume, 'm^3', 'cm^3'):.2f} cm3"
    )


@reproduces("energy.maximal.efficiency", "1")
def maximal_efficiency() -> ComputedValue:
    """Efficiency Ea of maximal shortening."""
    value, words = _number("maximal", "efficiency")
    return ComputedValue(value, f"{value:.4f} unrounded; {words}")


@reproduces("energy.maximal.efficiency_accumulator", "1")
def maximal_efficiency_accumulator() -> ComputedValue:
    """Efficiency Ea of maximal shortening with the accumulator."""
    smooth = cycle("maximal", accumulator=True, friction=False).efficiency
    value, words = _number("maximal", "efficiency", accumulator=True)
    return ComputedValue(value, f"{smooth:.3f} without friction, which is what is printed; {words}")


@reproduces("energy.maximal.best_pressure", "Pa")
def maximal_best_pressure() -> ComputedValue:
    """Pressure of the largest efficiency Ea of maximal shortening."""
    at, share = energy.best_pressure(muscle(), "maximal", conditions())
    high = energy.energy_curve(muscle(), "maximal", [10e5], conditions()).cycles.efficiency[0]
    return ComputedValue(at, f"Ea is {share:.4f} there and still {high:.3f} at 10 bar")


def largest_share(of: energy.CycleMuscle, between: energy.Conditions) -> tuple[float, float]:
    """Largest ratio Wa/W12 of maximal shortening, and its pressure [Pa]."""
    cycles = energy.energy_curve(of, "maximal", PRESSURES, between).cycles
    share = cycles.output / cycles.delivery
    return float(np.nanmax(share)), float(PRESSURES[int(np.nanargmax(share))])


@reproduces("energy.maximal.output_below_W12", "1")
def maximal_output_below_delivery() -> ComputedValue:
    """Largest ratio Wa/W12 of maximal shortening."""
    share, at = largest_share(muscle(), conditions())
    return ComputedValue(share, f"at {from_si(at, 'Pa', 'bar'):.1f} bar")


@reproduces("energy.isotonic.output", "J")
def isotonic_output() -> ComputedValue:
    """Output of both isotonic cycles."""
    one, (value, words) = cycle("isotonic"), _number("isotonic", "output")
    return ComputedValue(value, f"tendon at {one.load:.1f} N down to {100 * one.shortened_length:.3f} cm; {words}")


@reproduces("energy.valve.input", "J")
def valve_input() -> ComputedValue:
    """Input of the valve-controlled isotonic cycle, area EF'GH."""
    value, words = _number("valve", "input")
    return ComputedValue(value, f"{cycle('valve').throttling:.2f} J of it, area FF'G, throttled; {words}")
