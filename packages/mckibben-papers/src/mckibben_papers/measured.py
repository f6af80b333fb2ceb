"""The rows of recordings: loops, sines, the fit to ten points and lubricants, Figs. 3, 4 and 6b; Part III, timing and power.

Triangles at 5 bar where a row does not say otherwise; a loop is the mean of the recorded cycles, of the measured tension
over the measured span. Rows are raw as the paper's are; where the lag of the cell's filter matters, the note gives the
corrected number beside it. Part III is the timing of isometric tension after valve steps, and the power of isotonic
shortening: delays are those of the rising steps of the full range; every number is the mean over the recorded steps of its
kind.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from mckibben.analysis.characteristics import circle_area
from mckibben.analysis.frequency import CorrectedLoop, corrected_loop
from mckibben.analysis.loops import (
    LinearTensionFit,
    StaticPoint,
    TensionLoop,
    TensionPath,
    Variation,
    fit_linear_tension,
    loop,
    loop_ratio,
    path_distance,
    paths,
    peak_velocity,
    static_points,
    variation,
)
from mckibben.analysis.shortening import ShorteningPower, TensionError, power_density, shortening_power, tension_error
from mckibben.analysis.steps import IsometricTiming, isometric_timing
from mckibben.assembly.build import INFERRED
from mckibben.bench.rig_file import rig
from mckibben.documents import JsonValue
from mckibben.errors import ConvergenceError
from mckibben.quantities import from_si
from mckibben.recordings import Recording
from mckibben.specimens import specimen

from .reproduction import FIVE_BAR, SPAN, TENSION, recording, reproduces, saturation_words, step_of
from .rows import ComputedValue, printed

CM, MS, BAR = from_si(1.0, "m", "cm"), from_si(1.0, "s", "ms"), from_si(1.0, "Pa", "bar")
PRESSURES = ("0 bar", "1 bar", "2 bar", "3 bar", "4 bar", FIVE_BAR)


def triangle(
    muscle: str = "nylon",
    *,
    stroke: str = "large",
    frequency: str = "1 Hz",
    pressure: str = FIVE_BAR,
    rig: str = "paper",
    accept_saturation: bool = False,
    cycles: int | None = None,
    **machine: Any,
) -> Recording:
    """Recorded cycles of one triangle; as many as the protocol has by default, on a machine that `recording` may change."""
    more = machine | ({} if cycles is None else {"cycles": cycles})
    whole = recording(
        "quasi-static",
        muscle,
        rig=rig,
        accept_saturation=accept_saturation,
        range=stroke,
        frequency=frequency,
        pressure=pressure,
        **more,
    )
    return step_of(whole, "loops")


@functools.cache
def measured_loop(muscle: str = "nylon", *, stroke: str = "large") -> TensionLoop:
    """Measured loop at 5 bar."""
    return loop(triangle(muscle, stroke=stroke), length=SPAN, tension=TENSION)


MODERN = "modern"  # the rig whose cell reaches as far as the Bridgestone muscle pulls
TRIANGLES: dict[str, dict[str, Any]] = {  # of the muscles
    "nylon": {},
    "fiberglass": {"stroke": "fiberglass"},  # 0.85 to 1.1 L0
    "bridgestone": {"stroke": "bridgestone", "rig": MODERN},  # 0.78 to 1.02 L0
}


def rubbed_loop(muscle: str, friction: float) -> TensionLoop:
    """Loop at 5 bar as the cell reads it where the muscle's friction is another one [N]."""
    share = friction / specimen(muscle).property_si("coulomb_friction", "N")
    return loop(triangle(muscle, friction=round(share, 6), **TRIANGLES[muscle]), length=SPAN, tension=TENSION)


def without_lag(record: Recording, on: str = "paper") -> CorrectedLoop:
    """Loop as measured, and without the lag of the cell: its filter, and its delay within the sample."""
    cell = rig(on).sensors["tension"]
    return corrected_loop(
        record, cutoff=float(cell.cutoff), lag=-float(cell.converter.skew), length=SPAN, tension=TENSION
    )


@reproduces("loop.width", "m")
def width() -> ComputedValue:
    """Width of the nylon muscle's loop."""
    lagless = without_lag(triangle()).corrected
    return ComputedValue(
        measured_loop().width, f"raw; {lagless.width * CM:.3f} cm without the lag of the cell's filter"
    )


