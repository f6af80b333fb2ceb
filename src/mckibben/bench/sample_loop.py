"""The sample loop: at every sample the machine's counts, the software's pure step, and counts to the machine.

It runs in a separate thread, in which nothing is compiled, drawn or collected; who iterates over `played` gets what was
seen while it goes on, and can log, show and interrupt. The compiled step is the one that a simulation scans. A machine that
is sampled without a gap goes from loop to loop: each begins with the controllers and interlocks of the one before.
"""

from __future__ import annotations

import gc
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from typing import Any, NamedTuple

import numpy as np

from .._jax import jnp
from ..components.module import flatten, unflatten
from ..engine import sampled
from ..engine.packed import compile_once, pack
from ..errors import InputError, LineLostError
from .hardware.converters import SPAN, Converters
from .hardware.interface import Hardware, WaitInterrupted
from .segment import AFTER_STOP, Chunk
from .software.loop import BenchSoftware
from .software.sequencer import ROW, TENSION
from .software.sequencer import SPAN as BY_SPAN

LATE = 0.1  # share of a period from which a sample counts as late
LOOK = 0.02  # time between two looks at what was seen [s]
REMEMBERED = 20000  # samples whose lateness an endless loop remembers
MODES = ("command.span", "command.velocity", "command.tension")  # in the order of the motor's modes
OWN = "place"  # of a software's state, what belongs to its own set-points


class Lateness(NamedTuple):
    """Lateness of the samples of a loop."""

    samples: int  # all of them; none is left out, a late one is made up for as fast as it goes
    late: int  # those that began later than `LATE` of a period
    behind: int  # those that began later than a whole period
    percentiles: tuple[float, float, float, float]  # percentiles of the lateness, 50, 99, 99.9 and 100 % [s]

    @classmethod
    def of(cls, lateness: np.ndarray, period: float) -> Lateness:
        """Summarise the lateness of every sample (n,) [s]."""
        percentiles = np.percentile(lateness, [50.0, 99.0, 99.9, 100.0]) if lateness.size else np.zeros(4)
        late, behind = (int((lateness > share * period).sum()) for share in (LATE, 1.0))
        half, most, nearly, largest = (float(x) for x in percentiles)
        return cls(lateness.size, late, behind, (half, most, nearly, largest))


class Setpoints:
    """Set-points of manual operation, read by a loop at every sample, in the order of `sequencer.ROW`.

    Pressure [Pa], open 1 or 0, the motor's mode and its value [m, m/s or N; NaN: stay], alone 1 or 0.
    """

    names = ROW

    def __init__(self) -> None:
        self._values = np.zeros(len(ROW))
        self.change(motor=np.nan, open=1.0)

    def __call__(self) -> np.ndarray:
        """Return the present values."""
        return self._values

    def change(self, **values: float) -> None:
        """Change some set-points, all from the same sample on."""
        changed = np.array(self._values)
        for name, value in values.items():
            changed[ROW.index(name)] = value
        self._values = changed

    def __getitem__(self, name: str) -> float:
        """Return one set-point."""
        return float(self._values[ROW.index(name)])


class SampledMachine:
    """A machine that is sampled without gaps, also between successive loops.

    Args:
        hardware: the machine.
        period: period of the samples [s].

    Attributes:
        number: number of the next sample, counted since the machine was started.
        mark: told the number of the next sample before it is taken, once.
    """

    def __init__(self, hardware: Hardware, period: float) -> None:
        self.hardware, self.period = hardware, period
        self.number = 0
        self.mark: Callable[[int], None] | None = None
        self._started = False

    def start(self) -> None:
        """Begin to sample, once."""
        self.hardware.proceed()
        if not self._started:
            self._started = True
            self.hardware.start(self.period)

    def wait(self) -> tuple[int, float]:
        """Wait for the next sample; return its number and lateness [s]."""
        mark, self.mark = self.mark, None
        if mark is not None:
            mark(self.number)
        late = self.hardware.wait(self.number)
        self.number += 1
        return self.number - 1, late


