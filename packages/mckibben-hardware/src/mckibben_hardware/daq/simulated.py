"""A simulated card: a device server on this computer, whose card samples a simulated machine.

    with SimulatedDevice(machine, wiring) as device:
        hardware = DaqHardware(device.wiring)

It answers the calls of the service `nidaqmx_grpc.NiDAQmx` that `hardware` makes of the unmodified `nidaqmx`, one client at a
time, and refuses what a card would: unknown devices and terminals, a counter that is not on the clock of the inputs, samples
that were not read in time. It shows no noise, no settling and no time that a bus takes; what a real driver does beyond these
calls is not in it.
"""

from __future__ import annotations

import dataclasses
import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol

from mckibben.bench.hardware.interface import CountedMachine
from mckibben.errors import InputError

from .hardware import library
from .wiring import GRPC, Analog, CardWiring

OVERWRITTEN, TOO_EARLY, GONE = -200279, -200284, -201003  # codes of NI-DAQmx


class CardError(Exception):
    """An error status of a card, with its NI-DAQmx code."""

    def __init__(self, code: int, text: str = "") -> None:
        super().__init__(text)
        self.code, self.text = code, text


class Card:
    """Sampling of a machine by a card.

    Args:
        machine: the sampled machine.
        lock_step: whether the outputs make it go on; else the clock does.
        zeroed: whether the counter is set to nothing at the start, as a card does; else the machine's own zero holds.
    """

    def __init__(self, machine: CountedMachine, *, lock_step: bool, zeroed: bool) -> None:
        self.machine, self.lock_step, self.zeroed = machine, lock_step, zeroed
        self.valve, self.motor, self.opened = 0, 0, True
        self.writes = 0
        self._changed = threading.Condition()
        self._samples: deque[tuple[Sequence[int], int]] = deque()
        self._first = self._taken = 0  # index of the oldest sample in the buffer, and of the next one
        self._places: dict[str, int] = {}  # next sample of every reader
        self._size = 0
        self._running = False
        self._fresh = True  # whether the machine went on since its newest sample
        self._zero: int | None = None
        self._failed = ""
        self._clock: threading.Thread | None = None

    def start(self, period: float, size: int) -> None:
        """Start the sample clock of the inputs; every waiting reader gets the first sample."""
        self.stop()
        with self._changed:
            self._samples.clear()
            self._first = self._taken = 0
            self._places = dict.fromkeys(self._places, 0)
            self._size, self._running, self._zero = size, True, None
        if not self.lock_step:
            self._clock = threading.Thread(target=self._tick, args=(period,), name="simulated card", daemon=True)
            self._clock.start()

    def ready(self, reader: str) -> None:
        """Register a task, which receives every sample from now on."""
        with self._changed:
            self._places[reader] = self._taken

    def forget(self, reader: str) -> None:
        """Remove a task."""
        with self._changed:
            self._places.pop(reader, None)

    def stop(self) -> None:
        """Stop the clock."""
        with self._changed:
            self._running = False
            self._changed.notify_all()
        if self._clock is not None:
            self._clock.join()
            self._clock = None

    def write(self, valve: int | None, motor: int | None, opened: bool | None) -> None:
        """Set the output levels from now on; None leaves an output unchanged.

        In lock-step the machine goes on with levels of the valve, once for each sample that all readers have.
        """
        with self._changed:
            self.valve = self.valve if valve is None else valve
            self.motor = self.motor if motor is None else motor
            self.opened = self.opened if opened is None else opened
            if valve is not None:
                self.writes += 1
                read = all(place == self._taken for place in self._places.values())
                if self.lock_step and self._running and read and not self._fresh:
                    self._go(self._advance)

    def read(self, reader: str, count: int, timeout: float) -> list[tuple[Sequence[int], int]]:
        """Return the next samples of a reader.

        Raises:
            CardError: they did not come in time, or were overwritten.
        """
        with self._changed:
            place = self._places.get(reader, 0)

            def there() -> bool:
                if self.lock_step and self._fresh and self._running and self._taken < place + count:
                    self._go(self._sample)
                return self._taken >= place + count or bool(self._failed) or not self._running

            if not self._changed.wait_for(there, timeout):
                raise CardError(TOO_EARLY)
            if place < self._first:
                raise CardError(OVERWRITTEN)
            if self._taken < place + count:
                raise CardError(GONE, self._failed)
            self._places[reader] = place + count
            samples = [self._samples[k - self._first] for k in range(place, place + count)]
            while self._first < min(self._places.values()):
                self._samples.popleft()
                self._first += 1
            return samples

    def _go(self, action: Callable[[], None]) -> None:
        try:
            action()
        except Exception as error:  # the machine's own failure, reported to the next reader
            self._failed = f"{type(error).__name__}: {error}"
        self._changed.notify_all()

    def _advance(self) -> None:
        self.machine.advance(self.valve, self.motor, self.opened)
        self._fresh = True

    def _sample(self) -> None:
        counts, edges = self.machine.sample()
        self._fresh = False
        if self._zero is None:
            self._zero = edges if self.zeroed else 0
        self._samples.append((tuple(counts), edges - self._zero))
        self._taken += 1
        while len(self._samples) > self._size:
            self._samples.popleft()
            self._first += 1

    def _tick(self, period: float) -> None:
        origin, k = time.perf_counter(), 0
        while True:
            ahead = origin + k * period - time.perf_counter()
            if ahead > 0.0:
                time.sleep(ahead)
            with self._changed:
                if not self._running or self._failed:
                    return
                if not self._fresh:
                    self._go(self._advance)
                self._go(self._sample)
            k += 1