@reproduces("loop.height", "N")
def height() -> ComputedValue:
    """Height of the nylon muscle's loop."""
    lagless = without_lag(triangle()).corrected
    return ComputedValue(measured_loop().height, f"raw; {lagless.height:.2f} N without the lag of the cell's filter")


def _friction(record: Recording, on: str = "paper") -> ComputedValue:
    both = without_lag(record, on)
    return ComputedValue(
        both.raw.friction, f"raw; {both.corrected.friction:.2f} N without the lag of the cell's filter"
    )


reproduces("friction.nylon", "N")(lambda: _friction(triangle()))
reproduces("friction.fiberglass", "N")(lambda: _friction(triangle("fiberglass", **TRIANGLES["fiberglass"])))
reproduces("loop.width_fiberglass", "m")(lambda: measured_loop("fiberglass", stroke="fiberglass").width)


def bridgestone() -> Recording:
    """Recorded cycles of the Bridgestone muscle."""
    return triangle("bridgestone", **TRIANGLES["bridgestone"])


def _bridgestone_note() -> str:
    paper = triangle("bridgestone", stroke="bridgestone", accept_saturation=True)
    return (
        f"on the rig with a cell of 1 kN, up to {bridgestone()[TENSION].max():.0f} N, for at mid-range "
        f"the paper's cell of 100 N is {saturation_words(paper)}"
    )


@reproduces("loop.width_bridgestone", "m")
def width_bridgestone() -> ComputedValue:
    """Width of the Bridgestone muscle's loop."""
    return ComputedValue(loop(bridgestone(), length=SPAN, tension=TENSION).width, _bridgestone_note())


@reproduces("friction.bridgestone", "N")
def friction_bridgestone() -> ComputedValue:
    """Friction of the Bridgestone muscle: half the loop's height."""
    friction = _friction(bridgestone(), MODERN)
    return friction._replace(note=f"{friction.note}; {_bridgestone_note()}")


def pressure_variation(record: Recording) -> Variation:
    """Variation of the measured pressure over the cycles."""
    return variation(record, channel="pressure", drive="span")


def worst_pressure_variation(changes: tuple[tuple[str, str], ...] = ()) -> tuple[float, float]:
    """Largest variation of the pressure within a cycle of all pressures, as measured and the true one there [Pa].

    With a changed rig, that at the pressure that was worst.
    """
    worst = max(PRESSURES, key=lambda p: pressure_variation(triangle(pressure=p)).largest)
    record = triangle(pressure=worst, changes=changes)
    true = variation(record, channel="muscle.pressure", drive="span").largest
    return pressure_variation(record).largest, true


@reproduces("loop.pressure_variation", "Pa")
def largest_pressure_variation() -> ComputedValue:
    """Largest variation of the pressure within a cycle, the worst of the six pressures."""
    worst, _ = worst_pressure_variation()
    counts = worst / float(rig("paper").sensors["pressure"].resolution)
    bare = recording("preconditioning", plumbing="direct", pressure=FIVE_BAR, frequency="1 Hz", cycles=4)
    without = pressure_variation(step_of(bare, "cycles"))
    return ComputedValue(
        worst,
        f"{counts:.0f} counts of the converter, noise included; without accumulators {without.largest * BAR:.2f} bar",
    )


@reproduces("loop.rate_ratio", "1")
def rate_ratio() -> ComputedValue:
    """Ratio of the loop's areas at 0.25 Hz and at 1 Hz."""
    slow, fast = triangle(frequency="0.25 Hz"), triangle()
    ratio = loop_ratio(loop(slow, length=SPAN, tension=TENSION), loop(fast, length=SPAN, tension=TENSION))
    lagless = loop_ratio(without_lag(slow).corrected, without_lag(fast).corrected)
    return ComputedValue(ratio.area, f"raw; {lagless.area:.3f} without the lag of the cell's filter")


@reproduces("loop.small_range_ratio", "1")
def small_range_ratio() -> ComputedValue:
    """Ratio of the loop's widths at half and at the full range."""
    ratio = loop_ratio(measured_loop(stroke="small"), measured_loop())
    return ComputedValue(ratio.width, f"at {ratio.range:.2f} of the range; heights {ratio.height:.2f}")


def rising_and_falling(stroke: str) -> tuple[TensionPath, TensionPath]:
    """Both paths of the nylon muscle over a range."""
    return paths(triangle(stroke=stroke), length=SPAN, tension=TENSION)


