"""Part III of the paper: timing of isometric tension after valve steps, and power of isotonic shortening.

Delays are those of the rising steps of the full range; every number is the mean over the recorded steps of its kind.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ..analysis.characteristics import circle_area
from ..analysis.shortening import ShorteningPower, TensionError, power_density, shortening_power, tension_error
from ..analysis.steps import IsometricTiming, isometric_timing
from ..documents import JsonValue
from ..recordings import Recording
from ..specimens import specimen
from .recorded import SPAN, TENSION, recording, reproduces, step_of
from .rows import ComputedValue, printed

ISOTHERMAL = {"rig": "paper-isothermal"}
RIGID = {"rigid": True}


def steps(stroke: str, **options: JsonValue) -> Recording:
    """Recorded isometric steps of one range, ``full`` or ``half`` of the tension."""
    return step_of(recording("isometric-step", **options), "steps", range=stroke)


@functools.cache
def timings(stroke: str, **options: JsonValue) -> tuple[IsometricTiming, ...]:
    """Timing of every step of one range, ``full`` or ``half`` of the tension."""
    return isometric_timing(steps(stroke, **options), command="valve.command", pressure="pressure", tension="tension")


def mean_of(what: str, *, stroke: str = "full", rising: bool = True) -> ComputedValue:
    """Mean of one number over the rising or the falling steps of a range [s], beside that of other assumptions."""

    def mean(**which: Any) -> float:
        return float(np.mean([getattr(t, what) for t in timings(stroke, **which) if t.rising == rising]))

    length = steps(stroke)["muscle.length"]
    return ComputedValue(
        mean(),
        f"{1e3 * mean(**RIGID):.1f} ms with rigid cord and frame: as they are inferred the braid shortens by "
        f"{1e3 * float(np.ptp(length)):.2f} mm in this isometric step; "
        f"{1e3 * mean(**ISOTHERMAL):.1f} ms with isothermal gas and the 105 l/min that it needs",
    )


reproduces("isometric.valve_delay", "s")(lambda: mean_of("valve_delay"))
reproduces("isometric.pressure_to_tension", "s")(lambda: mean_of("pressure_to_tension"))
reproduces("isometric.total_delay", "s")(lambda: mean_of("total_delay"))
# The tension's rise to 90 % and fall to 10 % of the full range, and of half of it.
rise_full = reproduces("isometric.rise_full", "s")(lambda: mean_of("transition"))
rise_half = reproduces("isometric.rise_half", "s")(lambda: mean_of("transition", stroke="half"))
fall_full = reproduces("isometric.fall_full", "s")(lambda: mean_of("transition", rising=False))
fall_half = reproduces("isometric.fall_half", "s")(lambda: mean_of("transition", stroke="half", rising=False))

LIGHT, FAST = ("10 N", "1 Hz"), ("50 N", "5 Hz")
LOADS = {LIGHT: 10.0, FAST: 50.0}  # [N]
SKIP = 1  # the first cycle comes after another history


def cycles(case: tuple[str, str]) -> Recording:
    """The recorded cycles at one load and frequency."""
    load, frequency = case
    return step_of(recording("isotonic-triangle", load=load, frequency=frequency), "cycles")


@functools.cache
def power(case: tuple[str, str]) -> ShorteningPower:
    """Work and power of the cycles at one load and frequency."""
    return shortening_power(cycles(case), length=SPAN, tension=TENSION, skip=SKIP)


@functools.cache
def error(case: tuple[str, str]) -> TensionError:
    """Error of the controlled tension at one load and frequency."""
    return tension_error(cycles(case), set_point=LOADS[case], length=SPAN, tension=TENSION, skip=SKIP)


def _work(case: tuple[str, str]) -> ComputedValue:
    p = power(case)
    return ComputedValue(
        p.work,
        f"stroke {100 * p.stroke:.1f} cm at {p.mean_tension:.1f} N in the mean, at the set-point it would be "
        f"{LOADS[case] * p.stroke:.2f} J; "
        f"{p.positive_velocity_work:.2f} J wherever the velocity is positive",
    )


def _peak(case: tuple[str, str]) -> ComputedValue:
    p = power(case)
    wide = shortening_power(cycles(case), length=SPAN, tension=TENSION, skip=SKIP, window=0.25 / p.frequency).peak_power
    return ComputedValue(
        p.peak_power,
        f"at {p.peak_velocity:.2f} m/s, velocity over {1e3 * p.window:.0f} ms; {wide:.3g} W with it over a quarter of a "
        "cycle. It is reached as the muscle leaves its stretch stop, where a rise of pressure shortens it most; neither the "
        "stop, nor where the triangles began, nor how the velocity was taken is printed",
    )


def density(watts: float) -> float:
    """Power over the muscle's volume, its shortened section times its rest length [W/m^3]."""
    spec = specimen("nylon")
    area = circle_area(spec.property_si("diameter_shortened", "m"))
    return power_density(watts, section_area=area, rest_length=spec.property_si("rest_length", "m"))


work_light = reproduces("isotonic.work_10N_1Hz", "J")(lambda: _work(LIGHT))
mean_power_light = reproduces("isotonic.mean_power_10N_1Hz", "W")(lambda: power(LIGHT).mean_power)
peak_power_light = reproduces("isotonic.peak_power_10N_1Hz", "W")(lambda: _peak(LIGHT))
reproduces("isotonic.work_50N_5Hz", "J")(lambda: _work(FAST))
reproduces("isotonic.mean_power_50N_5Hz", "W")(lambda: power(FAST).mean_power)
reproduces("isotonic.peak_power_50N_5Hz", "W")(lambda: _peak(FAST))
reproduces("isotonic.mean_power_density", "W/m^3")(lambda: density(power(FAST).mean_power))
reproduces("isotonic.peak_power_density", "W/m^3", "goes with the peak power, whose note says why it differs")(
    lambda: density(power(FAST).peak_power)
)
# Cycles per second that the printed work and mean power leave: a shortening takes half a cycle.
reproduces("isotonic.frequency_50N", "1/s")(
    lambda: printed("isotonic.mean_power_50N_5Hz") / (2.0 * printed("isotonic.work_50N_5Hz"))
)
reproduces("isotonic.printed_peak_power_density", "W/m^3")(lambda: density(printed("isotonic.peak_power_50N_5Hz")))


@reproduces("isotonic.tension_error", "1")
def relative_tension_error() -> ComputedValue:
    """Rms error of the tension at 50 N, 5 Hz, over its set-point."""
    e, light = error(FAST), error(LIGHT)
    return ComputedValue(
        e.relative_rms,
        f"from {e.lowest:.0f} to {e.highest:.0f} N, {e.relative_rms_shortening:.2f} while shortening; "
        f"{light.relative_rms:.2f} at 10 N, 1 Hz",
    )
