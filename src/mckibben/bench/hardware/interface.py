"""Interface between the sample loop and a machine, in integer counts of its converters.

    wait(k) -> counts, edges -> the software -> write(valve, motor, opened)

What counts stand for is the matter of `Converters`, which is one for every machine. So a machine in the same process, one
behind a serial line and one behind a data acquisition card give the same run where they give the same counts. Nothing here
knows units, limits or protocols; a machine only has to vent whenever it is told to, and when it is told nothing for long.

A backend, such as ``serial:/dev/ttyACM0``, is a function of a `HardwareRequest` that returns an open `Hardware`. A package
adds one by an entry point of the group `GROUP`, whose name is what stands before the colon; ours are listed here, so that a
checkout needs no installation.
"""

from __future__ import annotations

import abc
import contextlib
import importlib.metadata
import math
from collections.abc import Callable, Iterator, Sequence
from operator import index
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from ...errors import InputError
from ...extras import library

if TYPE_CHECKING:
    from ..rig import Rig


LARGEST = 2**32 - 1  # count that a line carries


class WaitInterrupted(Exception):  # noqa: N818  # it reports no error: the loop was asked to leave
    """A `Hardware.wait` ended without a sample, since `Hardware.interrupt` was called."""


class Hardware(abc.ABC):
    """A machine that is sampled by a clock, simulated or real.

    A backend calls the constructor, keeps `counts` and `edges` up to date in `wait`, and implements the abstract methods.
    What a machine can do beyond that (`paced`, `statistics`, `look`, `state`) it says itself; the defaults are those of a
    real machine, of which nobody knows more than it measures.

    Args:
        names: analogue channels, in the order of their counts.
        encoder: whether there is an encoder.
        motor: whether there is an output to a motor.
        motor_rest: count at which the motor does nothing.

    Attributes:
        counts: counts of the analogue channels at the newest sample, in the order of `names`.
        edges: count of the encoder at the newest sample, with its sign; 0 where it was zeroed, and without an encoder.
        valve: count written to the valve.
        motor: count written to the motor.
        opened: whether the shut-off, where there is one, was asked to be open.
        venting: whether the machine was told to vent; then no count that is written to the valve takes effect.
    """

    paced = True  # its samples come at times of their own; False: every sample is there when it is asked for

    def __init__(self, names: Sequence[str], *, encoder: bool, motor: bool, motor_rest: int = 0) -> None:
        self.names, self.has_encoder, self.has_motor = tuple(names), encoder, motor
        self.counts: Sequence[int] = (0,) * len(self.names)
        self.edges = 0
        self.valve, self.motor, self.opened, self.venting = 0, motor_rest, True, False

    @abc.abstractmethod
    def start(self, period: float) -> None:
        """Zero the encoder and begin to sample with a period [s]; sample 0 is the next one."""

    @abc.abstractmethod
    def wait(self, sample: int) -> float:
        """Wait for a sample, counted from 0, and read its counts; return its lateness [s].

        Raises:
            LineLostError: if it will not come any more; says why.
            WaitInterrupted: if `interrupt` was called.
        """

    def write(self, valve: int, motor: int | None = None, *, opened: bool = True) -> None:
        """Set the counts of the outputs, which take effect at once; None leaves the motor's count unchanged.

        Raises:
            InputError: if one is no count.
            LineLostError: if nobody is there to take them.
        """
        self.valve, self.opened = _count("valve", valve), bool(opened)
        if motor is not None and self.has_motor:
            self.motor = _count("motor", motor)
        self.send()

    @abc.abstractmethod
    def send(self) -> None:
        """Make the written counts take effect; while `venting`, count 0 and an open shut-off.

        Raises:
            LineLostError: if nobody is there to take them.
        """

    def vent(self) -> None:
        """Vent at once, overriding later writes; may be called from any thread."""
        self.venting = True
        self._vent_now()

    @abc.abstractmethod
    def _vent_now(self) -> object:
        """Tell the machine to vent without waiting for the next sample."""

    @abc.abstractmethod
    def close(self) -> None:
        """Vent, and release the machine; may be called twice."""

    def interrupt(self) -> None:
        """Interrupt every `wait` that may last longer than a sample, also in another thread, until `proceed`."""
        return

    def proceed(self) -> None:
        """Allow `wait` again after `interrupt`."""
        return

    @property
    def statistics(self) -> NamedTuple | None:
        """Statistics of the connection, or None if there is no connection."""
        return None

    def look(self) -> np.ndarray | None:
        """True state at the newest sample, as a vector for `true_outputs`; None if it is unknown."""
        return None

    def true_outputs(self, looks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
        """True channels of some samples, (n,) each, from the vectors that `look` returned."""
        return {}

    def state(self) -> np.ndarray | None:
        """Complete state of a simulated machine between two samples, as a constant vector; None for a real machine."""
        return None


class CountedMachine(Protocol):
    """A machine of integer counts, advanced sample by sample, that a simulated card or device operates."""

    @property
    def names(self) -> tuple[str, ...]:
        """Analogue channels, in the order of the counts of a sample."""

    def sample(self) -> tuple[Sequence[int], int]:
        """Counts of the channels, and of the encoder (0 if there is none)."""

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        """Compute the physics of one period for given counts of the outputs and state of the shut-off."""


def _count(field: str, value: int) -> int:
    try:
        count = index(value)
    except TypeError:
        count = -1
    if not 0 <= count <= LARGEST:
        raise InputError(field, value, f"must be a count from 0 to {LARGEST}")
    return count


# ---- backends by name


GROUP = "mckibben.hardware"
SILENCE = 0.02  # after which a device vents by itself [s]; a program on a shared computer may pause so long
USAGE = {
    "serial": "serial:PORT or serial:PORT@BITS_PER_SECOND, such as serial:/dev/ttyACM0",
    "daq": "daq, with the table [daq] in the rig's file",
}


class HardwareRequest(NamedTuple):
    """The request to a backend to open a machine."""

    place: str  # what stands behind the colon, such as a port; empty without one
    rig: Rig  # whose channels and outputs the machine must have
    period: float  # period of the samples [s]
    lock_step: bool = False  # the machine waits for every command, as only a simulated device can
    silence: float = SILENCE  # time without a command after which the machine vents by itself [s]


Backend = Callable[[HardwareRequest], Hardware]


@contextlib.contextmanager
def connected(
    words: str | None, rig: Rig, period: float, *, lock_step: bool = False, silence: float = SILENCE
) -> Iterator[Hardware | None]:
    """Open the hardware named by a spec; vent and close it on exit. None and ``simulated`` stand for no hardware.

    Args:
        words: name of a backend, and behind a colon what it opens.
        rig: whose channels and outputs it must have.
        period: period of the samples [s].
        lock_step: it waits for every command, as only a simulated device can.
        silence: time without a command after which the machine vents by itself [s].

    Raises:
        InputError: if there is no such machine, or it is not the rig's.
        LineLostError: if it does not answer.
    """
    if words is None or words == "simulated":
        yield None
        return
    name, place = _split(words)
    backend: Backend | None = OURS.get(name)
    if backend is None:  # that of an installed package, which `_split` has found
        backend = next(e for e in importlib.metadata.entry_points(group=GROUP) if e.name == name).load()
    hardware = backend(HardwareRequest(place, rig, period, lock_step, silence))
    try:
        yield hardware
    finally:
        hardware.close()


def check_connection(words: str | None) -> None:
    """Refuse a spec that names no backend, or one whose library is not installed, before any work begins.

    Args:
        words: as of `connected`.

    Raises:
        InputError: if they name no backend.
        MissingLibraryError: if the library that talks to the machine is not installed.
    """
    if words is None or words == "simulated":
        return
    name, place = _split(words)
    if name == "serial":
        library("serial", "Machines on a serial port need", where=place)
    elif name == "daq":
        library("nidaqmx", "Data acquisition cards need")


def _split(words: str) -> tuple[str, str]:
    name, colon, place = words.partition(":")
    others = sorted({e.name for e in importlib.metadata.entry_points(group=GROUP)} - USAGE.keys())
    well_formed = bool(place) == (name == "serial") if name in USAGE else name in others
    if not well_formed:
        known = ", or ".join([*USAGE.values(), *others])
        raise InputError("--on", words, f"must be {known}")
    return name, place


def _open_serial(request: HardwareRequest) -> Hardware:
    from .serial_line import SerialHardware

    # such as ``/dev/ttyUSB0@3000000``, with bits per second; the name of a port may have an @ of its own
    port, _, stated = request.place.rpartition("@")
    speed = {"baud": int(stated)} if port and stated.isascii() and stated.isdigit() and len(stated) < 10 else {}
    if speed == {"baud": 0}:
        raise InputError("--on", f"serial:{request.place}", "must state 1 bit per second or more after @")
    converters = request.rig.converters(0.0)
    return SerialHardware(
        port if speed else request.place,
        converters.names,
        bits={n: c.bits for n, c in converters.analog.items()},
        encoder=converters.encoder is not None,
        motor=converters.motor is not None,
        lock_step=request.lock_step,
        watchdog=max(3, math.ceil(request.silence / request.period)),
        **speed,
    )


def _open_daq(request: HardwareRequest) -> Hardware:
    from .daq import DaqHardware, wiring

    rig = request.rig
    if "daq" not in rig.document:
        raise InputError("daq", None, "is missing: the rig's file must state how the card is wired", where=rig.where)
    wired = wiring(rig.document["daq"], where=rig.where)
    for name, converter in rig.converters(0.0).analog.items():
        if name in wired.inputs and wired.inputs[name].bits != converter.bits:
            allowed = f"must be {converter.bits}, as sensors.{name}.converter has"
            raise InputError(f"daq.inputs.{name}.bits", wired.inputs[name].bits, allowed, where=rig.where)
    return DaqHardware(wired)


OURS: dict[str, Backend] = {"serial": _open_serial, "daq": _open_daq}