@reproduces("loop.rising_path_distance", "N")
def rising_path_distance() -> ComputedValue:
    """Largest distance of the rising paths over the two ranges."""
    (up, down), (small_up, small_down) = rising_and_falling("large"), rising_and_falling("small")
    falling = path_distance(down, small_down)
    return ComputedValue(
        path_distance(up, small_up).largest, f"the falling paths lie up to {falling.largest:.1f} N apart"
    )


FIGURE = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)  # of the twelve only the ends are printed [Hz]
FASTEST = 40.0  # [Hz]; the text's 8 L0/s at the amplitude of the figure
AMPLITUDE = 0.0318  # 0.2 L0/s at 1 Hz [L0]
SINE_CYCLES, SINE_TIME = 8, 4.0  # recorded of a sine: so many cycles and so long [s], for at 10 Hz samples are few
OFF, TRIES = 0.025, 6  # error of the amplitude from which a sine is repeated [1], and how often at most


class SineLoop(NamedTuple):
    """The loop at one frequency.

    Attributes:
        loop: loop of the tension.
        velocity: peak that was reached [L0/s].
        pressure_gap: pressure on the rising path less that on the falling one, at mid-range [Pa].
    """

    loop: CorrectedLoop
    velocity: float
    pressure_gap: float


def recorded_sines(frequency: float) -> Recording:
    """Recording of the sine of a frequency [Hz] with about the amplitude of the figure, on which the width depends.

    Raises:
        ConvergenceError: no amplitude that was requested gave it.
    """
    words, asked = f"{frequency:g} Hz", AMPLITUDE
    for _ in range(TRIES):
        whole = recording(
            "sinusoids",
            frequency=words,
            amplitude=f"{asked:.5f} L0",
            cycles=max(SINE_CYCLES, math.ceil(SINE_TIME * frequency)),
            precondition=max(2, math.ceil(frequency)),
        )
        record = step_of(whole, "sines")
        raw = without_lag(record).raw
        share = (raw.length_high - raw.length_low) / (2.0 * AMPLITUDE * _rest_length())
        if abs(share - 1.0) <= OFF:
            return record
        asked /= share
    raise ConvergenceError(f"no sine of {words} had an amplitude of {AMPLITUDE:g} L0 within {OFF:g} of it")


def _rest_length() -> float:
    return specimen("nylon").property_si("rest_length", "m")


@functools.cache
def sine(frequency: float) -> SineLoop:
    """Loop at a frequency [Hz]."""
    record = recorded_sines(frequency)
    gas = loop(record, length=SPAN, tension="pressure")
    return SineLoop(without_lag(record), peak_velocity(record, length=SPAN) / _rest_length(), gas.height)


def spread(values: list[float]) -> float:
    """Largest minus smallest over the mean [1]."""
    return (max(values) - min(values)) * len(values) / sum(values)


DAMPED = f"internal damping of {INFERRED['viscosity'].value:g} N s/m"


@reproduces("loop.sine_width_spread", "1", DAMPED)
def sine_width_spread() -> ComputedValue:
    """Spread of the widths of the twelve sines."""
    sines = [sine(f) for f in FIGURE]
    raw, fixed = [s.loop.raw.width for s in sines], [s.loop.corrected.width for s in sines]
    first, last = sines[0].velocity, sines[-1].velocity
    gaps = [s.pressure_gap * BAR for s in sines]
    return ComputedValue(
        spread(fixed),
        f"{fixed[0] * CM:.3f} cm at {first:.2f} L0/s, {fixed[-1] * CM:.3f} cm at {last:.2f} L0/s; "
        f"raw {raw[0] * CM:.3f} and {raw[-1] * CM:.3f} cm, spread {spread(raw):.2f}. What widens the loops is gas: while "
        f"the muscle lengthens its pressure is {gaps[0]:.3f} bar higher at 1 Hz and up to {max(gaps):.3f} bar at the others",
    )


def widening(frequency: float) -> float:
    """Width due to the additional height of the raw loop at a frequency [Hz] above that of the slowest sine [m].

    Taken at the stiffness of the slowest sine: the inertia of the fittings turns a fast loop flatter, and so makes it wider
    across without any loss.
    """
    slow = sine(FIGURE[0]).loop.raw
    return (sine(frequency).loop.raw.height - slow.height) / slow.stiffness


def measurable() -> float:
    """Width equivalent to one count of the cell, at the stiffness of the slowest sine [m]."""
    return float(rig("paper").sensors["tension"].resolution) / sine(FIGURE[0]).loop.raw.stiffness