class SampleLoop:
    """A loop of samples on one machine, for a segment of a run or for manual operation.

    Args:
        machine: that is sampled.
        converters: what its counts stand for.
        software: the pure step.
        outputs: those of ``valve``, ``motor`` and ``open`` that there are, which a recording shows.
        stop: asked at every sample; where it says so, the machine is stopped and vented.
        longest: at most so many samples; None: until `leave`, for operation by hand.
        setpoints: what else a row of the software has.
        zero: count of the encoder that stands for the converters' mounted span.
        tell: given every chunk that the loop hands out.
        begin: called before the first sample, to let another loop leave the machine; returns that loop.
        ended: called with the loop after its last sample.

    Attributes:
        taken: samples so far.
        running: from before the first sample until after `ended`.
        lost: why the machine was lost.
        failed: another error that ended the loop.

    Raises:
        InputError: if the machine does not have the channels or outputs that the software needs.
    """

    def __init__(
        self,
        machine: SampledMachine,
        converters: Converters,
        software: BenchSoftware,
        *,
        outputs: Iterable[str],
        stop: Callable[[], bool],
        longest: int | None = None,
        setpoints: Setpoints | None = None,
        zero: int = 0,
        tell: Callable[[Chunk], None] | None = None,
        begin: Callable[[], SampleLoop | None] | None = None,
        ended: Callable[[SampleLoop], None] | None = None,
    ) -> None:
        _fits(machine.hardware, converters, software)
        self.machine, self.hardware, self.period, self.longest = machine, machine.hardware, machine.period, longest
        self.stop, self.zero, self._tell, self._begin_with, self._ended = stop, zero, tell, begin, ended
        self._encoder, self._setpoints = converters.encoder is not None, setpoints
        inputs = (*machine.hardware.names, *([SPAN] if self._encoder else []))
        counts, shows = np.zeros(len(inputs)), tuple(sorted(set(outputs)))
        names = () if setpoints is None else tuple(setpoints.names)
        self._outputs = frozenset(shows)
        # arguments, as those of a simulation: as constants of the program some would be folded, to another last bit
        setup = _Setup(software, converters, np.float64(machine.period))
        self._begin = compile_once(_begin, (inputs,), setup, counts)
        self._setup = pack(setup)
        (begun,) = self._begin(self._setup, counts)
        state, rows = self._begin.tree(0, begun), [] if setpoints is None else [np.zeros(len(names))]
        self._think = compile_once(_think, (inputs, names, shows), setup, state, counts, np.zeros(()), *rows)
        self._think(self._setup, begun, counts, np.zeros(1), *rows)  # the first call of all is slow
        leaves, shape = flatten(state)
        self.places: dict[str, Any] = unflatten(shape, range(len(leaves)))
        self._pressed, self._released = np.ones(1), np.zeros(1)
        self._halts = [self._think.index(4, name) for name in ("running", "code", "missed")]
        self.state: np.ndarray | None = None
        self.held, self.shown = np.zeros(self._think.size(3)), np.zeros(self._think.size(4))
        self.kept: deque[tuple[Any, ...]] = deque()
        self.before: SampleLoop | None = None
        self.taken, self.running = 0, False
        self.lost: LineLostError | None = None
        self.failed: BaseException | None = None
        self._lateness = np.zeros(REMEMBERED)
        self._leaving, self._fresh = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None

    # ---- its thread

    def start(self, after: SampleLoop | None = None) -> None:
        """Start the loop in a thread; an endless loop may continue at the set-points of another."""
        if after is not None and after.state is not None and self.state is not None:
            self.state = self._following(after)
        self._leaving.clear()
        self.running = True
        self._thread = threading.Thread(target=self._run, name="sample loop", daemon=True)
        self._thread.start()

    def leave(self) -> SampleLoop:
        """End between two samples, and wait for that; the samples stay in `kept`."""
        self._leaving.set()
        if self.alive:
            self.hardware.interrupt()
        self.join()
        return self

    def join(self) -> None:
        """Wait for the last sample."""
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()

    @property
    def alive(self) -> bool:
        """Whether the thread of the loop is alive."""
        return self._thread is not None and self._thread.is_alive()

    def renew(self) -> None:
        """Restart the software at the next sample, at rest at the present state of the machine."""
        self._fresh.set()

    def _run(self) -> None:
        interval, endless = sys.getswitchinterval(), self.longest is None
        if not endless:  # which lasts too long to go without a collection
            if self.hardware.paced:
                gc.collect()
            gc.disable()
        sys.setswitchinterval(1e-4)
        try:
            self.before = None if self._begin_with is None else self._begin_with()
            self.machine.start()
            self._samples()
        except WaitInterrupted:
            pass
        except LineLostError as error:
            self.lost = error
            self.hardware.vent()
        except BaseException as error:  # reported where the samples are iterated
            self.failed = error
            self.hardware.vent()
        finally:
            gc.enable()
            sys.setswitchinterval(interval)
            if self._ended is not None:
                self._ended(self)
            self.running = False

    def _samples(self) -> None:
        running, code, missed = self._halts
        left, longest = round(AFTER_STOP / self.period), self.longest
        while not self._leaving.is_set():
            if self._fresh.is_set():
                self._fresh.clear()
                self.state = None
            self._sample()
            if longest is None:
                continue
            if self.shown[running] < 0.5:
                halted = self.shown[code] > 0.5 or self.shown[missed] > 0.5
                left = left - 1 if halted else 0
                if left <= 0:
                    return
            if self.taken >= longest:
                return

    def _sample(self) -> None:
        machine, hardware = self.machine, self.hardware
        number, late = machine.wait()
        analog = hardware.counts
        counts = np.array([*analog, hardware.edges - self.zero] if self._encoder else analog, float)
        state = self.state
        if state is None:  # at the first sample, and where it was asked to begin again
            (state,) = self._begin(self._setup, counts)
            state = state if self.before is None else self._carried(self.before, state)
        row = () if self._setpoints is None else (self._setpoints(),)
        pressed = self._pressed if self.stop() else self._released
        self.state, out, measured, self.held, self.shown = self._think(self._setup, state, counts, pressed, *row)
        hardware.write(int(out[0]), int(out[1]), opened=out[2] > 0.5)
        self._lateness[self.taken % REMEMBERED] = late
        self.taken += 1
        self.kept.append((number, late, hardware.look(), measured, self.held, self.shown))

    # ---- what others see of it

    def number(self, name: str) -> float:
        """Value that the software reported at the newest sample, by name [SI]."""
        return float(self.shown[self._think.index(4, name)])

    @property
    def motor(self) -> tuple[int, float]:
        """Mode of the motor at the newest sample, and its set-point [m, m/s or N]."""
        values = [self.number(name) for name in MODES]
        mode = next((i for i, v in enumerate(values) if np.isfinite(v)), BY_SPAN)
        return mode, values[mode]

    @property
    def halted(self) -> bool:
        """Whether the software has stopped the machine."""
        return self.state is not None and self.state[self.places["stopped"]] > 0.5

    @property
    def opened(self) -> bool:
        """Whether the shut-off, if there is one, was commanded open at the newest sample."""
        return "open" not in self._outputs or self.held[self._think.index(3, "open")] > 0.5

    @property
    def pending(self) -> bool:
        """Whether it controls the machine, or has samples that were not yet taken."""
        return self.running or len(self.kept) > 0

    def deadlines(self) -> Lateness:
        """Summarise the lateness of the newest samples; all are counted."""
        newest = Lateness.of(self._lateness[: min(self.taken, REMEMBERED)], self.period)
        return newest._replace(samples=self.taken)

    def chunk(self, count: int | None = None) -> Chunk:
        """Take the oldest samples, `count` of them or all."""
        rows = [self.kept.popleft() for _ in range(len(self.kept) if count is None else count)]
        numbers, lateness, looks, *parts = zip(*rows, strict=True) if rows else ((),) * 6
        columns = [
            np.stack(p) if p else np.zeros((0, self._think.size(i))) for i, p in zip((2, 3, 4), parts, strict=True)
        ]
        measured, held, shown = (self._think.columns(i, part) for i, part in zip((2, 3, 4), columns, strict=True))
        outputs = self.hardware.true_outputs([look for look in looks if look is not None])
        n = len(rows)
        results = sampled.SampleResult(outputs, measured, held, shown, np.zeros(n), np.ones(n, bool))
        chunk = Chunk(results, n, numbers=np.array(numbers, int), lateness=np.array(lateness, float))
        if n and self._tell is not None:
            self._tell(chunk)
        return chunk

    # ---- from loop to loop

    def _carried(self, before: SampleLoop, state: np.ndarray) -> np.ndarray:
        if before.state is None:
            return state
        carried = np.array(state)
        mine, theirs = (
            [int(i) for i in flatten({k: v for k, v in loop.places.items() if k != OWN})[0]] for loop in (self, before)
        )
        carried[mine] = before.state[theirs]
        return carried

    def _following(self, after: SampleLoop) -> np.ndarray:
        """State after a protocol: its last set-points are held; after a velocity, the reached span."""
        assert self.state is not None and after.state is not None
        following = self._carried(after, self.state)
        place, (mode, value) = self.places[OWN], after.motor
        driven = float(after.state[after.places["driven"]])
        put = {
            place.pressure: after.number("command.pressure"),
            place.velocity: 0.0,
            place.acceleration: 0.0,
            place.mode: TENSION if mode == TENSION else BY_SPAN,
            place.span: driven,
            place.alone: 0.0,
            place.step: 0.0,
            place.open: float(after.opened),
        }
        if mode == TENSION:
            put[place.tension] = value
        for index, number in put.items():
            following[index] = number
        return following


