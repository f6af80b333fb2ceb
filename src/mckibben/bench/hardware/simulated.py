"""The simulated machine with converters: in the same process, or within a simulated device.

It takes and gives counts only, like a real one, and is advanced by one compiled function wherever it stands. So a loop that
drives it through a serial line gets the same counts as one that drives it here.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Sequence
from time import perf_counter
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..._jax import Tree
from ...components.module import flatten, map_leaves
from ...engine import sampled
from ...engine.packed import compile_once, pack
from ...errors import LineLostError
from .computer import Timing
from .converters import SPAN
from .interface import Hardware, WaitInterrupted
from .plant import InstrumentedPlant

SPIN = 3e-4  # time before a deadline from which the loop no longer sleeps, for the system wakes it late [s]
BEHIND = 1.0  # a machine that is later than this starts again, rather than to hurry after its clock [s]
BREATH = 16  # samples after which a shared clock without a speed lets other threads in
LEAD = 0.07  # so far ahead of what a viewer in control has seen does a machine go [s]
PATIENCE = 2.0  # time for which it waits for a viewer that says nothing [s]


class Clock:
    """Clock of one simulated machine; it may be changed from any thread at any time.

    A clock may have one viewer, such as a page: while that says how much of the machine it has seen (`viewed`), the machine
    is at most `LEAD` ahead. Who sees something and presses the stop so stops the machine near what was seen, however fast it
    is and however slow the viewer. Where the viewer has said nothing for `PATIENCE` the machine goes on, at most in real
    time.

    Args:
        speed: speed of the machine's time over that of the wall; None: as fast as it goes.
        grain: shortest time for which the machine sleeps where it is ahead [s], so that other threads of the process get
            their share; it then comes at most so late. 0 keeps deadlines to some microseconds, and spins before each.
        halted: whether it stands still at first.
    """

    def __init__(self, speed: float | None = 1.0, *, grain: float = 0.0, halted: bool = False) -> None:
        self._changed = threading.Condition()
        self._speed, self._grain, self._halted = speed, grain, halted
        self._due: float | None = None  # when the newest sample was due [s]
        self._count = self._until = 0  # samples let through, and up to which they are while it stands still
        self._waiting = self._interrupted = False
        self._reached, self._viewed = 0.0, None  # type: float, float | None
        self._heard = self._before = 0.0  # when the viewer spoke, and when the newest sample was let through [s]

    @property
    def speed(self) -> float | None:
        """Time of the machine over that of the wall; None: as fast as it goes."""
        return self._speed

    @speed.setter
    def speed(self, speed: float | None) -> None:
        """Go on at another speed from now on."""
        with self._changed:
            self._speed, self._due = speed, None
            self._changed.notify_all()

    def begin(self) -> None:
        """Restart at 0 s, running, without a viewer."""
        with self._changed:
            self._reached, self._viewed, self._halted, self._due = 0.0, None, False, None
            self._changed.notify_all()

    @property
    def halted(self) -> bool:
        """Whether the clock is halted."""
        return self._halted

    def halt(self, halted: bool = True) -> None:
        """Halt the machine, or let it continue."""
        with self._changed:
            self._halted, self._until, self._due = halted, self._count, None
            self._changed.notify_all()

    @property
    def count(self) -> int:
        """Number of samples so far."""
        return self._count

    def step(self, samples: int = 1) -> None:
        """Advance a halted machine by some samples."""
        with self._changed:
            self._until = max(self._until, self._count) + samples
            self._changed.notify_all()

    def advance(self, until: int) -> None:
        """Advance a halted machine to a number of samples, and wait until it is reached."""
        with self._changed:
            self._until = max(self._until, until)
            self._changed.notify_all()
            self._changed.wait_for(
                lambda: self._interrupted or not self._halted or (self._waiting and self._count >= until)
            )

    def viewed(self, time: float | None) -> None:
        """Set how much of the machine's time the viewer has seen [s]; None if there is no viewer."""
        with self._changed:
            self._viewed, self._heard = time, perf_counter()
            self._changed.notify_all()

    def interrupt(self, interrupted: bool = True) -> None:
        """Interrupt `wait` now and later, or let it wait again."""
        with self._changed:
            self._interrupted = interrupted
            if not interrupted:
                self._due = None
            self._changed.notify_all()

    def wait(self, period: float) -> float:
        """Wait for the next sample, a period after the last one; return its lateness in the machine's time [s].

        Raises:
            WaitInterrupted: if `interrupt` was called.
        """
        with self._changed:
            self._waiting = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._interrupted or not self._halted or self._count < self._until)
            self._waiting = False
            if self._interrupted:
                raise WaitInterrupted
            self._count += 1
            self._reached += period
            if self._halted:
                return 0.0
            if not self._near():  # wait until the viewer has seen enough; while it is silent, a period of real time
                until = max(self._heard + PATIENCE, self._before + period)
                self._changed.wait_for(self._near, max(until - perf_counter(), 0.0))
            self._before = perf_counter()
            speed, due = self._speed, self._due
        if speed is None:
            if self._grain and self._count % BREATH == 0:
                time.sleep(0.0)
            return 0.0
        now = perf_counter()
        due = now if due is None else due + period / speed
        if now - due > BEHIND:
            self._due = now
            return (now - due) * speed
        self._due = due
        if not self._grain:
            return wait_until(due) * speed
        if now < due:
            time.sleep(max(due - now, self._grain))
            return 0.0
        return now - due if now - due > self._grain + 1e-3 else 0.0

    def _near(self) -> bool:
        return self._viewed is None or self._halted or self._interrupted or self._reached - self._viewed < LEAD


def wait_until(deadline: float) -> float:
    """Wait until a time of `time.perf_counter` [s]; return the lateness [s]."""
    ahead = deadline - perf_counter()
    if ahead > SPIN:
        time.sleep(ahead - SPIN)
    while (now := perf_counter()) < deadline:
        pass
    return now - deadline


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
        timing: of the samples, of the physics between them, and of the commands.
        ahead: for so long [s] nothing is drawn while it goes.
    """

    def __init__(
        self, plant: InstrumentedPlant, carry: sampled.Carry, rows: SampleRows, timing: Timing, *, ahead: float = 0.0
    ) -> None:
        period = timing.period
        self.names = plant.converters.names
        self.bits = tuple(plant.converters.analog[n].bits for n in self.names)
        self._period = period
        self._zero: int | None = 0
        self._rows = rows
        self._drawn: deque[np.ndarray] = deque()
        physics, row = carry._replace(software=()), map_leaves(lambda x: x[0], self._draw())
        # Arguments, as those of a simulation: as constants of the program some would be folded, to another last bit.
        setup = _Setup(plant, np.float64(period), np.int64(timing.inner), np.float64(timing.latency))
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
    """A simulated machine in the same process, as the hardware of a sample loop."""

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
