"""The loop by the wall clock: at every sample the machine's counts, the software's pure step, and counts to the machine.

It runs in a thread of its own, in which nothing is compiled, drawn or collected; whoever iterates over `clocked` gets what
was seen while it goes on, and can log, show and interrupt. The compiled step is the one that a simulation scans.
"""

from __future__ import annotations

import gc
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np

from ..engine import sampled
from ..engine.packed import compile_once
from ..errors import InputError, LineLostError
from .hardware.converters import SPAN, Converters
from .hardware.in_process import InProcess
from .hardware.interface import Hardware
from .hardware.ongoing import Lent
from .segment import AFTER_STOP, Chunk
from .software.loop import BenchSoftware

LATE = 0.1  # share of a period from which a sample counts as late
LOOK = 0.02  # time between two looks at what was seen [s]


class Lateness(NamedTuple):
    """How a loop kept its deadlines.

    Attributes:
        samples: all of them; none is left out, a late one is made up for as fast as it goes.
        late: those that began later than `LATE` of a period.
        behind: those that began later than a whole period.
        percentiles: of the lateness, 50, 99, 99.9 and 100 % [s].
    """

    samples: int
    late: int
    behind: int
    percentiles: tuple[float, float, float, float]

    @classmethod
    def of(cls, lateness: np.ndarray, period: float) -> Lateness:
        """Of the lateness of every sample (n,) [s]."""
        found = np.percentile(lateness, [50.0, 99.0, 99.9, 100.0]) if lateness.size else np.zeros(4)
        late, behind = (int((lateness > share * period).sum()) for share in (LATE, 1.0))
        half, most, nearly, largest = (float(x) for x in found)
        return cls(lateness.size, late, behind, (half, most, nearly, largest))


class Source(Protocol):
    """Set-points that come with the samples; read at every one of them, so it only hands out what is there."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of what a sample brings."""

    def __call__(self) -> np.ndarray:
        """The numbers of this sample, in the order of the names."""


class Loop:
    """One part of a run on one machine, or its operation by hand.

    Args:
        hardware: at the border.
        converters: what its counts stand for.
        software: the pure step.
        outputs: those of ``valve``, ``motor`` and ``open`` that there are, which a recording shows.
        period: of the samples [s].
        longest: at most so many samples.
        stop: asked at every sample; where it says so, the machine is stopped and vented.
        source: of what else a row of the software has.

    Raises:
        InputError: if the machine does not have the channels or outputs that the software needs.
    """

    def __init__(
        self, hardware: Hardware, converters: Converters, software: BenchSoftware, *, outputs: Iterable[str],
        period: float, longest: int, stop: Callable[[], bool], source: Source | None = None,
    ) -> None:  # fmt: skip
        _fits(hardware, converters, software)
        self.hardware, self.period, self.longest, self.stop = hardware, period, longest, stop
        self.names = tuple(hardware.analog_in.names)
        inputs = (*self.names, *([SPAN] if converters.encoder is not None else []))
        counts, shows = np.zeros(len(inputs)), tuple(sorted(set(outputs)))
        self._outputs, self.source, told = frozenset(shows), source, () if source is None else tuple(source.names)
        self._begin = compile_once(_begin, (software, converters, inputs), counts)
        (begun,) = self._begin(counts)
        state, rows = self._begin.tree(0, begun), [] if source is None else [np.zeros(len(told))]
        constants = software, converters, inputs, told, shows, period
        self._think = compile_once(_think, constants, state, counts, np.zeros(()), *rows)
        self._think(begun, counts, np.zeros(1), *rows)  # the first call of all is slow
        leaves, shape = jax.tree.flatten(state)
        self.places: dict[str, Any] = jax.tree.unflatten(shape, list(range(len(leaves))))
        self._inputs, self._pressed, self._released = len(inputs), np.ones(1), np.zeros(1)
        self._halts = [self._think.index(4, name) for name in ("running", "code", "missed")]
        self.state: np.ndarray | None = None
        self.held, self.shown = np.zeros(self._think.size(3)), np.zeros(self._think.size(4))
        self.kept: deque[tuple[np.ndarray, ...]] = deque()
        self.lateness = np.zeros(longest)
        self.taken = 0
        self.lost: LineLostError | None = None
        self.failed: BaseException | None = None

    def run(self) -> None:
        """All samples by the clock of the machine."""
        interval = sys.getswitchinterval()
        if not isinstance(self.hardware, InProcess):  # which has no deadline, and begins sooner without it
            gc.collect()
        gc.disable()
        sys.setswitchinterval(1e-4)
        try:
            self.hardware.start(self.period)
            self._samples()
        except LineLostError as error:
            self.lost = error
            self.hardware.valve.vent()
        except BaseException as error:  # told by whoever iterates
            self.failed = error
            self.hardware.valve.vent()
        finally:
            gc.enable()
            sys.setswitchinterval(interval)
            if isinstance(self.hardware, Lent):
                self.hardware.give_back(self)

    def _samples(self) -> None:
        running, code, missed = self._halts
        left = round(AFTER_STOP / self.period)
        for k in range(self.longest):
            self.lateness[k] = self._sample(k)
            self.taken = k + 1
            shown = self.shown
            if shown[running] < 0.5:
                halted = shown[code] > 0.5 or shown[missed] > 0.5
                left = left - 1 if halted else 0
                if left <= 0:
                    return

    def _sample(self, k: int) -> float:
        """One sample, counted from 0; how late it was [s]."""
        hardware, encoder, motor = self.hardware, self.hardware.encoder, self.hardware.motor
        late = hardware.wait(k)
        analog = hardware.analog_in.read()
        counts = np.array([*analog, encoder.read()] if encoder is not None else analog, float)[: self._inputs]
        state = self.state
        if state is None:
            state = self._first(counts)
        asked = () if self.source is None else (self.source(),)
        pressed = self._pressed if self.stop() else self._released
        self.state, out, measured, self.held, self.shown = self._think(state, counts, pressed, *asked)
        hardware.valve.write(int(out[0]), opened=out[2] > 0.5)
        if motor is not None:
            motor.write(int(out[1]))
        hardware.send()
        self.kept.append((measured, self.held, self.shown))
        return late

    def _first(self, counts: np.ndarray) -> np.ndarray:
        """The software's state before the first sample; a machine that goes on has something of it."""
        (state,) = self._begin(counts)
        return self.hardware.continued(self, state) if isinstance(self.hardware, Lent) else state

    def number(self, name: str) -> float:
        """What the software showed at the newest sample, by name [SI]."""
        return float(self.shown[self._think.index(4, name)])

    @property
    def halted(self) -> bool:
        """Whether the software has stopped the machine."""
        return self.state is not None and self.state[self.places["stopped"]] > 0.5

    @property
    def opened(self) -> bool:
        """Whether the shut-off, where there is one, was asked to be open at the newest sample."""
        return "open" not in self._outputs or self.held[self._think.index(3, "open")] > 0.5

    def chunk(self, count: int) -> Chunk:
        """The oldest samples that nobody has taken yet, `count` of them; with what was true, where that is known."""
        rows = [self.kept.popleft() for _ in range(count)]
        columns = [np.stack(part) for part in zip(*rows, strict=True)] if rows else self._nothing()
        measured, held, shown = (self._think.columns(i, part) for i, part in zip((2, 3, 4), columns, strict=True))
        outputs: dict[str, Any] = {}
        if isinstance(self.hardware, InProcess):
            outputs = self.hardware.machine.seen(count).outputs
        elif isinstance(self.hardware, Lent):
            outputs = self.hardware.seen(count)
        seen = sampled.Seen(outputs, measured, held, shown, np.zeros(count), np.ones(count, bool))
        if isinstance(self.hardware, Lent):
            self.hardware.tell(seen, count)
        return Chunk(seen, count)

    def _nothing(self) -> list[np.ndarray]:
        return [np.zeros((0, self._think.size(i))) for i in (2, 3, 4)]


