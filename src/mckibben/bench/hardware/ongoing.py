"""A machine that goes on: it is sampled without a gap, while one loop after the other has it.

    ground.wait(n) by number since the session began  ->  Lent.wait(k) counts from 0 for each loop

A loop that takes it over has the software's state of the one before (controllers, interlocks), so nothing jumps. A simulated
one hands out its state as well, between two samples, for the accounts of what is recorded.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...engine import sampled
from ...errors import InputError
from .in_process import InProcess, SimulatedMachine
from .interface import AnalogIn, AnalogLine, Hardware, Valve

if TYPE_CHECKING:
    from ..wall_clock import Loop

BEHIND = 1.0  # a simulated machine that is later than this begins a new clock, rather than to hurry after it [s]
OWN = "place"  # of a software's state, what belongs to its own set-points


class Ongoing(SimulatedMachine):
    """A simulated machine whose past does not pile up."""

    def columns(self, rows: Sequence[np.ndarray]) -> dict[str, Any]:
        """True outputs of some samples, (n,) each."""
        table = np.stack(rows) if rows else np.zeros((0, self._observe.size(1)))
        found: sampled.Look = self._observe.columns(1, table)
        return found.outputs

    def state(self) -> np.ndarray:
        """All of it between two samples, as a vector that stays as it is."""
        return self._physics

    def carry_of(self, state: np.ndarray) -> sampled.Carry:
        """The same for the accounts."""
        found: sampled.Carry = self._act.tree(0, state)
        return found


class AtSpeed(InProcess):
    """An ongoing machine by the wall clock, faster or slower by a factor; or every sample at once where that is None."""

    machine: Ongoing

    def __init__(self, machine: Ongoing, speed: float | None = 1.0) -> None:
        super().__init__(machine, paced=speed is not None)
        self.speed = 1.0 if speed is None else speed

    def start(self, period: float) -> None:
        """As of any simulated machine."""
        super().start(period / self.speed)

    def wait(self, sample: int) -> float:
        """Until it is there; how late by the machine's clock [s]."""
        late = super().wait(sample)
        if late > BEHIND:
            self._origin += late
        return late * self.speed


class Ground:
    """The machine below all loops of a session, started once.

    Args:
        hardware: at the border.
        period: of the samples [s].
    """

    def __init__(self, hardware: Hardware, period: float) -> None:
        self.hardware, self.period = hardware, period
        self.number = 0  # of the next sample
        self.mark: Callable[[int], None] | None = None  # told the number of the next sample before it is taken, once
        self._started = False

    @property
    def machine(self) -> Ongoing | None:
        """What is simulated, if anything is."""
        return self.hardware.machine if isinstance(self.hardware, AtSpeed) else None

    def start(self) -> None:
        """Begin to sample, once."""
        if not self._started:
            self._started = True
            self.hardware.start(self.period)

    def wait(self) -> tuple[int, float]:
        """The next sample: its number and how late it is [s]."""
        mark, self.mark = self.mark, None
        if mark is not None:
            mark(self.number)
        late = self.hardware.wait(self.number)
        self.number += 1
        return self.number - 1, late


Tell = Callable[[sampled.Seen, np.ndarray, np.ndarray], None]  # seen, numbers of the samples, lateness [s]


class Lent:
    """`interface.Hardware` of one loop: the machine for as long as it has it.

    Args:
        ground: the machine.
        tell: given every chunk that the loop hands out.
        take: called before the first sample; whoever has the machine gives it back. What it returns is told to `first`.
        ended: called with the loop after its last sample.
    """

    def __init__(
        self, ground: Ground, tell: Tell, *, take: Callable[[], Loop | None] | None = None,
        ended: Callable[[Loop], None] | None = None,
    ) -> None:  # fmt: skip
        self.ground, self._tell, self._take, self._ended = ground, tell, take, ended
        self._before: Loop | None = None
        self._samples: deque[tuple[int, float]] = deque()
        self._looks: deque[np.ndarray] = deque()
        self.encoder = None if ground.hardware.encoder is None else _FromZero(ground.hardware)
        self.holds, self._taken, self._told = False, 0, 0

    @property
    def pending(self) -> int:
        """Samples that were taken, and not told of."""
        return self._taken - self._told

    def zero(self, count: int) -> None:
        """The count of the encoder that the next loop takes for nothing."""
        if self.encoder is not None:
            self.encoder.zero = count

    @property
    def analog_in(self) -> AnalogIn:
        """The machine's."""
        return self.ground.hardware.analog_in

    @property
    def motor(self) -> AnalogLine | None:
        """The machine's."""
        return self.ground.hardware.motor

    @property
    def valve(self) -> Valve:
        """The machine's."""
        return self.ground.hardware.valve

    @property
    def statistics(self) -> Any:
        """Of the machine, since the session began."""
        return getattr(self.ground.hardware, "statistics", None)

    def start(self, period: float) -> None:
        """Take the machine over; it is neither stopped nor zeroed.

        Raises:
            InputError: if the loop has another clock.
        """
        if abs(period - self.ground.period) > 1e-9 * period:
            raise InputError("period", period, f"the machine goes on with {self.ground.period:g} s")
        if self._take is not None:
            self._before = self._take()
        self.holds = True
        self.ground.start()

    def wait(self, _: int) -> float:
        """The next sample; how late it is [s]."""
        number, late = self.ground.wait()
        self._samples.append((number, late))
        self._taken += 1
        if self.ground.machine is not None:
            self._looks.append(self.ground.machine.looks.popleft())
        return late

    def send(self) -> None:
        """Let what was written take effect."""
        self.ground.hardware.send()

    def close(self) -> None:
        """It belongs to the session, and stays open."""

    def continued(self, loop: Loop, state: np.ndarray) -> np.ndarray:
        """The first state of a loop's software, with the controllers and interlocks of the loop before."""
        return state if self._before is None else carried(self._before, loop, state)

    def give_back(self, loop: Loop) -> None:
        """After the loop's last sample."""
        if self._ended is not None and self.holds:
            self._ended(loop)
        self.holds = False

    def seen(self, count: int) -> dict[str, Any]:
        """What was true at the oldest samples, where that is known; it is gone then."""
        machine = self.ground.machine
        return {} if machine is None else machine.columns([self._looks.popleft() for _ in range(count)])

    def tell(self, seen: sampled.Seen, count: int) -> None:
        """Hand on a chunk of the oldest samples."""
        if count:
            some = [self._samples.popleft() for _ in range(count)]
            self._tell(seen, np.array([n for n, _ in some]), np.array([late for _, late in some]))
            self._told += count


class _FromZero:
    """An encoder that counts from elsewhere."""

    def __init__(self, hardware: Hardware) -> None:
        self.hardware, self.zero = hardware, 0

    def read(self) -> int:
        encoder = self.hardware.encoder
        assert encoder is not None
        return encoder.read() - self.zero


def carried(before: Loop, loop: Loop, state: np.ndarray) -> np.ndarray:
    """The state of a loop's software with all that is not its own set-points as another loop left it."""
    if before.state is None:
        return state
    found = np.array(state)
    found[_shared(loop)] = before.state[_shared(before)]
    return found


def _shared(loop: Loop) -> list[int]:
    import jax

    return [int(i) for i in jax.tree.leaves({k: v for k, v in loop.places.items() if k != OWN})]