NO_DEVICE, NO_CHANNEL, NO_ROUTE, NO_TASK = -200220, -200170, -89136, -200088  # codes of NI-DAQmx
BAD_VALUE, RESERVED, NOT_STARTED = -200077, -50103, -200846
TEXTS = {
    OVERWRITTEN: "The application is not able to keep up with the hardware acquisition.",
    TOO_EARLY: "Some or all of the samples requested have not yet been acquired.",
    GONE: "Device cannot be accessed.",
    NO_DEVICE: "Device identifier is invalid.",
    NO_CHANNEL: "Physical channel specified does not exist on this device.",
    NO_ROUTE: "Specified route cannot be satisfied, because the hardware does not support it.",
    NO_TASK: "Task specified is invalid or does not exist.",
    BAD_VALUE: "Requested value is not a supported value for this property.",
    RESERVED: "The specified resource is reserved.",
    NOT_STARTED: "Write cannot be performed when the task is not started and auto start is false.",
}
TIMEBASE = 100e6  # of the sample clock, divided by a whole number [Hz]
VERSION = {0x1272: 24, 0x1923: 3, 0x2F22: 0}  # of the driver: major, minor, update
TASK_NAME, SAMPLE_RATE, TICKS, BY_CHANNEL, CONTINUOUS, RESERVE = 0x1276, 0x1344, 10304, 0, 10123, 4


@dataclasses.dataclass
class _Task:
    """The state of one task; its channels in lower case, its kind is ai, ao, do or ci."""

    name: str
    channels: list[str] = dataclasses.field(default_factory=list)
    kind: str = ""
    rate: float = 0.0
    size: int = 0
    reserved: bool = False
    running: bool = False


class _TaskName(Protocol):
    """The name of a task, as requests state it."""

    name: str


class _Request(Protocol):
    """A request of the client: the fields of all those that are answered here; each message has some of them."""

    task: _TaskName
    session_name: str
    physical_channel: str
    lines: str
    counter: str
    source: str
    attribute_raw: int
    action_raw: int
    error_code: int
    fill_mode_raw: int
    sample_mode_raw: int
    units_raw: int
    num_samps_per_chan: int
    samps_per_chan: int
    value: int
    rate: float
    timeout: float
    write_array: Any


def _answers(call: Callable[[_Calls, _Request], dict[str, object]]) -> Any:
    """Declare a call of the service; errors of the card are reported as a device server does."""
    name = call.__name__

    def answered(self: _Calls, request: _Request, context: Any) -> Any:
        try:
            answer = call(self, request)
        except CardError as error:
            task = request.task.name if hasattr(request, "task") else ""
            parts = [TEXTS[error.code], error.text, f"Task Name: {task}", f"Status Code: {error.code}"]
            context.set_trailing_metadata((("ni-error", str(error.code)),))
            context.abort(self.grpc.StatusCode.UNKNOWN, "\n\n".join(p for p in parts if p))
        return getattr(self.messages, f"{name}Response")(**answer)

    return answered


