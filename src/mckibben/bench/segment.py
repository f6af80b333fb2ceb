"""One segment of a run: its software, and the simulated machine at rest where the segment begins."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from .._jax import Tree, jnp
from ..assembly.accounts import Accounts, accounts
from ..components.module import map_leaves
from ..engine import sampled
from ..engine.native import call_compiled
from .hardware.computer import Timing, configure
from .hardware.plant import InstrumentedPlant
from .hardware.simulated import SampleRows, SimulatedMachine
from .prepare import PreparedRun, RunSegment, with_friction_scale
from .software.loop import BenchSoftware
from .software.sequencer import Sequencer

CHUNK = 500  # samples between two looks at the display, at the rates, and at whether it is interrupted
AFTER_STOP = 0.5  # time for which a stopped machine is sampled further, so that it is seen to vent [s]


class Chunk(NamedTuple):
    """Consecutive samples of a run.

    Attributes:
        results: values at each, as arrays (size,); without true channels where the machine is real.
        size: number of the samples.
        inner: steps of the physics per sample; 0 where it was not computed here.
        carry: the machine after them, where it was scanned: then no stop was seen at the samples.
        numbers: numbers of the samples since the machine was started (size,), where they came one by one.
        lateness: lateness of the same (size,) [s].
    """

    results: sampled.SampleResult
    size: int
    inner: int = 0
    carry: sampled.Carry | None = None
    numbers: np.ndarray = np.zeros(0, int)
    lateness: np.ndarray = np.zeros(0)


def simulated(
    plant: InstrumentedPlant, software: BenchSoftware, carry: sampled.Carry, rows: SampleRows, timing: Timing
) -> Iterator[Chunk]:
    """Yield chunks of a simulation as fast as possible, with steps that the rates of the plant allow."""
    while True:
        carry, results, inner = sampled.advance(
            plant, software, carry, rows.next(), period=timing.period, inner=timing.inner, latency=timing.latency
        )
        yield Chunk(results, CHUNK, inner, carry)


def timing_of(bench: PreparedRun) -> Timing:
    """Return the timing of a run; commands are stored for the longest dead time of the rig."""
    commanded = [e for p in bench.rig.plumbing.values() for e in (p.valve, p.shut_off) if e is not None]
    delays = [float(e.delay() or 0.0) for e in commanded]
    return configure(bench.rig.computer, bench.plan.sample_rate, dead_time=max(delays), step=bench.step)


def software_of(bench: PreparedRun, part: RunSegment, timing: Timing) -> BenchSoftware:
    """Build sequencer, controllers and interlocks of a segment."""
    rig = bench.rig
    begins = part.start_span if part.steps[0].mode == "span" else 0.0
    return BenchSoftware(
        sequencer=Sequencer.of(part.steps, rest_length=bench.plan.rest_length, period=timing.period),
        motion=rig.motion,
        pressure=rig.pressure,
        position=rig.position,
        force=rig.force,
        interlocks=rig.watch(part.layout, tension=not bench.accepted),
        start_pressure=jnp.asarray(part.start_pressure),
        start_motor=jnp.asarray(float(begins)),
        has_motor=part.moves,
    )


class SegmentMachine:
    """The simulated machine of a segment."""

    def __init__(self, bench: PreparedRun, number: int, part: RunSegment, timing: Timing, begin: float = 0.0) -> None:
        rig, self.timing = bench.rig, timing
        unit = with_friction_scale(bench.unit, part.friction)
        self.machine = rig.machine(part.layout, unit, start=part.start_span, moves=part.moves)
        self.plant = rig.plant(self.machine, part.layout, mounted=part.start_span)
        self.commands = {"valve": part.start_pressure, "motor": 0.0, "open": 1.0}
        pressures = dict.fromkeys(self.machine.circuit.chambers, part.start_pressure)
        self.start = self.plant.at_rest(self.commands, pressures)
        self.rows = SensorNoise(bench, number, begin)

    def carry(self, software: BenchSoftware) -> sampled.Carry:
        """Return the state before the first sample of a simulation with this software."""
        first = self.rows.first()
        carry: sampled.Carry = call_compiled(sampled.with_software, self.plant, software, self.rested, first)
        return carry

    @functools.cached_property
    def rested(self) -> sampled.Carry:
        """Return the machine at rest at the start of the segment, without software."""
        depth = self.timing.depth
        carry: sampled.Carry = call_compiled(sampled.rest, self.plant, self.start, self.commands, depth=depth)
        return carry

    def at_interface(self, ahead: float = 0.0) -> SimulatedMachine:
        """Build the machine behind its converters; noise for the first `ahead` seconds is drawn before it begins."""
        return SimulatedMachine(self.plant, self.rested, self.rows, self.timing, ahead=ahead)

    def closed(self, carry: sampled.Carry, begun: sampled.Carry | None = None) -> Accounts:
        """Close the accounts between a state, by default the start, and a later one."""
        timing = self.timing
        begun = self.rested if begun is None else begun
        at = timing.latency, timing.period
        first, last = (call_compiled(sampled.inputs_of, self.plant, c, *at) for c in (begun, carry))
        sums = map_leaves(lambda end, begin: end - begin, carry.integrals, begun.integrals)
        ended: Any = carry._replace(state=carry.state["machine"], integrals=sums)
        return accounts(self.machine, (begun.state["machine"], begun.memory), ended, first, last)


class SensorNoise:
    """Sensor noise, open wires and drifts of the samples of a segment."""

    def __init__(self, bench: PreparedRun, part: int, begin: float = 0.0, drifting: Iterable[str] = ()) -> None:
        # a generator for each part, so that the parts do not depend on each other's length
        self.chance = np.random.default_rng([bench.seed, part])
        self.period = 1.0 / bench.plan.sample_rate
        self.names = list(bench.rig.sensors)
        self.lost = [*self.names, "span"]
        self.opened = {f.channel: f.at for f in bench.faults}
        # beside runs in which other channels drift, rows need them too
        self.drifts = dict.fromkeys(drifting, 0.0) | bench.rig.faults.drifts()
        self.begin, self.count = begin, 0

    def first(self) -> dict[str, Tree]:
        """Return the row of a sample without noise."""
        zero = np.zeros(())
        row = {"draws": dict.fromkeys(self.names, zero), "lost": dict.fromkeys(self.lost, zero)}
        return row | ({"drift": dict.fromkeys(self.drifts, zero)} if self.drifts else {})

    def next(self) -> dict[str, Tree]:
        """Draw the rows of the next chunk."""
        draws = self.chance.standard_normal((len(self.names), CHUNK))
        times = self.begin + self.period * (self.count + np.arange(CHUNK))
        self.count += CHUNK
        rows = {
            "draws": dict(zip(self.names, draws, strict=True)),
            "lost": {n: np.where(times >= self.opened.get(n, np.inf), 1.0, 0.0) for n in self.lost},
        }
        return rows | ({"drift": {n: float(r) * times for n, r in self.drifts.items()}} if self.drifts else {})