def _begin(software: BenchSoftware, converters: Converters, inputs: tuple[str, ...], counts: Any) -> tuple[Any]:
    """State of the software at the first sample, for counts of the inputs."""
    return (software.initial(_measured(converters, inputs, counts)),)


def _think(
    software: BenchSoftware, converters: Converters, inputs: tuple[str, ...], told: tuple[str, ...],
    shows: tuple[str, ...], period: float, state: Any, counts: Any, pressed: Any, *asked: Any,
) -> tuple[Any, ...]:  # fmt: skip
    """The software's step: state, counts of the outputs, measured channels, held outputs, and what is shown."""
    measured, row = _measured(converters, inputs, counts), {name: asked[0][i] for i, name in enumerate(told)}
    state, commands, shown = software.step(state, measured, {"stop": pressed, **row}, period)
    out = converters.write(commands)
    held = {n: v for n, v in converters.held(out).items() if n in shows}
    return state, jnp.stack([out[n] for n in ("valve", "motor", "open")]), measured, held, shown


def _measured(converters: Converters, inputs: tuple[str, ...], counts: Any) -> dict[str, Any]:
    return converters.read({name: counts[i] for i, name in enumerate(inputs)})


def clocked(loop: Loop) -> Generator[Chunk, None, None]:
    """What is seen while a loop goes on in a thread of its own; the first chunk is empty and comes before it begins.

    An interrupt of the iteration, or its end before that of the run, lets the loop stop and vent first.

    Raises:
        LineLostError: at the end, if the machine was lost.
    """
    yield loop.chunk(0)
    button, asked = threading.Event(), loop.stop
    loop.stop = lambda: button.is_set() or asked()
    thread = threading.Thread(target=loop.run, name="bench loop", daemon=True)
    thread.start()
    try:
        while thread.is_alive() or loop.kept:
            ready = len(loop.kept)
            if ready:
                yield loop.chunk(ready)
            if thread.is_alive():
                time.sleep(LOOK)
    finally:
        button.set()
        thread.join()
    if loop.failed is not None:
        raise loop.failed
    if loop.lost is not None:
        raise loop.lost


def _fits(hardware: Hardware, converters: Converters, software: BenchSoftware) -> None:
    """Refuse a machine that lacks what the rig says it has."""
    has, needs = set(hardware.analog_in.names), set(converters.names)
    if has != needs:
        odd = ", ".join(sorted(needs ^ has))
        raise InputError(
            "analogue channels of the machine", sorted(has), f"the rig has {sorted(needs)}; not both: {odd}"
        )
    if converters.encoder is not None and hardware.encoder is None:
        raise InputError("encoder", "none at the machine", "the rig has one")
    if software.has_motor and hardware.motor is None:
        raise InputError("motor", "none at the machine", "the protocol moves the end of the muscle")
    if software.has_motor and converters.motor is None:
        raise InputError("outputs.motor", "none", "a machine at the border takes counts: the rig needs this converter")