class _Calls:
    """Implemented calls of the service, each from its request to the fields of its answer."""

    def __init__(self, card: Card, wiring: CardWiring) -> None:
        missing = sorted(set(wiring.inputs) - set(card.machine.names))
        if missing:
            names = card.machine.names
            raise InputError(f"inputs.{missing[0]}", None, "the machine has", known=names, where=wiring.where)
        self.card, self.wiring = card, wiring
        self.grpc, self.messages = library("grpc"), library("nidaqmx._stubs.nidaqmx_pb2")
        self.tasks: dict[str, _Task] = {}
        self.lock = threading.Lock()
        self.numbers = itertools.count()
        self.scales = {e.channel.lower(): e for e in wiring.inputs.values()}
        self.inputs = {e.channel.lower(): list(card.machine.names).index(n) for n, e in wiring.inputs.items()}
        self.outputs: dict[str, tuple[str, Analog]] = {wiring.valve.channel.lower(): ("valve", wiring.valve)}
        if wiring.motor is not None:
            self.outputs[wiring.motor.channel.lower()] = "motor", wiring.motor

    def task(self, request: _Request) -> _Task:
        if request.task.name not in self.tasks:
            raise CardError(NO_TASK)
        return self.tasks[request.task.name]

    def running(self, request: _Request) -> _Task:
        """Return the task of a write request, which must have been started."""
        task = self.task(request)
        if not task.running:
            raise CardError(NOT_STARTED)
        return task

    def add(self, request: _Request, kind: str, channel: str, known: Iterable[str]) -> dict[str, object]:
        """Add a terminal to a task."""
        device, _, rest = channel.partition("/")
        if device.lower() not in {t.split("/")[0].lower() for t in self.wiring.terminals().values()}:
            raise CardError(NO_DEVICE, f"Device Specified: {device}")
        if channel.lower() not in {k.lower() for k in known}:
            raise CardError(NO_CHANNEL, f"Device: {device}\nPhysical Channel Name: {rest}")
        task = self.task(request)
        task.kind = kind
        task.channels.append(channel.lower())
        return {}

    @_answers
    def GetSystemInfoAttributeUInt32(self, request: _Request) -> dict[str, object]:  # noqa: N802
        return {"value": VERSION.get(request.attribute_raw, 0)}

    @_answers
    def GetErrorString(self, request: _Request) -> dict[str, object]:  # noqa: N802
        return {"error_string": TEXTS.get(request.error_code, "")}

    @_answers
    def CreateTask(self, request: _Request) -> dict[str, object]:  # noqa: N802
        with self.lock:
            name = request.session_name or f"_unnamedTask<{next(self.numbers)}>"
            new = name not in self.tasks
            self.tasks.setdefault(name, _Task(name))
        return {"task": {"name": name}, "new_session_initialized": new}

    @_answers
    def ClearTask(self, request: _Request) -> dict[str, object]:  # noqa: N802
        task = self.task(request)
        self.halt(task)
        self.card.forget(task.name)
        del self.tasks[task.name]
        return {}

    @_answers
    def GetTaskAttributeString(self, request: _Request) -> dict[str, object]:  # noqa: N802
        if request.attribute_raw != TASK_NAME:
            raise CardError(BAD_VALUE)
        return {"value": self.task(request).name}

    @_answers
    def CreateAIVoltageChan(self, request: _Request) -> dict[str, object]:  # noqa: N802
        return self.add(request, "ai", request.physical_channel, self.inputs)

    @_answers
    def CreateAOVoltageChan(self, request: _Request) -> dict[str, object]:  # noqa: N802
        return self.add(request, "ao", request.physical_channel, self.outputs)

    @_answers
    def CreateDOChan(self, request: _Request) -> dict[str, object]:  # noqa: N802
        shut_off = self.wiring.shut_off
        return self.add(request, "do", request.lines, [] if shut_off is None else [shut_off.line])

    @_answers
    def CreateCIAngEncoderChan(self, request: _Request) -> dict[str, object]:  # noqa: N802
        if request.units_raw != TICKS:
            raise CardError(BAD_VALUE, "Property: DAQmx_CI_AngEncoder_Units")
        encoder = self.wiring.encoder
        return self.add(request, "ci", request.counter, [] if encoder is None else [encoder.counter])

    @_answers
    def SetChanAttributeString(self, request: _Request) -> dict[str, object]:  # noqa: N802
        """Accept the terminals of the encoder's signals, which are fixed."""
        self.task(request)
        return {}

    @_answers
    def CfgSampClkTiming(self, request: _Request) -> dict[str, object]:  # noqa: N802
        """Set rate and clock source: the inputs have their own clock, and the counter uses it."""
        task = self.task(request)
        clock = "" if task.kind == "ai" else self.wiring.sample_clock
        if request.source.lower() != clock.lower():
            raise CardError(NO_ROUTE, f"Source Terminal: {request.source}")
        if request.sample_mode_raw != CONTINUOUS:
            raise CardError(BAD_VALUE, "Property: DAQmx_SampQuant_SampMode")
        task.rate, task.size = TIMEBASE / round(TIMEBASE / request.rate), request.samps_per_chan
        return {}

    @_answers
    def SetBufferAttributeUInt32(self, request: _Request) -> dict[str, object]:  # noqa: N802
        self.task(request).size = request.value
        return {}

    @_answers
    def GetTimingAttributeDouble(self, request: _Request) -> dict[str, object]:  # noqa: N802
        """Return the actual sample rate."""
        if request.attribute_raw != SAMPLE_RATE:
            raise CardError(BAD_VALUE)
        return {"value": self.task(request).rate}

    def reserve(self, task: _Task) -> None:
        with self.lock:
            taken = {c for t in self.tasks.values() if t.reserved and t is not task for c in t.channels}
            if taken & set(task.channels):
                raise CardError(RESERVED)
            task.reserved = True

    @_answers
    def TaskControl(self, request: _Request) -> dict[str, object]:  # noqa: N802
        if request.action_raw != RESERVE:
            raise CardError(BAD_VALUE)
        self.reserve(self.task(request))
        return {}

    @_answers
    def StartTask(self, request: _Request) -> dict[str, object]:  # noqa: N802
        """Start a task; with the task of the inputs the clock starts."""
        task = self.task(request)
        self.reserve(task)
        task.running = True
        if task.kind in ("ai", "ci"):
            self.card.ready(task.name)
        if task.kind == "ai":
            self.card.start(1.0 / task.rate, task.size)
        return {}

    @_answers
    def StopTask(self, request: _Request) -> dict[str, object]:  # noqa: N802
        self.halt(self.task(request))
        return {}

    def halt(self, task: _Task) -> None:
        if task.running and task.kind == "ai":
            self.card.stop()
        task.running = False

    def samples(self, request: _Request) -> tuple[_Task, list[tuple[Sequence[int], int]], int]:
        """Return the samples that a read requests, or a status if they do not arrive in time."""
        task = self.task(request)
        if request.fill_mode_raw != BY_CHANNEL:
            raise CardError(BAD_VALUE)
        try:
            return task, self.card.read(task.name, request.num_samps_per_chan, request.timeout), 0
        except CardError as error:
            if error.code != TOO_EARLY:
                raise
            return task, [], error.code

    @_answers
    def ReadAnalogF64(self, request: _Request) -> dict[str, object]:  # noqa: N802
        task, samples, status = self.samples(request)
        levels = [self.scales[c].volts(counts[self.inputs[c]]) for c in task.channels for counts, _ in samples]
        return {"status": status, "read_array": levels, "samps_per_chan_read": len(samples)}

    @_answers
    def ReadCounterF64Ex(self, request: _Request) -> dict[str, object]:  # noqa: N802
        _, samples, status = self.samples(request)
        return {"status": status, "read_array": [float(n) for _, n in samples], "samps_per_chan_read": len(samples)}

    @_answers
    def WriteAnalogF64(self, request: _Request) -> dict[str, object]:  # noqa: N802
        """Set the levels of the outputs, which take effect together."""
        levels: dict[str, int] = {}
        for channel, level in zip(self.running(request).channels, request.write_array, strict=True):
            name, scale = self.outputs[channel]
            levels[name] = scale.count(level)
        self.card.write(levels.get("valve"), levels.get("motor"), None)
        return {"samps_per_chan_written": 1}

    @_answers
    def WriteDigitalLines(self, request: _Request) -> dict[str, object]:  # noqa: N802
        self.running(request)
        assert self.wiring.shut_off is not None
        self.card.write(None, None, bool(request.write_array[0]) == self.wiring.shut_off.level(True))
        return {"samps_per_chan_written": 1}