@reproduces("loop.max_velocity", "1/s", DAMPED)
def max_velocity() -> ComputedValue:
    """Largest peak velocity of the sines whose raw loop is not measurably wider than the slowest."""
    narrow = [f for f in (*FIGURE, FASTEST) if widening(f) < measurable()]
    fast, slow = sine(FASTEST).loop, sine(FIGURE[0]).loop
    return ComputedValue(
        max(sine(f).velocity for f in narrow),
        f"raw height {slow.raw.height:.2f} N at 1 Hz, {fast.raw.height:.2f} N at 40 Hz; without the lag of the cell's "
        f"filter {slow.corrected.height:.2f} and {fast.corrected.height:.2f} N: what gas and damping add, it hides. "
        f"The raw loop is {fast.raw.width * CM:.3f} cm wide at 40 Hz, {slow.raw.width * CM:.3f} cm at 1 Hz, for the "
        "inertia of the fittings turns it",
    )


@reproduces("loop.peak_velocity", "1/s")
def peak_velocity_of_figure() -> float:
    """Largest velocity of a sine of the largest frequency of Fig. 4, at its amplitude [L0/s]."""
    return 2.0 * np.pi * FIGURE[-1] * AMPLITUDE


THIRDS = (1.0 / 3.0, 2.0 / 3.0)
SHARES = {
    "2 bar": THIRDS,
    "3 bar": THIRDS,
    "4 bar": (THIRDS[0], 0.5, THIRDS[1]),
    "5 bar": (THIRDS[0], 0.5, THIRDS[1]),
}
FIT_CYCLES = 12  # that are averaged
TAUT = 0.8  # tension from which the muscle counts as taut, two counts of the cell [N]
LENGTH = "length"  # channel of the span without the stretch of the machine


class Fits(NamedTuple):
    """Eq. 13 through ten points, with the stretch of the machine taken off and as measured."""

    corrected: LinearTensionFit
    raw: LinearTensionFit


def stiff(record: Recording) -> Recording:
    """Recording with a channel ``length``: the measured span minus the stretch of cord and frame [m]."""
    known = record.meta["parameters"]
    cord, toe, frame = (
        known[name]["value"]
        for name in ("units.muscle.tendon.stiffness", "units.muscle.tendon.toe_length", "load.frame.stiffness")
    )
    tension = np.maximum(record[TENSION], 0.0)
    in_toe = tension < 0.5 * cord * toe
    stretch = np.where(in_toe, np.sqrt(2.0 * toe * tension / cord), tension / cord + 0.5 * toe) + tension / frame
    return record.with_channels({LENGTH: record.channels[SPAN].with_values(record[SPAN] - stretch)})


def ten_points(length: str) -> list[StaticPoint]:
    """Means of the rising and the falling path at the lengths of a channel."""
    points: list[StaticPoint] = []
    for pressure, shares in SHARES.items():
        record = stiff(triangle(pressure=pressure, cycles=FIT_CYCLES))
        rising, falling = paths(record, length=length, tension=TENSION)
        low, high = falling.length_at(TAUT), min(rising.length[-1], falling.length[-1])
        at = [low + share * (high - low) for share in shares]
        points += static_points(record, at, length=length, tension=TENSION, pressure="pressure")
    return points


@functools.cache
def fits() -> Fits:
    """Fit the tension at the ten points, with the braid's length and with the span."""
    return Fits(*(fit_linear_tension(ten_points(length)) for length in (LENGTH, SPAN)))


def _found(which: str, unit: str, scale: float, digits: int) -> ComputedValue:
    one, raw = (getattr(fit, which) for fit in fits())
    half = 0.5 * (one.high - one.low)
    return ComputedValue(
        one.value,
        f"95 % +-{half / scale:.{digits}f} {unit}; {raw.value / scale:.{digits}f} {unit} "
        "with the stretch of cord and frame left in the length",
    )


reproduces("static.fit_Kg", "m")(lambda: _found("stiffness_per_pressure", "cm", 1e-2, 3))
reproduces("static.fit_Pa", "Pa")(lambda: _found("offset_pressure", "bar", 1e5, 3))
reproduces("static.fit_Lmin", "m")(lambda: _found("shortest_length", "cm", 1e-2, 2))
reproduces("static.fit_Fa", "N")(lambda: _found("offset_tension", "N", 1.0, 1))

