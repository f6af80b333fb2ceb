"""Fig. 3 of the paper: loops of tension over length at constant pressure, from recordings of the three muscles.

Triangles at 5 bar where a row does not say otherwise; a loop is the mean of the recorded cycles, of the measured tension
over the measured span. Rows are raw as the paper's are; where the lag of the cell's filter matters, the note gives the
corrected number beside it.
"""

from __future__ import annotations

import functools

from ..analysis.lag import CorrectedLoop, corrected_loop
from ..analysis.loops import Loop, Variation, loop, loop_ratio, variation
from ..analysis.paths import Path, path_distance, paths
from ..bench.rig_file import rig
from ..recordings import Recording
from .recorded import FIVE_BAR, SPAN, TENSION, recording, reproduces, saturation_words, step_of
from .rows import Found

PRESSURES = ("0 bar", "1 bar", "2 bar", "3 bar", "4 bar", FIVE_BAR)


def triangle(muscle: str = "nylon", *, stroke: str = "large", frequency: str = "1 Hz", pressure: str = FIVE_BAR,
             rig: str = "paper", accept_saturation: bool = False, cycles: int | None = None) -> Recording:  # fmt: skip
    """The recorded cycles of one triangle; as many as the protocol has, where nothing is said."""
    more = {} if cycles is None else {"cycles": cycles}
    whole = recording(
        "quasi-static", muscle, rig=rig, accept_saturation=accept_saturation, range=stroke, frequency=frequency,
        pressure=pressure, **more,
    )  # fmt: skip
    return step_of(whole, "loops")


@functools.cache
def measured_loop(muscle: str = "nylon", *, stroke: str = "large") -> Loop:
    """The loop at 5 bar as measured."""
    return loop(triangle(muscle, stroke=stroke), length=SPAN, tension=TENSION)


def without_lag(record: Recording, on: str = "paper") -> CorrectedLoop:
    """The loop raw, and with the lag of a rig's cell taken out: its filter, less its turn after the sample."""
    cell = rig(on).sensors["tension"]
    return corrected_loop(
        record, cutoff=float(cell.cutoff), lag=-float(cell.converter.skew), length=SPAN, tension=TENSION
    )


@reproduces("loop.width", "m")
def width() -> Found:
    """Width of the nylon muscle's loop."""
    lagless = without_lag(triangle()).corrected
    return Found(measured_loop().width, f"raw; {100 * lagless.width:.3f} cm without the lag of the cell's filter")


@reproduces("loop.height", "N")
def height() -> Found:
    """Height of the same loop."""
    lagless = without_lag(triangle()).corrected
    return Found(measured_loop().height, f"raw; {lagless.height:.2f} N without the lag of the cell's filter")


def _friction(record: Recording, on: str = "paper") -> Found:
    both = without_lag(record, on)
    return Found(both.raw.friction, f"raw; {both.corrected.friction:.2f} N without the lag of the cell's filter")


@reproduces("friction.nylon", "N")
def friction_nylon() -> Found:
    """Half the height."""
    return _friction(triangle())


@reproduces("loop.width_fiberglass", "m")
def width_fiberglass() -> float:
    """Width of the fiberglass muscle's loop, 0.85 to 1.1 L0."""
    return measured_loop("fiberglass", stroke="fiberglass").width


@reproduces("friction.fiberglass", "N")
def friction_fiberglass() -> Found:
    """Half its height."""
    return _friction(triangle("fiberglass", stroke="fiberglass"))


MODERN = "modern"  # the rig whose cell reaches as far as the Bridgestone muscle pulls


def bridgestone() -> Recording:
    """The Bridgestone muscle's cycles, 0.78 to 1.02 L0, on that rig."""
    return triangle("bridgestone", stroke="bridgestone", rig=MODERN)


def _bridgestone_note() -> str:
    paper = triangle("bridgestone", stroke="bridgestone", accept_saturation=True)
    return (
        f"on the rig with a cell of 1 kN, up to {bridgestone()[TENSION].max():.0f} N, for at mid-range "
        f"the paper's cell of 100 N is {saturation_words(paper)}"
    )


@reproduces("loop.width_bridgestone", "m")
def width_bridgestone() -> Found:
    """Width of the Bridgestone muscle's loop."""
    return Found(loop(bridgestone(), length=SPAN, tension=TENSION).width, _bridgestone_note())


@reproduces("friction.bridgestone", "N")
def friction_bridgestone() -> Found:
    """Half its height."""
    found = _friction(bridgestone(), MODERN)
    return found._replace(note=f"{found.note}; {_bridgestone_note()}")


def pressure_variation(record: Recording) -> Variation:
    """Variation of the measured pressure over the cycles."""
    return variation(record, channel="pressure", drive="span")


@reproduces("loop.pressure_variation", "Pa")
def largest_pressure_variation() -> Found:
    """Largest less smallest within a cycle, the worst of the six pressures."""
    worst = max(pressure_variation(triangle(pressure=p)).largest for p in PRESSURES)
    counts = worst / float(rig("paper").sensors["pressure"].resolution)
    bare = recording("preconditioning", plumbing="direct", pressure=FIVE_BAR, frequency="1 Hz", cycles=4)
    without = pressure_variation(step_of(bare, "cycles"))
    return Found(
        worst,
        f"{counts:.0f} counts of the converter, noise included; without accumulators {1e-5 * without.largest:.2f} bar",
    )


@reproduces("loop.rate_ratio", "1")
def rate_ratio() -> Found:
    """Area at 0.25 Hz over that at 1 Hz."""
    slow, fast = triangle(frequency="0.25 Hz"), triangle()
    ratio = loop_ratio(loop(slow, length=SPAN, tension=TENSION), loop(fast, length=SPAN, tension=TENSION))
    lagless = loop_ratio(without_lag(slow).corrected, without_lag(fast).corrected)
    return Found(ratio.area, f"raw; {lagless.area:.3f} without the lag of the cell's filter")


@reproduces("loop.small_range_ratio", "1")
def small_range_ratio() -> Found:
    """Width at half the range over that at the full one."""
    ratio = loop_ratio(measured_loop(stroke="small"), measured_loop())
    return Found(ratio.width, f"at {ratio.range:.2f} of the range; heights {ratio.height:.2f}")


def rising_and_falling(stroke: str) -> tuple[Path, Path]:
    """The two paths of the nylon muscle over a range."""
    return paths(triangle(stroke=stroke), length=SPAN, tension=TENSION)


@reproduces("loop.rising_path_distance", "N")
def rising_path_distance() -> Found:
    """Largest distance of the rising paths over the two ranges."""
    (up, down), (small_up, small_down) = rising_and_falling("large"), rising_and_falling("small")
    falling = path_distance(down, small_down)
    return Found(path_distance(up, small_up).largest, f"the falling paths lie up to {falling.largest:.1f} N apart")
