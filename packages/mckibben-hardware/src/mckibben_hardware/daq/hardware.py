"""A machine behind a data acquisition card as `interface.Hardware`, by NI's driver here or by a device server over gRPC.

    inputs    one continuous task on its own sample clock; a read waits for its samples
    encoder   one task on the same clock, started before it, so that both count from the same sample
    outputs   valve and motor in one task, the shut-off in another; both on demand: they change when they are written

    wait(k)   the card's own clock samples all inputs and the encoder; the read waits for sample k
    send()    the outputs take their levels at once, not with the clock: what was written acts during the period

Lateness is that of the read, and the card's clock is not the computer's. So sample k is due at t0 + k T, where t0 follows
the earliest reads and may move by 1e-4 T per sample, more than two quartz clocks differ. What takes equally long for every
sample (conversion, bus, network) does not show in it, nor a loop that falls behind by less than 1e-4.

A card holds its outputs when nobody writes any more. Therefore a thread vents where the software sends nothing for a while;
it lives and dies with this process. Who must vent even when the process is killed needs a watchdog on the card or a valve
that closes without power.

Nothing of NI is loaded before a card is opened.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from mckibben import extras
from mckibben._jax import Tree
from mckibben.bench.hardware.interface import Hardware
from mckibben.errors import InputError, LineLostError

from .wiring import GRPC, LOCAL, CardWiring

OVERRUNS = (
    "SAMPLES_NO_LONGER_AVAILABLE", "ACQ_STOPPED_TO_PREVENT_INPUT_BUFFER_OVERWRITE", "INPUT_FIFO_OVERFLOW",
    "INPUT_FIFO_OVERFLOW_2", "INPUT_FIFO_OVERFLOW_3", "ACQ_STOPPED_DRIVER_CANT_XFER_DATA_FAST_ENOUGH", "ADC_OVERRUN",
    "ACQ_STOPPED_TO_PREVENT_INPUT_BUFFER_OVERWRITE_ONE_DATA_XFER_MECH", "AI_OVERRUN", "CI_OVERRUN",
    "ACQ_STOPPED_TO_PREVENT_INTERMEDIATE_BUFFER_OVERFLOW",
)  # fmt: skip
MISNAMED = (
    "PHYSICAL_CHAN_DOES_NOT_EXIST", "INVALID_DEVICE_ID", "INVALID_PHYS_CHAN_NAME", "INVALID_PHYS_CHAN_TYPE",
    "PHYS_CHAN_MEAS_TYPE", "INVALID_ATTRIBUTE_VALUE", "INVALID_TERM", "INVALID_TERM_ROUTING",
    "ROUTE_NOT_SUPPORTED_BY_HW_ROUTING",
)  # fmt: skip


SILENT_SERVER = {
    "UNAVAILABLE": "the device server does not answer any more",
    "DEADLINE_EXCEEDED": "the device server did not answer in time",
    "CANCELLED": "the device server does not answer any more",
}


class OverrunError(LineLostError):
    """Samples were overwritten on the card, or in transfer, before they were read."""


def library(module: str = "nidaqmx") -> ModuleType:
    """Load the client library, or a module of it.

    Raises:
        MissingLibraryError: it is not installed.
    """
    return extras.library(module, "Data acquisition cards need")


class Complaints:
    """Error messages of one card: `place` is its name, `where` names its wiring."""

    def __init__(self, place: str, where: str) -> None:
        self.errors = library("nidaqmx.errors")
        self.place, self.where = place, where
        self.closed = False

    @contextmanager
    def told(self, path: str = "", said: str = "") -> Iterator[None]:
        """Convert errors of the client to one-line errors; with a path, a wrong name there is the user's."""
        errors = self.errors
        try:
            yield
        except errors.DaqNotFoundError:
            raise LineLostError(
                f"{self.place}: no NI-DAQmx driver is installed on this computer; install it, "
                f"or name a device server: connection = '{GRPC}host:port'"
            ) from None
        except errors.RpcError as error:
            name = getattr(error.rpc_code, "name", str(error.rpc_code))
            said = f"the device server says {name}: {_line(str(error.description))}"
            raise LineLostError(f"{self.place}: {SILENT_SERVER.get(name, said)}") from None
        except errors.DaqError as error:
            text, name = _line(str(error)), error.error_type.name
            code = f"(NI-DAQmx {error.error_code})"
            if path and name in MISNAMED:
                raise InputError(path, said, f"{text} {code}", where=self.where) from None
            at = f"{self.place}, {said}" if said else self.place
            if name in OVERRUNS:
                raise OverrunError(f"{at}: samples were overwritten before they were read: {text} {code}") from None
            raise LineLostError(f"{at}: {text} {code}") from None
        except errors.Error as error:
            raise LineLostError(f"{self.place}: {_line(str(error))}") from None
        except ValueError:
            if not self.closed:
                raise
            raise LineLostError(f"{self.place}: the tasks are closed") from None