DRY, OILED, OF_OILS = "no lubricant", "WD-40", 0.9  # what the paper's rig leaves of the friction
LUBRICANT_CYCLES = {"precondition": 4, "cycles": 12}  # of three cycles a tenth of the height is told to 3 % only


def treated(lubricant: str, *, friction: float = 1.0) -> TensionLoop:
    """Loop with a lubricant on the muscle, whose friction is a share of its specimen's."""
    whole = recording("lubricant-test", lubricant=lubricant, friction=friction, **LUBRICANT_CYCLES)
    return loop(step_of(whole, "loops"), length=SPAN, tension=TENSION)


def lubricated_share(left: float) -> float:
    """Ratio of the loop's height where a share of the friction is left to that without a lubricant."""
    oiled = treated(OILED) if left == OF_OILS else treated(DRY, friction=left)
    return loop_ratio(oiled, treated(DRY)).height


@reproduces("friction.lubricated", "1", "with WD-40; it tests the measurement, not the lubricant")
def lubricated() -> float:
    """Ratio of the loop's height with WD-40 to that without."""
    return loop_ratio(treated(OILED), treated(DRY)).height


ISOTHERMAL = {"rig": "paper-isothermal"}
RIGID = {"rigid": True}


def steps(stroke: str, **options: JsonValue) -> Recording:
    """Recorded isometric steps of one range, ``full`` or ``half`` of the tension."""
    return step_of(recording("isometric-step", **options), "steps", range=stroke)


@functools.cache
def timings(stroke: str, **options: JsonValue) -> tuple[IsometricTiming, ...]:
    """Timing of every step of one range, ``full`` or ``half`` of the tension."""
    return isometric_timing(steps(stroke, **options), command="valve.command", pressure="pressure", tension="tension")


def mean_time(what: str, *, stroke: str, rising: bool, **options: Any) -> float:
    """Mean of one number over the rising or the falling steps of a range [s]."""
    return float(np.mean([getattr(t, what) for t in timings(stroke, **options) if t.rising == rising]))


def mean_of(what: str, *, stroke: str = "full", rising: bool = True) -> ComputedValue:
    """Mean of one number over the rising or the falling steps of a range [s], beside that of other assumptions."""

    def mean(**which: Any) -> float:
        return mean_time(what, stroke=stroke, rising=rising, **which)

    length = steps(stroke)["muscle.length"]
    return ComputedValue(
        mean(),
        f"{mean(**RIGID) * MS:.1f} ms with rigid cord and frame: as they are inferred the braid shortens by "
        f"{from_si(float(np.ptp(length)), 'm', 'mm'):.2f} mm in this isometric step; "
        f"{mean(**ISOTHERMAL) * MS:.1f} ms with isothermal gas and the 105 l/min that it needs",
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


def cycles(case: tuple[str, str], changes: tuple[tuple[str, str], ...] = ()) -> Recording:
    """The recorded cycles at one load and frequency, on a rig that may be changed."""
    load, frequency = case
    return step_of(recording("isotonic-triangle", load=load, frequency=frequency, changes=changes), "cycles")


@functools.cache
def power(
    case: tuple[str, str], *, changes: tuple[tuple[str, str], ...] = (), window: float | None = None
) -> ShorteningPower:
    """Work and power of the cycles at one load and frequency; the velocity over a window [s], else a fiftieth of a cycle."""
    return shortening_power(cycles(case, changes), length=SPAN, tension=TENSION, skip=SKIP, window=window)


@functools.cache
def error(case: tuple[str, str]) -> TensionError:
    """Error of the controlled tension at one load and frequency."""
    return tension_error(cycles(case), set_point=LOADS[case], length=SPAN, tension=TENSION, skip=SKIP)


def _work(case: tuple[str, str]) -> ComputedValue:
    p = power(case)
    return ComputedValue(
        p.work,
        f"stroke {p.stroke * CM:.1f} cm at {p.mean_tension:.1f} N in the mean, at the set-point it would be "
        f"{LOADS[case] * p.stroke:.2f} J; "
        f"{p.positive_velocity_work:.2f} J wherever the velocity is positive",
    )


def _peak(case: tuple[str, str]) -> ComputedValue:
    p = power(case)
    wide = power(case, window=0.25 / p.frequency).peak_power
    return ComputedValue(
        p.peak_power,
        f"at {p.peak_velocity:.2f} m/s, velocity over {p.window * MS:.0f} ms; {wide:.3g} W with it over a quarter of a "
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
