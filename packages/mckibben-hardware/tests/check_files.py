"""Checks of machines with one fault each, as their owners would send them: run this file to make `checks/*.json` anew.

The machine is the simulated one of the rig `modern`, behind the emulated microcontroller on a virtual serial line that keeps
its own clock. The fault is put between its converters and the device, or into the line, and `mckibben device check` writes
the file. Of the tests each fault must fail the one named here, and be told in the words beside it; the last word is of what
the calibration or the first protocol then says, where the fault is seen there too.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mckibben.bench.rig_file import rig

FOLDER = Path(__file__).parent / "checks"
PERIOD, PLUMBING, PRESSURE = 0.04, "tight", "1 bar"
MODERN = rig("modern")
SCALES = MODERN.converters(0.0).analog
NAMES = tuple(SCALES)


def counts_of(name: str, value: float) -> int:
    """How many counts of a channel a value is [SI]."""
    return round(value / float(SCALES[name].resolution))


def at_nothing(name: str) -> int:
    return counts_of(name, -float(SCALES[name].low))


class Case(NamedTuple):
    """A fault: what it does to counts, encoder, and the commands of valve and shut-off; the line's; what must be said."""

    failed: tuple[str, str] | None  # channel and test; None where the machine is lost or refused
    told: str
    later: str = ""
    counts: Callable[[dict[str, int]], dict[str, int]] = lambda c: c
    turned: int = 1
    valve: Callable[[Sequence[int]], int] = lambda asked: asked[-1]
    shuts: bool = True
    bits: int = 16
    line: dict[int, str] = {}
    delay: float = 0.0


def mirrored(name: str) -> Callable[[dict[str, int]], dict[str, int]]:
    return lambda c: {**c, name: min(max(2 * at_nothing(name) - c[name], 0), 65535)}


def exchanged(a: str, b: str) -> Callable[[dict[str, int]], dict[str, int]]:
    return lambda c: {**c, a: c[b], b: c[a]}


def noisy(name: str, value: float) -> Callable[[dict[str, int]], dict[str, int]]:
    draw = np.random.default_rng(7)
    return lambda c: {**c, name: c[name] + round(counts_of(name, value) * float(draw.standard_normal()))}


CASES: dict[str, Case] = {
    "sound": Case(None, ""),
    "cell_turned": Case(("tension", "sign"), "falls with the pull: exchange its signal wires", counts=mirrored("tension")),
    "encoder_turned": Case(("span", "sign"), "exchange the encoder's lines A and B", turned=-1),
    "pressures_exchanged": Case(
        ("shut-off", "tight"), "exchange the wires of pressure and valve_pressure",
        counts=exchanged("pressure", "valve_pressure"),
    ),
    "pressure_at_the_cell": Case(
        ("pressure", "answer"), "tension changes by as many counts as it should: exchange the wires of both", "zeros of",
        counts=exchanged("pressure", "tension"),
    ),
    "noisy_cell": Case(("tension", "noise"), "shield its cable, check ground and supply", counts=noisy("tension", 40.0)),
    "half_scale": Case(
        ("pressure", "scale"), "reads 0.5 of what the valve was asked for: check low and high",
        counts=lambda c: {**c, "pressure": (c["pressure"] + at_nothing("pressure")) // 2},
    ),
    "offset": Case(
        ("pressure", "zero"), "reads 2 bar at rest: check low and high", "pressure must be at rest near nothing",
        counts=lambda c: {**c, "pressure": min(c["pressure"] + counts_of("pressure", 2e5), 65535)},
    ),
    "open_wire": Case(
        ("machine", "limits"), "valve_pressure read 11 bar, above the rig's interlock", "at an end of the converter",
        counts=lambda c: {**c, "valve_pressure": 65535},
    ),
    "shut_off_elsewhere": Case(
        ("shut-off", "tight"), "it does not shut, or its output is wired to another pin", shuts=False
    ),
    "valve_sticks": Case(("vent", "time"), "after it was told to vent: mend that before all else", valve=max),
    "frames_lost": Case(
        ("line", "samples"), "6 lost, late by", line=dict.fromkeys(range(30, 210, 30), "lost")
    ),
    "line_torn": Case(None, "unplugged", line={120: "unplug"}),
    "line_slow": Case(None, "the device vented by itself, for it had no command", line={60: "late"}, delay=0.6),
    "other_converter": Case(None, "bits of pressure is 12: the rig has 16", bits=12),
}  # fmt: skip


class FaultyMachine:
    """A simulated machine whose counts and commands pass through a fault."""

    def __init__(self, machine: Any, case: Case) -> None:
        self.machine, self.case, self.names, self.asked = machine, case, machine.names, [0]
        self.bits = (case.bits,) * len(machine.names)

    @property
    def period(self) -> float:
        return self.machine.period

    @period.setter
    def period(self, period: float) -> None:
        self.machine.period = period

    def sample(self) -> tuple[list[int], int]:
        counts, edges = self.machine.sample()
        seen = self.case.counts(dict(zip(self.names, counts, strict=True)))
        return [seen[n] for n in self.names], self.case.turned * edges

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        self.asked.append(valve)
        self.machine.advance(self.case.valve(self.asked), motor, opened or not self.case.shuts)


def make(name: str) -> None:
    from mckibben.cli import main
    from mckibben_hardware.commissioning import simulated_machine
    from mckibben_hardware.serial_line import About, in_thread
    from mckibben_hardware.serial_line.microcontroller import Faults

    case = CASES[name]
    machine = simulated_machine(MODERN, "nylon", period=PERIOD, plumbing=PLUMBING, motor=True).machine
    about = About(motor_rest=int(MODERN.motor_out.count(0.0)))
    with in_thread(FaultyMachine(machine, case), about=about, faults=Faults(case.line, case.delay)) as device:
        words = ["device", "check", "--rig", "modern", "--on", f"serial:{device.port}", "--rate", f"{1 / PERIOD:g} Hz"]
        words += [
            "--plumbing",
            PLUMBING,
            "--pressure",
            PRESSURE,
            "--motor",
            "--yes",
            "--out",
            str(FOLDER / f"{name}.json"),
        ]
        with contextlib.suppress(SystemExit):
            main(words)


if __name__ == "__main__":
    for case_name in sys.argv[1:] or CASES:
        print(f"== {case_name}", flush=True)
        make(case_name)
