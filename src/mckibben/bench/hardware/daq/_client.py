"""The tasks of a card through the `nidaqmx` client: by the driver on this computer, or by a device server over gRPC.

    inputs    one continuous task on its own sample clock; a read waits for its samples
    encoder   one task on the same clock, started before it, so that both count from the same sample
    outputs   valve and motor in one task, the shut-off in another; both on demand: they change when they are written

Levels [V] and ticks only; what they count is the matter of `hardware`. Nothing here is loaded before a card is opened.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np

from .... import extras
from ...._jax import Tree
from ....errors import InputError, LineLostError
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
            raise LineLostError(f"{self.place}: {_rpc(error)}") from None
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


def _rpc(error: Any) -> str:
    """Describe a failed connection to a device server."""
    name = getattr(error.rpc_code, "name", str(error.rpc_code))
    known = {
        "UNAVAILABLE": "the device server does not answer any more",
        "DEADLINE_EXCEEDED": "the device server did not answer in time",
        "CANCELLED": "the device server does not answer any more",
    }
    return known.get(name, f"the device server says {name}: {_line(str(error.description))}")


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
            self._counter = self._task()
            self._add_encoder()
        self._writers()

    def _add_encoder(self) -> None:
        entry, ni = self.wiring.encoder, self._constants
        assert entry is not None and self._counter is not None
        decodings = {"X1": ni.EncoderType.X_1, "X2": ni.EncoderType.X_2, "X4": ni.EncoderType.X_4}
        with self._complaints.told("encoder.counter", entry.counter):
            channel = self._counter.ci_channels.add_ci_ang_encoder_chan(
                entry.counter, decoding_type=decodings[entry.decoding], units=ni.AngleUnits.TICKS, initial_angle=0.0
            )
            if entry.a:
                channel.ci_encoder_a_input_term = entry.a
            if entry.b:
                channel.ci_encoder_b_input_term = entry.b

    def _writers(self) -> None:
        """Prepare readers and writers without further calls of the card; the outputs are reserved."""
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

        Args:
            period: period of the samples [s].
            block: samples of one read.
            buffer: time for which samples may stay unread on their way [s].

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
        clocked = (
            [(self._inputs, "")]
            if self._counter is None
            else [(self._counter, self.wiring.sample_clock), (self._inputs, "")]
        )
        with self._complaints.told("clock", self.wiring.sample_clock):
            for task, source in clocked:
                task.timing.cfg_samp_clk_timing(
                    1.0 / period,
                    source=source,
                    sample_mode=self._constants.AcquisitionType.CONTINUOUS,
                    samps_per_chan=size,
                )
                task.in_stream.input_buf_size = size
            rate = float(self._inputs.timing.samp_clk_rate)
        if abs(rate * period - 1.0) > RATE_TOLERANCE:
            raise InputError(
                "period",
                None,
                f"of {period:g} s is not one of the card, which samples at {rate:.6g} Hz instead",
                where=self.place,
            )
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
