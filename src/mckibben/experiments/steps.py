"""Steps of a protocol: what the valve and the motor shall do, for how long, and how a person reads it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import InputError
from .amounts import Amount, in_metres, table_words
from .until import Until
from .waveforms import Constant, Sine, Table, Triangle, Waveform, read_waveform, time_words
from .waveforms.waveform import RELATIVE

MOST_CYCLES = 100_000
USUAL_REST_LENGTH = 0.14  # [m]
MODES = ("span", "velocity", "tension")


@dataclass(frozen=True)
class Follow:
    """Follow a waveform from the beginning of the step; its unit is SI, ``L0`` or ``L0/s``.

    Some values may be in rest lengths and others not. `mixed` then has the waveform's table, and `waveform` is that of a
    muscle of `USUAL_REST_LENGTH`, whose kind and times are those of any other.
    """

    waveform: Waveform
    unit: str
    mixed: Any = None
    place: str = field(default="", compare=False)

    def at(self, times: np.ndarray, rest_length: float) -> np.ndarray:
        """Set-points [SI] at times [s] from the beginning of the step, shape of the times."""
        if self.mixed is not None:
            table = in_metres(self.mixed, self.unit, rest_length)
            return read_waveform(table, self.unit, field=self.place, where=None).at(times)
        return self.waveform.at(times) * (rest_length if self.unit in RELATIVE else 1.0)

    def sentence(self, channel: str) -> str:
        """Such as ``span as triangle from 0.75 L0 to 1 L0 at 1 Hz``, ``pressure 5 bar``."""
        if self.mixed is not None:
            return f"{channel} as {table_words(self.mixed, self.unit)}"
        joint = "" if isinstance(self.waveform, Constant) else "as "
        return f"{channel} {joint}{self.waveform.sentence(self.unit)}"


@dataclass(frozen=True)
class Go:
    """Go on a line from where it is to a value, in a time [s] or at a speed."""

    to: Amount
    seconds: float | None = None
    speed: Amount | None = None

    def duration(self, start: float, rest_length: float) -> float:
        """Time that it takes from a start [SI], s; NaN where the start is unknown and only a speed is stated."""
        if self.seconds is not None:
            return self.seconds
        assert self.speed is not None  # the reader asks for one of the two
        return abs(self.to.si(rest_length) - start) / self.speed.si(rest_length)

    def sentence(self, channel: str) -> str:
        """Such as ``pressure to 5 bar in 1 s``."""
        way = f"at {self.speed.sentence()}" if self.speed is not None else f"in {time_words(self.seconds or 0.0)}"
        return f"{channel} to {self.to.sentence()} {way}"


@dataclass(frozen=True)
class Phased:
    """Pressure by the direction of the motion: one value while the muscle shortens, another while it lengthens.

    Each change leads the reversal of the motion by `lead` [s] and takes `ramp` [s]; one that would lie before the motion
    begins starts with it. Pressures [Pa].
    """

    shortening: float
    lengthening: float
    lead: float
    ramp: float

    def table(self, motion: Waveform, duration: float) -> Table:
        """The pressure over a duration [s] of a sine or triangle of the span.

        Raises:
            InputError: if the motion is another one, or its strokes are shorter than the ramps.
        """
        start, share, period = _shortening(motion)
        if self.ramp >= period * min(share, 1.0 - share):
            stroke = time_words(period * min(share, 1.0 - share))
            raise InputError("ramp", time_words(self.ramp), f"allowed is less than the shorter stroke, {stroke}")
        if duration > MOST_CYCLES * period:
            raise InputError(
                "cycles", f"{duration / period:.6g}", f"allowed are {MOST_CYCLES} with pressure by direction"
            )
        changes = []
        for k in range(-1, math.ceil(duration / period) + 2):
            rise, fall = start + k * period, start + (k + share) * period
            if fall > 1e-9:  # a stroke under way at the beginning has its pressure from there on
                changes += [(max(rise - self.lead, 0.0), self.shortening), (fall - self.lead, self.lengthening)]
        times, values = [0.0], [self.lengthening]
        for begin, to in changes:
            if begin < times[-1]:
                raise InputError("lead", time_words(self.lead), "allowed is less: one change would overtake another")
            if begin > times[-1]:
                times, values = [*times, begin], [*values, values[-1]]
            times, values = [*times, begin + self.ramp], [*values, to]
        return Table(times=tuple(times), values=tuple(values))

    def sentence(self, channel: str) -> str:
        """In words."""
        high, low = Amount(self.shortening, "Pa").sentence(), Amount(self.lengthening, "Pa").sentence()
        early = f", {time_words(self.lead)} early" if self.lead else ""
        return f"{channel} {high} while it shortens and {low} while it lengthens{early}, in ramps of {time_words(self.ramp)}"


@dataclass(frozen=True)
class Shut:
    """The muscle is shut off from valve and vent: its gas stays."""

    def sentence(self, channel: str) -> str:
        """In words."""
        return f"{channel} shut off"


Command = Follow | Go | Phased | Shut


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step. A channel without a command keeps its last set-point; `mode` says what the motor controls.

    It ends after `duration` [s] or `cycles` of its waveform, or earlier by `until`; with neither it lasts as long as its
    lines. `otherwise` says what follows when a test did not come true within the time: ``stop`` or ``go on``. `ask` is
    what a person has to do before it begins. Only recorded steps are kept.
    """

    label: str = ""
    ask: str = ""
    pressure: Command | None = None
    mode: str | None = None
    motor: Follow | Go | None = None
    duration: float | None = None
    cycles: float | None = None
    until: Until | None = None
    otherwise: str = "stop"
    record: bool = True

    def frequency(self) -> float | None:
        """Of its periodic waveform, the motor's first [1/s]."""
        for command in (self.motor, self.pressure):
            if isinstance(command, Follow):
                rate = getattr(command.waveform, "frequency", None)
                if rate is not None:
                    return float(rate)
        return None

    def stated_duration(self) -> float | None:
        """Longest time that it may take [s]; None where its lines decide."""
        rate = self.frequency()
        return self.duration if self.cycles is None or rate is None else self.cycles / rate

    def sentence(self) -> str:
        """In words, with all its numbers."""
        said = [f"ask to {self.ask}"] if self.ask else []
        if self.pressure is not None:
            said.append(self.pressure.sentence("pressure"))
        if self.motor is not None and self.mode is not None:
            said.append(self.motor.sentence(self.mode))
        if self.until is not None:
            said.append(f"until {self.until.sentence()}")
        time = self._time()
        if time:
            said.append(f"at most {time}, then {self.otherwise}" if self.until is not None else f"for {time}")
        if not self.record:
            said.append("not recorded")
        text = ", ".join(said)
        return f"{self.label}: {text}" if self.label else text

    def _time(self) -> str:
        if self.cycles is not None:
            return f"{self.cycles:g} cycle{'' if self.cycles == 1 else 's'}"
        return time_words(self.duration) if self.duration is not None else ""


def _shortening(motion: Waveform) -> tuple[float, float, float]:
    """When a motion first begins to shorten within its first cycle [s], the share of the cycle it does, the period [s]."""
    if isinstance(motion, Triangle):
        period = 1.0 / motion.frequency
        return motion.rising * period, 1.0 - motion.rising, period
    if isinstance(motion, Sine):
        period = 1.0 / motion.frequency
        turn = (0.25 - motion.phase / (2.0 * math.pi) + (0.5 if motion.amplitude < 0.0 else 0.0)) % 1.0
        turn = 0.0 if turn > 1.0 - 1e-9 else turn
        return turn * period, 0.5, period
    raise InputError("span.kind", motion.kind, "pressure by direction needs sine or triangle")