def played(loop: SampleLoop) -> Generator[Chunk, None, None]:
    """Iterate over the samples while a loop runs; the first chunk is empty and comes before the start.

    An interrupt of the iteration, or its end before that of the run, lets the loop stop and vent first.

    Raises:
        LineLostError: at the end, if the machine was lost.
    """
    yield loop.chunk(0)
    button, asked = threading.Event(), loop.stop
    loop.stop = lambda: button.is_set() or asked()
    loop.start()
    try:
        while loop.alive or loop.kept:
            if loop.kept:
                yield loop.chunk()
            if loop.alive:
                time.sleep(LOOK)
    finally:
        button.set()
        loop.join()
        loop.chunk()  # what nobody has looked at after an interrupt
    if loop.failed is not None:
        raise loop.failed
    if loop.lost is not None:
        raise loop.lost


class _Setup(NamedTuple):
    """The software, what its counts stand for, and the period of the samples [s]."""

    software: BenchSoftware
    converters: Converters
    period: Any


def _begin(inputs: tuple[str, ...], setup: _Setup, counts: Any) -> tuple[Any]:
    return (setup.software.initial(_measured(setup.converters, inputs, counts)),)


def _think(
    inputs: tuple[str, ...],
    names: tuple[str, ...],
    shows: tuple[str, ...],
    setup: _Setup,
    state: Any,
    counts: Any,
    pressed: Any,
    *setpoints: Any,
) -> tuple[Any, ...]:
    """Compute the software's step: state, counts of the outputs, measured channels, held outputs, and reported values."""
    software, converters, period = setup
    measured, row = _measured(converters, inputs, counts), {name: setpoints[0][i] for i, name in enumerate(names)}
    state, commands, shown = software.step(state, measured, {"stop": pressed, **row}, period)
    out = converters.write(commands)
    held = {n: v for n, v in converters.held(out).items() if n in shows}
    return state, jnp.stack([out[n] for n in ("valve", "motor", "open")]), measured, held, shown


def _measured(converters: Converters, inputs: tuple[str, ...], counts: Any) -> dict[str, Any]:
    return converters.read({name: counts[i] for i, name in enumerate(inputs)})


def _fits(hardware: Hardware, converters: Converters, software: BenchSoftware) -> None:
    has, needs = set(hardware.names), set(converters.names)
    if has != needs:
        machine, of_rig, odd = (", ".join(sorted(names)) or "none" for names in (has, needs, needs ^ has))
        problem = f"are {machine}, but those of the rig are {of_rig}: one of the two lacks {odd}"
        raise InputError("analogue channels of the machine", None, problem)
    if converters.encoder is not None and not hardware.has_encoder:
        raise InputError("encoder", None, "is missing on the machine: the rig has one")
    if software.has_motor and not hardware.has_motor:
        raise InputError("motor", None, "is missing on the machine: the protocol moves the end of the muscle")
    if software.has_motor and converters.motor is None:
        raise InputError("outputs.motor", None, "is missing: a machine takes counts, so the rig needs this converter")