class SimulatedDevice:
    """A device server in this process, for the duration of its context.

    Args:
        machine: the machine that the card operates.
        wiring: the terminals that the card has; the machine's names are those of its inputs.
        lock_step: the machine goes on when its outputs are written, which needs reads of one sample; else by the clock.
        zeroed: the counter is set to nothing at every start; else it shows the machine's own count.

    Raises:
        InputError: the library is missing, or the wiring has a channel that the machine has not.
    """

    def __init__(
        self, machine: CountedMachine, wiring: CardWiring, *, lock_step: bool = True, zeroed: bool = True
    ) -> None:
        self.card = Card(machine, lock_step=lock_step, zeroed=zeroed)
        stubs = library("nidaqmx._stubs.nidaqmx_pb2_grpc")
        service = type("Service", (_Calls, stubs.NiDAQmxServicer), {})(self.card, wiring)
        self._server = library("grpc").server(ThreadPoolExecutor(8, "simulated device"))
        stubs.add_NiDAQmxServicer_to_server(service, self._server)
        port = self._server.add_insecure_port("127.0.0.1:0")
        self.wiring = dataclasses.replace(wiring, connection=f"{GRPC}127.0.0.1:{port}")

    def __enter__(self) -> SimulatedDevice:
        self._server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Disconnect the device: pending calls fail, later calls find no device."""
        self.card.stop()
        self._server.stop(None).wait()