def _line(message: str) -> str:
    """Message of the driver in one line, without repetitions."""
    parts = [" ".join(p.split()) for p in message.splitlines()]
    kept = [p for p in parts if p and not p.startswith(("Task Name:", "Status Code:"))]
    closed = [p if p.endswith((".", ":", ",")) else f"{p}," for p in kept]
    return " ".join(closed).rstrip(".,")


RATE_TOLERANCE = 1e-4  # between the rate that is asked for and the one that the card can make


class Tasks:
    """The tasks of a wiring, from opening to closing.

    Args:
        wiring: the terminals.
        patience: how long a sample, or an answer of a device server, may be overdue [s].

    Raises:
        InputError: a library is missing, or the card has no such terminal or range.
        LineLostError: no driver, no device server, or no card.
    """

    def __init__(self, wiring: CardWiring, patience: float) -> None:
        self.wiring, self.patience = wiring, patience
        name = next(iter(wiring.inputs.values())).channel.split("/")[0]
        self.place = name if wiring.connection == LOCAL else f"{name} at {wiring.connection}"  # as complaints name it
        self._complaints, self._constants = Complaints(self.place, wiring.where), library("nidaqmx.constants")
        self._deadline = [2.0 * patience]  # of a call to a device server [s]
        self._grpc, self._channel = self._connect()
        self._open: list[Any] = []
        self._sampling: list[Any] = []  # those that are clocked
        self._level: bool | None = None
        self._writing = False
        try:
            self._create()
        except BaseException:
            self.close()
            raise

    def _connect(self) -> tuple[Tree, Tree]:
        """Options and channel of a device server; none for the driver on this computer."""
        where = self.wiring.connection
        if where == LOCAL:
            return None, None
        grpc = library("grpc")
        channel = grpc.insecure_channel(where.removeprefix(GRPC))
        try:
            grpc.channel_ready_future(channel).result(timeout=self.patience)
        except grpc.FutureTimeoutError:
            channel.close()
            raise LineLostError(f"{where}: no device server answers within {self.patience:g} s") from None
        waiting = grpc.intercept_channel(channel, _deadlines(grpc, self._deadline))
        return library().GrpcSessionOptions(waiting, ""), channel

    def _create(self) -> None:
        wiring, ni = self.wiring, self._constants
        kinds = {
            "default": ni.TerminalConfiguration.DEFAULT,
            "rse": ni.TerminalConfiguration.RSE,
            "nrse": ni.TerminalConfiguration.NRSE,
            "differential": ni.TerminalConfiguration.DIFF,
            "pseudodifferential": ni.TerminalConfiguration.PSEUDO_DIFF,
        }
        self._inputs = self._task()
        for name, entry in wiring.inputs.items():
            with self._complaints.told(f"inputs.{name}.channel", entry.channel):
                least, most = entry.span
                self._inputs.ai_channels.add_ai_voltage_chan(
                    entry.channel, terminal_config=kinds[entry.terminal], min_val=least, max_val=most
                )
        self._outputs = self._task()
        for key, out in (("valve", wiring.valve), ("motor", wiring.motor)):
            if out is not None:
                with self._complaints.told(f"{key}.channel", out.channel):
                    least, most = out.span
                    self._outputs.ao_channels.add_ao_voltage_chan(out.channel, min_val=least, max_val=most)
        self._line = self._counter = None
        if wiring.shut_off is not None:
            self._line = self._task()
            with self._complaints.told("shut_off.line", wiring.shut_off.line):
                self._line.do_channels.add_do_chan(wiring.shut_off.line)
        if wiring.encoder is not None:
            self._counter, wheel = self._task(), wiring.encoder
            decodings = {"X1": ni.EncoderType.X_1, "X2": ni.EncoderType.X_2, "X4": ni.EncoderType.X_4}
            with self._complaints.told("encoder.counter", wheel.counter):
                channel = self._counter.ci_channels.add_ci_ang_encoder_chan(
                    wheel.counter, decoding_type=decodings[wheel.decoding], units=ni.AngleUnits.TICKS, initial_angle=0.0
                )
                if wheel.a:
                    channel.ci_encoder_a_input_term = wheel.a
                if wheel.b:
                    channel.ci_encoder_b_input_term = wheel.b
        # readers and writers now, so that a sample makes no further calls of the card; the outputs are reserved
        readers, writers = library("nidaqmx.stream_readers"), library("nidaqmx.stream_writers")
        self._analog = readers.AnalogMultiChannelReader(self._inputs.in_stream)
        self._edges = None if self._counter is None else readers.CounterReader(self._counter.in_stream)
        self._volts_out = writers.AnalogMultiChannelWriter(self._outputs.out_stream, auto_start=False)
        self._line_out = None
        if self._line is not None:
            self._line_out = writers.DigitalSingleChannelWriter(self._line.out_stream, auto_start=False)
        for one in (self._analog, self._edges, self._volts_out, self._line_out):
            if one is not None:
                one.verify_array_shape = False
        for task in (self._outputs, self._line):
            if task is not None:  # started with the first write only, for that may drive what was left alone before
                with self._complaints.told():
                    task.control(self._constants.TaskMode.TASK_RESERVE)

    def _task(self) -> Any:
        with self._complaints.told():
            task = library().Task(grpc_options=self._grpc)
        self._open.append(task)
        return task

    def start(self, period: float, block: int, buffer: float) -> None:
        """Zero the counter and begin to sample.

        Raises:
            InputError: the card has no such rate.
            LineLostError: it does not start.
        """
        for task in self._sampling:  # of the run before, which may have failed
            try:
                task.stop()
            except self._complaints.errors.Error:
                pass
        self._sampling = []
        self.block, self._wait = block, self.patience + block * period
        self._deadline[0] = 2.0 * self._wait
        size = max(math.ceil(buffer / period), 2 * block)
        self._read = np.zeros((len(self.wiring.inputs), block)), np.zeros(block)
        counted = [] if self._counter is None else [(self._counter, self.wiring.sample_clock)]
        clocked = [*counted, (self._inputs, "")]  # the counter waits for the clock that the inputs start
        with self._complaints.told("clock", self.wiring.sample_clock):
            for task, source in clocked:
                mode = self._constants.AcquisitionType.CONTINUOUS
                task.timing.cfg_samp_clk_timing(1.0 / period, source=source, sample_mode=mode, samps_per_chan=size)
                task.in_stream.input_buf_size = size
            rate = float(self._inputs.timing.samp_clk_rate)
        if abs(rate * period - 1.0) > RATE_TOLERANCE:
            problem = f"of {period:g} s is not one of the card, which samples at {rate:.6g} Hz instead"
            raise InputError("period", None, problem, where=self.place)
        with self._complaints.told("clock", self.wiring.sample_clock):
            for task, _ in clocked:
                self._sampling.append(task)
                task.start()

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Read the next block: levels (channels, block) [V] and ticks (block,), in arrays reused by the next call.

        Raises:
            OverrunError: samples were lost.
            LineLostError: none came.
        """
        volts, ticks = self._read
        with self._complaints.told(said=", ".join(e.channel for e in self.wiring.inputs.values())):
            self._analog.read_many_sample(volts, number_of_samples_per_channel=self.block, timeout=self._wait)
        if self._edges is not None and self.wiring.encoder is not None:
            with self._complaints.told(said=self.wiring.encoder.counter):
                self._edges.read_many_sample_double(ticks, number_of_samples_per_channel=self.block, timeout=self._wait)
        return volts, ticks

    def write(self, volts: Sequence[float], opened: bool) -> None:
        """Write the output levels of valve and motor [V] and the shut-off; unchanged levels are not written again.

        Raises:
            LineLostError: they cannot be written.
        """
        shut_off = self.wiring.shut_off
        if not self._writing:
            self._writing = True
            for task in (self._line, self._outputs):
                if task is not None:
                    with self._complaints.told():
                        task.start()
        try:
            if shut_off is not None and self._line_out is not None and self._level != shut_off.level(opened):
                self._level = None  # unknown if this fails
                with self._complaints.told(said=shut_off.line):
                    self._line_out.write_one_sample_one_line(shut_off.level(opened), timeout=self.patience)
                self._level = shut_off.level(opened)
        finally:  # the valve vents whatever became of the shut-off
            with self._complaints.told(said=self.wiring.valve.channel):
                self._volts_out.write_one_sample(np.array(volts), timeout=self.patience)

    def close(self) -> None:
        """Stop and clear all tasks, as far as the card responds."""
        self._complaints.closed = True
        answers = True
        for task in reversed(self._open):
            try:
                if answers:
                    task.close()
            except self._complaints.errors.RpcError:
                answers = False
            except self._complaints.errors.Error:
                pass
        self._open, self._sampling = [], []
        if self._channel is not None:
            self._channel.close()
            self._channel = None


def _deadlines(grpc: Any, deadline: list[float]) -> Any:
    """Set deadlines for calls, since the client would wait for ever for a hanging server."""

    class Deadlines(grpc.UnaryUnaryClientInterceptor):  # type: ignore[misc] # of an optional library
        """Interceptor that gives every call the present deadline."""

        def intercept_unary_unary(self, call: Any, details: Any, request: Any) -> Any:
            """Call with the present deadline."""
            return call(details._replace(timeout=deadline[0]), request)

    return Deadlines()


# ---- the machine


DRIFT = 1e-4  # of the card's clock against the computer's that is not taken for lateness
UNWRITTEN = -1  # count of a motor that nobody commands: its output is at the level of rest
LOOKS = 4.0  # at the software per time of its silence


class DaqStatistics(NamedTuple):
    """Counts of the samples since the start."""

    reads: int  # samples that were given to the software, none left out
    late: int  # those that came more than a period late: the next one was there already
    overruns: int  # losses of samples; the first one ends the run


class DaqHardware(Hardware):
    """`interface.Hardware` of a card. Opening changes no output; `start` sets them to rest, and a `vent` persists.

    `vented` says whether the card was told to vent by what was written last.

    Args:
        wiring: wiring of the card.
        block: samples of one read. With more than 1 the software gets them late, up to block - 1 periods, and what it
            sends acts as late: for runs that only record.
        buffer: time for which samples may wait to be read before some are lost [s], which ends the run; a control loop
            that is so far behind is better vented.
        patience: how long a sample may be overdue before the card counts as lost [s].
        silence: time without `send` after which the machine is vented [s]; never less than four blocks.

    Raises:
        InputError: a library is missing, or the card has no such terminal or range.
        LineLostError: no driver, no device server, or no card.
    """

    def __init__(
        self, wiring: CardWiring, *, block: int = 1, buffer: float = 0.25, patience: float = 1.0, silence: float = 0.25
    ) -> None:
        if type(block) is not int or block < 1:
            raise InputError("block", str(block), "must be a whole number, 1 or more")
        for key, value in (("buffer", buffer), ("patience", patience), ("silence", silence)):
            if not 1e-3 <= value <= 3600.0:
                raise InputError(key, None, f"must be between 1 ms and 1 h, got {value:g} s")
        self.wiring = wiring
        self._block, self._buffer, self._silence = block, buffer, silence
        self._tasks = Tasks(wiring, patience)
        encoder, motor = wiring.encoder is not None, wiring.motor is not None
        super().__init__(tuple(wiring.inputs), encoder=encoder, motor=motor, motor_rest=UNWRITTEN)
        self._alarm = threading.Event()
        self._lock = threading.RLock()  # of the outputs
        self._waiting: deque[tuple[list[int], int]] = deque()
        self.period = 0.0  # not started
        self._fault = ""
        self._silent = self._closed = False
        self._sent: float | None = None
        self._next = self._late = self._overruns = 0
        self._origin: float | None = None
        self.vented = False
        self._watch = threading.Thread(target=self._watching, name="daq watch", daemon=True)
        self._watch.start()

    @property
    def statistics(self) -> DaqStatistics:
        """Statistics since the start."""
        return DaqStatistics(self._next, self._late, self._overruns)

    def start(self, period: float) -> None:
        """Vent, set the motor to rest, zero the encoder and begin to sample; refuses a rate that the card has not."""
        if not 1e-6 <= period <= 10.0:
            raise InputError("period", None, f"must be between 1 us and 10 s, got {period:g} s")
        self._not_closed()
        self.period = period
        self._pause = max(self._silence, 4.0 * self._block * period)
        with self._lock:
            self._sent, self._silent, self._fault = None, False, ""
            self._waiting.clear()
            self._next = self._late = self._overruns = 0
            self._origin = None
            self.valve, self.opened = 0, True
            self._rest()
            self._tasks.start(period, self._block, self._buffer)

    def wait(self, sample: int) -> float:
        """Wait until the next sample has arrived; return its lateness [s]; a lost machine was vented, if it could be."""
        self._alive()
        if not self.period:
            raise InputError("sample", str(sample), "none comes before the start")
        if sample != self._next:
            raise InputError("sample", str(sample), f"must be {self._next}; they are waited for one after another")
        if not self._waiting:
            try:
                volts, ticks = self._tasks.read()
            except LineLostError as error:
                self._overruns += isinstance(error, OverrunError)
                raise self._lost(error) from None
            self._take(volts.T.tolist(), ticks.tolist())
        now = time.perf_counter()
        self.counts, count = self._waiting.popleft()
        if self.has_encoder:
            self.edges = count
        begun = now - sample * self.period
        self._origin = begun if self._origin is None else min(begun, self._origin + DRIFT * self.period)
        self._next += 1
        self._late += begun - self._origin > self.period
        return begun - self._origin

    def send(self) -> None:
        """Write the pending output levels; after a `vent`, or where nothing was sent for too long, those of rest."""
        self._alive()
        try:
            with self._lock:
                self._put()
                self._sent = time.monotonic()
        except LineLostError as error:
            raise self._lost(error) from None

    def _vent_now(self) -> None:
        self._alarm.set()  # a caller does not wait for the card

    def close(self) -> None:
        """Vent, set the motor to rest, and clear the tasks; `vented` states whether that reached the machine."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            self.vent()
            self._try_rest()
            self._tasks.close()
        if self._watch is not threading.current_thread():
            self._watch.join()

    def _take(self, samples: list[list[float]], ticks: list[float]) -> None:
        scales, counter = tuple(self.wiring.inputs.values()), self.wiring.encoder
        for levels, tick in zip(samples, ticks, strict=True):
            try:
                counts = [scale.count(level) for scale, level in zip(scales, levels, strict=True)]
                self._waiting.append((counts, 0 if counter is None else counter.signed(tick)))
            except (ValueError, OverflowError):
                readings = ", ".join(f"{s.channel} {v:g} V" for s, v in zip(scales, levels, strict=True))
                raise self._lost(LineLostError(f"{self._tasks.place}: no numbers came: {readings}")) from None

    def _levels(self, valve: int, motor: float | None) -> list[float]:
        return [self.wiring.valve.volts(valve), *([] if motor is None else [motor])]

    def _put(self) -> None:
        """Write the pending levels; write them again if a vent came in between, since the vent must come last."""
        drive = self.wiring.motor
        while True:
            vented = self.venting or self._silent
            count, opened = (0, True) if vented else (self.valve, self.opened)
            pull = None
            if drive is not None:
                pull = drive.rest if self.motor == UNWRITTEN else drive.volts(self.motor)
            self._tasks.write(self._levels(count, pull), opened)
            self.vented = vented
            if vented or not self.venting:
                return

    def _rest(self) -> None:
        """Write count 0, an open shut-off, and a motor without force."""
        drive = self.wiring.motor
        self.motor = UNWRITTEN
        self._tasks.write(self._levels(0, None if drive is None else drive.rest), True)
        self.vented = True

    def _try_rest(self) -> bool:
        try:
            with self._lock:
                self._rest()
            return True
        except LineLostError:
            self.vented = False
            return False

    def _lost(self, error: LineLostError) -> LineLostError:
        """The error message about a card that failed, after an attempt to vent; it holds for every later call."""
        done = "the machine is vented" if self._try_rest() else "it could not be told to vent"
        self._fault = f"{error}; {done}"
        return type(error)(self._fault)

    def _not_closed(self) -> None:
        if self._closed:
            raise LineLostError(f"{self._tasks.place}: it was closed")

    def _alive(self) -> None:
        self._not_closed()
        if self._fault:
            raise LineLostError(self._fault)

    def _watching(self) -> None:
        """Vent at once on request, and when nothing has been sent for too long."""
        while True:
            called = self._alarm.wait(self._silence / LOOKS)
            self._alarm.clear()
            with self._lock:
                if self._closed:
                    return
                silent = self._sent is not None and time.monotonic() - self._sent > self._pause
                if silent:
                    self._sent, self._silent = None, True
                    error = LineLostError(f"{self._tasks.place}: nothing was sent for {self._pause:g} s")
                    self._lost(error)
                elif called and self._fault:
                    self._try_rest()
                elif called:
                    try:
                        self._put()
                    except LineLostError as error:
                        self._lost(error)
