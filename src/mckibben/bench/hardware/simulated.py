"""The simulated machine with converters: in the same process, or within a simulated device.

It takes and gives counts only, like a real one, and is advanced by one compiled function wherever it stands. So a loop that
drives it through a serial line gets the same counts as one that drives it here.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..._jax import Tree
from ...components.module import flatten, map_leaves
from ...engine import sampled
from ...engine.packed import compile_once, pack
from ...errors import LineLostError
from .clock import Clock
from .converters import SPAN
from .interface import Hardware
from .plant import InstrumentedPlant


class SampleRows(Protocol):
    """External inputs of each sample, chunk by chunk: sensor noise and disconnected wires."""

    def next(self) -> dict[str, Tree]:
        """Rows of the next chunk, (n,) each."""


class SimulatedMachine:
    """A simulated machine with converters, advanced sample by sample.

    Args:
        plant: the machine.
        carry: where it begins; its software is not looked at.
        rows: external inputs of the samples.
        period: period of the samples [s].
        inner: steps of the physics per sample.
        latency: from a sample to the action of its commands [s].
        ahead: for so long [s] nothing is drawn while it goes.
    """

    def __init__(
        self,
        plant: InstrumentedPlant,
        carry: sampled.Carry,
        rows: SampleRows,
        *,
        period: float,
        inner: int,
        latency: float,
        ahead: float = 0.0,
    ) -> None:
        self.names = plant.converters.names
        self.bits = tuple(plant.converters.analog[n].bits for n in self.names)
        self._period = period
        self._zero: int | None = 0
        self._rows = rows
        self._drawn: deque[np.ndarray] = deque()
        physics, row = carry._replace(software=()), map_leaves(lambda x: x[0], self._draw())
        # Arguments, as those of a simulation: as constants of the program some would be folded, to another last bit.
        setup = _Setup(plant, np.float64(period), np.int64(inner), np.float64(latency))
        self._observe = compile_once(_observe, (), setup, physics, row)
        self._act = compile_once(_act, (), setup, physics, np.zeros(3))
        self._setup, self._physics = pack(setup), pack(physics)
        # the first call of all makes machine code, for which no host waits at a sample
        self._observe(self._setup, self._physics, self._drawn[0])
        self._act(self._setup, self._physics, np.zeros(3))
        self._places = [self._observe.index(0, f"{n}.code") for n in self.names]
        self._span = None if plant.converters.encoder is None else self._observe.index(0, f"{SPAN}.code")
        self.look: np.ndarray | None = None  # what is true at the newest sample
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
        self._drawn.extend(np.stack([np.asarray(x, float) for x in flatten(rows)[0]], axis=1))
        return rows

    def sample(self) -> tuple[list[int], int]:
        """Counts of the analogue channels in the order of `names`, and of the encoder.

        Raises:
            LineLostError: if the physics failed, of which there is no count.
        """
        if not self._drawn:
            self._draw()
        measured, self.look = self._observe(self._setup, self._physics, self._drawn.popleft())
        if not np.isfinite(measured).all():
            raise LineLostError("simulated machine: its state is not finite any more")
        count = 0 if self._span is None else int(measured[self._span])
        if self._zero is None:
            self._zero = count
        return [int(measured[i]) for i in self._places], count - self._zero

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        """Compute the physics until the next sample, for counts of the outputs."""
        (self._physics,) = self._act(self._setup, self._physics, np.array([valve, motor, opened], float))

    def state(self) -> np.ndarray:
        """Complete state of the machine between two samples, as a constant vector."""
        return self._physics

    def carry(self, state: np.ndarray | None = None) -> sampled.Carry:
        """Convert a vector of `state`, or the present one, for the accounts."""
        carry: sampled.Carry = self._act.tree(0, self._physics if state is None else state)
        return carry

    def true_outputs(self, looks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
        """True outputs at some samples, (n,) each, from the vectors that `look` returned."""
        table = np.stack(looks) if looks else np.zeros((0, self._observe.size(1)))
        observation: sampled.Observation = self._observe.columns(1, table)
        return observation.outputs


class _Setup(NamedTuple):
    """The machine and its timing: period [s], steps of the physics per sample, and latency [s]."""

    plant: InstrumentedPlant
    period: Any
    inner: Any
    latency: Any


def _observe(setup: _Setup, carry: sampled.Carry, row: Tree) -> tuple[Tree, ...]:
    """Compute counts of the inputs, and true values at a sample."""
    return sampled.observe(setup.plant, carry, row, period=setup.period, latency=setup.latency)


def _act(setup: _Setup, carry: sampled.Carry, counts: Any) -> tuple[sampled.Carry, ...]:
    """Advance the machine to the next sample, with counts of the outputs ``valve``, ``motor`` and ``open``."""
    plant, period, inner, latency = setup
    commands = plant.converters.held({"valve": counts[0], "motor": counts[1], "open": counts[2]})
    return sampled.act(plant, carry, commands, period=period, inner=inner, latency=latency, stiff=False)[:1]


class SimulatedHardware(Hardware):
    """A simulated machine in the same process, as the hardware of a sample loop.

    Args:
        machine: behind its converters.
        clock: clock of its time; None: every sample is there when it is requested.
    """

    def __init__(self, machine: SimulatedMachine, clock: Clock | None = None) -> None:
        super().__init__(machine.names, encoder=True, motor=True)
        self.machine, self.clock = machine, clock
        self.paced = clock is not None
        self._period = 0.0

    def start(self, period: float) -> None:
        """Begin with a period [s]; the encoder is zeroed already, where the machine is mounted."""
        self._period = period

    def wait(self, sample: int) -> float:
        """Wait until the clock permits the next sample; return its lateness [s]."""
        late = 0.0 if self.clock is None else self.clock.wait(self._period)
        self.counts, self.edges = self.machine.sample()
        return late

    def send(self) -> None:
        """Compute the physics until the next sample."""
        if self.venting:
            self.valve, self.opened = 0, True
        self.machine.advance(self.valve, self.motor, self.opened)

    def _vent_now(self) -> None:
        return  # the next sample does

    def close(self) -> None:
        """Vent; nothing else is to be released."""
        self.vent()

    def interrupt(self) -> None:
        """End a wait for the clock."""
        if self.clock is not None:
            self.clock.interrupt()

    def proceed(self) -> None:
        """Allow waits for the clock again."""
        if self.clock is not None:
            self.clock.interrupt(False)

    def look(self) -> np.ndarray | None:
        """True state at the newest sample."""
        return self.machine.look

    def true_outputs(self, looks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
        """True channels of some samples, (n,) each."""
        return self.machine.true_outputs(looks)

    def state(self) -> np.ndarray | None:
        """Complete state of the machine between two samples."""
        return self.machine.state()
