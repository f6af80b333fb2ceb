"""The simulated machine at the hardware border: in the same process, or as what a simulated device has around it.

It takes and gives counts only, like a real one, and is advanced by one compiled function wherever it stands. So a loop that
drives it through a serial line gets the same counts as one that drives it here.
"""

from __future__ import annotations

import time
from collections import deque
from typing import Any, Protocol

import jax
import numpy as np

from ...engine import sampled
from ...engine.packed import compile_once, pack
from ...errors import LineLostError
from .converters import SPAN
from .lines import AnalogInputs, EdgeCounter, MotorOutput, ValveOutput
from .plant import InstrumentedPlant

SPIN = 3e-4  # time before a deadline from which the loop no longer sleeps, for the system wakes it late [s]
BEGIN = 5.0  # samples until the first one


class Rows(Protocol):
    """What every sample brings from outside, chunk by chunk: draws of the noise, and wires that are open."""

    def next(self) -> dict[str, Any]:
        """Of the next chunk, each (n,)."""


class SimulatedMachine:
    """A machine behind its converters that goes on from sample to sample.

    Args:
        plant: the machine.
        carry: where it begins; its software is not looked at.
        rows: what the samples bring.
        period: of the samples [s].
        inner: steps of the physics per sample.
        latency: from a sample to the action of its commands [s].
        ahead: for so long [s] nothing is drawn while it goes.
        watched: somebody takes what was true at every sample (`seen`).
    """

    def __init__(
        self, plant: InstrumentedPlant, carry: sampled.Carry, rows: Rows, *,
        period: float, inner: int, latency: float, ahead: float = 0.0, watched: bool = True,
    ) -> None:  # fmt: skip
        self.names = plant.converters.names
        self.bits = tuple(plant.converters.analog[n].bits for n in self.names)
        self._period = period
        self._zero: int | None = 0
        self._rows = rows
        self._drawn: deque[np.ndarray] = deque()
        physics, row = carry._replace(software=()), jax.tree.map(lambda x: x[0], self._draw())
        self._observe = compile_once(_observe, (plant, period, latency), physics, row)
        self._act = compile_once(_act, (plant, period, inner, latency), physics, np.zeros(3))
        self._physics = pack(physics)
        self._places = [self._observe.index(0, f"{n}.code") for n in self.names]
        self._span = None if plant.converters.encoder is None else self._observe.index(0, f"{SPAN}.code")
        # what was true at every sample, until somebody takes it
        self.looks: deque[np.ndarray] = deque(maxlen=None if watched else 1)
        while len(self._drawn) * period < ahead:
            self._draw()

    @property
    def period(self) -> float:
        """Of the samples [s]. A device sets it where a run begins: then the encoder is zeroed at the next sample."""
        return self._period

    @period.setter
    def period(self, period: float) -> None:
        """Refused where it is another one than the machine was made for."""
        if abs(period / self._period - 1.0) > 1e-6:
            made = f"it was made for samples every {self._period:g} s, not {period:g} s"
            raise LineLostError(f"simulated machine: {made}")
        self._zero = None

    def _draw(self) -> Any:
        rows = self._rows.next()
        self._drawn.extend(np.stack([np.asarray(x, float) for x in jax.tree.leaves(rows)], axis=1))
        return rows

    def sample(self) -> tuple[list[int], int]:
        """Counts of the analogue channels in the order of `names`, and of the encoder.

        Raises:
            LineLostError: if the physics failed, of which there is no count.
        """
        if not self._drawn:
            self._draw()
        measured, look = self._observe(self._physics, self._drawn.popleft())
        self.looks.append(look)
        if not np.isfinite(measured).all():
            raise LineLostError("simulated machine: its state is not finite any more")
        count = 0 if self._span is None else int(measured[self._span])
        if self._zero is None:
            self._zero = count
        return [int(measured[i]) for i in self._places], count - self._zero

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        """The physics until the next sample, with counts of the outputs."""
        (self._physics,) = self._act(self._physics, np.array([valve, motor, opened], float))

    def carry(self) -> sampled.Carry:
        """Where it is now."""
        found: sampled.Carry = self._act.tree(0, self._physics)
        return found

    def seen(self, count: int) -> sampled.Look:
        """The oldest of `looks`, `count` of them, as columns (n,); they are gone then."""
        rows = [self.looks.popleft() for _ in range(count)]
        table = np.stack(rows) if rows else np.zeros((0, self._observe.size(1)))
        found: sampled.Look = self._observe.columns(1, table)
        return found


def _observe(
    plant: InstrumentedPlant, period: float, latency: float, carry: sampled.Carry, row: Any
) -> tuple[Any, ...]:
    """Counts of the inputs, and what is true at a sample."""
    return sampled.observe(plant, carry, row, period=period, latency=latency)


def _act(
    plant: InstrumentedPlant, period: float, inner: int, latency: float, carry: sampled.Carry, counts: Any
) -> tuple[sampled.Carry, ...]:
    """The machine at the next sample, with counts of the outputs ``valve``, ``motor`` and ``open``."""
    commands = plant.converters.held({"valve": counts[0], "motor": counts[1], "open": counts[2]})
    return sampled.act(plant, carry, commands, period=period, inner=inner, latency=latency, stiff=False)[:1]


class InProcess:
    """`interface.Hardware` of a simulated machine; paced by the wall clock, or with every sample there at once."""

    def __init__(self, machine: SimulatedMachine, *, paced: bool = True) -> None:
        self.machine, self.paced = machine, paced
        self.analog_in, self.encoder = AnalogInputs(machine.names), EdgeCounter()
        self.valve, self.motor = ValveOutput(), MotorOutput(0)
        self._origin = 0.0

    def start(self, period: float) -> None:
        """Begin some samples from now; the encoder is zeroed already, where the machine is mounted."""
        self._origin = time.perf_counter() + BEGIN * period
        self._period = period

    def wait(self, sample: int) -> float:
        """Until it is there; how late [s]."""
        late = wait_until(self._origin + sample * self._period) if self.paced else 0.0
        self.analog_in.counts, self.encoder.count = self.machine.sample()
        return late

    def send(self) -> None:
        """The physics until the next sample."""
        valve = self.valve
        if valve.vented:
            valve.count, valve.opened = 0, True
        self.machine.advance(valve.count, self.motor.count, valve.opened)

    def close(self) -> None:
        """Vent; there is nothing to let go of."""
        self.valve.vent()


def wait_until(deadline: float) -> float:
    """Wait for a time of `time.perf_counter` [s]; how much later it is then [s]."""
    ahead = deadline - time.perf_counter()
    if ahead > SPIN:
        time.sleep(ahead - SPIN)
    while (now := time.perf_counter()) < deadline:
        pass
    return now - deadline
